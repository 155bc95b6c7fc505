#pragma once

#include "sysid/effects/effect.hpp"

namespace sysid {

/// The optical or satellite speed sensor is mounted turned to the right.
struct SpeedSensorMisalignment : Effect {
    static constexpr EffectInfo info{
        "speed_sensor_misalignment",
        "speed sensor turned about the vertical",
        "v_x' = v_x cos(e) - v_y sin(e), v_y' = v_y cos(e) + v_x sin(e)",
        "Klein & Morelli, Aircraft System Identification, ch. 10",
        "straight driving at several speeds",
        "vy_mps",
        "steer_rad, vx_mps, yaw_rate_radps, vy_mps",
        "steer_offset, rear_toe, side_wind",
        1,
        {{"angle_rad", "rad", 0.0, 0.008, 0.0015, -0.3, 0.3, 0.003, 0.017, true}},
    };

    template <class T, class S>
    static void sensors(const T* p, const Workings<S>& /*w*/, const S* /*state*/, S* y) {
        using std::cos;
        using std::sin;
        const S forward = y[kVx];
        y[kVx] = forward * cos(p[0]) - y[kVy] * sin(p[0]);
        y[kVy] = y[kVy] * cos(p[0]) + forward * sin(p[0]);
    }
};

}  // namespace sysid
