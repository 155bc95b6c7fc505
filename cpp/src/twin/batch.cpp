#include "sysid/twin/batch.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>

#include "sysid/estimate/kalman.hpp"

namespace sysid {

namespace {
Eigen::Index at(std::size_t i) { return static_cast<Eigen::Index>(i); }
}  // namespace

BatchEstimator::BatchEstimator(std::vector<BatchParameter> parameters,
                               std::vector<BatchChannel> channels, double dt,
                               BatchSettings settings)
    : parameters_(std::move(parameters)),
      channels_(std::move(channels)),
      settings_(settings),
      dt_(dt) {
    for (const BatchParameter& p : parameters_) {
        const bool known = p.parameter >= 0 && p.parameter < static_cast<int>(kEstimates);
        if (!known && !p.start)
            throw std::invalid_argument("batch: parameter " + std::to_string(p.parameter) +
                                        " is not one of " + std::to_string(kEstimates));
        const bool good = std::isfinite(p.step) && p.step != 0.0 && std::isfinite(p.spread) &&
                          p.spread > 0.0 && p.walk >= 0.0 && p.lower <= p.upper;
        if (!good)
            throw std::invalid_argument(
                "batch: steps must not be zero, spreads must be positive, limits in their order");
    }
    for (const BatchChannel& c : channels_) {
        const bool noisy = c.noise > 0.0 && c.high_pass_hz >= 0.0;
        if (!noisy)
            throw std::invalid_argument("batch: the noise of every channel must be positive");
    }
    const bool usable = dt > 0.0 && settings.residual_s > 0.0 && settings.clip > 0.0 &&
                        settings.forgetting >= 0.0 && settings.block_s > 0.0;
    if (!usable) throw std::invalid_argument("batch: step, times and clip must be positive");
    const auto n = at(parameters_.size());
    const auto m = at(channels_.size());
    // In units of each parameter's spread, so that kilograms and metres mix.
    P_ = Eigen::MatrixXd::Identity(n, n);
    leaning_.setZero(n);
    for (std::size_t j = 0; j < parameters_.size(); ++j) {
        if (!parameters_[j].considered) continue;
        if (leaning_.any()) throw std::invalid_argument("batch: only one number can be considered");
        // Without a variance of its own it has no gain.
        leaning_(at(j)) = 1.0;
        P_(at(j), at(j)) = 0.0;
    }
    slopes_.setZero(m, n);
    held_.setZero(m, n + 1);
    power_.setZero(m);
    residual_.setZero(m);
    since_s_.setZero(m);
    heard_.setZero(m);
    learnt_.setZero(n);
    gain_.setZero(n);
    moved_.setZero(n);
    slope_.setZero(n);
    scores_.setZero(n, n);
    score_.setZero(n);
}

std::size_t BatchEstimator::readings() const {
    std::size_t most = 0;
    for (const BatchChannel& c : channels_) most = std::max(most, c.channel + 1);
    return most;
}

Eigen::VectorXd BatchEstimator::spread() const {
    const Eigen::MatrixXd B = scores_ + score_ * score_.transpose();
    const Eigen::VectorXd shown = (P_ * B * P_).diagonal();
    return (P_.diagonal().cwiseMax(shown) + leaning_.cwiseAbs2()).cwiseSqrt();
}

Estimates BatchEstimator::of_twin(std::size_t which, const Estimates& estimate) const {
    Estimates v = estimate;
    if (which > parameters_.size())
        throw std::out_of_range("twin " + std::to_string(which) + ": there are " +
                                std::to_string(twins()) + ", counted from 0");
    if (which > 0 && !parameters_[which - 1].start) {
        const BatchParameter& p = parameters_[which - 1];
        v[static_cast<std::size_t>(p.parameter)] += p.step;
    }
    return v;
}

const Eigen::VectorXd& BatchEstimator::update(const double* car, const double* twins,
                                              std::size_t stride, Estimates& estimate) {
    const std::size_t n = parameters_.size();
    moved_.setZero();
    time_s_ += dt_;
    const double learning_s = time_s_ - settings_.start_s;
    for (std::size_t c = 0; c < channels_.size(); ++c) {
        const BatchChannel& channel = channels_[c];
        const double own = twins[channel.channel];
        residual_[at(c)] = car[channel.channel] - own;
        since_s_[at(c)] += dt_;
        if (std::isnan(residual_[at(c)])) continue;
        // A channel may be read less often than the twins step.
        const double gap_s = std::exchange(since_s_[at(c)], 0.0);
        heard_[at(c)] += 1.0;
        for (std::size_t j = 0; j < n; ++j)
            slopes_(at(c), at(j)) = (twins[(j + 1) * stride + channel.channel] - own) /
                                    parameters_[j].step * parameters_[j].spread;
        if (channel.high_pass_hz > 0.0) {
            const double share =
                std::min(1.0, gap_s * 2.0 * std::acos(-1.0) * channel.high_pass_hz);
            const auto lifted = [&](Eigen::Index k, double value) {
                double& low = held_(at(c), k);
                low += share * (value - low);
                return value - low;
            };
            residual_[at(c)] = lifted(at(n), residual_[at(c)]);
            for (std::size_t j = 0; j < n; ++j)
                slopes_(at(c), at(j)) = lifted(at(j), slopes_(at(c), at(j)));
        }
        const double e = residual_[at(c)];
        // At first a plain mean, so that the scale does not start from nothing.
        const double share =
            std::min(1.0, std::max(gap_s / settings_.residual_s, 1.0 / heard_[at(c)]));
        power_[at(c)] += share * (e * e - power_[at(c)]);
    }
    if (learning_s <= 0.0) return moved_;

    const double forgotten = settings_.forgetting * dt_ / (learning_s + settings_.residual_s);
    const double kept = std::max(1.0 - forgotten, 0.5);
    P_ /= kept;
    score_ *= kept;
    scores_ *= kept * kept;
    for (std::size_t j = 0; j < n; ++j) {
        if (parameters_[j].considered) continue;
        const double walk = parameters_[j].walk / parameters_[j].spread;
        P_(at(j), at(j)) += walk * walk * dt_;
        // A direction nobody excites must not drift open: it cannot be known worse than at first.
        if (P_(at(j), at(j)) > 1.0) {
            const double shrink = 1.0 / std::sqrt(P_(at(j), at(j)));
            P_.row(at(j)) *= shrink;
            P_.col(at(j)) *= shrink;
        }
    }
    const double early = std::max(1.0, settings_.gentle_s / learning_s);
    const auto variance = [&](std::size_t c) {
        return early * early * std::max(power_[at(c)], channels_[c].noise * channels_[c].noise);
    };
    // All are limited before any corrects: what is learnt does not depend on their order.
    for (std::size_t c = 0; c < channels_.size(); ++c) {
        if (std::isnan(residual_[at(c)])) continue;
        const double limit = settings_.clip * std::sqrt(variance(c));
        residual_[at(c)] = std::clamp(residual_[at(c)], -limit, limit);
        score_.noalias() += slopes_.row(at(c)).transpose() * (residual_[at(c)] / variance(c));
    }
    for (std::size_t c = 0; c < channels_.size(); ++c) {
        if (std::isnan(residual_[at(c)])) continue;
        slope_ = slopes_.row(at(c));
        // Channels follow one another: the next sees what this one has already corrected.
        learn(c, residual_[at(c)], variance(c), estimate);
    }
    if (learning_s - block_began_s_ >= settings_.block_s) {
        block_began_s_ = learning_s;
        scores_.noalias() += score_ * score_.transpose();
        score_.setZero();
    }
    return moved_;
}

void BatchEstimator::learn(std::size_t channel, double error, double variance,
                           Estimates& estimate) {
    learnt_.noalias() = P_ * slope_.transpose();
    use_one_reading(P_, learnt_, variance + slope_.dot(learnt_), gain_);
    leaning_ -= gain_ * slope_.dot(leaning_);
    for (std::size_t j = 0; j < parameters_.size(); ++j) {
        const BatchParameter& p = parameters_[j];
        double change = gain_[at(j)] * error * p.spread;
        if (!p.start) {
            double& value = estimate[static_cast<std::size_t>(p.parameter)];
            const double before = value;
            value = std::clamp(value + change, p.lower, p.upper);
            change = value - before;
        }
        const double moved = change / p.spread;
        moved_[at(j)] += change / p.step;
        for (std::size_t d = channel + 1; d < channels_.size(); ++d)
            residual_[at(d)] -= slopes_(at(d), at(j)) * moved;
    }
}

}  // namespace sysid
