#pragma once

#include "sysid/effects/effect.hpp"

namespace sysid {

/// The yaw inertia differs from the vehicle file.
struct YawInertia : Effect {
    static constexpr EffectInfo info{
        "yaw_inertia",
        "yaw inertia differs from the vehicle file",
        "I_z *= 1 + e",
        "Milliken & Milliken, Race Car Vehicle Dynamics, ch. 5",
        "steering sweeps at 2 Hz and faster, steps",
        "yaw_rate_radps",
        "steer_rad, vx_mps, yaw_rate_radps",
        "mass, tyre_relaxation, locked_differential",
        1,
        {{"relative_error", "1", 0.0, 0.25, 0.05, -0.8, 3.0, -0.2, 0.3}},
    };

    template <class T, class S>
    static void vehicle(const T* p, Workings<S>& w) {
        w.I_z *= 1.0 + p[0];
    }
};

}  // namespace sysid
