#pragma once

#include "sysid/effects/effect.hpp"

namespace sysid {

/// Wind along the road; positive against the car.
struct HeadWind : Effect {
    static constexpr EffectInfo info{
        "head_wind",
        "steady head wind",
        "F_x -= 1/2 rho C_dA ((v_x + w)^2 - v_x^2)",
        "Gillespie, Fundamentals of Vehicle Dynamics, ch. 4",
        "the same road out and back, at several speeds",
        "vx_mps, ax_mps2",
        "fx_n, vx_mps",
        "aero_drag, rolling_resistance, road_grade",
        1,
        {{"speed_mps", "m/s", 0.0, 6.0, 1.0, -40.0, 40.0, 2.0, 10.0}},
        false,
        true,
    };

    template <class T, class S>
    static void body(const T* p, Workings<S>& w) {
        w.force_x = w.force_x - 0.5 * w.rho * (w.drag_area * (p[0] * (2.0 * w.v_x + p[0])));
    }
};

}  // namespace sysid
