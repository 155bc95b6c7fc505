// Active disturbance rejection: speed and yaw rate are linearised by feedback, the observer's
// estimates of what the linear model lacks are taken away, and proportional control does the rest.
//
//   F_x   = m (K_v (v_ref - v_x) + dv_ref/dt - v_y r) + C_d v_x - xi_x                          (1)
//   delta = I_z / (C_f l_f) (K_r (r_ref - r) - N_v v_y - N_r r - xi_psi / I_z)                  (2)
//   r_ref = K_psi (psi_ref - psi) + dpsi_ref/dt, limited in rate and size                       (3)
//   |r_ref - a_y / v_x + K_a alpha_r| <= K_a alpha_max,  alpha_r = -atan2(v_y - l_r r, v_x)     (5)
//   N_v = -(C_f l_f - C_r l_r) / (I_z v_x),  N_r = -(C_f l_f^2 + C_r l_r^2) / (I_z v_x)         (4)
// (5): the rear slip angle changes by about r - a_y / v_x, and may come nearer to its limit no
// faster than K_a times what is left; a yaw rate alone says nothing of how far the car has come
// round (control barrier: Ames et al., IEEE Trans. Autom. Control 62 (2017)). J. Han, From PID to
// Active Disturbance Rejection Control, IEEE Trans. Ind. Electron. 56 (2009).
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "sysid/lab/actuators.hpp"
#include "sysid/lab/car.hpp"
#include "sysid/math/linear.hpp"
#include "sysid/model/kinematics.hpp"

namespace sysid::lab {

/// What the observer estimates: motion, and forces [N] and a moment [N m] that the model lacks.
enum Estimated : int { kEstVx, kEstVy, kEstYawRate, kEstXiX, kEstXiY, kEstXiPsi, kEstimated };
using Estimate = Vec<kEstimated>;

struct AdrcData {
    double speed_gain_ps = 4.0;
    double yaw_rate_gain_ps = 30.0;
    double heading_gain_ps = 12.0;
    double yaw_rate_limit_radps = 0.3;
    double yaw_acceleration_limit_radps2 = 1.0;
    double lateral_limit_mps2 = std::numeric_limits<double>::infinity();   // of v_x r_ref
    double slip_limit_rad = std::numeric_limits<double>::infinity();       // of the front tyre
    double rear_slip_limit_rad = std::numeric_limits<double>::infinity();  // of the rear tyre
    double rear_slip_gain_ps = 4.0;
    double brakes_from_mps2 = 0.0;  // below this deceleration the car is left to roll
    bool feed_forward = true;       // the derivatives of the references in (1) and (3)
    bool coupling = true;           // the term v_y r of (1)
    double lowest_speed_mps = 1.0;  // in the denominators of (4)
    double added_speed_mps = 0.0;   // and added there
};

/// What is wanted at one sample.
struct Wanted {
    double speed_mps = 0.0;
    double acceleration_mps2 = 0.0;
    double heading_rad = 0.0;
    double yaw_rate_radps = 0.0;  // derivative of the heading
    double steer_rad = 0.0;       // where steering is open loop
};

class Adrc {
  public:
    Adrc(const AdrcData& data, const NominalCar& car) : data_(data), car_(car) {}

    double force(const Wanted& wanted, const Estimate& x, std::uint32_t& limits) const {
        double acceleration = data_.speed_gain_ps * (wanted.speed_mps - x[kEstVx]);
        if (data_.feed_forward) acceleration += wanted.acceleration_mps2;
        if (data_.coupling) acceleration -= x[kEstVy] * x[kEstYawRate];
        const double pull = car_.mass_kg * acceleration - x[kEstXiX] + car_.drag_nspm * x[kEstVx];
        const bool idle = pull <= 0.0 && -pull <= data_.brakes_from_mps2 * car_.mass_kg;
        if (idle && pull < 0.0) limits |= kBrakesIdle;
        return idle ? 0.0 : pull;
    }

    /// Equation (3); remembers its last value.
    double yaw_rate(const Wanted& wanted, double heading_rad, double v_x, double dt,
                    std::uint32_t& limits) {
        const double error = std::remainder(wanted.heading_rad - heading_rad, 2.0 * kPi);
        double rate = data_.heading_gain_ps * error;
        if (data_.feed_forward) rate += wanted.yaw_rate_radps;
        const double step = data_.yaw_acceleration_limit_radps2 * dt;
        if (std::abs(rate - yaw_rate_) > step) {
            limits |= kYawAccelerationLimited;
            rate = yaw_rate_ + std::copysign(step, rate - yaw_rate_);
        }
        yaw_rate_ = rate;
        const double most =
            std::min(data_.yaw_rate_limit_radps, data_.lateral_limit_mps2 / std::max(v_x, 1.0));
        if (std::abs(rate) > most) limits |= kYawRateLimited;
        return std::clamp(rate, -most, most);
    }

    /// Equation (5); `steer_rad` is the angle that acts on the state `x`.
    double guarded(double yaw_rate, const Estimate& x, double steer_rad, const Axles<double>& loads,
                   std::uint32_t& limits) const {
        const double v = std::max(x[kEstVx], 1.0);
        const double slip = slips(x, v, steer_rad).rear;
        const Axles<double> small =
            small_slip_angles(x[kEstVy] / v, x[kEstYawRate] / v, car_.lf_m, car_.lr_m, steer_rad);
        const double force = car_.stiffness_front * loads.front * small.front +
                             car_.stiffness_rear * loads.rear * small.rear + x[kEstXiY];
        const double middle = force / (car_.mass_kg * v) - data_.rear_slip_gain_ps * slip;
        const double room = data_.rear_slip_gain_ps * data_.rear_slip_limit_rad;
        const double kept = std::clamp(yaw_rate, middle - room, middle + room);
        if (kept != yaw_rate) limits |= kRearSlipLimited;
        return kept;
    }

    /// Equation (2).
    double steer(double yaw_rate, const Estimate& x, const Axles<double>& loads,
                 std::uint32_t& limits) const {
        const double front = car_.stiffness_front * loads.front;
        const double rear = car_.stiffness_rear * loads.rear;
        const double inertia = car_.yaw_inertia_kgm2;
        const double v = std::max(x[kEstVx], data_.lowest_speed_mps) + data_.added_speed_mps;
        const double n_v = -(front * car_.lf_m - rear * car_.lr_m) / (inertia * v);
        const double n_r =
            -(front * car_.lf_m * car_.lf_m + rear * car_.lr_m * car_.lr_m) / (inertia * v);
        const double r = x[kEstYawRate];
        const double wanted = data_.yaw_rate_gain_ps * (yaw_rate - r) - n_v * x[kEstVy] - n_r * r -
                              x[kEstXiPsi] / inertia;
        const double angle = wanted * inertia / (front * car_.lf_m);
        const double straight = -slips(x, v, 0.0).front;
        const double kept =
            std::clamp(angle, straight - data_.slip_limit_rad, straight + data_.slip_limit_rad);
        if (kept != angle) limits |= kSlipLimited;
        return kept;
    }

  private:
    Axles<double> slips(const Estimate& x, double v, double steer_rad) const {
        return slip_angles(v, x[kEstVy], x[kEstYawRate], car_.lf_m, car_.lr_m, steer_rad);
    }

    static constexpr double kPi = 3.14159265358979323846;

    AdrcData data_;
    NominalCar car_;
    double yaw_rate_ = 0.0;
};

}  // namespace sysid::lab
