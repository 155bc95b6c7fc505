// Combined-slip tyre forces by similarity, sensitive to load.
//
// Pacejka, Tire and Vehicle Dynamics (3rd ed.), sec. 4.2 (similarity method) and eq. (4.E25) for
// the cornering stiffness; Radt and Milliken's normalised slip joins the two directions:
//   K_y = p1 F_z0 sin(2 atan(F_z / (p2 F_z0))),  K_x = p_x F_z,
//   mu = mu0 + mu' (F_z/F_z0 - 1),
//   (s_x, s_y) = (K_x kappa / (mu_x F_z), K_y tan(alpha) / (mu_y F_z)),  s = |(s_x, s_y)|,
//   (F_x, F_y) = f(s)/s (mu_x F_z s_x, mu_y F_z s_y),  f(s) = sin(C atan(b - E (b - atan b))),
//   b = s/C, so that f has slope one at the origin.
#pragma once

#include <type_traits>

#include "sysid/twin/trig.hpp"

namespace sysid {

struct TyreData {
    double nominal_load_n = 5500.0;
    double friction_x = 1.05, friction_y = 1.0;  // at the nominal load
    double friction_slope = -0.12;               // per relative load
    double slip_stiffness = 20.0;                // K_x per load
    double cornering_stiffness = 20.0;           // p1: K_y at F_z = p2 F_z0, per nominal load
    double load_at_peak_stiffness = 1.6;         // p2
    double shape = 1.45;                         // C
    double curvature = -0.3;                     // E
    double relaxation_m = 0.0;                   // zero: forces follow the slip at once
};

/// What the equations take of the data, worked out once: of one tyre, or of all wheels at once.
template <class T>
struct TyreCurve {
    T per_nominal_load, friction_x, friction_y, lowest_x, lowest_y, friction_slope;
    T slip_stiffness, stiffness, per_load_at_peak, shape, per_shape, curvature;

    TyreCurve() = default;
    /// Of the tyres in front and rear; the same tyre twice for `double`.
    TyreCurve(const TyreData& front, const TyreData& rear) {
        const auto take = [&](auto of) {
            if constexpr (std::is_same_v<T, double>)
                return of(front);
            else
                return T(of(front), of(rear));
        };
        const double lowest = 0.3;  // of the friction, far beyond any load the data stand for
        per_nominal_load = take([](const TyreData& t) { return 1.0 / t.nominal_load_n; });
        friction_x = take([](const TyreData& t) { return t.friction_x; });
        friction_y = take([](const TyreData& t) { return t.friction_y; });
        lowest_x = T(lowest) * friction_x;
        lowest_y = T(lowest) * friction_y;
        friction_slope = take([](const TyreData& t) { return t.friction_slope; });
        slip_stiffness = take([](const TyreData& t) { return t.slip_stiffness; });
        stiffness =
            take([](const TyreData& t) { return 2.0 * t.cornering_stiffness * t.nominal_load_n; });
        per_load_at_peak = take([](const TyreData& t) { return 1.0 / t.load_at_peak_stiffness; });
        shape = take([](const TyreData& t) { return t.shape; });
        per_shape = take([](const TyreData& t) { return 1.0 / t.shape; });
        curvature = take([](const TyreData& t) { return t.curvature; });
    }
};

template <class T>
struct TyreForce {
    T fx, fy;
};

/// Forces of a tyre or of all; slips positive where the force is.
template <class T>
inline TyreForce<T> tyre_force(const TyreCurve<T>& t, T load, T kappa, T tan_alpha) {
    const T one = 1.0;
    const T ratio = load * t.per_nominal_load;
    const T sensitivity = t.friction_slope * (ratio - one);
    const T peak_x = load * larger(t.friction_x + sensitivity, t.lowest_x);
    const T peak_y = load * larger(t.friction_y + sensitivity, t.lowest_y);
    // sin(2 atan q) = 2 q / (1 + q^2)
    const T q = ratio * t.per_load_at_peak;
    const T stiffness_y = t.stiffness * q / (one + q * q);
    const T tiny = 1e-9;
    const T force_x = t.slip_stiffness * load * kappa;
    const T force_y = stiffness_y * tan_alpha;
    const T sx = force_x / (peak_x + tiny);
    const T sy = force_y / (peak_y + tiny);
    const T s = root(sx * sx + sy * sy);
    const T b = s * t.per_shape;
    // Never negative for E <= 1.
    const T bent = b - t.curvature * (b - atan_of_positive(b));
    const T gain = choose(s < T(1e-8), one, sin_of_positive(t.shape * atan_of_positive(bent)) / s);
    return {gain * force_x, gain * force_y};
}

}  // namespace sysid
