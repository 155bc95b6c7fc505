// Lateral axle forces for the observers: a Magic Formula that moves with the load, shares its grip
// with the longitudinal force, and whose stiffness and friction can be rescaled while driving.
#pragma once

#include <array>
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

/// `axle_force` of one axle, for a filter that asks at one sigma point after the other. Most of
/// them differ from the one before in what tyres do not feel: what was asked last is not worked out
/// again. Stiffness and friction are given by their logarithms.
class AxleForceAgain {
  public:
    double operator()(double alpha, double fz, double fx, const TyreCoefficients<double>& tyre,
                      double log_stiffness, double log_friction) {
        const std::array<double, 4> curve{fz, fx, log_stiffness, log_friction};
        const bool same_curve = curve == curve_;
        if (same_curve && alpha == alpha_) return force_;
        if (!same_curve) {
            const double friction = std::exp(log_friction);
            curve_ = curve;
            most_ = fz * grip_left(fx, fz, tyre.D * friction);
            scaled_ = {tyre.B * std::exp(log_stiffness) / friction, tyre.C, tyre.D * friction,
                       tyre.E};
        }
        alpha_ = alpha;
        force_ = most_ * magic_formula(alpha, scaled_);
        return force_;
    }

  private:
    std::array<double, 4> curve_{std::nan("")};  // equal to nothing
    double alpha_ = 0.0, most_ = 0.0, force_ = 0.0;
    TyreCoefficients<double> scaled_{};
};

}  // namespace sysid
