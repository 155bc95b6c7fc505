#pragma once

#include "sysid/effects/effect.hpp"

namespace sysid {

/// The friction coefficient falls as the load on the axle rises.
struct TyreLoadSensitivity : Effect {
    static constexpr EffectInfo info{
        "tyre_load_sensitivity",
        "tyre load sensitivity: grip per load falls with load",
        "mu(F_z) = mu_0 (1 - k (F_z/F_z0 - 1))",
        "Milliken & Milliken, Race Car Vehicle Dynamics, ch. 2",
        "braking and driving while cornering, downforce at several speeds",
        "ay_mps2, yaw_rate_radps",
        "steer_rad, vx_mps, yaw_rate_radps",
        "lateral_load_transfer, longitudinal_load_transfer, aero_downforce",
        1,
        {{"sensitivity", "1", 0.0, 0.25, 0.05, -1.0, 1.0, 0.05, 0.25}},
    };

    template <class T, class S>
    static void grip(const T* p, Workings<S>& w, const S* /*state*/) {
        w.grip_f *= 1.0 - p[0] * (w.fz_f / w.fz0_f - 1.0);
        w.grip_r *= 1.0 - p[0] * (w.fz_r / w.fz0_r - 1.0);
    }
};

}  // namespace sysid
