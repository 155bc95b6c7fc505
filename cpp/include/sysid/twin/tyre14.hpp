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

#include <algorithm>
#include <cmath>

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

struct TyreForce {
    double fx, fy;
};

/// Forces of one tyre; slips positive where the force is.
inline TyreForce tyre_force(const TyreData& t, double load, double kappa, double tan_alpha) {
    const double ratio = load / t.nominal_load_n;
    const double sensitivity = t.friction_slope * (ratio - 1.0);
    const double lowest = 0.3;  // of the friction, far beyond any load the data stand for
    const double peak_x = load * std::max(t.friction_x + sensitivity, lowest * t.friction_x);
    const double peak_y = load * std::max(t.friction_y + sensitivity, lowest * t.friction_y);
    // sin(2 atan q) = 2 q / (1 + q^2)
    const double q = ratio / t.load_at_peak_stiffness;
    const double stiffness_y = t.cornering_stiffness * t.nominal_load_n * 2.0 * q / (1.0 + q * q);
    const double tiny = 1e-9;
    const double force_x = t.slip_stiffness * load * kappa;
    const double force_y = stiffness_y * tan_alpha;
    const double sx = force_x / (peak_x + tiny);
    const double sy = force_y / (peak_y + tiny);
    const double s = std::sqrt(sx * sx + sy * sy);
    if (s < 1e-8) return {force_x, force_y};
    const double b = s / t.shape;
    // Never negative for E <= 1.
    const double bent = t.curvature == 0.0 ? b : b - t.curvature * (b - atan_of_positive(b));
    const double gain = sin_of_positive(t.shape * atan_of_positive(bent)) / s;
    return {gain * force_x, gain * force_y};
}

}  // namespace sysid
