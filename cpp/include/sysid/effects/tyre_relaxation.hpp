#pragma once

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
    static void slip(const T* p, Workings<S>& w, Lags<S> lags) {
        using std::abs;
        if (!(value_of(p[0]) > 0.0)) return;
        S rate = abs(w.v_x) / p[0];
        if (value_of(rate) > 1.0 / kShortestLag) rate = S(1.0 / kShortestLag);
        w.alpha_f = lags.follow(0, w.alpha_f, rate);
        w.alpha_r = lags.follow(1, w.alpha_r, rate);
    }
};

}  // namespace sysid
