#pragma once

#include "sysid/effects/effect.hpp"

namespace sysid {

/// Braking and driving move more, or less, load between the axles than the height of the centre of
/// gravity in the vehicle file says.
struct LongitudinalLoadTransfer : Effect {
    static constexpr EffectInfo info{
        "longitudinal_load_transfer",
        "longitudinal load transfer: height of the centre of gravity",
        "h += d in Delta F_z = m a_x h/L",
        "Rajamani, Vehicle Dynamics and Control, ch. 4; Milliken & Milliken, Race Car Vehicle "
        "Dynamics, ch. 18",
        "braking and accelerating in corners",
        "yaw_rate_radps, ay_mps2",
        "steer_rad, vx_mps, yaw_rate_radps",
        "tyre_load_sensitivity, combined_slip, force_split",
        1,
        {{"height_error_m", "m", 0.0, 0.12, 0.03, -0.6, 1.5, -0.15, 0.15}},
    };

    template <class T, class S>
    static void vehicle(const T* p, Workings<S>& w) {
        w.h += p[0];
    }
};

}  // namespace sysid
