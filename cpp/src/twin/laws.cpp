#include "sysid/twin/laws.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

namespace sysid {

Derivative::Derivative(double corner_hz, double dt)
    : share_(1.0 - std::exp(-2.0 * std::acos(-1.0) * corner_hz * dt)), dt_(dt) {}

double Derivative::operator()(double value) {
    if (!started_) {
        smooth_ = value;
        started_ = true;
    }
    const double change = share_ * (value - smooth_);
    smooth_ += change;
    return change / dt_;
}

ParameterLaws::ParameterLaws(std::vector<ParameterLaw> laws, double dt,
                             std::size_t yaw_rate_channel, double derivative_hz, Schedule schedule)
    : laws_(std::move(laws)), schedule_(schedule), dt_(dt), yaw_rate_channel_(yaw_rate_channel) {
    const bool positive = dt > 0.0 && derivative_hz > 0.0;
    if (!positive)
        throw std::invalid_argument("laws: the step and the derivative's corner must be positive");
    stage_ = std::numeric_limits<int>::max();
    const auto check = [](std::size_t channel) {
        if (channel >= kMostReadings)
            throw std::invalid_argument("laws: channel " + std::to_string(channel) +
                                        " is none of readings");
    };
    check(yaw_rate_channel);
    for (const ParameterLaw& law : laws_) {
        check(law.channel);
        if (law.parameter < 0 || law.parameter >= kLoadParameters)
            throw std::invalid_argument("laws: parameter " + std::to_string(law.parameter) +
                                        " is not one of " + std::to_string(kLoadParameters));
        if (!(law.lower <= law.upper))
            throw std::invalid_argument("laws: limits of a parameter are not in their order");
        working_.push_back({Derivative(derivative_hz, dt), Derivative(derivative_hz, dt)});
        stage_ = std::min(stage_, law.stage);
        last_stage_ = std::max(last_stage_, law.stage);
    }
}

std::size_t ParameterLaws::readings() const {
    std::size_t most = yaw_rate_channel_;
    for (const ParameterLaw& law : laws_) most = std::max(most, law.channel);
    return most + 1;
}

void ParameterLaws::update(const double* car, const double* twin, Estimates& parameters) {
    const double yaw_rate = std::abs(car[yaw_rate_channel_]);
    for (std::size_t i = 0; i < laws_.size(); ++i) {
        const ParameterLaw& law = laws_[i];
        Working& w = working_[i];
        double& value = parameters[static_cast<std::size_t>(law.parameter)];
        if (!started_) w.first = w.mark = value;
        double real = car[law.channel];
        double model = twin[law.channel];
        if (std::isnan(real) || std::isnan(model)) continue;
        if (law.differentiate) {
            real = w.car(real);
            model = w.twin(model);
        }
        w.power += dt_ / law.averaging_s * (model * model - w.power);
        // Written so that an unknown yaw rate closes a gate, but only where one is asked for.
        const bool gated =
            (std::isfinite(law.yaw_rate_below_radps) && !(yaw_rate <= law.yaw_rate_below_radps)) ||
            (law.yaw_rate_above_radps > 0.0 && !(yaw_rate >= law.yaw_rate_above_radps));
        const double leading = law.sign == SignSource::kTwin ? model : real;
        if (law.stage != stage_ || gated || !(std::abs(leading) > law.deadband)) continue;
        const double gain =
            std::max(law.gain, law.first_gain / (1.0 + w.acting_s / law.first_gain_s));
        const double direction = law.published_sign ? -1.0 : 1.0;
        const double weight = law.kind == LawKind::kSign
                                  ? std::copysign(1.0, leading)
                                  : leading / (law.floor * law.floor + w.power);
        value += dt_ * direction * gain * weight * (model - real);
        value = std::clamp(value, law.lower, law.upper);
        w.acting_s += dt_;
        watch(i, value);
    }
    started_ = true;
    const auto waiting = [&](std::size_t i) {
        return laws_[i].stage == stage_ && !working_[i].settled;
    };
    bool done = stage_ < last_stage_;
    for (std::size_t i = 0; i < laws_.size(); ++i) done = done && !waiting(i);
    if (!done) return;
    int next = last_stage_;
    for (const ParameterLaw& law : laws_)
        if (law.stage > stage_) next = std::min(next, law.stage);
    stage_ = next;
}

void ParameterLaws::watch(std::size_t i, double value) {
    Working& w = working_[i];
    w.since_mark_s += dt_;
    if (w.since_mark_s < schedule_.window_s) return;
    const double pace = std::abs(value - w.mark) / w.since_mark_s;
    w.settled =
        w.acting_s >= schedule_.excited_s && pace < schedule_.relative_rate_ps * std::abs(w.first);
    w.mark = value;
    w.since_mark_s = 0.0;
}

}  // namespace sysid
