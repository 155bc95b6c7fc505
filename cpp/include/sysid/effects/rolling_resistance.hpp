#pragma once

#include "sysid/effects/effect.hpp"
#include "sysid/model/kinematics.hpp"

namespace sysid {

/// Rolling resistance of all wheels together, and its rise with speed.
struct RollingResistance : Effect {
    static constexpr EffectInfo info{
        "rolling_resistance",
        "rolling resistance",
        "F_x -= (f_0 + f_1 v_x) m g",
        "Gillespie, Fundamentals of Vehicle Dynamics, ch. 4",
        "coasting at low and high speed",
        "vx_mps, ax_mps2",
        "fx_n, vx_mps",
        "aero_drag, road_grade, head_wind, force_gain",
        2,
        {
            {"coefficient", "1", 0.0, 0.012, 0.003, 0.0, 0.1, 0.008, 0.015},
            {"per_speed_spm", "s/m", 0.0, 2.2e-4, 6.0e-5, 0.0, 5.0e-4, 0.0, 4.0e-4},
        },
        false,
        true,
    };

    template <class T, class S>
    static void body(const T* p, Workings<S>& w) {
        w.force_x = w.force_x - (p[0] + p[1] * w.v_x) * (w.m * kGravity);
    }
};

}  // namespace sysid
