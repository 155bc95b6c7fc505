// What is known of the car beforehand. ISO 8855 axes (x forward, y left, z up), SI units.
#pragma once

#include "sysid/model/kinematics.hpp"

namespace sysid {

/// Numbers, or what stands for them where the model itself is written down.
template <class V>
struct VehicleDataOf {
    V mass_kg = 0.0;
    V lf_m = 0.0;  // centre of gravity to front axle
    V lr_m = 0.0;  // centre of gravity to rear axle
    V cg_height_m = 0.0;
    V track_front_m = 0.0;
    V track_rear_m = 0.0;
    V drag_area_m2 = 0.0;  // C_d A
    V air_density_kgpm3 = 1.225;
    V brake_front_share = 0.5;
    V drive_front_share = 0.0;
    V gravity_mps2 = kGravity;  // behind the static axle loads
};
using VehicleData = VehicleDataOf<double>;

}  // namespace sysid
