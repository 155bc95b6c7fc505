// Lateral axle forces for the observers: a Magic Formula that moves with the load, shares its grip
// with the longitudinal force, and whose stiffness and friction can be rescaled while driving.
#pragma once

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
struct AxleForces {
    double fz_f, fz_r, fx_f, fx_r;
};

/// Quasi-static loads under the longitudinal acceleration `ax` (specific force), and the
/// longitudinal force shared as brakes or drive do it.
inline AxleForces axle_forces(const ObservedCar& car, double ax, double speed) {
    const VehicleData& c = car.data;
    const double pull = c.mass_kg * ax;
    const Axles<double> fz = axle_loads(c.mass_kg * kGravity, pull, c.cg_height_m, c.lf_m, c.lr_m);
    const double fx = pull + drag_force(c.air_density_kgpm3, c.drag_area_m2, speed);
    const double front = fx < 0.0 ? c.brake_front_share : c.drive_front_share;
    return {fz.front, fz.rear, front * fx, (1.0 - front) * fx};
}

/// Share of the lateral grip that the longitudinal force leaves.
inline double grip_left(double fx, double fz, double mu) {
    return ellipse_left(1.0, fx / (mu * fz));
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
