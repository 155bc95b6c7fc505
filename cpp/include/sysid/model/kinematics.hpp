// What every model of a car has in common: slip angles, axle loads, drag, the friction ellipse and
// gravity. ISO 8855 axes, SI units.
//
// Rajamani, Vehicle Dynamics and Control (2nd ed.), ch. 2 and 4; Milliken and Milliken, Race Car
// Vehicle Dynamics (1995), ch. 5.
#pragma once

#include <cmath>

#include "sysid/math/dual.hpp"
#include "sysid/math/recorded.hpp"

namespace sysid {

constexpr double kGravity = 9.80665;  // m/s2

/// One number for each axle.
template <class S>
struct Axles {
    S front, rear;
};

/// alpha = delta - atan2(v_across, v_along): the force has the sign of its slip angle [rad].
template <class S, class D>
S slip_angle(const S& along, const S& across, const D& steer) {
    return steer - direction(across, along);
}

/// Of a car that moves at v_x, v_y with yaw rate r, its centre of gravity l_f behind the front axle
/// and l_r before the rear one. With tan(beta) and r/v_x for v_y and r, v_x is one.
template <class S, class L, class D>
Axles<S> slip_angles(const S& v_x, const S& v_y, const S& r, const L& l_f, const L& l_r,
                     const D& steer) {
    return {slip_angle(v_x, S(v_y + l_f * r), steer), -direction(S(v_y - l_r * r), v_x)};
}

/// The same for small angles, as linear observers have them.
inline Axles<double> small_slip_angles(double beta, double r_per_speed, double l_f, double l_r,
                                       double steer) {
    return {steer - beta - l_f * r_per_speed, -beta + l_r * r_per_speed};
}

/// Axle loads at rest on a level road [N].
template <class S, class L>
Axles<S> static_loads(const S& weight, const L& l_f, const L& l_r) {
    const S per_metre = named("weight_per_metre", S(weight / named("wheelbase", l_f + l_r)));
    return {per_metre * l_r, per_metre * l_f};
}

/// With what the force `pull` = m a_x at the height h moves from the front axle to the rear one. No
/// axle keeps less than a twentieth of the weight: a wheel in the air breaks every formula.
inline Axles<double> axle_loads(double weight, double pull, double h, double l_f, double l_r) {
    const Axles<double> rest = static_loads(weight, l_f, l_r);
    const double moved = pull * h / (l_f + l_r), least = 0.05 * weight;
    return {std::fmax(rest.front - moved, least), std::fmax(rest.rear + moved, least)};
}

/// 1/2 rho C_dA v |v| [N].
template <class R, class A, class S>
S drag_force(const R& rho, const A& area, const S& v) {
    using std::abs;
    return 0.5 * rho * (area * (v * abs(v)));
}

/// Share of the lateral grip that is left where the longitudinal force takes the share `used` of
/// its own, sqrt(1 - p used^2): the friction ellipse, a circle for p = 1. Beyond 98 % of it a fifth
/// is left: a locked wheel keeps a little lateral force, and the derivative stays finite.
template <class T, class S>
S ellipse_left(const T& p, const S& used) {
    using std::sqrt;
    const S rest = 1.0 - p * (used * used);
    return sqrt(if_below(rest, 0.04, S(0.04), rest));
}

}  // namespace sysid
