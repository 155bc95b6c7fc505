// The road: bank, grade, grip, rolling resistance.
#pragma once

#include "sysid/effects/effect.hpp"
#include "sysid/model/kinematics.hpp"

namespace sysid {

/// The road leans; positive where gravity pulls the car to its left.
struct RoadBank : Effect {
    static constexpr EffectInfo info{
        .id = "road_bank",
        .title = "banked road, positive where gravity pulls to the left",
        .equation = "dv_y/dt += g sin(phi), F_z *= cos(phi) + v_x r / g sin(phi)",
        .source = "Rajamani, Vehicle Dynamics and Control, ch. 2; Ryu & Gerdes, ACC 2004",
        .excited_by = "the same road in both directions, with measured sideslip",
        .moves = "vy_mps",
        .needs = "steer_rad, vx_mps, yaw_rate_radps, ay_mps2",
        .confounded_with = "steer_offset, rear_toe, side_wind, gyro_bias, accelerometer_bias",
        .parameters = {{.name = "bank_rad",
                        .unit = "rad",
                        .typical = 0.05,
                        .matters = 0.01,
                        .bounds = {-0.8, 0.8},
                        .usual = {0.02, 0.12},
                        .mirrored = true}},
    };

    template <class T, class S>
    static void body(const T* p, Workings<S>& w) {
        using std::sin;
        w.gravity_y += kGravity * sin(p[0]);
    }
    template <class T, class S>
    static void loads(const T* p, Workings<S>& w) {
        using std::cos;
        using std::sin;
        const S factor = named("banked", cos(p[0]) + w.v_x * w.r / kGravity * sin(p[0]));
        w.fz_f *= factor;
        w.fz_r *= factor;
    }
};

/// The road climbs; positive uphill.
struct RoadGrade : Effect {
    static constexpr EffectInfo info{
        .id = "road_grade",
        .title = "road grade, positive uphill",
        .equation = "dv_x/dt -= g sin(theta)",
        .source = "Rajamani, Vehicle Dynamics and Control, eq. (4.1)",
        .excited_by = "the same road out and back",
        .moves = "vx_mps",
        .needs = "vx_mps, ax_mps2",
        .confounded_with =
            "aero_drag, rolling_resistance, head_wind, force_gain, accelerometer_bias",
        .parameters = {{.name = "grade_rad",
                        .unit = "rad",
                        .typical = 0.03,
                        .matters = 0.005,
                        .bounds = {-0.5, 0.5},
                        .usual = {0.01, 0.06}}},
        .breaks = Breaks::kOnASlope,
    };

    template <class T, class S>
    static void body(const T* p, Workings<S>& w) {
        using std::sin;
        w.gravity_x = w.gravity_x - kGravity * sin(p[0]);
    }
};

/// Grip changes at one moment of the log: another surface, rain. It blends over a second, so that
/// the moment can be sought; without a change the moment means nothing.
struct FrictionChange : Effect {
    static constexpr EffectInfo info{
        .id = "friction_change",
        .title = "grip changes at some moment",
        .equation = "mu *= 1 - s / (1 + exp(-(t - t_0) / 0.2 s))",
        .source = "Rajamani, Vehicle Dynamics and Control, ch. 13",
        .excited_by = "the same corner before and after, near the limit",
        .moves = "ay_mps2, yaw_rate_radps",
        .needs = "steer_rad, vx_mps, yaw_rate_radps",
        .confounded_with = "aero_downforce, tyre_temperature",
        .parameters = {{.name = "drop",
                        .unit = "1",
                        .typical = 0.2,
                        .matters = 0.04,
                        .bounds = {-1.0, 0.95},
                        .usual = {0.05, 0.6}},
                       {.name = "at_s",
                        .unit = "s",
                        .typical = 5.0,
                        .matters = 1.0,
                        .bounds = {0.0, 100000.0},
                        .usual = {0.0, 60.0},
                        .scan = Scan::kTime}},
    };

    template <class T, class S>
    static void grip(const T* p, Workings<S>& w, const S* /*state*/) {
        const T left = 1.0 - p[0] * after(T((w.time_s - p[1]) / kBlend));
        w.mu_peak_f *= left;
        w.mu_peak_r *= left;
        w.grip_f *= left;
        w.grip_r *= left;
    }

    static constexpr double kBlend = 0.2;  // [s]

    template <class T>
    static T after(const T& x) {
        using std::exp;
        // Beyond, nothing is left to blend.
        const T above = if_below(x, -40.0, T(-40.0), x);
        return 1.0 / (1.0 + exp(-if_below(above, 40.0, above, T(40.0))));
    }
};

/// Rolling resistance of all wheels together, and its rise with speed.
struct RollingResistance : Effect {
    static constexpr EffectInfo info{
        .id = "rolling_resistance",
        .title = "rolling resistance",
        .equation = "F_x -= (f_0 + f_1 v_x) m g",
        .source = "Gillespie, Fundamentals of Vehicle Dynamics, ch. 4",
        .excited_by = "coasting at low and high speed",
        .moves = "vx_mps, ax_mps2",
        .needs = "fx_n, vx_mps",
        .confounded_with = "aero_drag, road_grade, head_wind, force_gain",
        .parameters = {{.name = "coefficient",
                        .unit = "1",
                        .typical = 0.012,
                        .matters = 0.003,
                        .bounds = {0.0, 0.1},
                        .usual = {0.008, 0.015}},
                       {.name = "per_speed_spm",
                        .unit = "s/m",
                        .typical = 2.2e-4,
                        .matters = 6.0e-5,
                        .bounds = {0.0, 5.0e-4},
                        .usual = {0.0, 4.0e-4}}},
        .needs_force = true,
    };

    template <class T, class S>
    static void body(const T* p, Workings<S>& w) {
        w.force_x = w.force_x - (p[0] + p[1] * w.v_x) * (w.m * kGravity);
    }
};

}  // namespace sysid
