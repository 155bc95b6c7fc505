#pragma once

#include "sysid/effects/effect.hpp"

namespace sysid {

/// Scale error of the yaw-rate sensor.
struct GyroScale : Effect {
    static constexpr EffectInfo info{
        "gyro_scale",
        "scale error of the yaw-rate sensor",
        "r *= 1 + s",
        "Klein & Morelli, Aircraft System Identification, ch. 10",
        "full turns against a heading that is known",
        "yaw_rate_radps",
        "steer_rad, vx_mps, yaw_rate_radps, ay_mps2",
        "body_attitude, accelerometer_scale",
        1,
        {{"scale_error", "1", 0.0, 0.015, 0.004, -0.3, 0.3, 0.005, 0.02}},
    };

    template <class T, class S>
    static void sensors(const T* p, const Workings<S>& /*w*/, const S* /*state*/, S* y) {
        y[kYawRate] *= 1.0 + p[0];
    }
};

}  // namespace sysid
