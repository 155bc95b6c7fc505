#pragma once

#include "sysid/effects/effect.hpp"

namespace sysid {

/// The steering ratio used to log the road-wheel angle is wrong.
struct SteerRatio : Effect {
    static constexpr EffectInfo info{
        "steer_ratio",
        "error of the steering ratio",
        "delta *= 1 + s",
        "Gillespie, Fundamentals of Vehicle Dynamics, ch. 8",
        "slow tight circles together with fast driving",
        "yaw_rate_radps, ay_mps2",
        "steer_rad, vx_mps, yaw_rate_radps",
        "steer_compliance, steer_nonlinearity",
        1,
        {{"ratio_error", "1", 0.0, 0.08, 0.02, -0.6, 0.6, -0.1, 0.1}},
    };

    template <class T, class S>
    static void steering(const T* p, Workings<S>& w, Lags<S> /*lags*/) {
        w.delta *= 1.0 + p[0];
    }
};

}  // namespace sysid
