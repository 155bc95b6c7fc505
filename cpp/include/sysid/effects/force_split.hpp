#pragma once

#include "sysid/effects/effect.hpp"

namespace sysid {

/// Brake or drive force is shared between the axles in another way than the vehicle file says.
struct ForceSplit : Effect {
    static constexpr EffectInfo info{
        "force_split",
        "share of the front axle in brake and drive force",
        "F_xf = (beta + Delta beta) F_x",
        "Rajamani, Vehicle Dynamics and Control, ch. 4",
        "braking and full throttle in corners",
        "yaw_rate_radps, ay_mps2",
        "steer_rad, vx_mps, yaw_rate_radps",
        "combined_slip, longitudinal_load_transfer",
        2,
        {
            {"brake_front_error", "1", 0.0, 0.1, 0.03, -0.6, 0.6, 0.03, 0.15},
            {"drive_front_error", "1", 0.0, 0.1, 0.03, -0.6, 0.6, 0.03, 0.15},
        },
        false,
        false,
        "combined_slip",
    };

    template <class T, class S>
    static void vehicle(const T* p, Workings<S>& w) {
        w.brake_front += p[0];
        w.drive_front += p[1];
    }
};

}  // namespace sysid
