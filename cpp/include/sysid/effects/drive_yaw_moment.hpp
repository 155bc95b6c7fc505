#pragma once

#include "sysid/effects/effect.hpp"
#include "sysid/model/vehicle.hpp"

namespace sysid {

/// Drive or brake force that is not equal left and right: a constant pull, and torque vectoring or
/// a limited-slip differential that answers to the corner.
struct DriveYawMoment : Effect {
    static constexpr EffectInfo info{
        "drive_yaw_moment",
        "yaw moment of drive and brake force",
        "M_z += F_x (b + k v_x r / g)",
        "Milliken & Milliken, Race Car Vehicle Dynamics, ch. 20",
        "full throttle and braking, straight and in corners",
        "yaw_rate_radps",
        "fx_n, vx_mps, yaw_rate_radps",
        "limited_slip_differential, locked_differential",
        2,
        {
            {"arm_m", "m", 0.0, 0.03, 0.005, -1.0, 1.0, 0.005, 0.05, true},
            {"cornering_arm_m", "m", 0.0, 0.05, 0.01, -1.0, 1.0, 0.01, 0.1},
        },
        false,
        true,
    };

    template <class T, class S>
    static void body(const T* p, Workings<S>& w) {
        w.moment_z += w.fx * (p[0] + p[1] * (w.v_x * w.r / kGravity));
    }
};

}  // namespace sysid
