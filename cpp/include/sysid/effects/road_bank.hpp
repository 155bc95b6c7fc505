#pragma once

#include "sysid/effects/effect.hpp"
#include "sysid/model/vehicle.hpp"

namespace sysid {

/// The road leans; positive where gravity pulls the car to its left.
struct RoadBank : Effect {
    static constexpr EffectInfo info{
        "road_bank",
        "banked road, positive where gravity pulls to the left",
        "dv_y/dt += g sin(phi), F_z *= cos(phi) + v_x r / g sin(phi)",
        "Rajamani, Vehicle Dynamics and Control, ch. 2; Ryu & Gerdes, ACC 2004",
        "the same road in both directions, with measured sideslip",
        "vy_mps",
        "steer_rad, vx_mps, yaw_rate_radps, ay_mps2",
        "steer_offset, rear_toe, side_wind, gyro_bias, accelerometer_bias",
        1,
        {{"bank_rad", "rad", 0.0, 0.05, 0.01, -0.8, 0.8, 0.02, 0.12, true}},
    };

    template <class T, class S>
    static void body(const T* p, Workings<S>& w) {
        using std::sin;
        w.gravity_y += kGravity * sin(p[0]);
    }
    template <class T, class S>
    static void loads(const T* p, Workings<S>& w) {
        using std::cos;
        using std::sin;
        const S factor = cos(p[0]) + w.v_x * w.r / kGravity * sin(p[0]);
        w.fz_f *= factor;
        w.fz_r *= factor;
    }
};

}  // namespace sysid
