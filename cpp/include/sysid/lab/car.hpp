// The car as the observer of the loop and its controller believe it to be.
#pragma once

#include "sysid/model/kinematics.hpp"

namespace sysid::lab {

/// What the observer needs of it.
struct ObserverCar {
    double mass_kg = 0.0;
    double yaw_inertia_kgm2 = 0.0;
    double lf_m = 0.0, lr_m = 0.0;
    double drag_nspm = 0.0;  // linear drag C_d
};

/// What the controller needs besides.
struct NominalCar : ObserverCar {
    double cg_height_m = 0.0;
    double gravity_mps2 = kGravity;
    double stiffness_front = 50.0;  // cornering stiffness per load [1/rad]
    double stiffness_rear = 50.0;

    /// Axle loads on a level road under a total wheel force.
    Axles<double> loads(double force_n) const {
        return axle_loads(mass_kg * gravity_mps2, force_n, cg_height_m, lf_m, lr_m);
    }
};

}  // namespace sysid::lab
