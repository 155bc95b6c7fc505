#pragma once

#include "sysid/effects/effect.hpp"

namespace sysid {

/// Sliding heats the tread, and a tread away from its best temperature grips less. The states are
/// the sliding powers [kW] of front and rear axle, as late as the tread's temperature follows them;
/// grip falls in proportion (or rises: a cold tyre).
struct TyreTemperature : Effect {
    static constexpr EffectInfo info{
        "tyre_temperature",
        "grip fades with the heat of sliding",
        "mu_i *= 1 - c q_i, tau dq_i/dt + q_i = |F_y,i alpha_i v_x|",
        "Pacejka, Tire and Vehicle Dynamics (3rd ed.), ch. 3; Farroni et al., Meccanica 2014, "
        "linearised",
        "cold and hot repeats of the same corners, long stints",
        "ay_mps2, yaw_rate_radps",
        "steer_rad, vx_mps, yaw_rate_radps",
        "aero_downforce, friction_change, lateral_load_transfer",
        2,
        {
            {"loss_pkw", "1/kW", 0.0, 0.03, 0.005, -0.15, 0.3, 0.01, 0.06},
            {"time_constant_s", "s", 20.0, 20.0, 5.0, 1.0, 900.0, 5.0, 60.0, false, Scan::kRange},
        },
    };
    static constexpr std::size_t state_count = 2;
    static constexpr double state_spread = 0.5;  // [kW]

    template <class T, class S>
    static void grip(const T* p, Workings<S>& w, const S* state) {
        apply(1.0 - p[0] * state[0], w.mu_peak_f, w.grip_f);
        apply(1.0 - p[0] * state[1], w.mu_peak_r, w.grip_r);
    }
    template <class T, class S>
    static void follow(const T* p, const Workings<S>& w, Lags<S> lags) {
        const S speed = 1e-3 * w.v_x;
        const S rate(lag_rate(p[1]));
        // Force and slip angle have the same sign, so that the product needs no absolute value.
        lags.follow_slowly(0, speed * (w.fy_f * w.alpha_f), rate);
        lags.follow_slowly(1, speed * (w.fy_r * w.alpha_r), rate);
    }

    template <class S>
    static void apply(const S& left, S& peak, S& grip) {
        if (value_of(left) < 0.05) return apply(S(0.05), peak, grip);
        peak *= left;
        grip *= left;
    }
};

}  // namespace sysid
