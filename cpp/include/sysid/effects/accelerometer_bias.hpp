#pragma once

#include "sysid/effects/effect.hpp"

namespace sysid {

/// Constant error of the accelerometer.
struct AccelerometerBias : Effect {
    static constexpr EffectInfo info{
        "accelerometer_bias",
        "bias of the accelerometer",
        "a_x += b_x, a_y += b_y",
        "Klein & Morelli, Aircraft System Identification, ch. 10",
        "standstill on level ground, or both directions of the same road",
        "ax_mps2, ay_mps2",
        "ax_mps2, ay_mps2",
        "side_wind, road_bank, road_grade",
        2,
        {
            {"ax_mps2", "m/s2", 0.0, 0.15, 0.03, -5.0, 5.0, 0.05, 0.2},
            {"ay_mps2", "m/s2", 0.0, 0.25, 0.03, -5.0, 5.0, 0.05, 0.3, true},
        },
    };

    template <class T, class S>
    static void input(const T* p, Workings<S>& w) {
        w.ax_input = w.ax_input - p[0];
    }
    template <class T, class S>
    static void sensors(const T* p, const Workings<S>& /*w*/, const S* /*state*/, S* y) {
        y[kAx] += p[0];
        y[kAy] += p[1];
    }
};

}  // namespace sysid
