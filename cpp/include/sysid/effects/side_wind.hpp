#pragma once

#include "sysid/effects/effect.hpp"

namespace sysid {

/// A steady lateral force and yaw moment from outside.
struct SideWind : Effect {
    static constexpr EffectInfo info{
        "side_wind",
        "steady side wind: lateral force and yaw moment",
        "F_y += F_w, M_z += M_w",
        "Gillespie, Fundamentals of Vehicle Dynamics, ch. 4",
        "the same road out and back, at several speeds",
        "ay_mps2, yaw_rate_radps",
        "steer_rad, vx_mps, yaw_rate_radps, ay_mps2",
        "steer_offset, rear_toe, speed_sensor_misalignment, road_bank, accelerometer_bias",
        2,
        {
            {"side_force_n", "N", 0.0, 450.0, 60.0, -1.0e4, 1.0e4, 150.0, 900.0, true},
            {"yaw_moment_nm", "N m", 0.0, 250.0, 50.0, -1.0e4, 1.0e4, 50.0, 500.0, true},
        },
    };

    template <class T, class S>
    static void body(const T* p, Workings<S>& w) {
        w.force_y += p[0];
        w.moment_z += p[1];
    }
};

}  // namespace sysid
