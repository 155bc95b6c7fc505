// The observer to compare with: a planar double track with constant gains.
//
// Dettu et al. (2023), eqs. (27) to (32), with these corrections:
//   (28) the third term of M_z has l_f, the lever of the front axle, where the paper prints l_r;
//   (30) alpha = delta - atan(v_y/v_x): as printed, without the steering angle and with the sign
//        that makes the force of (29) grow the slip, the car would be unstable;
//   (31) an accelerometer reads F/M, not dv/dt: the terms v_y r and v_x r are left out of the
//   reading; (24) the sign of the mass law as in `laws.hpp`.
// Drag, which (27) leaves out, may be given; the wheel loads follow from the measured
// accelerations.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "sysid/twin/vehicle14.hpp"

namespace sysid {

struct PacejkaPair {
    double bx = 12.0, cx = 1.5, dx = 1.0, ex = 0.0;
    double by = 11.0, cy = 1.4, dy = 1.0, ey = 0.0;
};

struct DoubleTrackData {
    double mass_kg = 1500.0, jzz_kgm2 = 2200.0;
    double lf_m = 1.2, lr_m = 1.5, track_m = 1.6, height_m = 0.5;
    double radius_m = 0.33;
    double drag_area_m2 = 0.0, air_density_kgpm3 = 1.225;
    double roll_share_front = 0.5;  // of the lateral load transfer
    PacejkaPair front, rear;
};

/// Gains per second, in the order of eq. (32); `yaw_rate_below_radps` gates the mass.
struct DoubleTrackGains {
    double ax_vx = 0.0, yaw_yaw = 0.0, ax_mass = 0.0, ay_vy = 0.0;
    double yaw_rate_below_radps = 0.0523598775598298873;
    bool published_sign = false;
    double lowest_mass_kg = -1000.0, highest_mass_kg = 1000.0;
};

/// v_x, v_y, yaw rate and mass error, one row per sample, each before its correction.
std::vector<double> observe_double_track(const DoubleTrackData& car, const DoubleTrackGains& gains,
                                         const std::array<double, 4>& start, const Input14* inputs,
                                         const double* measured, std::size_t n, double dt);

}  // namespace sysid
