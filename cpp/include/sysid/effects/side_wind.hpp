#pragma once

#include "sysid/effects/effect.hpp"

namespace sysid {

/// A steady lateral force and yaw moment from outside.
struct SideWind : Effect {
    static constexpr EffectInfo info{
        "side_wind",
        "steady side wind: lateral force and yaw moment",
        "F_y += F_w, M_z += M_w",
        "Gillespie, Fundamentals of Vehicle Dynamics, ch. 4",
        "the same road out and back, at several speeds",
        "ay_mps2, yaw_rate_radps",
        2,
        {
            {"side_force_n", "N", 0.0, 450.0, 60.0, -1.0e4, 1.0e4},
            {"yaw_moment_nm", "N m", 0.0, 250.0, 50.0, -1.0e4, 1.0e4},
        },
    };

    template <class T, class S>
    static void body(const T* p, Workings<S>& w) {
        w.force_y += p[0];
        w.moment_z += p[1];
    }
};

}  // namespace sysid
