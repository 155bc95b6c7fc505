#pragma once

#include "sysid/effects/effect.hpp"

namespace sysid {

/// Grip changes at one moment of the log: another surface, rain. It blends over a second, so that
/// the moment can be sought; without a change the moment means nothing.
struct FrictionChange : Effect {
    static constexpr EffectInfo info{
        "friction_change",
        "grip changes at some moment",
        "mu *= 1 - s / (1 + exp(-(t - t_0) / 0.2 s))",
        "Rajamani, Vehicle Dynamics and Control, ch. 13",
        "the same corner before and after, near the limit",
        "ay_mps2, yaw_rate_radps",
        "steer_rad, vx_mps, yaw_rate_radps",
        "aero_downforce, tyre_temperature",
        2,
        {
            {"drop", "1", 0.0, 0.2, 0.04, -1.0, 0.95, 0.05, 0.6},
            {"at_s", "s", 0.0, 5.0, 1.0, 0.0, 100000.0, 0.0, 60.0, false, Scan::kTime},
        },
    };

    template <class T, class S>
    static void grip(const T* p, Workings<S>& w, const S* /*state*/) {
        const T left = 1.0 - p[0] * after(T((w.time_s - p[1]) / kBlend));
        w.mu_peak_f *= left;
        w.mu_peak_r *= left;
        w.grip_f *= left;
        w.grip_r *= left;
    }

    static constexpr double kBlend = 0.2;  // [s]

    template <class T>
    static T after(const T& x) {
        using std::exp;
        if (value_of(x) < -40.0) return T(0.0);
        if (value_of(x) > 40.0) return T(1.0);
        return 1.0 / (1.0 + exp(-x));
    }
};

}  // namespace sysid
