#pragma once

#include "sysid/effects/effect.hpp"
#include "sysid/model/kinematics.hpp"

namespace sysid {

/// Friction ellipse: longitudinal force takes lateral force away. The parameter is the square of
/// the usual shape factor, so that the derivative at zero exists.
struct CombinedSlip : Effect {
    static constexpr EffectInfo info{
        "combined_slip",
        "combined slip: drive and brake force cost lateral force",
        "F_y *= sqrt(1 - p (F_x / (D F_z))^2)",
        "Pacejka, Tire and Vehicle Dynamics (3rd ed.), ch. 4",
        "braking and accelerating while cornering",
        "ay_mps2, yaw_rate_radps",
        "steer_rad, vx_mps, yaw_rate_radps",
        "longitudinal_load_transfer, force_split",
        1,
        {{"ellipse", "1", 0.0, 1.0, 0.2, 0.0, 1.5, 0.5, 1.0}},
    };

    template <class T, class S>
    static void grip(const T* p, Workings<S>& w, const S* /*state*/) {
        w.grip_f *= ellipse_left(p[0], w.fx_f / (w.mu_peak_f * w.fz_f));
        w.grip_r *= ellipse_left(p[0], w.fx_r / (w.mu_peak_r * w.fz_r));
    }
};

}  // namespace sysid
