// Drive and brakes: the force itself, its share of the axles, moments between the wheels.
#pragma once

#include "sysid/effects/effect.hpp"
#include "sysid/model/kinematics.hpp"

namespace sysid {

/// The logged wheel force is too small or too large: the torque maps of engine and brakes err, each
/// by its own share.
struct ForceGain : Effect {
    static constexpr EffectInfo info{
        .id = "force_gain",
        .title = "gain of the drive and the brake force",
        .equation = "F_x *= 1 + k_drive (F_x > 0), 1 + k_brake (F_x < 0)",
        .source = "Rajamani, Vehicle Dynamics and Control, ch. 4",
        .excited_by = "accelerating and braking on a straight",
        .moves = "vx_mps, ax_mps2",
        .needs = "fx_n, vx_mps",
        .confounded_with =
            "aero_drag, rolling_resistance, head_wind, road_grade, mass, wheel_inertia",
        .parameters = {{.name = "drive_error",
                        .unit = "1",
                        .typical = 0.08,
                        .matters = 0.02,
                        .bounds = {-0.6, 1.0},
                        .usual = {0.03, 0.1}},
                       {.name = "brake_error",
                        .unit = "1",
                        .typical = 0.08,
                        .matters = 0.02,
                        .bounds = {-0.6, 1.0},
                        .usual = {0.03, 0.1}}},
        .needs_force = true,
    };

    template <class T, class S>
    static void input(const T* p, Workings<S>& w) {
        w.fx *= 1.0 + if_below(w.fx, 0.0, S(p[1]), S(p[0]));
    }
};

/// The wheels push after the log says so: the logged force is what engine and brakes were told to
/// give, and torque and pressure build up. The state is the force that acts [kN].
struct ForceLag : Effect {
    static constexpr EffectInfo info{
        .id = "force_lag",
        .title = "lag between the logged and the acting wheel force",
        .equation = "tau d(F_x')/dt + F_x' = F_x",
        .source = "Rajamani, Vehicle Dynamics and Control, ch. 5: lag of the lower controller",
        .excited_by = "steps of throttle and brake on a straight",
        .moves = "ax_mps2, vx_mps",
        .needs = "fx_n, vx_mps",
        .confounded_with = "sensor_delay",
        .parameters = {{.name = "time_constant_s",
                        .unit = "s",
                        .typical = 0.15,
                        .matters = 0.03,
                        .bounds = {0.0, 2.0},
                        .usual = {0.05, 0.5}}},
        .states = {{"lagging_force", "kN"}},
        .scored_at_typical = true,
        .needs_force = true,
    };
    static constexpr double state_spread = 0.2;  // [kN]

    template <class T, class S>
    static void drive(const T* p, Workings<S>& w, Lags<S> lags) {
        if (value_of(p[0]) > 0.0) w.fx = 1e3 * lags.follow(0, 1e-3 * w.fx, S(lag_rate(p[0])));
    }
};

/// A part of the logged force turns the wheels and the drive line faster: it moves more mass than
/// the car has, and the contacts get what is left, half of it taken from each axle. Load transfer
/// stays that of the logged force, as the moment of the turning wheels acts on it too.
struct WheelInertia : Effect {
    static constexpr EffectInfo info{
        .id = "wheel_inertia",
        .title = "inertia of wheels and drive line",
        .equation = "F_x = F_x,logged - e m dv_x/dt, e m = sum J_i / R^2",
        .source = "Gillespie, Fundamentals of Vehicle Dynamics, ch. 2: mass factor",
        .excited_by = "accelerating and braking on a straight",
        .moves = "ax_mps2, vx_mps",
        .needs = "fx_n, vx_mps",
        .confounded_with = "force_gain, mass",
        .parameters = {{.name = "mass_share",
                        .unit = "1",
                        .typical = 0.06,
                        .matters = 0.02,
                        .bounds = {0.0, 1.0},
                        .usual = {0.03, 0.12}}},
        .needs_force = true,
    };

    template <class T, class S>
    static void forces(const T* p, Workings<S>& w) {
        if (!w.force_known) return;
        const S turning = named("turning_mass", p[0] * w.m);
        const S along = 0.5 * (w.cos_delta + 1.0);  // of what both axles lose equally
        const S pull = w.fx_f * w.cos_delta - w.fy_f * w.sin_delta + w.fx_r + w.force_x;
        const S beyond = w.v_y * w.r + w.gravity_x;  // of dv_x/dt, beyond what forces do
        const S taken = named("taken", turning * (pull + w.m * beyond) / (w.m + turning * along));
        w.fx_f = w.fx_f - 0.5 * taken;
        w.fx_r = w.fx_r - 0.5 * taken;
    }
};

/// Brake or drive force is shared between the axles in another way than the vehicle file says.
struct ForceSplit : Effect {
    static constexpr EffectInfo info{
        .id = "force_split",
        .title = "share of the front axle in brake and drive force",
        .equation = "F_xf = (beta + Delta beta) F_x",
        .source = "Rajamani, Vehicle Dynamics and Control, ch. 4",
        .excited_by = "braking and full throttle in corners",
        .moves = "yaw_rate_radps, ay_mps2",
        .needs = "steer_rad, vx_mps, yaw_rate_radps",
        .confounded_with = "combined_slip, longitudinal_load_transfer, drive_yaw_moment",
        .parameters = {{.name = "brake_front_error",
                        .unit = "1",
                        .typical = 0.1,
                        .matters = 0.03,
                        .bounds = {-0.6, 0.6},
                        .usual = {0.03, 0.15}},
                       {.name = "drive_front_error",
                        .unit = "1",
                        .typical = 0.1,
                        .matters = 0.03,
                        .bounds = {-0.6, 0.6},
                        .usual = {0.03, 0.15}}},
        .through = "combined_slip",
    };

    template <class T, class S>
    static void vehicle(const T* p, Workings<S>& w) {
        w.brake_front += p[0];
        w.drive_front += p[1];
    }
};

/// Drive or brake force that is not equal left and right: a constant pull, and torque vectoring or
/// a limited-slip differential that answers to the corner.
struct DriveYawMoment : Effect {
    static constexpr EffectInfo info{
        .id = "drive_yaw_moment",
        .title = "yaw moment of drive and brake force",
        .equation = "M_z += F_x (b + k v_x r / g)",
        .source = "Milliken & Milliken, Race Car Vehicle Dynamics, ch. 20",
        .excited_by = "full throttle and braking, straight and in corners",
        .moves = "yaw_rate_radps",
        .needs = "fx_n, vx_mps, yaw_rate_radps",
        .confounded_with =
            "limited_slip_differential, locked_differential, longitudinal_load_transfer, "
            "tyre_load_sensitivity, force_split",
        .parameters = {{.name = "arm_m",
                        .unit = "m",
                        .typical = 0.03,
                        .matters = 0.005,
                        .bounds = {-1.0, 1.0},
                        .usual = {0.005, 0.05},
                        .mirrored = true},
                       {.name = "cornering_arm_m",
                        .unit = "m",
                        .typical = 0.05,
                        .matters = 0.01,
                        .bounds = {-1.0, 1.0},
                        .usual = {0.01, 0.1}}},
        .needs_force = true,
    };

    template <class T, class S>
    static void body(const T* p, Workings<S>& w) {
        w.moment_z += w.fx * (p[0] + p[1] * (w.v_x * w.r / kGravity));
    }
};

/// Both driven wheels turn equally fast, so that in a bend the inner one is driven too fast and the
/// outer too slow.
struct LockedDifferential : Effect {
    static constexpr EffectInfo info{
        .id = "locked_differential",
        .title = "locked differential: wheels of one axle turn together",
        .equation = "M_z -= C_x T^2/2 r / v_x",
        .source = "Milliken & Milliken, Race Car Vehicle Dynamics, ch. 20",
        .excited_by = "slow circles, throttle in corners at several speeds",
        .moves = "yaw_rate_radps",
        .needs = "steer_rad, vx_mps, yaw_rate_radps",
        .confounded_with =
            "yaw_inertia, limited_slip_differential, aligning_moment, drive_yaw_moment, "
            "aero_downforce",
        .parameters = {{.name = "slip_stiffness_nm2",
                        .unit = "N m2",
                        .typical = 120000.0,
                        .matters = 20000.0,
                        .bounds = {0.0, 1000000.0},
                        .usual = {50000.0, 250000.0}}},
    };

    template <class T, class S>
    static void body(const T* p, Workings<S>& w) {
        const S speed = if_below(w.v_x, 1.0, S(1.0), w.v_x);
        w.moment_z = w.moment_z - p[0] * (w.r / speed);
    }
};

/// Friction between the driven wheels holds the faster one back: a moment of one size against the
/// turn, its sign blended over 0.02 rad/s.
struct LimitedSlipDifferential : Effect {
    static constexpr EffectInfo info{
        .id = "limited_slip_differential",
        .title = "limited-slip differential: a moment against the turn",
        .equation = "M_z -= M_0 r / sqrt(r^2 + (0.02 rad/s)^2)",
        .source = "Milliken & Milliken, Race Car Vehicle Dynamics, ch. 20",
        .excited_by = "slow circles and fast corners in both directions",
        .moves = "yaw_rate_radps",
        .needs = "steer_rad, vx_mps, yaw_rate_radps",
        .confounded_with = "locked_differential, drive_yaw_moment",
        .parameters = {{.name = "moment_nm",
                        .unit = "N m",
                        .typical = 400.0,
                        .matters = 60.0,
                        .bounds = {0.0, 6000.0},
                        .usual = {150.0, 900.0}}},
    };

    template <class T, class S>
    static void body(const T* p, Workings<S>& w) {
        using std::sqrt;
        constexpr double kBlend = 0.02;  // [rad/s]
        w.moment_z = w.moment_z - p[0] * (w.r / sqrt(w.r * w.r + kBlend * kBlend));
    }
};

}  // namespace sysid
