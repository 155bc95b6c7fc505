#pragma once

#include "sysid/effects/effect.hpp"

namespace sysid {

/// The logged steering angle is not zero when the wheels point straight ahead.
struct SteerOffset : Effect {
    static constexpr EffectInfo info{
        "steer_offset",
        "offset of the logged steering angle",
        "delta += delta_0",
        "Gillespie, Fundamentals of Vehicle Dynamics, ch. 8",
        "straight driving and corners in both directions",
        "ay_mps2, yaw_rate_radps",
        "steer_rad, vx_mps, yaw_rate_radps",
        "rear_toe, speed_sensor_misalignment, side_wind, road_bank",
        1,
        {{"offset_rad", "rad", 0.0, 0.006, 0.001, -0.2, 0.2, 0.002, 0.01, true}},
    };

    template <class T, class S>
    static void steering(const T* p, Workings<S>& w, Lags<S> /*lags*/) {
        w.delta += p[0];
    }
};

}  // namespace sysid
