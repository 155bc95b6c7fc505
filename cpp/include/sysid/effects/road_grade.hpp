#pragma once

#include "sysid/effects/effect.hpp"
#include "sysid/model/vehicle.hpp"

namespace sysid {

/// The road climbs; positive uphill.
struct RoadGrade : Effect {
    static constexpr EffectInfo info{
        "road_grade",
        "road grade, positive uphill",
        "dv_x/dt -= g sin(theta)",
        "Rajamani, Vehicle Dynamics and Control, eq. (4.1)",
        "the same road out and back",
        "vx_mps",
        "vx_mps, ax_mps2",
        "aero_drag, rolling_resistance, head_wind, force_gain, accelerometer_bias",
        1,
        {{"grade_rad", "rad", 0.0, 0.03, 0.005, -0.5, 0.5, 0.01, 0.06}},
    };

    template <class T, class S>
    static void body(const T* p, Workings<S>& w) {
        using std::sin;
        w.gravity_x = w.gravity_x - kGravity * sin(p[0]);
    }
};

}  // namespace sysid
