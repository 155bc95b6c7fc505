// What is known of the car beforehand. ISO 8855 axes (x forward, y left, z up), SI units.
#pragma once

#include "sysid/model/kinematics.hpp"

namespace sysid {

struct VehicleData {
    double mass_kg = 0.0;
    double lf_m = 0.0;  // centre of gravity to front axle
    double lr_m = 0.0;  // centre of gravity to rear axle
    double cg_height_m = 0.0;
    double track_front_m = 0.0;
    double track_rear_m = 0.0;
    double drag_area_m2 = 0.0;  // C_d A
    double air_density_kgpm3 = 1.225;
    double brake_front_share = 0.5;
    double drive_front_share = 0.0;
    double gravity_mps2 = kGravity;  // behind the static axle loads
};

}  // namespace sysid
