// The suspension: the body that rolls on its springs, and what that does to the wheels.
#pragma once

#include <numbers>

#include "sysid/effects/effect.hpp"
#include "sysid/effects/tyre.hpp"

namespace sysid {

/// About a fixed axis cars roll at 1 to 2.5 Hz with a damping ratio of 0.2 to 0.5; about their
/// centre of gravity both are higher by a fifth or so, as the inertia is smaller.
constexpr double kRollDamping = 0.35;
constexpr ParameterInfo kRollFrequency{.name = "frequency_hz",
                                       .unit = "Hz",
                                       .null_value = 2.0,
                                       .typical = 2.0,
                                       .matters = 0.4,
                                       .bounds = {0.5, 6.0},
                                       .usual = {1.2, 3.5},
                                       .scan = Scan::kRange};

/// How the roll angle over its gradient, a_y/g in a long corner, follows the lateral acceleration:
/// states 0 and 1 are it and its rate.
template <class T, class S>
void follow_roll(const T& frequency, const Workings<S>& w, Lags<S> lags) {
    lags.swing(0, w.a_y / kGravity, S((2.0 * std::numbers::pi) * frequency), kRollDamping);
}

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
        .confounded_with =
            "body_attitude, accelerometer_scale, tyre_relaxation, front_roll_steer, "
            "rear_roll_steer",
        .parameters = {{.name = "roll_per_g_rad",
                        .unit = "rad",
                        .typical = 0.06,
                        .matters = 0.01,
                        .bounds = {0.0, 0.4},
                        .usual = {0.02, 0.09}},
                       kRollFrequency},
        .states = {{"roll_per_gradient", "1"}, {"roll_rate_per_gradient", "1/s"}},
        .refines = "body_attitude, accelerometer_scale",
    };
    static constexpr double state_spread = 0.1;
    /// Of the height of the centre of gravity, what is above the roll axis.
    static constexpr double kAboveAxis = 0.8;

    template <class T, class S>
    static void steering(const T* p, Workings<S>& w, Lags<S> lags) {
        w.v_road = w.v_road + (kAboveAxis * p[0]) * (w.h * lags.states()[1]);
    }
    template <class T, class S>
    static void follow(const T* p, const Workings<S>& w, Lags<S> lags) {
        follow_roll(p[1], w, lags);
    }
    template <class T, class S>
    static void sensors(const T* p, const Workings<S>& /*w*/, const S* state, S* y) {
        using std::cos;
        using std::sin;
        const S phi = named("roll", p[0] * state[0]);
        y[kAy] = y[kAy] * cos(phi) + kGravity * sin(phi);
    }
};

/// What the roll of the body does to the wheels of an axle: the suspension turns them a little, and
/// they lean, which pushes sideways too. In a long corner that is a part of the cornering
/// stiffness, and only there: it comes with the roll, not with the slip.
template <Axle axle>
struct RollSteer : Effect {
    static constexpr EffectInfo info = [] {
        EffectInfo own{
            .source =
                "Gillespie, Fundamentals of Vehicle Dynamics, ch. 6 and 8; Milliken & Milliken, "
                "Race Car Vehicle Dynamics, ch. 17",
            .excited_by = "steps of the steering and sweeps up to 3 Hz, then a long corner",
            .moves = "yaw_rate_radps, ay_mps2",
            .needs = "steer_rad, vx_mps, yaw_rate_radps",
            .parameters = {{.name = "per_g_rad",
                            .unit = "rad",
                            .typical = 0.01,
                            .matters = 0.002,
                            .bounds = {-0.1, 0.1},
                            .usual = {-0.02, 0.02}},
                           kRollFrequency},
            .on_request = true,
        };
        if (axle == Axle::kFront) {
            own.id = "front_roll_steer";
            own.title = "front wheels that steer and lean as the body rolls";
            own.equation = "alpha_f += e s, s'' + 0.7 w s' + w^2 s = w^2 a_y/g, w = 2 pi f";
            own.confounded_with =
                "tyre_relaxation, front_tyre_relaxation, body_roll, rear_roll_steer, steer_lag, "
                "steer_delay, yaw_inertia";
            own.states[0] = {"roll_at_front", "1"};
            own.states[1] = {"roll_rate_at_front", "1/s"};
        } else {
            own.id = "rear_roll_steer";
            own.title = "rear wheels that steer and lean as the body rolls";
            own.equation = "alpha_r += e s, s'' + 0.7 w s' + w^2 s = w^2 a_y/g, w = 2 pi f";
            own.confounded_with =
                "tyre_relaxation, rear_tyre_relaxation, body_roll, front_roll_steer, yaw_inertia";
            own.states[0] = {"roll_at_rear", "1"};
            own.states[1] = {"roll_rate_at_rear", "1/s"};
        }
        return own;
    }();
    static constexpr double state_spread = BodyRoll::state_spread;

    template <class T, class S>
    static void slip(const T* p, Workings<S>& w, Lags<S> lags) {
        S& alpha = axle == Axle::kFront ? w.alpha_f : w.alpha_r;
        alpha = alpha + p[0] * lags.states()[0];
    }
    template <class T, class S>
    static void follow(const T* p, const Workings<S>& w, Lags<S> lags) {
        follow_roll(p[1], w, lags);
    }
};
using FrontRollSteer = RollSteer<Axle::kFront>;
using RearRollSteer = RollSteer<Axle::kRear>;

}  // namespace sysid
