// The grey-box car whose tyres are to be identified: a single track with logged inputs.
//
//   dv_x/dt = v_y r + (F_x - F_yf sin(delta) - 1/2 rho C_dA v_x^2)/m                      (1)
//   a_y     = (F_yf cos(delta) + F_yr)/m + P_1 v_x^2 + P_2 v_y + P_3 r                    (2)
//   dv_y/dt = a_y - v_x r,   dr/dt = (l_f F_yf cos(delta) - l_r F_yr)/I_z                 (3)
//   F_y = F_z mu(alpha),  alpha_f = delta - atan((v_y + l_f r)/v_x), rear without delta   (4)
// with mu the Magic Formula of `model/tyre.hpp`. The logged loads F_z belong to the beginning of a
// sample; within it they move with the longitudinal acceleration and with the speed,
//   F_zf = F_zf(0) + h/L (T - T(0)) + A_f (v_x^2/v_x(0)^2 - 1),                           (5)
//   F_zr = F_zr(0) - h/L (T - T(0)) + A_r (v_x^2/v_x(0)^2 - 1),
//   T = F_yf sin(delta) + 1/2 rho C_dA v_x^2,
// where A is what is left of F_z(0) besides the weight and h/L m a_x: the air's part.
// At 10 ms that is a thousandth of the force, which a drive beyond the peak resolves.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "sysid/math/dual.hpp"
#include "sysid/math/integrate.hpp"
#include "sysid/math/whole.hpp"
#include "sysid/model/tyre.hpp"
#include "sysid/model/vehicle.hpp"

namespace sysid::lab {

/// Mass and yaw inertia are factors on the given ones, so that a prior can be put on them.
enum TyreParameter : int {
    kFront = 0,  // B, C, D, E
    kRear = 4,   // B, C, D, E
    kP1 = 8,
    kP2 = 9,
    kP3 = 10,
    kMassFactor = 11,
    kInertiaFactor = 12,
    kDragArea = 13,  // C_d A [m2]
    kTyreParameters = 14,
};

struct GreyBoxCar {
    double mass_kg = 0.0;
    double yaw_inertia_kgm2 = 0.0;
    double lf_m = 0.0;
    double lr_m = 0.0;
    double air_density_kgpm3 = 1.225;
    double cg_height_m = 0.0;  // h of (5); 0 where the loads are held over a sample
    double slowest_mps = 1.0;  // slip angles are those at this speed below it
};

/// What acts during one sampling interval.
struct GreyBoxInput {
    double fx_n = 0.0;
    double steer_rad = 0.0;
    double sin_steer = 0.0;
    double cos_steer = 1.0;
    double fz_front_n = 0.0;
    double fz_rear_n = 0.0;
};

constexpr int kGreyStates = 3;  // v_x, v_y, r

/// T(0) and v_x(0)^2 of (5); without `moves` the loads are those that were logged.
template <class S>
struct LoadsSince {
    bool moves = false;
    S drawn_n{};
    S speed_squared{};  // 0 at walking pace, where the air does nothing
};

/// How far the air's part of the loads has grown: v_x^2/v_x(0)^2 - 1.
template <class S>
S air_growth(const LoadsSince<S>& since, const S& v_x) {
    return value_of(since.speed_squared) > 0.0 ? v_x * v_x / since.speed_squared - 1.0 : S(0.0);
}

/// Rates of v_x, v_y, r, and a_y.
template <class S, class T>
std::array<S, kGreyStates + 1> grey_box(const GreyBoxCar& car, const std::array<S, kGreyStates>& x,
                                        const GreyBoxInput& u, const T* p,
                                        const LoadsSince<S>& since = {}) {
    const S speed = value_of(x[0]) > car.slowest_mps ? x[0] : S(car.slowest_mps);
    const Axles<S> alpha = slip_angles(speed, x[1], x[2], car.lf_m, car.lr_m, u.steer_rad);
    const TyreCoefficients<T> front{p[kFront], p[kFront + 1], p[kFront + 2], p[kFront + 3]};
    const TyreCoefficients<T> rear{p[kRear], p[kRear + 1], p[kRear + 2], p[kRear + 3]};
    const T mass = car.mass_kg * p[kMassFactor];
    const T inertia = car.yaw_inertia_kgm2 * p[kInertiaFactor];
    const S drag = drag_force(car.air_density_kgpm3, p[kDragArea], x[0]);
    const double lever = since.moves ? car.cg_height_m / (car.lf_m + car.lr_m) : 0.0;
    const S mu_f = magic_formula(alpha.front, front);
    const S growth = air_growth(since, x[0]);
    const S shift = lever * (u.fx_n - since.drawn_n);
    const Axles<T> rest = static_loads(T(mass * kGravity), car.lf_m, car.lr_m);
    const S fz_f = u.fz_front_n + growth * (u.fz_front_n - rest.front + shift);
    const S fz_r = u.fz_rear_n + growth * (u.fz_rear_n - rest.rear - shift);
    const S force_f =
        (fz_f + lever * (drag - since.drawn_n)) * mu_f / (1.0 - lever * u.sin_steer * mu_f);
    const S moved = lever * (u.sin_steer * force_f + drag - since.drawn_n);
    const S force_r = (fz_r - moved) * magic_formula(alpha.rear, rear);
    const S a_y = (u.cos_steer * force_f + force_r) / mass + p[kP1] * (x[0] * x[0]) +
                  p[kP2] * x[1] + p[kP3] * x[2];
    return {
        x[1] * x[2] + (u.fx_n - u.sin_steer * force_f - drag) / mass,
        a_y - x[0] * x[2],
        (car.lf_m * u.cos_steer * force_f - car.lr_m * force_r) / inertia,
        a_y,
    };
}

/// T of (5) from the rates there.
template <class S, class T>
S drawn_along(const GreyBoxCar& car, const std::array<S, kGreyStates>& x, const GreyBoxInput& u,
              const T* p, const std::array<S, kGreyStates + 1>& rates) {
    return u.fx_n - car.mass_kg * p[kMassFactor] * (rates[0] - x[1] * x[2]);
}

/// What the loads move from, with the rates at the beginning of a sample.
template <class S, class T>
LoadsSince<S> loads_from(const GreyBoxCar& car, const std::array<S, kGreyStates>& x,
                         const GreyBoxInput& u, const T* p,
                         const std::array<S, kGreyStates + 1>& rates) {
    if (car.cg_height_m <= 0.0) return {};
    const bool rolling = value_of(x[0]) > car.slowest_mps;
    return {true, drawn_along(car, x, u, p, rates), rolling ? x[0] * x[0] : S(0.0)};
}

/// Sub-steps of the Runge-Kutta rule that follow the fastest motion to some 1e-5 of what it moves
/// in a sample; a precise drive resolves the 5 % that stability alone would leave.
inline int grey_box_substeps(const GreyBoxCar& car, const GreyBoxInput& u, const double* p,
                             double v_x, double dt) {
    const double front = std::abs(p[kFront] * p[kFront + 1] * p[kFront + 2]) * u.fz_front_n;
    const double rear = std::abs(p[kRear] * p[kRear + 1] * p[kRear + 2]) * u.fz_rear_n;
    const double mass = car.mass_kg * p[kMassFactor];
    const double inertia = car.yaw_inertia_kgm2 * p[kInertiaFactor];
    const double rate =
        std::max((front + rear) / mass,
                 (front * car.lf_m * car.lf_m + rear * car.lr_m * car.lr_m) / inertia) /
        std::max(v_x, car.slowest_mps);
    return whole_within(std::ceil(dt * rate / 0.25), 1, 144);
}

/// Moves `x` over `dt`; force and steering are held, as a digital controller does.
template <class S, class T>
void grey_box_step(const GreyBoxCar& car, std::array<S, kGreyStates>& x, const GreyBoxInput& u,
                   const T* p, double dt, int substeps) {
    using State = std::array<S, kGreyStates>;
    LoadsSince<S> since;
    for (int n = 0; n < substeps; ++n)
        runge_kutta_step(
            x, dt / substeps,
            [&](std::size_t stage, const State& at, State& k) {
                const auto rates = grey_box(car, at, u, p, since);
                if (n == 0 && stage == 0) since = loads_from(car, at, u, p, rates);
                std::copy_n(rates.begin(), kGreyStates, k.begin());
            },
            [](auto&& use) {
                for (std::size_t i = 0; i < kGreyStates; ++i) use(i);
            });
}

}  // namespace sysid::lab
