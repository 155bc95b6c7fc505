#pragma once

#include "sysid/effects/effect.hpp"
#include "sysid/model/vehicle.hpp"

namespace sysid {

/// Unequal loads left and right cost an axle grip, through the tyre's load sensitivity.
struct LateralLoadTransfer : Effect {
    static constexpr EffectInfo info{
        "lateral_load_transfer",
        "grip lost to lateral load transfer",
        "F_y,i *= 1 - kappa_i (v_x r / g)^2",
        "Milliken & Milliken, Race Car Vehicle Dynamics, ch. 18",
        "a slow ramp to the limit of grip",
        "ay_mps2, yaw_rate_radps",
        "steer_rad, vx_mps, yaw_rate_radps",
        "tyre_load_sensitivity, steer_compliance, tyre_temperature",
        2,
        {
            {"loss_front", "1", 0.0, 0.08, 0.02, -0.3, 0.6, 0.03, 0.15},
            {"loss_rear", "1", 0.0, 0.08, 0.02, -0.3, 0.6, 0.03, 0.15},
        },
    };

    template <class T, class S>
    static void grip(const T* p, Workings<S>& w, const S* /*state*/) {
        const S quasi_static = w.v_x * w.r / kGravity;
        w.grip_f *= 1.0 - p[0] * (quasi_static * quasi_static);
        w.grip_r *= 1.0 - p[1] * (quasi_static * quasi_static);
    }
};

}  // namespace sysid
