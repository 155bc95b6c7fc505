#pragma once

#include "sysid/effects/effect.hpp"

namespace sysid {

/// The front axle force twists the steering. The force is the quasi-static one, m l_r/L v_x r: the
/// true one would make the steering angle depend on itself.
struct SteerCompliance : Effect {
    static constexpr EffectInfo info{
        "steer_compliance",
        "compliance of the steering under the front lateral force",
        "delta -= c m l_r/(l_f + l_r) v_x r",
        "Gillespie, Fundamentals of Vehicle Dynamics, ch. 6",
        "a ramp at constant speed together with slow tight circles",
        "yaw_rate_radps, ay_mps2",
        "steer_rad, vx_mps, yaw_rate_radps",
        "lateral_load_transfer, steer_ratio, steer_nonlinearity, aligning_moment",
        1,
        {{"compliance_radpn", "rad/N", 0.0, 1.5e-6, 3.0e-7, -1.0e-5, 2.0e-5, 5e-7, 2e-6}},
    };

    template <class T, class S>
    static void steering(const T* p, Workings<S>& w, Lags<S> /*lags*/) {
        w.delta = w.delta - p[0] * (w.m * w.l_r / (w.l_f + w.l_r) * w.v_x * w.r);
    }
};

}  // namespace sysid
