#pragma once

#include "sysid/effects/effect.hpp"

namespace sysid {

/// Vertical aerodynamic load on each axle.
struct AeroDownforce : Effect {
    static constexpr EffectInfo info{
        "aero_downforce",
        "aerodynamic downforce on the front and rear axle",
        "F_z,i += 1/2 rho C_lA,i v_x^2",
        "Milliken & Milliken, Race Car Vehicle Dynamics, ch. 15",
        "the same lateral acceleration at three or more speeds",
        "ay_mps2, yaw_rate_radps",
        "steer_rad, vx_mps, yaw_rate_radps",
        "friction_change, tyre_temperature, tyre_load_sensitivity",
        2,
        {
            {"cl_a_front_m2", "m2", 0.0, 0.9, 0.1, -3.0, 6.0, 0.0, 1.5},
            {"cl_a_rear_m2", "m2", 0.0, 1.3, 0.1, -3.0, 6.0, 0.0, 2.5},
        },
    };

    template <class T, class S>
    static void loads(const T* p, Workings<S>& w) {
        const S dynamic_pressure = 0.5 * w.rho * w.v_x * w.v_x;
        w.fz_f += p[0] * dynamic_pressure;
        w.fz_r += p[1] * dynamic_pressure;
    }
};

}  // namespace sysid
