#pragma once

#include <algorithm>

#include "sysid/effects/effect.hpp"

namespace sysid {

/// The slip angle that makes the force follows the geometric one over a rolled distance.
struct TyreRelaxation : Effect {
    static constexpr EffectInfo info{
        "tyre_relaxation",
        "tyre relaxation length",
        "(sigma / v_x) d(alpha')/dt + alpha' = alpha",
        "Pacejka, Tire and Vehicle Dynamics (3rd ed.), eq. (7.18)",
        "steps and sweeps of the steering at low and high speed",
        "ay_mps2, yaw_rate_radps",
        "steer_rad, vx_mps, yaw_rate_radps",
        "steer_lag, steer_delay, yaw_inertia",
        1,
        {{"relaxation_length_m", "m", 0.0, 0.45, 0.1, 0.0, 3.0, 0.2, 0.7}},
        true,
    };
    static constexpr std::size_t state_count = 2;

    template <class T, class S>
    static void slip(const T* p, Workings<S>& w, const S* state, S* state_rate) {
        if (!(value_of(p[0]) > 0.0)) return;
        S rate = w.v_x / p[0];
        if (value_of(rate) > kFastestLag) rate = S(kFastestLag);
        state_rate[0] = rate * (w.alpha_f - state[0]);
        state_rate[1] = rate * (w.alpha_r - state[1]);
        w.alpha_f = state[0];
        w.alpha_r = state[1];
    }
    static double rate(const double* p, double v_x) {
        return p[0] > 0.0 ? std::min(v_x / p[0], kFastestLag) : 0.0;
    }
};

}  // namespace sysid
