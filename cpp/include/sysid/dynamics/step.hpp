// One sampling interval of the model: classical Runge-Kutta with the inputs linear in between.
//
// A cruder rule would be read as a missing lag: 60 s of driving resolve about a millisecond.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include "sysid/dynamics/single_track.hpp"

namespace sysid {

constexpr int kMotionStates = 3;
constexpr int kModelStates = kMotionStates + kAuxiliaryStates;

/// v_x, v_y, r, then the auxiliary states.
template <class S>
using ModelState = std::array<S, kModelStates>;

inline Input between(const Input& a, const Input& b, double part) {
    return {
        a.steer_rad + part * (b.steer_rad - a.steer_rad),
        a.longitudinal + part * (b.longitudinal - a.longitudinal),
        a.time_s + part * (b.time_s - a.time_s),
    };
}

/// Speeds below this are treated as this in the slip angles' denominator [m/s].
constexpr double kLowestSpeed = 1.0;

/// However stiff or long the interval, it is cut into no more parts than this.
constexpr int kMostSubsteps = 250;

inline int substeps_for(const SingleTrack& model, const double* p, double v_x, double dt) {
    const double rate = model.fastest_rate(p, std::max(v_x, kLowestSpeed));
    return static_cast<int>(std::clamp(std::ceil(dt * rate / 0.8), 1.0, 1.0 * kMostSubsteps));
}

template <class S, class T>
ModelState<S> model_rate(const SingleTrack& model, const ModelState<S>& x, const S* push,
                         const Input& u, const T* p) {
    ModelState<S> rate;
    model.evaluate(x.data(), push, x.data() + kMotionStates, u, p, rate.data(),
                   rate.data() + kMotionStates);
    return rate;
}

/// Moves `x` over `dt` seconds in `substeps` equal parts; `push` is held.
template <class S, class T>
void advance(const SingleTrack& model, ModelState<S>& x, const S* push, const Input& from,
             const Input& to, const T* p, double dt, int substeps) {
    const double h = dt / substeps;
    const ActiveStates own = active_states(model.effects);
    const auto moved = [&](const ModelState<S>& a, const ModelState<S>& k, double by) {
        ModelState<S> b;
        for (std::size_t i = 0; i < kMotionStates; ++i) b[i] = a[i] + by * k[i];
        for (std::size_t i : own)
            b[kMotionStates + i] = a[kMotionStates + i] + by * k[kMotionStates + i];
        return b;
    };
    for (int n = 0; n < substeps; ++n) {
        const Input u0 = between(from, to, static_cast<double>(n) / substeps);
        const Input u1 = between(from, to, (n + 0.5) / substeps);
        const Input u2 = between(from, to, (n + 1.0) / substeps);
        const auto k1 = model_rate(model, x, push, u0, p);
        const auto k2 = model_rate(model, moved(x, k1, 0.5 * h), push, u1, p);
        const auto k3 = model_rate(model, moved(x, k2, 0.5 * h), push, u1, p);
        const auto k4 = model_rate(model, moved(x, k3, h), push, u2, p);
        const auto move = [&](std::size_t i) {
            x[i] += (h / 6.0) * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]);
        };
        for (std::size_t i = 0; i < kMotionStates; ++i) move(i);
        for (std::size_t i : own) move(kMotionStates + i);
    }
}

/// The sensors' readings in state `x`.
template <class S, class T>
std::array<S, kChannels> sense(const SingleTrack& model, const ModelState<S>& x, const S* push,
                               const Input& u, const T* p) {
    ModelState<S> rate;
    const auto w = model.evaluate(x.data(), push, x.data() + kMotionStates, u, p, rate.data(),
                                  rate.data() + kMotionStates);
    std::array<S, kChannels> y;
    model.sense(w, p, x.data() + kMotionStates, y.data());
    return y;
}

/// Auxiliary states that have settled: the lagging quantities equal what they follow.
template <class S, class T>
void settle_auxiliary(const SingleTrack& model, ModelState<S>& x, const S* push, const Input& u,
                      const T* p) {
    const ActiveStates own = active_states(model.effects);
    // Some follow others: as many rounds as there are states settle any chain of them.
    for (std::size_t repeat = 0; repeat < own.count; ++repeat) {
        const auto rate = model_rate(model, x, push, u, p);
        for (std::size_t place : own) {
            const std::size_t i = kMotionStates + place;
            // All auxiliary states are first-order lags: rate = (target - state) / time constant.
            ModelState<S> nudged = x;
            nudged[i] += 1e-6;
            const S slope = (model_rate(model, nudged, push, u, p)[i] - rate[i]) / 1e-6;
            if (value_of(slope) == 0.0) continue;  // no active effect drives this state
            x[i] -= rate[i] / slope;
        }
    }
}

}  // namespace sysid
