// Lateral axle forces for the observers: a Magic Formula that moves with the load, shares its grip
// with the longitudinal force, and whose stiffness and friction can be rescaled while driving.
#pragma once

#include <algorithm>
#include <cmath>

#include "sysid/math/dual.hpp"
#include "sysid/model/tyre.hpp"
#include "sysid/model/vehicle.hpp"

namespace sysid {

struct ObservedCar {
    VehicleData data;
    double yaw_inertia_kgm2 = 0.0;
    TyreCoefficients<double> front{}, rear{};

    double wheelbase_m() const { return data.lf_m + data.lr_m; }
};

/// Vertical and longitudinal axle forces [N].
struct AxleLoads {
    double fz_f, fz_r, fx_f, fx_r;
};

/// Quasi-static loads under the longitudinal acceleration `ax` (specific force), and the
/// longitudinal force shared as brakes or drive do it.
inline AxleLoads axle_loads(const ObservedCar& car, double ax, double speed) {
    const VehicleData& c = car.data;
    const double shift = c.mass_kg * ax * c.cg_height_m / car.wheelbase_m();
    const double drag = 0.5 * c.air_density_kgpm3 * c.drag_area_m2 * speed * speed;
    const double fx = c.mass_kg * ax + drag;
    const double front = fx < 0.0 ? c.brake_front_share : c.drive_front_share;
    const double weight = c.mass_kg * kGravity / car.wheelbase_m();
    const double least = 0.05 * c.mass_kg * kGravity;  // a wheel in the air breaks every formula
    return {
        std::max(weight * c.lr_m - shift, least),
        std::max(weight * c.lf_m + shift, least),
        front * fx,
        (1.0 - front) * fx,
    };
}

/// Share of the lateral grip that the longitudinal force leaves (friction ellipse).
inline double grip_left(double fx, double fz, double mu) {
    const double used = fx / (mu * fz);
    return std::sqrt(std::max(1.0 - used * used, 0.05));
}

/// Axle force at slip angle `alpha` (positive gives a positive force), with the cornering stiffness
/// times `stiffness` and the friction times `friction`.
template <class S>
S axle_force(const S& alpha, double fz, double fx, const TyreCoefficients<double>& tyre,
             const S& stiffness, const S& friction) {
    const TyreCoefficients<S> t{
        tyre.B * stiffness / friction,
        S(tyre.C),
        tyre.D * friction,
        S(tyre.E),
    };
    return fz * grip_left(fx, fz, tyre.D * value_of(friction)) * magic_formula<S>(alpha, t);
}

}  // namespace sysid
