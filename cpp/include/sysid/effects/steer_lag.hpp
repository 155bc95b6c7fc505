#pragma once

#include "sysid/effects/effect.hpp"

namespace sysid {

/// The road wheels follow the logged steering angle with a first-order lag.
struct SteerLag : Effect {
    static constexpr EffectInfo info{
        "steer_lag",
        "steering lag between the logged and the acting angle",
        "tau d(delta')/dt + delta' = delta",
        "Rajamani, Vehicle Dynamics and Control, ch. 2",
        "fast sweeps and steps of the steering",
        "yaw_rate_radps, ay_mps2",
        "steer_rad, vx_mps, yaw_rate_radps",
        "tyre_relaxation, steer_delay, sensor_delay",
        1,
        {{"time_constant_s", "s", 0.0, 0.06, 0.01, 0.0, 0.5, 0.02, 0.08}},
        true,
    };
    static constexpr std::size_t state_count = 1;

    template <class T, class S>
    static void steering(const T* p, Workings<S>& w, Lags<S> lags) {
        if (value_of(p[0]) > 0.0) w.delta = lags.follow(0, w.delta, S(lag_rate(p[0])));
    }
};

}  // namespace sysid
