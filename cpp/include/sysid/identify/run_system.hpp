// A run of a car as a state-space system for the extended Kalman filter.
#pragma once

#include "sysid/estimate/kalman.hpp"
#include "sysid/identify/problem.hpp"

namespace sysid {

/// State: v_x, v_y, r, disturbing F_x, F_y, M_z and, for NX = 9, the auxiliary states.
template <int NX>
class RunSystem {
  public:
    RunSystem(const SingleTrack& model, const Run& run, const double* p, const Noise& noise)
        : model_(model), run_(run), p_(p), start_(initial_state(model, run, p)) {
        forget_ = std::exp(-run.dt / noise.correlation_time_s);
        process_.setZero();
        for (int i = 0; i < kMotionStates; ++i) {
            const auto n = static_cast<std::size_t>(i);
            process_(i, i) = noise.motion[n] * noise.motion[n] * run.dt;
            wander_variance_[i] = noise.wander[n] * noise.wander[n];
            process_(kMotionStates + i, kMotionStates + i) =
                wander_variance_[i] * (1.0 - forget_ * forget_);
        }
        sensors_.setZero();
        for (int i = 0; i < kChannels; ++i) {
            const double s = noise.sensor[static_cast<std::size_t>(i)];
            sensors_(i, i) = s * s;
        }
    }

    double forget() const { return forget_; }
    const ModelState<double>& start() const { return start_; }

    Vec<NX> initial_mean() const {
        Vec<NX> x = Vec<NX>::Zero();
        for (int i = 0; i < kMotionStates; ++i) x[i] = start_[static_cast<std::size_t>(i)];
        for (int i = kStatesPlain; i < NX; ++i)
            x[i] = start_[static_cast<std::size_t>(i) - kMotionStates];
        return x;
    }

    // Wide enough that the first measurements, not the guess, decide.
    Mat<NX, NX> initial_covariance() const {
        Vec<NX> variance = Vec<NX>::Zero();
        variance[0] = 1.0;
        variance[1] = 1.0;
        variance[2] = 0.04;
        variance.template segment<kMotionStates>(kMotionStates) = wander_variance_;
        for (int i = kStatesPlain; i < NX; ++i) variance[i] = 4e-4;
        return variance.asDiagonal();
    }

    std::size_t size() const { return run_.size(); }

    Vec<NX> predict(std::size_t k, const Vec<NX>& x, Mat<NX, NX>& A, Mat<NX, NX>& Q) const {
        using D = Dual<NX>;
        ModelState<D> s;
        std::array<D, kPushes> push;
        load(x, s, push);
        const int substeps = substeps_for(model_, p_, x[0], run_.dt);
        advance(model_, s, push.data(), run_.inputs[k - 1], run_.inputs[k], p_, run_.dt, substeps);
        A.setZero();
        Vec<NX> next;
        for (int i = 0; i < NX; ++i) {
            if (i >= kMotionStates && i < kStatesPlain) {
                next[i] = forget_ * x[i];
                A(i, i) = forget_;
                continue;
            }
            const D& moved = s[static_cast<std::size_t>(i < kMotionStates ? i : i - kMotionStates)];
            next[i] = moved.v;
            for (int j = 0; j < NX; ++j) A(i, j) = moved.d[static_cast<std::size_t>(j)];
        }
        Q = process_;
        return next;
    }

    Vec<kChannels> observe(std::size_t k, const Vec<NX>& x, Mat<kChannels, NX>& H) const {
        using D = Dual<NX>;
        ModelState<D> s;
        std::array<D, kPushes> push;
        load(x, s, push);
        const auto y = sense(model_, s, push.data(), run_.inputs[k], p_);
        Vec<kChannels> expected;
        for (int i = 0; i < kChannels; ++i) {
            const D& reading = y[static_cast<std::size_t>(i)];
            expected[i] = reading.v;
            for (int j = 0; j < NX; ++j) H(i, j) = reading.d[static_cast<std::size_t>(j)];
        }
        return expected;
    }

    const Vec<kChannels>& measurement(std::size_t k) const { return run_.measurements[k]; }
    const Mat<kChannels, kChannels>& measurement_noise(std::size_t /*k*/) const { return sensors_; }

  private:
    template <class D>
    void load(const Vec<NX>& x, ModelState<D>& s, std::array<D, kPushes>& push) const {
        for (std::size_t i = 0; i < kModelStates; ++i) s[i] = D(start_[i]);
        for (int i = 0; i < kMotionStates; ++i) {
            s[static_cast<std::size_t>(i)] = D::seeded(x[i], i);
            push[static_cast<std::size_t>(i)] = D::seeded(x[kMotionStates + i], kMotionStates + i);
        }
        for (int i = kStatesPlain; i < NX; ++i)
            s[static_cast<std::size_t>(i - kMotionStates)] = D::seeded(x[i], i);
    }

    const SingleTrack& model_;
    const Run& run_;
    const double* p_;
    ModelState<double> start_;
    double forget_ = 0.0;
    Vec<kMotionStates> wander_variance_;
    Mat<NX, NX> process_;
    Mat<kChannels, kChannels> sensors_;
};

/// Calls `use(std::integral_constant<int, NX>)` with the state size the effects need.
template <class Use>
auto with_state_size(EffectMask effects, Use&& use) {
    if (has_own_states(effects)) return use(std::integral_constant<int, kStatesFull>{});
    return use(std::integral_constant<int, kStatesPlain>{});
}

}  // namespace sysid
