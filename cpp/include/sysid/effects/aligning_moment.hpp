#pragma once

#include "sysid/effects/effect.hpp"

namespace sysid {

/// The lateral force acts behind the middle of the contact patch. The trail has its full length at
/// small slip and goes once the patch slides; both axles have the same.
struct AligningMoment : Effect {
    static constexpr EffectInfo info{
        "aligning_moment",
        "aligning moment of the tyres: pneumatic trail",
        "M_z -= sum_i t F_y,i / (1 + (B_i alpha_i)^2)",
        "Pacejka, Tire and Vehicle Dynamics (3rd ed.), eq. (4.E33) with C_t = 2, D_t constant",
        "gentle sweeps, then a ramp to the limit",
        "yaw_rate_radps, ay_mps2",
        "steer_rad, vx_mps, yaw_rate_radps",
        "steer_compliance, cg_position, locked_differential",
        1,
        {{"trail_m", "m", 0.0, 0.03, 0.008, -0.2, 0.3, 0.02, 0.05}},
    };

    template <class T, class S>
    static void forces(const T* p, Workings<S>& w) {
        const S front = w.B_f * w.alpha_f;
        const S rear = w.B_r * w.alpha_r;
        w.moment_z =
            w.moment_z - p[0] * (w.fy_f / (1.0 + front * front) + w.fy_r / (1.0 + rear * rear));
    }
};

}  // namespace sysid
