// Mass, inertia, where the centre of gravity lies, the load that moves with it, and the body that
// leans on its springs.
#pragma once

#include <numbers>

#include "sysid/effects/effect.hpp"
#include "sysid/model/kinematics.hpp"

namespace sysid {

/// The car is heavier than the vehicle file says.
struct Mass : Effect {
    static constexpr EffectInfo info{
        .id = "mass",
        .title = "mass differs from the vehicle file",
        .equation = "m *= 1 + e",
        .source = "Rajamani, Vehicle Dynamics and Control, ch. 14",
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
            "mass, tyre_relaxation, front_tyre_relaxation, rear_tyre_relaxation, "
            "steer_lag, steer_delay, locked_differential",
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
        .excited_by = "a ramp to the limit and a sweep; axle scales settle it",
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

/// The body rolls on its springs, late and with overshoot, and the accelerometer with it. The state
/// is the roll angle over its gradient, which is a_y/g in a long corner. The mass reacts through
/// the tyres: while it rolls outwards, the axles move inwards under it, and slip less. (2) stays as
/// it is, because it is about the centre of gravity, where sensors of speed are taken to be. The
/// roll axis is taken to lie at a fifth of its height. f is that of rolling about the centre of
/// gravity, which the tyres let go sideways.
struct BodyRoll : Effect {
    static constexpr EffectInfo info{
        .id = "body_roll",
        .title = "body that rolls with a natural frequency, and its inertia",
        .equation =
            "s'' + 0.7 w s' + w^2 s = w^2 a_y/g, w = 2 pi f, phi = K s: a_y' = a_y cos(phi) + "
            "g sin(phi), tan(alpha_i) of v_y + 0.8 h phi'",
        .source =
            "Segel, Proc. IMechE Auto. Div. 7 (1956), 310-330; Rajamani, Vehicle Dynamics and "
            "Control, ch. 15; Gillespie, Fundamentals of Vehicle Dynamics, ch. 6",
        .excited_by = "steps of the steering and sweeps up to 3 Hz, then a long corner",
        .moves = "ay_mps2, yaw_rate_radps",
        .needs = "steer_rad, vx_mps, yaw_rate_radps, ay_mps2",
        .confounded_with = "body_attitude, accelerometer_scale, tyre_relaxation",
        .parameters = {{.name = "roll_per_g_rad",
                        .unit = "rad",
                        .typical = 0.06,
                        .matters = 0.01,
                        .bounds = {0.0, 0.4},
                        .usual = {0.02, 0.09}},
                       {.name = "frequency_hz",
                        .unit = "Hz",
                        .null_value = 2.0,
                        .typical = 2.0,
                        .matters = 0.4,
                        .bounds = {0.5, 6.0},
                        .usual = {1.2, 3.5},
                        .scan = Scan::kRange}},
        .states = {{"roll_per_gradient", "1"}, {"roll_rate_per_gradient", "1/s"}},
        .refines = "body_attitude, accelerometer_scale",
    };
    static constexpr double state_spread = 0.1;
    /// About a fixed axis cars roll at 1 to 2.5 Hz with a damping ratio of 0.2 to 0.5; about their
    /// centre of gravity both are higher by a fifth or so, as the inertia is smaller.
    static constexpr double kDamping = 0.35;
    /// Of the height of the centre of gravity, what is above the roll axis.
    static constexpr double kAboveAxis = 0.8;

    template <class T, class S>
    static void steering(const T* p, Workings<S>& w, Lags<S> lags) {
        w.v_road = w.v_road + (kAboveAxis * p[0]) * (w.h * lags.states()[1]);
    }
    template <class T, class S>
    static void follow(const T* p, const Workings<S>& w, Lags<S> lags) {
        lags.swing(0, w.a_y / kGravity, S((2.0 * std::numbers::pi) * p[1]), kDamping);
    }
    template <class T, class S>
    static void sensors(const T* p, const Workings<S>& /*w*/, const S* state, S* y) {
        using std::cos;
        using std::sin;
        const S phi = named("roll", p[0] * state[0]);
        y[kAy] = y[kAy] * cos(phi) + kGravity * sin(phi);
    }
};

}  // namespace sysid
