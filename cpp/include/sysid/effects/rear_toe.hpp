#pragma once

#include "sysid/effects/effect.hpp"

namespace sysid {

/// The rear wheels do not point straight ahead.
struct RearToe : Effect {
    static constexpr EffectInfo info{
        "rear_toe",
        "toe of the rear axle: thrust angle",
        "alpha_r += delta_r0",
        "Gillespie, Fundamentals of Vehicle Dynamics, ch. 8",
        "straight driving in both directions, at several speeds",
        "vy_mps, yaw_rate_radps",
        "steer_rad, vx_mps, yaw_rate_radps",
        "steer_offset, speed_sensor_misalignment, side_wind, road_bank",
        1,
        {{"toe_rad", "rad", 0.0, 0.004, 0.0008, -0.1, 0.1, 0.001, 0.005, true}},
    };

    template <class T, class S>
    static void slip(const T* p, Workings<S>& w, Lags<S> /*lags*/) {
        w.alpha_r += p[0];
    }
};

}  // namespace sysid
