#pragma once

#include "sysid/effects/effect.hpp"

namespace sysid {

/// The speed sensor is not at the centre of gravity.
struct SpeedSensorLeverArm : Effect {
    static constexpr EffectInfo info{
        "speed_sensor_lever_arm",
        "speed sensor away from the centre of gravity",
        "v_x' = v_x - l_y r, v_y' = v_y + l_x r",
        "Klein & Morelli, Aircraft System Identification, ch. 10",
        "tight circles in both directions, sweeps",
        "vy_mps, vx_mps",
        "steer_rad, vx_mps, yaw_rate_radps, vy_mps",
        "cg_position",
        2,
        {
            {"forward_m", "m", 0.0, 0.8, 0.1, -4.0, 4.0, 0.1, 1.5},
            {"left_m", "m", 0.0, 0.4, 0.1, -2.0, 2.0, 0.1, 0.8, true},
        },
    };

    template <class T, class S>
    static void sensors(const T* p, const Workings<S>& w, const S* /*state*/, S* y) {
        y[kVx] = y[kVx] - p[1] * w.r;
        y[kVy] += p[0] * w.r;
    }
};

}  // namespace sysid
