#pragma once

#include <algorithm>

#include "sysid/effects/effect.hpp"
#include "sysid/math/dual.hpp"

namespace sysid {

/// The road wheels follow the logged steering angle with a first-order lag.
struct SteerLag : Effect {
    static constexpr EffectInfo info{
        "steer_lag",
        "steering lag between the logged and the acting angle",
        "tau d(delta')/dt + delta' = delta",
        "Rajamani, Vehicle Dynamics and Control, ch. 2",
        "fast sweeps and steps of the steering",
        "yaw_rate_radps, ay_mps2",
        1,
        {{"time_constant_s", "s", 0.0, 0.06, 0.01, 0.0, 0.5}},
        true,
    };

    template <class T, class S>
    static void steering(const T* p, Workings<S>& w, const S* aux, S* aux_rate) {
        if (!(value_of(p[0]) > 0.0)) return;
        const T time_constant = value_of(p[0]) > 1.0 / kFastestLag ? p[0] : T(1.0 / kFastestLag);
        aux_rate[kSteerLagged] = (w.delta - aux[kSteerLagged]) / time_constant;
        w.delta = aux[kSteerLagged];
    }
    static double rate(const double* p, double /*v_x*/) {
        return p[0] > 0.0 ? std::min(1.0 / p[0], kFastestLag) : 0.0;
    }
};

}  // namespace sysid
