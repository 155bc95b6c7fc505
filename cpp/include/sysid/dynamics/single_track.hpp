// The single-track model with three degrees of freedom and whatever effects are switched on.
//
//   m (dv_x/dt - v_y r) = F_xf cos(delta) - F_yf sin(delta) + F_xr - 1/2 rho C_dA v_x^2     (1)
//   m (dv_y/dt + v_x r) = F_yf cos(delta) + F_xf sin(delta) + F_yr                          (2)
//   I_z dr/dt = l_f (F_yf cos(delta) + F_xf sin(delta)) - l_r F_yr                          (3)
//   alpha_f = delta - atan2(v_y + l_f r, v_x),  alpha_r = -atan2(v_y - l_r r, v_x)          (4)
//   F_zf = m g l_r/L - m a_x h/L,  F_zr = m g l_f/L + m a_x h/L,                            (5)
//   with m a_x the sum of forces on the right of (1).
// Rajamani, Vehicle Dynamics and Control (2nd ed.), ch. 2 and 4; tyres: `model/tyre.hpp`.
#pragma once

#include <algorithm>
#include <cmath>

#include "sysid/dynamics/parameters.hpp"
#include "sysid/math/dual.hpp"
#include "sysid/model/vehicle.hpp"

namespace sysid {

/// What the driver does, at one instant.
template <class V>
struct InputOf {
    V steer_rad{};
    V longitudinal{};      // total wheel force [N], or measured a_x [m/s2] where that is unknown
    V time_s{};            // since the log began
    V steer_rate_radps{};  // where a model asks for it
    std::array<V, kUserChannels> channels{};  // that users' effects read
    Axles<V> loads_n{};                       // that the tyres feel, of a model with `loads_known`
    V gravity_x_mps2{}, gravity_y_mps2{};     // along and across, of one with `slope_known`
};
using Input = InputOf<double>;
template <class S>
using InputFor = InputOf<Given<S>>;

/// What disturbs the motion: forces and a moment, and accelerations that no accelerometer feels;
/// and what readings of yaw rate, a_x and a_y have beside it.
enum External : int {
    kForceX,
    kForceY,
    kMomentZ,
    kGravityX,
    kGravityY,
    kReadYawRate,
    kReadAx,
    kReadAy,
    kExternals
};
/// Those that move the car.
constexpr int kPushes = kReadYawRate;

/// What the axle loads of an input that is held move from within its sample:
///   F_zf = F_zf(0) - h/L (m a_x - m a_x(0)) + A_f (v_x^2/v_x(0)^2 - 1),                     (6)
///   F_zr = F_zr(0) + h/L (m a_x - m a_x(0)) + A_r (v_x^2/v_x(0)^2 - 1),
/// where A is what F_z(0) is beyond (5): the air's part. At 10 ms that is a thousandth of the
/// force, which a drive beyond the peak resolves.
template <class S>
struct LoadsSince {
    bool on = false;
    S pull{};           // m a_x(0)
    S speed_squared{};  // v_x(0)^2
};

/// A car with its effects; the parameters' values stay outside, so that they can carry derivatives.
/// `V`: numbers, or what stands for the car's data where the model itself is written down.
template <class V>
struct SingleTrackOf {
    VehicleDataOf<V> car;
    EffectMask effects = 0;
    bool force_known = true;     // false: `Input::longitudinal` is the measured acceleration
    UserEffects user = nullptr;  // those that act; `effects` has no bits of theirs
    bool loads_known = false;    // tyres feel the loads of the input in place of (5)
    bool inputs_held = false;    // from sample to sample, as a digital controller does
    bool slope_known = false;    // the slope of the road is that of the input
    Axles<double> most_n{};      // largest of these loads, where they are known

    /// Whether loads move by (6); with no height of the centre of gravity they are held as well.
    bool loads_move() const { return loads_known && inputs_held && car.cg_height_m > 0.0; }

    /// Evaluates (1) to (5). `motion` = v_x, v_y, r; `external` = disturbance, see `External`;
    /// `lags` = how the auxiliary states move; `rate` receives the derivatives of the motion.
    template <class S, class T>
    Workings<S> evaluate(const S* motion, const S* external, const Lags<S>& lags,
                         const InputFor<S>& u, const T* p, S* rate,
                         const LoadsSince<S>& since = {}) const;

    /// The same with the derivatives of the auxiliary states `aux`.
    template <class S, class T>
    Workings<S> evaluate(const S* motion, const S* external, const S* aux, const InputFor<S>& u,
                         const T* p, S* rate, S* aux_rate) const {
        for (int i = 0; i < kAuxiliaryStates; ++i) aux_rate[i] = S(0.0);
        return evaluate(motion, external, Lags<S>(LagStage::kRates, aux, aux_rate), u, p, rate);
    }

    /// What the sensors read: v_x, v_y, r, a_x, a_y.
    template <class S, class T>
    void sense(const Workings<S>& w, const T* p, const S* aux, S* y) const;

    /// The car as parameters and effects make it; nothing beyond its own numbers is filled in.
    Workings<double> car_with_effects(const double* p) const {
        Workings<double> w{};
        make_car(w, p,
                 [&](auto&& visit) { for_each_active(effects, p + kBaseParameterCount, visit); });
        return w;
    }

    /// Fastest rate [1/s] of the motion, for choosing integration steps. Inputs that jump at every
    /// sample excite it at every sample: it counts three times.
    double fastest_rate(const double* p, double v_x) const {
        Axles<double> load = static_loads(car.mass_kg * car.gravity_mps2, car.lf_m, car.lr_m);
        if (most_n.front > 0.0) load = most_n;
        const double c_f = p[kBFront] * p[kCFront] * p[kDFront] * load.front;
        const double c_r = p[kBRear] * p[kCRear] * p[kDRear] * load.rear;
        const double yaw = (c_f * car.lf_m * car.lf_m + c_r * car.lr_m * car.lr_m) / p[kYawInertia];
        return (inputs_held ? 3.0 : 1.0) * std::max(yaw, (c_f + c_r) / car.mass_kg) / v_x;
    }

  private:
    /// What only parameters move of the car has no slope where these are plain numbers.
    template <class T, class S>
    static auto plain(const S& x) {
        if constexpr (std::is_same_v<T, double>)
            return value_of(x);
        else
            return x;
    }

    template <class T>
    static TyreCoefficients<T> front_tyre(const T* p) {
        return {p[kBFront], p[kCFront], p[kDFront], p[kEFront]};
    }
    template <class T>
    static TyreCoefficients<T> rear_tyre(const T* p) {
        return {p[kBRear], p[kCRear], p[kDRear], p[kERear]};
    }

    /// Where x = f(x) ends, of which `one` = f(0) and `two` = f(one).
    template <class S>
    static S limit_of(const S& one, const S& two) {
        constexpr double least = 1e-3, most = 0.5;  // [rad/s2], and of the slope of f
        const S step = two - one;
        const S slope = step / if_below(one * one, least * least, S(1.0), one);
        const S bounded = if_below(slope, -most, S(-most), if_below(slope, most, slope, S(most)));
        return one + step / (1.0 - bounded);
    }

    // `w.r_dot` is the yaw acceleration as far as it is known.
    template <class S, class T>
    void once(Workings<S>& w, const S* motion, const S* external, const Lags<S>& lags,
              const InputFor<S>& u, const T* p, const LoadsSince<S>& since) const {
        begin(w, motion, u, p);
        w.user_states = lags.states() + kCatalogueStates;
        const T* q = p + kBaseParameterCount;
        using At = std::size_t;
        const auto each = [&](auto&& visit) {
            if constexpr (!std::is_same_v<S, Recorded>)
                for_each_active(effects, q, visit);
            else  // its names follow what each effect does
                for_each_active(effects, q, [&](auto e, const T* own, At at) {
                    using Acts = decltype(visit(e, own, at));
                    if constexpr (std::is_same_v<Acts, Inactive>) {
                        return Inactive{};
                    } else {
                        visit(e, own, at);
                        name_workings(w);
                    }
                });
        };
        const auto part = [&](const char* title) {
            if constexpr (std::is_same_v<S, Recorded>) {
                name_workings(w);
                begin_part(title, w.v_x);
            }
        };
        part("car");
        make_car(w, p, each);
        part("wheel force");
        // Backwards: what the sensors did last to the acceleration is undone first.
        for_each_active_backwards(effects, q,
                                  [&](auto e, const T* own, At) { return e.input(own, w); });
        each([&](auto e, const T* own, At at) { return e.drive(own, w, lags.from(at)); });
        part("steering");
        each([&](auto e, const T* own, At at) { return e.steering(own, w, lags.from(at)); });
        part("forces from outside");
        settle_outside_forces<T>(w, external, u);
        each([&](auto e, const T* own, At) { return e.body(own, w); });
        user_body(user, q, w);
        part("slip angles");
        const Axles<S> alpha =
            slip_angles(w.v_x, w.v_road, w.r, plain<T>(w.l_f), plain<T>(w.l_r), w.delta);
        w.alpha_f = alpha.front;
        w.alpha_r = alpha.rear;
        each([&](auto e, const T* own, At at) { return e.slip(own, w, lags.from(at)); });
        part("tyres: lateral force of a unit of load");
        const S mu_f = named("mu_f", magic_formula(w.alpha_f, front_tyre(p)));
        const S mu_r = named("mu_r", magic_formula(w.alpha_r, rear_tyre(p)));
        part("axle loads");
        const Axles<S> known = axle_loads<T>(w, mu_f, u, since);
        const S front_at_first = w.fz_f;
        each([&](auto e, const T* own, At) { return e.loads(own, w); });
        part("lateral forces of the axles");
        each([&](auto e, const T* own, At at) { return e.grip(own, w, lags.from(at).states()); });
        if (force_known && !loads_known && (effects & kChangeAxleForces) != 0)
            settle_loads<T>(w, mu_f, front_at_first);
        w.fy_f = (loads_known ? known.front : w.fz_f) * mu_f * w.grip_f;
        w.fy_r = (loads_known ? known.rear : w.fz_r) * mu_r * w.grip_r;
        part("forces of the car");
        each([&](auto e, const T* own, At) { return e.forces(own, w); });
        user_forces(user, q, w);
        part("motion");
        balance<T>(w);
        part("rates of the states");
        each([&](auto e, const T* own, At at) { return e.follow(own, w, lags.from(at)); });
        user_states(user, q, w, lags.from(kCatalogueStates));
    }

    template <class S, class T, class Each>
    void make_car(Workings<S>& w, const T* p, const Each& each) const {
        w.m = S(car.mass_kg);
        w.I_z = S(p[kYawInertia]);
        w.l_f = S(car.lf_m);
        w.l_r = S(car.lr_m);
        w.h = S(car.cg_height_m);
        w.drag_area = S(car.drag_area_m2);
        w.brake_front = S(car.brake_front_share);
        w.drive_front = S(car.drive_front_share);
        each([&](auto e, const T* own, std::size_t) { return e.vehicle(own, w); });
        const auto rest =
            static_loads(plain<T>(w.m) * car.gravity_mps2, plain<T>(w.l_f), plain<T>(w.l_r));
        w.fz0_f = S(rest.front);
        w.fz0_r = S(rest.rear);
    }

    template <class S, class T>
    void begin(Workings<S>& w, const S* motion, const InputFor<S>& u, const T* p) const {
        w.rho = car.air_density_kgpm3;
        w.B_f = S(p[kBFront]);
        w.B_r = S(p[kBRear]);
        w.C_f = S(p[kCFront]);
        w.E_f = S(p[kEFront]);
        w.mu_peak_f = S(p[kDFront]);
        w.mu_peak_r = S(p[kDRear]);
        w.time_s = u.time_s;
        w.track_f = car.track_front_m;
        w.track_r = car.track_rear_m;
        w.channels = u.channels.data();
        w.v_x = motion[0];
        w.v_y = w.v_road = motion[1];
        w.r = motion[2];
        w.delta = S(u.steer_rad);
        w.steer_rate = u.steer_rate_radps;
        w.force_known = force_known;
        w.fx = force_known ? S(u.longitudinal) : S(0.0);
        w.ax_input = force_known ? S(0.0) : S(u.longitudinal);
        w.grip_f = w.grip_r = S(1.0);
    }

    template <class T, class S>
    void settle_outside_forces(Workings<S>& w, const S* external, const InputFor<S>& u) const {
        w.force_x = external[kForceX] - drag_force(w.rho, plain<T>(w.drag_area), w.v_x);
        w.force_y = external[kForceY];
        w.moment_z = external[kMomentZ];
        w.gravity_x = external[kGravityX];
        w.gravity_y = external[kGravityY];
        if (!slope_known) return;
        w.gravity_x += S(u.gravity_x_mps2);
        w.gravity_y += S(u.gravity_y_mps2);
    }

    // The front load depends on a_x, which depends on the front lateral force, which is
    // proportional to the front load: (1) and (5), or (6), are solved together for F_zf. Returns
    // the loads of the input.
    template <class T, class S>
    Axles<S> axle_loads(Workings<S>& w, const S& mu_f, const InputFor<S>& u,
                        const LoadsSince<S>& since) const {
        using std::cos;
        using std::sin;
        const auto m = plain<T>(w.m), l_f = plain<T>(w.l_f), l_r = plain<T>(w.l_r);
        const S c = w.cos_delta = cos(w.delta);
        const S s = w.sin_delta = sin(w.delta);
        const auto lever = named("lever", plain<T>(w.h) / (l_f + l_r));
        Axles<S> told{S(u.loads_n.front), S(u.loads_n.rear)};
        if (since.on) {
            const S& squared = since.speed_squared;
            const S growth = (w.v_x * w.v_x - squared) / if_below(squared, 1.0, S(1.0), squared);
            told.front += growth * (told.front - w.fz0_f + lever * since.pull);
            told.rear += growth * (told.rear - w.fz0_r - lever * since.pull);
        }
        S pull;  // m a_x
        if (force_known) {
            split_force(w);
            const S known = named("known_pull", w.fx_f * c + w.fx_r + w.force_x);
            S front;
            if (since.on)
                front = (told.front - lever * (known - since.pull)) / (1.0 - lever * (mu_f * s));
            else if (loads_known)
                front = told.front;
            else
                front = (w.fz0_f - lever * known) / (1.0 - lever * (mu_f * s));
            pull = named("pull", known - named("fz_f_at_first", front) * (mu_f * s));
        } else {
            pull = m * w.ax_input;
            const S front = loads_known ? told.front : w.fz0_f - lever * pull;
            const S along = pull - w.force_x + front * (mu_f * s);  // F_xf cos(delta) + F_xr
            const S share = front_share(w, along);
            w.fx = along / (share * c + (1.0 - share));
            split_force(w);
        }
        w.fz_f = w.fz0_f - lever * pull;
        w.fz_r = w.fz0_r + lever * pull;
        if (since.on) {
            told.front -= lever * (pull - since.pull);
            told.rear += lever * (pull - since.pull);
        }
        return told;
    }

    // With the downforce and the grip of effects the front lateral force is another one, and so is
    // a_x: (1) and (5) are solved once more. Grip stays that at the loads before, on which it
    // hardly depends.
    template <class T, class S>
    static void settle_loads(Workings<S>& w, const S& mu_f, const S& at_first) {
        const auto lever = named("lever", plain<T>(w.h) / (plain<T>(w.l_f) + plain<T>(w.l_r)));
        const S part = named("front_drag_share", lever * (mu_f * w.sin_delta));
        const S moved = part * (w.fz_f * w.grip_f - at_first) / (1.0 - part * w.grip_f);
        w.fz_f += moved;
        w.fz_r -= moved;
    }

    template <class S>
    static S front_share(const Workings<S>& w, const S& force) {
        return named("front_share", if_below(force, 0.0, w.brake_front, w.drive_front));
    }

    template <class S>
    static void split_force(Workings<S>& w) {
        const S front = front_share(w, w.fx);
        w.fx_f = front * w.fx;
        w.fx_r = (1.0 - front) * w.fx;
    }

    template <class T, class S>
    void balance(Workings<S>& w) const {
        const S &c = w.cos_delta, &s = w.sin_delta;
        const auto m = plain<T>(w.m);
        const S front_lateral = named("lateral_f", w.fy_f * c + w.fx_f * s);
        w.a_x = force_known ? (w.fx_f * c - w.fy_f * s + w.fx_r + w.force_x) / m : w.ax_input;
        w.a_y = (front_lateral + w.fy_r + w.force_y) / m;
        w.r_dot = (plain<T>(w.l_f) * front_lateral - plain<T>(w.l_r) * w.fy_r + w.moment_z) /
                  plain<T>(w.I_z);
    }
};

using SingleTrack = SingleTrackOf<double>;

// Not inside the class: there they would be inline, and compiled by every user of the model.

template <class V>
template <class S, class T>
Workings<S> SingleTrackOf<V>::evaluate(const S* motion, const S* external, const Lags<S>& lags,
                                       const InputFor<S>& u, const T* p, S* rate,
                                       const LoadsSince<S>& since) const {
    // An accelerometer beside the centre of gravity makes the measured a_x, which stands for
    // the force, depend on the yaw acceleration it brings about. Each pass shrinks the error
    // to a tenth, a fifth at most; two of them say where they lead (Aitken).
    const int passes = !force_known && (effects & kReadYawAcceleration) != 0 ? 3 : 1;
    Workings<S> w;
    w.r_dot = S(0.0);
    S first = w.r_dot;
    for (int i = 0; i < passes; ++i) {
        if (i == 1) first = w.r_dot;
        if (i == 2) w.r_dot = limit_of(first, w.r_dot);
        once(w, motion, external, lags, u, p, since);
    }
    rate[0] = w.a_x + w.v_y * w.r + w.gravity_x;
    rate[1] = w.a_y - w.v_x * w.r + w.gravity_y;
    rate[2] = w.r_dot;
    return w;
}

template <class V>
template <class S, class T>
void SingleTrackOf<V>::sense(const Workings<S>& w, const T* p, const S* aux, S* y) const {
    y[kVx] = w.v_x;
    y[kVy] = w.v_y;
    y[kYawRate] = w.r;
    y[kAx] = w.a_x;
    y[kAy] = w.a_y;
    for_each_active(effects, p + kBaseParameterCount, [&](auto e, const T* own, std::size_t at) {
        return e.sensors(own, w, aux + at, y);
    });
    user_sensors(user, p + kBaseParameterCount, w, y);
}

}  // namespace sysid
