#pragma once

#include "sysid/effects/effect.hpp"

namespace sysid {

/// Sensors write late: the speeds (satellite or optical receiver) and the inertial unit each by a
/// time of their own. Every channel is an all-pass lag of what the motion is; other errors of the
/// sensors come on top and are not delayed.
struct SensorDelay : Effect {
    static constexpr EffectInfo info{
        "sensor_delay",
        "readings that come late",
        "y'(t) = y(t - T), (1 - s T/2) / (1 + s T/2)",
        "Klein & Morelli, Aircraft System Identification, ch. 10; Pade approximation of first "
        "order",
        "sweeps of the steering, steps of the drive torque",
        "yaw_rate_radps, ay_mps2, vy_mps",
        "steer_rad, vx_mps, yaw_rate_radps",
        "steer_lag, steer_delay",
        2,
        {
            {"speeds_s", "s", 0.0, 0.06, 0.01, 0.0, 0.5, 0.02, 0.15},
            {"inertial_s", "s", 0.0, 0.02, 0.004, 0.0, 0.5, 0.005, 0.03},
        },
        true,
    };
    static constexpr std::size_t state_count = kChannels;
    static constexpr double state_spread = 0.3;

    template <class T, class S>
    static void follow(const T* p, const Workings<S>& w, Lags<S> lags) {
        const S now[kChannels] = {w.v_x, w.v_y, w.r, w.a_x, w.a_y};
        for (int i = 0; i < kChannels; ++i) {
            const T& delay = of(p, i);
            if (value_of(delay) > 0.0)
                lags.follow(static_cast<std::size_t>(i), now[i], S(lag_rate(T(0.5 * delay))));
        }
    }
    template <class T, class S>
    static void sensors(const T* p, const Workings<S>& /*w*/, const S* state, S* y) {
        for (int i = 0; i < kChannels; ++i)
            if (value_of(of(p, i)) > 0.0) y[i] = 2.0 * state[i] - y[i];
    }

    template <class T>
    static const T& of(const T* p, int channel) {
        return p[channel < kYawRate ? 0 : 1];
    }
};

}  // namespace sysid
