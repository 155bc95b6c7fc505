#pragma once

#include "sysid/effects/effect.hpp"

namespace sysid {

/// The ratio between the logged angle and the road wheels changes with the angle.
struct SteerNonlinearity : Effect {
    static constexpr EffectInfo info{
        "steer_nonlinearity",
        "steering ratio that changes with the angle",
        "delta *= 1 + s_3 delta^2",
        "Gillespie, Fundamentals of Vehicle Dynamics, ch. 8",
        "slow tight circles together with fast driving",
        "yaw_rate_radps, ay_mps2",
        "steer_rad, vx_mps, yaw_rate_radps",
        "steer_ratio, steer_compliance",
        1,
        {{"cubic_prad2", "1/rad2", 0.0, 30.0, 5.0, -200.0, 200.0, -40.0, 40.0}},
    };

    template <class T, class S>
    static void steering(const T* p, Workings<S>& w, Lags<S> /*lags*/) {
        w.delta *= 1.0 + p[0] * (w.delta * w.delta);
    }
};

}  // namespace sysid
