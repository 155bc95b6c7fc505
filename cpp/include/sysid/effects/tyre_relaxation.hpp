#pragma once

#include <algorithm>

#include "sysid/effects/effect.hpp"
#include "sysid/math/dual.hpp"

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
        1,
        {{"relaxation_length_m", "m", 0.0, 0.45, 0.1, 0.0, 3.0}},
        true,
    };

    template <class T, class S>
    static void slip(const T* p, Workings<S>& w, const S* aux, S* aux_rate) {
        if (!(value_of(p[0]) > 0.0)) return;
        S rate = w.v_x / p[0];
        if (value_of(rate) > kFastestLag) rate = S(kFastestLag);
        aux_rate[kSlipFrontLagged] = rate * (w.alpha_f - aux[kSlipFrontLagged]);
        aux_rate[kSlipRearLagged] = rate * (w.alpha_r - aux[kSlipRearLagged]);
        w.alpha_f = aux[kSlipFrontLagged];
        w.alpha_r = aux[kSlipRearLagged];
    }
    static double rate(const double* p, double v_x) {
        return p[0] > 0.0 ? std::min(v_x / p[0], kFastestLag) : 0.0;
    }
};

}  // namespace sysid
