#pragma once

#include "sysid/effects/effect.hpp"

namespace sysid {

/// The accelerometer is not at the centre of gravity.
struct ImuLeverArm : Effect {
    static constexpr EffectInfo info{
        "imu_lever_arm",
        "accelerometer away from the centre of gravity",
        "a_x -= l_x r^2 + l_y dr/dt, a_y += l_x dr/dt - l_y r^2",
        "Klein & Morelli, Aircraft System Identification, ch. 10",
        "sweeps and tight circles",
        "ay_mps2, ax_mps2",
        "ay_mps2, yaw_rate_radps",
        "cg_position",
        2,
        {
            {"forward_m", "m", 0.0, 0.5, 0.05, -4.0, 4.0, 0.1, 0.8},
            {"left_m", "m", 0.0, 0.3, 0.05, -2.0, 2.0, 0.1, 0.5, true},
        },
    };

    static constexpr bool reads_yaw_acceleration = true;

    template <class T, class S>
    static void input(const T* p, Workings<S>& w) {
        w.ax_input += p[0] * (w.r * w.r) + p[1] * w.r_dot;
    }
    template <class T, class S>
    static void sensors(const T* p, const Workings<S>& w, const S* /*state*/, S* y) {
        y[kAx] = y[kAx] - (p[0] * (w.r * w.r) + p[1] * w.r_dot);
        y[kAy] += p[0] * w.r_dot - p[1] * (w.r * w.r);
    }
};

}  // namespace sysid
