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
        2,
        {
            {"forward_m", "m", 0.0, 0.5, 0.05, -4.0, 4.0},
            {"left_m", "m", 0.0, 0.3, 0.05, -2.0, 2.0},
        },
    };

    template <class T, class S>
    static void input(const T* p, Workings<S>& w) {
        // l_y dr/dt is left out: the yaw acceleration follows from the forces, which come later.
        w.ax_input += p[0] * (w.r * w.r);
    }
    template <class T, class S>
    static void sensors(const T* p, const Workings<S>& w, S* y) {
        y[kAx] = y[kAx] - (p[0] * (w.r * w.r) + p[1] * w.r_dot);
        y[kAy] += p[0] * w.r_dot - p[1] * (w.r * w.r);
    }
};

}  // namespace sysid
