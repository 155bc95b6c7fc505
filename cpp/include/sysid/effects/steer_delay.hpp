#pragma once

#include "sysid/effects/effect.hpp"

namespace sysid {

/// The road wheels follow the logged steering angle after a dead time, here two all-pass lags in a
/// row: the gain is one, and up to omega T = 1 the time is right to 2 %.
struct SteerDelay : Effect {
    static constexpr EffectInfo info{
        "steer_delay",
        "dead time between the logged and the acting steering angle",
        "delta'(t) = delta(t - T), (1 - s T/4)^2 / (1 + s T/4)^2",
        "Rajamani, Vehicle Dynamics and Control, ch. 2; Pade approximation of first order, twice",
        "fast sweeps and steps of the steering",
        "yaw_rate_radps, ay_mps2",
        "steer_rad, vx_mps, yaw_rate_radps",
        "tyre_relaxation, steer_lag, sensor_delay",
        1,
        {{"delay_s", "s", 0.0, 0.04, 0.008, 0.0, 0.5, 0.01, 0.06}},
        true,
    };
    static constexpr std::size_t state_count = 2;

    template <class T, class S>
    static void steering(const T* p, Workings<S>& w, Lags<S> lags) {
        if (!(value_of(p[0]) > 0.0)) return;
        const S rate(lag_rate(T(0.25 * p[0])));
        for (std::size_t i = 0; i < state_count; ++i)
            w.delta = 2.0 * lags.follow(i, w.delta, rate) - w.delta;
    }
};

}  // namespace sysid
