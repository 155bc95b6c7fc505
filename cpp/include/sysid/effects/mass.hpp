#pragma once

#include "sysid/effects/effect.hpp"

namespace sysid {

/// The car is heavier than the vehicle file says.
struct Mass : Effect {
    static constexpr EffectInfo info{
        "mass",
        "mass differs from the vehicle file",
        "m *= 1 + e",
        "Rajamani, Vehicle Dynamics and Control, ch. 14",
        "a longitudinal force known in newtons",
        "ax_mps2, vx_mps",
        "fx_n, vx_mps, steer_rad, yaw_rate_radps",
        "force_gain, yaw_inertia",
        1,
        {{"relative_error", "1", 0.0, 0.12, 0.02, -0.6, 1.5, -0.1, 0.15}},
    };

    template <class T, class S>
    static void vehicle(const T* p, Workings<S>& w) {
        w.m *= 1.0 + p[0];
    }
};

}  // namespace sysid
