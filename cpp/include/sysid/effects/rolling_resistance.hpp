#pragma once

#include "sysid/effects/effect.hpp"
#include "sysid/model/vehicle.hpp"

namespace sysid {

/// Rolling resistance of all wheels together.
struct RollingResistance : Effect {
    static constexpr EffectInfo info{
        "rolling_resistance",
        "rolling resistance",
        "F_x -= f_0 m g",
        "Gillespie, Fundamentals of Vehicle Dynamics, ch. 4",
        "coasting at low and high speed",
        "vx_mps, ax_mps2",
        1,
        {{"coefficient", "1", 0.0, 0.012, 0.003, -0.05, 0.1}},
        false,
        true,
    };

    template <class T, class S>
    static void body(const T* p, Workings<S>& w) {
        w.force_x = w.force_x - p[0] * (w.m * kGravity);
    }
};

}  // namespace sysid
