#pragma once

#include "sysid/effects/effect.hpp"

namespace sysid {

/// Constant error of the yaw-rate sensor.
struct GyroBias : Effect {
    static constexpr EffectInfo info{
        "gyro_bias",
        "bias of the yaw-rate sensor",
        "r += b_r",
        "Klein & Morelli, Aircraft System Identification, ch. 10",
        "standstill, straight driving",
        "yaw_rate_radps",
        "steer_rad, vx_mps, yaw_rate_radps",
        "road_bank",
        1,
        {{"bias_radps", "rad/s", 0.0, 0.006, 0.001, -0.5, 0.5, 0.002, 0.01, true}},
    };

    template <class T, class S>
    static void sensors(const T* p, const Workings<S>& /*w*/, const S* /*state*/, S* y) {
        y[kYawRate] += p[0];
    }
};

}  // namespace sysid
