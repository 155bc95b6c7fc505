#pragma once

#include "sysid/effects/effect.hpp"

namespace sysid {

/// Friction between the driven wheels holds the faster one back: a moment of one size against the
/// turn, its sign blended over 0.02 rad/s.
struct LimitedSlipDifferential : Effect {
    static constexpr EffectInfo info{
        "limited_slip_differential",
        "limited-slip differential: a moment against the turn",
        "M_z -= M_0 r / sqrt(r^2 + (0.02 rad/s)^2)",
        "Milliken & Milliken, Race Car Vehicle Dynamics, ch. 20",
        "slow circles and fast corners in both directions",
        "yaw_rate_radps",
        "steer_rad, vx_mps, yaw_rate_radps",
        "locked_differential, drive_yaw_moment",
        1,
        {{"moment_nm", "N m", 0.0, 400.0, 60.0, 0.0, 6000.0, 150.0, 900.0}},
    };

    template <class T, class S>
    static void body(const T* p, Workings<S>& w) {
        using std::sqrt;
        constexpr double kBlend = 0.02;  // [rad/s]
        w.moment_z = w.moment_z - p[0] * (w.r / sqrt(w.r * w.r + kBlend * kBlend));
    }
};

}  // namespace sysid
