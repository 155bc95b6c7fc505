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
        .confounded_with = "aero_drag, rolling_resistance, road_grade, mass",
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
        .confounded_with = "combined_slip, longitudinal_load_transfer",
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
        .confounded_with = "limited_slip_differential, locked_differential",
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
            "yaw_inertia, limited_slip_differential, aligning_moment, drive_yaw_moment",
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
