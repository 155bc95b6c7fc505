#pragma once

#include "sysid/effects/effect.hpp"

namespace sysid {

/// The centre of gravity lies further back than the vehicle file says.
struct CgPosition : Effect {
    static constexpr EffectInfo info{
        "cg_position",
        "centre of gravity further back than in the vehicle file",
        "l_f += d, l_r -= d",
        "Milliken & Milliken, Race Car Vehicle Dynamics, ch. 5",
        "a ramp to the limit and a sweep; axle scales settle it",
        "yaw_rate_radps, vy_mps",
        "steer_rad, vx_mps, yaw_rate_radps",
        "aligning_moment, imu_lever_arm, speed_sensor_lever_arm",
        1,
        {{"shift_rearward_m", "m", 0.0, 0.08, 0.02, -0.8, 0.8, -0.1, 0.1}},
    };

    template <class T, class S>
    static void vehicle(const T* p, Workings<S>& w) {
        w.l_f += p[0];
        w.l_r -= p[0];
    }
};

}  // namespace sysid
