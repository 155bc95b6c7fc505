// From the logged angle to the road wheels: offsets, gains, delays, what gives way.
#pragma once

#include <cmath>

#include "sysid/effects/effect.hpp"
#include "sysid/model/kinematics.hpp"

namespace sysid {

/// The road wheels act after the log says so, or before where the angle was logged late: a dead
/// time is a shift of the input in time, and the clock of a logged channel errs in either
/// direction. The shift itself is done where the log is at hand, exactly (`identify/in_time.hpp`);
/// what is left for the equations is its derivative.
struct SteerDelay : Effect {
    static constexpr EffectInfo info{
        .id = "steer_delay",
        .title = "dead time between the logged and the acting steering angle",
        .equation = "delta'(t) = delta(t - T); T < 0: logged late",
        .source =
            "Rajamani, Vehicle Dynamics and Control, ch. 2; Klein & Morelli, Aircraft System "
            "Identification, ch. 10",
        .excited_by = "fast sweeps and steps of the steering",
        .moves = "yaw_rate_radps, ay_mps2",
        .needs = "steer_rad, vx_mps, yaw_rate_radps",
        .confounded_with =
            "tyre_relaxation, front_tyre_relaxation, steer_lag, yaw_inertia, sensor_delay, "
            "front_roll_steer",
        .parameters = {{.name = "delay_s",
                        .unit = "s",
                        .typical = 0.04,
                        .matters = 0.008,
                        .bounds = {-0.5, 0.5},
                        .usual = {-0.04, 0.06}}},
        .breaks = Breaks::kAnswersLate,
    };

    template <class T, class S>
    static void steering(const T* p, Workings<S>& w, Lags<S> /*lags*/) {
        w.delta = w.delta - w.steer_rate * (p[0] - value_of(p[0]));
    }
};

/// The logged steering angle is not zero when the wheels point straight ahead.
struct SteerOffset : Effect {
    static constexpr EffectInfo info{
        .id = "steer_offset",
        .title = "offset of the logged steering angle",
        .equation = "delta += delta_0",
        .source = "Gillespie, Fundamentals of Vehicle Dynamics, ch. 8",
        .excited_by = "straight driving and corners in both directions",
        .moves = "ay_mps2, yaw_rate_radps",
        .needs = "steer_rad, vx_mps, yaw_rate_radps",
        .confounded_with = "rear_toe, speed_sensor_misalignment, side_wind, road_bank",
        .parameters = {{.name = "offset_rad",
                        .unit = "rad",
                        .typical = 0.006,
                        .matters = 0.001,
                        .bounds = {-0.2, 0.2},
                        .usual = {0.002, 0.01},
                        .mirrored = true}},
    };

    template <class T, class S>
    static void steering(const T* p, Workings<S>& w, Lags<S> /*lags*/) {
        w.delta += p[0];
    }
};

/// The steering ratio used to log the road-wheel angle is wrong.
struct SteerRatio : Effect {
    static constexpr EffectInfo info{
        .id = "steer_ratio",
        .title = "error of the steering ratio",
        .equation = "delta *= 1 + s",
        .source = "Gillespie, Fundamentals of Vehicle Dynamics, ch. 8",
        .excited_by = "slow tight circles together with fast driving",
        .moves = "yaw_rate_radps, ay_mps2",
        .needs = "steer_rad, vx_mps, yaw_rate_radps",
        .confounded_with = "steer_compliance, steer_nonlinearity",
        .parameters = {{.name = "ratio_error",
                        .unit = "1",
                        .typical = 0.08,
                        .matters = 0.02,
                        .bounds = {-0.6, 0.6},
                        .usual = {-0.1, 0.1}}},
    };

    template <class T, class S>
    static void steering(const T* p, Workings<S>& w, Lags<S> /*lags*/) {
        w.delta *= 1.0 + p[0];
    }
};

/// The ratio between the logged angle and the road wheels changes with the angle.
struct SteerNonlinearity : Effect {
    static constexpr EffectInfo info{
        .id = "steer_nonlinearity",
        .title = "steering ratio that changes with the angle",
        .equation = "delta *= 1 + s_3 delta^2",
        .source = "Gillespie, Fundamentals of Vehicle Dynamics, ch. 8",
        .excited_by = "slow tight circles together with fast driving",
        .moves = "yaw_rate_radps, ay_mps2",
        .needs = "steer_rad, vx_mps, yaw_rate_radps",
        .confounded_with = "steer_ratio, steer_compliance",
        .parameters = {{.name = "cubic_prad2",
                        .unit = "1/rad2",
                        .typical = 30.0,
                        .matters = 5.0,
                        .bounds = {-200.0, 200.0},
                        .usual = {-40.0, 40.0}}},
    };

    template <class T, class S>
    static void steering(const T* p, Workings<S>& w, Lags<S> /*lags*/) {
        w.delta *= 1.0 + p[0] * (w.delta * w.delta);
    }
};

/// The road wheels follow the logged steering angle with a first-order lag.
struct SteerLag : Effect {
    static constexpr EffectInfo info{
        .id = "steer_lag",
        .title = "steering lag between the logged and the acting angle",
        .equation = "tau d(delta')/dt + delta' = delta",
        .source = "Rajamani, Vehicle Dynamics and Control, ch. 2",
        .excited_by = "fast sweeps and steps of the steering",
        .moves = "yaw_rate_radps, ay_mps2",
        .needs = "steer_rad, vx_mps, yaw_rate_radps",
        .confounded_with =
            "tyre_relaxation, front_tyre_relaxation, steer_delay, yaw_inertia, sensor_delay, "
            "front_roll_steer",
        .parameters = {{.name = "time_constant_s",
                        .unit = "s",
                        .typical = 0.06,
                        .matters = 0.01,
                        .bounds = {0.0, 0.5},
                        .usual = {0.02, 0.08}}},
        .states = {{"steer_lag", "rad"}},
        .scored_at_typical = true,
        .breaks = Breaks::kAnswersLate,
    };

    template <class T, class S>
    static void steering(const T* p, Workings<S>& w, Lags<S> lags) {
        if (value_of(p[0]) > 0.0) w.delta = lags.follow(0, w.delta, S(lag_rate(p[0])));
    }
};

/// The front axle force twists the steering. The force is that of the tyre at the static load, and
/// depends on the angle itself: three of Newton's steps solve for it, to 1e-4 rad where the
/// steering is ten times softer than usual.
struct SteerCompliance : Effect {
    static constexpr EffectInfo info{
        .id = "steer_compliance",
        .title = "compliance of the steering under the front lateral force",
        .equation = "delta' = delta - c F_yf(delta'), F_yf of the tyre at the static load",
        .source = "Gillespie, Fundamentals of Vehicle Dynamics, ch. 6",
        .excited_by =
            "hard corners of either side with a known wheel force, from gentle to the limit",
        .moves = "yaw_rate_radps, ay_mps2",
        .needs = "steer_rad, vx_mps, yaw_rate_radps",
        .confounded_with =
            "lateral_load_transfer, steer_ratio, steer_nonlinearity, aligning_moment",
        .parameters = {{.name = "compliance_radpn",
                        .unit = "rad/N",
                        .typical = 1.5e-6,
                        .matters = 3.0e-7,
                        .bounds = {-1.0e-5, 2.0e-5},
                        .usual = {5e-7, 2e-6}}},
    };

    template <class T, class S>
    static void steering(const T* p, Workings<S>& w, Lags<S> /*lags*/) {
        using std::atan;
        using std::cos;
        using std::sin;
        using std::sqrt;
        const S logged =
            named("alpha_untwisted", slip_angle(w.v_x, S(w.v_road + w.l_f * w.r), w.delta));
        const S stiff = w.B_f * w.C_f;
        const S peak = named("largest_twist", S(p[0] * w.fz0_f * w.mu_peak_f));
        // To begin with, a tyre whose force is D B C alpha / (1 + B C |alpha|).
        const S size = if_below(logged, 0.0, S(-logged), logged);
        const S less = 1.0 + peak * stiff - stiff * size;
        const S left = (sqrt(less * less + 4.0 * stiff * size) - less) / (2.0 * stiff);
        S twist = logged - if_below(logged, 0.0, S(-left), left);
        for (int step = 0; step < 3; ++step) {
            const S x = w.B_f * (logged - twist);
            const S y = x - w.E_f * (x - atan(x));
            const S angle = w.C_f * atan(y);
            const S slope =
                peak * cos(angle) * stiff * (1.0 - w.E_f + w.E_f / (1.0 + x * x)) / (1.0 + y * y);
            // What stiffens the steering by more than the tyre bends it has no angle.
            const S gain = 1.0 + if_below(slope, kLeastSlope, S(kLeastSlope), slope);
            twist = named("twist", S(twist + (peak * sin(angle) - twist) / gain));
        }
        w.delta = w.delta - twist;
    }

  private:
    static constexpr double kLeastSlope = -0.5;
};

/// The rear wheels do not point straight ahead.
struct RearToe : Effect {
    static constexpr EffectInfo info{
        .id = "rear_toe",
        .title = "toe of the rear axle: thrust angle",
        .equation = "alpha_r += delta_r0",
        .source = "Gillespie, Fundamentals of Vehicle Dynamics, ch. 8",
        .excited_by = "straight driving in both directions, at several speeds",
        .moves = "vy_mps, yaw_rate_radps",
        .needs = "steer_rad, vx_mps, yaw_rate_radps",
        .confounded_with = "steer_offset, speed_sensor_misalignment, side_wind, road_bank",
        .parameters = {{.name = "toe_rad",
                        .unit = "rad",
                        .typical = 0.004,
                        .matters = 0.0008,
                        .bounds = {-0.1, 0.1},
                        .usual = {0.001, 0.005},
                        .mirrored = true}},
    };

    template <class T, class S>
    static void slip(const T* p, Workings<S>& w, Lags<S> /*lags*/) {
        w.alpha_r += p[0];
    }
};

}  // namespace sysid
