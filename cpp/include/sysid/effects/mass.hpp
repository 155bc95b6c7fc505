// Mass, inertia, where the centre of gravity lies, and the load that moves with it.
#pragma once

#include "sysid/effects/effect.hpp"
#include "sysid/model/kinematics.hpp"

namespace sysid {

/// The car is heavier than the vehicle file says.
struct Mass : Effect {
    static constexpr EffectInfo info{
        .id = "mass",
        .title = "mass differs from the vehicle file",
        .equation = "m *= 1 + e",
        .source = "Rajamani, Vehicle Dynamics and Control, eq. (4.1)",
        .excited_by = "a longitudinal force known in newtons",
        .moves = "ax_mps2, vx_mps",
        .needs = "fx_n, vx_mps, steer_rad, yaw_rate_radps",
        .confounded_with = "force_gain, yaw_inertia, wheel_inertia",
        .parameters = {{.name = "relative_error",
                        .unit = "1",
                        .typical = 0.12,
                        .matters = 0.02,
                        .bounds = {-0.6, 1.5},
                        .usual = {-0.1, 0.15}}},
    };

    template <class T, class S>
    static void vehicle(const T* p, Workings<S>& w) {
        w.m *= 1.0 + p[0];
    }
};

/// The yaw inertia differs from the vehicle file.
struct YawInertia : Effect {
    static constexpr EffectInfo info{
        .id = "yaw_inertia",
        .title = "yaw inertia differs from the vehicle file",
        .equation = "I_z *= 1 + e",
        .source = "Milliken & Milliken, Race Car Vehicle Dynamics, ch. 5",
        .excited_by = "steering sweeps at 2 Hz and faster, steps",
        .moves = "yaw_rate_radps",
        .needs = "steer_rad, vx_mps, yaw_rate_radps",
        .confounded_with =
            "mass, tyre_relaxation, front_tyre_relaxation, rear_tyre_relaxation, steer_lag, "
            "steer_delay, locked_differential, front_roll_steer, rear_roll_steer",
        .parameters = {{.name = "relative_error",
                        .unit = "1",
                        .typical = 0.25,
                        .matters = 0.05,
                        .bounds = {-0.8, 3.0},
                        .usual = {-0.2, 0.3}}},
    };

    template <class T, class S>
    static void vehicle(const T* p, Workings<S>& w) {
        w.I_z *= 1.0 + p[0];
    }
};

/// The centre of gravity lies further back than the vehicle file says. Sensors are mounted in the
/// body, and their lever arms count from the centre of gravity of the vehicle file: they stay where
/// they are, which is `d` further ahead of the true one.
struct CgPosition : Effect {
    static constexpr EffectInfo info{
        .id = "cg_position",
        .title = "centre of gravity further back than in the vehicle file",
        .equation =
            "l_f += d, l_r -= d; v_y' = v_y + d r, a_x -= d r^2, a_y += d dr/dt: sensors stay in "
            "the body",
        .source =
            "Milliken & Milliken, Race Car Vehicle Dynamics, ch. 5; Klein & Morelli, Aircraft "
            "System Identification, ch. 10",
        .excited_by = "hard cornering, braking and drive on an even road; axle scales settle it",
        .moves = "yaw_rate_radps, vy_mps",
        .needs = "steer_rad, vx_mps, yaw_rate_radps",
        .confounded_with =
            "aligning_moment, imu_lever_arm, ins_lever_arm, "
            "speed_sensor_lever_arm",
        .parameters = {{.name = "shift_rearward_m",
                        .unit = "m",
                        .typical = 0.08,
                        .matters = 0.02,
                        .bounds = {-0.8, 0.8},
                        .usual = {-0.1, 0.1}}},
    };

    template <class T, class S>
    static void vehicle(const T* p, Workings<S>& w) {
        w.l_f += p[0];
        w.l_r -= p[0];
    }
    template <class T, class S>
    static void input(const T* p, Workings<S>& w) {
        w.ax_input += p[0] * (w.r * w.r);
    }
    template <class T, class S>
    static void sensors(const T* p, const Workings<S>& w, const S* /*state*/, S* y) {
        y[kVy] += p[0] * w.r;
        y[kAx] = y[kAx] - p[0] * (w.r * w.r);
        y[kAy] += p[0] * w.r_dot;
    }
};

/// Unequal loads left and right cost an axle grip, through the tyre's load sensitivity.
struct LateralLoadTransfer : Effect {
    static constexpr EffectInfo info{
        .id = "lateral_load_transfer",
        .title = "grip lost to lateral load transfer",
        .equation = "F_y,i *= 1 - kappa_i (v_x r / g)^2",
        .source = "Milliken & Milliken, Race Car Vehicle Dynamics, ch. 18",
        .excited_by = "a slow ramp to the limit of grip",
        .moves = "ay_mps2, yaw_rate_radps",
        .needs = "steer_rad, vx_mps, yaw_rate_radps",
        .confounded_with = "tyre_load_sensitivity, steer_compliance, tyre_temperature",
        .parameters = {{.name = "loss_front",
                        .unit = "1",
                        .typical = 0.08,
                        .matters = 0.02,
                        .bounds = {-0.3, 0.6},
                        .usual = {0.03, 0.15}},
                       {.name = "loss_rear",
                        .unit = "1",
                        .typical = 0.08,
                        .matters = 0.02,
                        .bounds = {-0.3, 0.6},
                        .usual = {0.03, 0.15}}},
    };

    template <class T, class S>
    static void grip(const T* p, Workings<S>& w, const S* /*state*/) {
        const S quasi_static = w.v_x * w.r / kGravity;
        w.grip_f *= 1.0 - p[0] * (quasi_static * quasi_static);
        w.grip_r *= 1.0 - p[1] * (quasi_static * quasi_static);
    }
};

/// Braking and driving move more, or less, load between the axles than the height of the centre of
/// gravity in the vehicle file says.
struct LongitudinalLoadTransfer : Effect {
    static constexpr EffectInfo info{
        .id = "longitudinal_load_transfer",
        .title = "longitudinal load transfer: height of the centre of gravity",
        .equation = "h += d in Delta F_z = m a_x h/L",
        .source =
            "Rajamani, Vehicle Dynamics and Control, ch. 4; Milliken & Milliken, Race Car Vehicle "
            "Dynamics, ch. 18",
        .excited_by = "braking and accelerating in corners",
        .moves = "yaw_rate_radps, ay_mps2",
        .needs = "steer_rad, vx_mps, yaw_rate_radps",
        .confounded_with = "tyre_load_sensitivity, combined_slip, force_split, drive_yaw_moment",
        .parameters = {{.name = "height_error_m",
                        .unit = "m",
                        .typical = 0.12,
                        .matters = 0.03,
                        .bounds = {-0.6, 1.5},
                        .usual = {-0.15, 0.15}}},
    };

    template <class T, class S>
    static void vehicle(const T* p, Workings<S>& w) {
        w.h += p[0];
    }
};

}  // namespace sysid
