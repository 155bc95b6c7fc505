#pragma once

#include "sysid/effects/effect.hpp"

namespace sysid {

/// The logged wheel force is too small or too large: the torque maps of engine and brakes err, each
/// by its own share.
struct ForceGain : Effect {
    static constexpr EffectInfo info{
        "force_gain",
        "gain of the drive and the brake force",
        "F_x *= 1 + k_drive (F_x > 0), 1 + k_brake (F_x < 0)",
        "Rajamani, Vehicle Dynamics and Control, ch. 4",
        "accelerating and braking on a straight",
        "vx_mps, ax_mps2",
        "fx_n, vx_mps",
        "aero_drag, rolling_resistance, road_grade, mass",
        2,
        {
            {"drive_error", "1", 0.0, 0.08, 0.02, -0.6, 1.0, 0.03, 0.1},
            {"brake_error", "1", 0.0, 0.08, 0.02, -0.6, 1.0, 0.03, 0.1},
        },
        false,
        true,
    };

    template <class T, class S>
    static void input(const T* p, Workings<S>& w) {
        w.fx *= 1.0 + p[value_of(w.fx) < 0.0 ? 1 : 0];
    }
};

}  // namespace sysid
