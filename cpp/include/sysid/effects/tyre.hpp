// Tyres: load, relaxation, heat, what longitudinal force takes, the moment about the contact.
#pragma once

#include "sysid/effects/effect.hpp"
#include "sysid/model/kinematics.hpp"

namespace sysid {

/// The friction coefficient falls as the load on the axle rises.
struct TyreLoadSensitivity : Effect {
    static constexpr EffectInfo info{
        .id = "tyre_load_sensitivity",
        .title = "tyre load sensitivity: grip per load falls with load",
        .equation = "mu(F_z) = mu_0 (1 - k (F_z/F_z0 - 1))",
        .source = "Milliken & Milliken, Race Car Vehicle Dynamics, ch. 2",
        .excited_by = "braking and driving while cornering, downforce at several speeds",
        .moves = "ay_mps2, yaw_rate_radps",
        .needs = "steer_rad, vx_mps, yaw_rate_radps",
        .confounded_with =
            "lateral_load_transfer, longitudinal_load_transfer, aero_downforce, combined_slip, "
            "drive_yaw_moment",
        .parameters = {{.name = "sensitivity",
                        .unit = "1",
                        .typical = 0.25,
                        .matters = 0.05,
                        .bounds = {-1.0, 1.0},
                        .usual = {0.05, 0.25}}},
    };

    template <class T, class S>
    static void grip(const T* p, Workings<S>& w, const S* /*state*/) {
        w.grip_f *= 1.0 - p[0] * (w.fz_f / w.fz0_f - 1.0);
        w.grip_r *= 1.0 - p[0] * (w.fz_r / w.fz0_r - 1.0);
    }
};

/// The distance over which slip angles relax: the ratio of the tyre's cornering stiffness to the
/// lateral stiffness of its carcass, so that it grows with the load and falls with the pressure.
constexpr ParameterInfo kRelaxationLength{.name = "relaxation_length_m",
                                          .unit = "m",
                                          .typical = 0.45,
                                          .matters = 0.1,
                                          .bounds = {0.0, 3.0},
                                          .usual = {0.2, 0.7}};

/// Rate at which a slip angle relaxes [1/s].
template <class T, class S>
S relaxation_rate(const T& length, const Workings<S>& w) {
    using std::abs;
    constexpr double kFastest = 1.0 / kShortestLag;
    const S rate = abs(w.v_x) / length;
    return if_below(rate, kFastest, rate, S(kFastest));
}

/// What the effects below have in common, beside what is their own.
constexpr EffectInfo relaxation(EffectInfo own) {
    own.source = "Pacejka, Tire and Vehicle Dynamics (3rd ed.), eq. (7.18)";
    own.excited_by = "steps and sweeps of the steering at low and high speed";
    own.needs = "steer_rad, vx_mps, yaw_rate_radps";
    own.parameters[0] = kRelaxationLength;
    own.scored_at_typical = true;
    return own;
}

/// The slip angle that makes the force follows the geometric one over a rolled distance.
struct TyreRelaxation : Effect {
    static constexpr EffectInfo info = relaxation(EffectInfo{
        .id = "tyre_relaxation",
        .title = "tyre relaxation length",
        .equation = "(sigma / v_x) d(alpha')/dt + alpha' = alpha",
        .moves = "ay_mps2, yaw_rate_radps",
        .confounded_with =
            "steer_lag, steer_delay, yaw_inertia, front_tyre_relaxation, rear_tyre_relaxation, "
            "body_roll, front_roll_steer, rear_roll_steer",
        .states = {{"slip_front", "rad"}, {"slip_rear", "rad"}},
        .breaks = Breaks::kAnswersLate,
    });

    template <class T, class S>
    static void slip(const T* p, Workings<S>& w, Lags<S> lags) {
        if (!(value_of(p[0]) > 0.0)) return;
        const S rate = relaxation_rate(p[0], w);
        w.alpha_f = lags.follow(0, w.alpha_f, rate);
        w.alpha_r = lags.follow(1, w.alpha_r, rate);
    }
};

enum class Axle { kFront, kRear };

/// The same of one axle alone; beside that of both, by how much it is longer: two lags behind each
/// other are, to first order, one of their sum.
template <Axle axle>
struct OneAxleRelaxation : Effect {
    static constexpr EffectInfo info =
        axle == Axle::kFront
            ? relaxation(EffectInfo{
                  .id = "front_tyre_relaxation",
                  .title = "tyre relaxation length of the front axle",
                  .equation = "(sigma_f / v_x) d(alpha_f')/dt + alpha_f' = alpha_f",
                  .moves = "yaw_rate_radps, ay_mps2",
                  .confounded_with =
                      "tyre_relaxation, rear_tyre_relaxation, steer_lag, steer_delay, yaw_inertia, "
                      "sensor_delay, front_roll_steer",
                  .states = {{"own_slip_front", "rad"}},
                  .breaks = Breaks::kAnswersLate,
              })
            : relaxation(EffectInfo{
                  .id = "rear_tyre_relaxation",
                  .title = "tyre relaxation length of the rear axle",
                  .equation = "(sigma_r / v_x) d(alpha_r')/dt + alpha_r' = alpha_r",
                  .moves = "ay_mps2, yaw_rate_radps",
                  .confounded_with =
                      "tyre_relaxation, front_tyre_relaxation, yaw_inertia, rear_roll_steer",
                  .states = {{"own_slip_rear", "rad"}},
              });

    template <class T, class S>
    static void slip(const T* p, Workings<S>& w, Lags<S> lags) {
        S& alpha = axle == Axle::kFront ? w.alpha_f : w.alpha_r;
        if (value_of(p[0]) > 0.0) alpha = lags.follow(0, alpha, relaxation_rate(p[0], w));
    }
};
using FrontTyreRelaxation = OneAxleRelaxation<Axle::kFront>;
using RearTyreRelaxation = OneAxleRelaxation<Axle::kRear>;

/// Sliding heats the tread, and a tread away from its best temperature grips less. The states are
/// the sliding powers [kW] of front and rear axle, as late as the tread's temperature follows them;
/// grip falls in proportion (or rises: a cold tyre).
struct TyreTemperature : Effect {
    static constexpr EffectInfo info{
        .id = "tyre_temperature",
        .title = "grip fades with the heat of sliding",
        .equation = "mu_i *= 1 - c q_i, tau dq_i/dt + q_i = |F_y,i alpha_i v_x|",
        .source =
            "Pacejka, Tire and Vehicle Dynamics (3rd ed.), ch. 3; Farroni et al., Meccanica 2014, "
            "linearised",
        .excited_by = "cold and hot repeats of the same corners, long stints",
        .moves = "ay_mps2, yaw_rate_radps",
        .needs = "steer_rad, vx_mps, yaw_rate_radps",
        .confounded_with = "aero_downforce, friction_change, lateral_load_transfer",
        .parameters = {{.name = "loss_pkw",
                        .unit = "1/kW",
                        .typical = 0.03,
                        .matters = 0.005,
                        .bounds = {-0.15, 0.3},
                        .usual = {0.01, 0.06}},
                       {.name = "time_constant_s",
                        .unit = "s",
                        .null_value = 20.0,
                        .typical = 20.0,
                        .matters = 5.0,
                        .bounds = {1.0, 900.0},
                        .usual = {5.0, 60.0},
                        .scan = Scan::kRange}},
        .states = {{"sliding_front", "kW"}, {"sliding_rear", "kW"}},
    };
    static constexpr double state_spread = 0.5;  // [kW]

    template <class T, class S>
    static void grip(const T* p, Workings<S>& w, const S* state) {
        apply(1.0 - p[0] * state[0], w.mu_peak_f, w.grip_f);
        apply(1.0 - p[0] * state[1], w.mu_peak_r, w.grip_r);
    }
    template <class T, class S>
    static void follow(const T* p, const Workings<S>& w, Lags<S> lags) {
        const S speed = 1e-3 * w.v_x;
        const S rate(lag_rate(p[1]));
        // Force and slip angle have the same sign, so that the product needs no absolute value.
        lags.follow_slowly(0, speed * (w.fy_f * w.alpha_f), rate);
        lags.follow_slowly(1, speed * (w.fy_r * w.alpha_r), rate);
    }

    template <class S>
    static void apply(const S& left, S& peak, S& grip) {
        const S kept = named("kept", if_below(left, 0.05, S(0.05), left));
        peak *= kept;
        grip *= kept;
    }
};

/// Friction ellipse: longitudinal force takes lateral force away. The parameter is the square of
/// the usual shape factor, so that the derivative at zero exists.
struct CombinedSlip : Effect {
    static constexpr EffectInfo info{
        .id = "combined_slip",
        .title = "combined slip: drive and brake force cost lateral force",
        .equation = "F_y *= sqrt(1 - p (F_x / (D F_z))^2)",
        .source = "Pacejka, Tire and Vehicle Dynamics (3rd ed.), ch. 4",
        .excited_by = "braking and accelerating while cornering",
        .moves = "ay_mps2, yaw_rate_radps",
        .needs = "steer_rad, vx_mps, yaw_rate_radps",
        .confounded_with = "tyre_load_sensitivity, longitudinal_load_transfer, force_split",
        .parameters = {{.name = "ellipse",
                        .unit = "1",
                        .typical = 1.0,
                        .matters = 0.2,
                        .bounds = {0.0, 1.5},
                        .usual = {0.5, 1.0}}},
    };

    template <class T, class S>
    static void grip(const T* p, Workings<S>& w, const S* /*state*/) {
        w.grip_f *= ellipse_left(p[0], w.fx_f / (w.mu_peak_f * w.fz_f));
        w.grip_r *= ellipse_left(p[0], w.fx_r / (w.mu_peak_r * w.fz_r));
    }
};

/// The lateral force acts behind the middle of the contact patch. The trail has its full length at
/// small slip and goes once the patch slides; both axles have the same.
struct AligningMoment : Effect {
    static constexpr EffectInfo info{
        .id = "aligning_moment",
        .title = "aligning moment of the tyres: pneumatic trail",
        .equation = "M_z -= sum_i t F_y,i / (1 + (B_i alpha_i)^2)",
        .source =
            "Pacejka, Tire and Vehicle Dynamics (3rd ed.), eq. (4.E33), whose cosine is squared "
            "here with C_t = 1, D_t constant",
        .excited_by = "gentle sweeps, then a ramp to the limit",
        .moves = "yaw_rate_radps, ay_mps2",
        .needs = "steer_rad, vx_mps, yaw_rate_radps",
        .confounded_with = "steer_compliance, cg_position, locked_differential",
        .parameters = {{.name = "trail_m",
                        .unit = "m",
                        .typical = 0.03,
                        .matters = 0.008,
                        .bounds = {-0.2, 0.3},
                        .usual = {0.02, 0.05}}},
    };

    template <class T, class S>
    static void forces(const T* p, Workings<S>& w) {
        const S front = w.B_f * w.alpha_f;
        const S rear = w.B_r * w.alpha_r;
        w.moment_z =
            w.moment_z - p[0] * (w.fy_f / (1.0 + front * front) + w.fy_r / (1.0 + rear * rear));
    }
};

}  // namespace sysid
