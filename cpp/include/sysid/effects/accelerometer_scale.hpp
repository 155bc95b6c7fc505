#pragma once

#include "sysid/effects/effect.hpp"

namespace sysid {

/// Scale error of the accelerometer; body roll and pitch act like one.
struct AccelerometerScale : Effect {
    static constexpr EffectInfo info{
        "accelerometer_scale",
        "scale error of the accelerometer, or body roll and pitch",
        "a_x *= 1 + s_x, a_y *= 1 + s_y",
        "Klein & Morelli, Aircraft System Identification, ch. 10",
        "a ramp to the limit, hard braking",
        "ay_mps2, ax_mps2",
        "ax_mps2, ay_mps2",
        "body_attitude, gyro_scale",
        2,
        {
            {"ax_error", "1", 0.0, 0.05, 0.01, -0.5, 0.5, 0.01, 0.05},
            {"ay_error", "1", 0.0, 0.05, 0.01, -0.5, 0.5, 0.01, 0.05},
        },
    };

    template <class T, class S>
    static void input(const T* p, Workings<S>& w) {
        w.ax_input = w.ax_input / (1.0 + p[0]);
    }
    template <class T, class S>
    static void sensors(const T* p, const Workings<S>& /*w*/, const S* /*state*/, S* y) {
        y[kAx] *= 1.0 + p[0];
        y[kAy] *= 1.0 + p[1];
    }
};

}  // namespace sysid
