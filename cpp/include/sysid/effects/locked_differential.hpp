#pragma once

#include "sysid/effects/effect.hpp"

namespace sysid {

/// Both driven wheels turn equally fast, so that in a bend the inner one is driven too fast and the
/// outer too slow.
struct LockedDifferential : Effect {
    static constexpr EffectInfo info{
        "locked_differential",
        "locked differential: wheels of one axle turn together",
        "M_z -= C_x T^2/2 r / v_x",
        "Milliken & Milliken, Race Car Vehicle Dynamics, ch. 20",
        "slow circles, throttle in corners at several speeds",
        "yaw_rate_radps",
        "steer_rad, vx_mps, yaw_rate_radps",
        "yaw_inertia, limited_slip_differential, aligning_moment, drive_yaw_moment",
        1,
        {{"slip_stiffness_nm2", "N m2", 0.0, 120000.0, 20000.0, 0.0, 1000000.0, 50000.0, 250000.0}},
    };

    template <class T, class S>
    static void body(const T* p, Workings<S>& w) {
        const S speed = value_of(w.v_x) > 1.0 ? w.v_x : S(1.0);
        w.moment_z = w.moment_z - p[0] * (w.r / speed);
    }
};

}  // namespace sysid
