#pragma once

#include "sysid/effects/effect.hpp"

namespace sysid {

/// Drag area that the vehicle file does not know of.
struct AeroDrag : Effect {
    static constexpr EffectInfo info{
        "aero_drag",
        "drag area beyond the vehicle file",
        "F_x -= 1/2 rho Delta(C_dA) v_x^2",
        "Rajamani, Vehicle Dynamics and Control, eq. (4.2)",
        "coasting and full throttle over a wide range of speed",
        "vx_mps, ax_mps2",
        "fx_n, vx_mps",
        "rolling_resistance, road_grade, head_wind, force_gain",
        1,
        {{"drag_area_m2", "m2", 0.0, 0.45, 0.05, -2.0, 4.0, -0.3, 0.6}},
        false,
        true,
    };

    template <class T, class S>
    static void vehicle(const T* p, Workings<S>& w) {
        w.drag_area = w.drag_area + p[0];
    }
};

}  // namespace sysid
