// A driver who follows references of speed and path curvature, whatever the car.
#pragma once

#include <algorithm>
#include <cmath>

#include "sysid/dynamics/step.hpp"

namespace sysid {

/// What the driver is asked to do at one sample.
struct Reference {
    double speed_mps = 20.0;
    double curvature_radpm = 0.0;  // followed by steering with feedback
    double steer_rad = 0.0;        // added as it is (open loop)
};

/// A driver who sees the car with a delay, previews the path, and has limited hands and feet.
struct Driver {
    double reaction_s = 0.15;
    // Feedback, in parts of the steering that an error of the yaw rate would need in steady state:
    // a gain that does not fall with speed would make a fast car weave.
    double yaw_rate_gain = 0.4;
    double yaw_rate_integral_ps = 1.2;
    double understeer_radps2pm = 0.0;  // steering per lateral acceleration that is fed forward
    double speed_gain_ps = 1.5;
    double steer_limit_rad = 0.5;
    double steer_rate_limit_radps = 1.0;
    double drive_limit_n = 6000.0;
    double brake_limit_n = 14000.0;
    double power_limit_w = 250e3;
    double force_rate_limit_nps = 40e3;
    bool tracks_path = true;  // false: only the open-loop steering
};

/// The car as its driver knows it.
struct DrivenCar {
    double mass_kg, wheelbase_m;
    double air_density_kgpm3, drag_area_m2;
    double rolling_n = 0.0;  // rolling resistance

    double resistance(double v) const {
        return drag_force(air_density_kgpm3, drag_area_m2, v) + rolling_n;
    }
};

/// What the driver saw, `reaction_s` ago.
struct Seen {
    double speed_mps;
    double yaw_rate_radps;
    Reference reference;
};

/// Decides the next steering angle and force: what the path ahead needs, corrected by readings.
class Hands {
  public:
    Hands(const DrivenCar& car, const Driver& driver, double dt)
        : car_(car), driver_(driver), dt_(dt) {}

    /// Samples between what happens and what the driver does about it.
    std::size_t delay() const {
        return static_cast<std::size_t>(std::lround(driver_.reaction_s / dt_));
    }
    /// How far ahead the driver looks: half of the reaction time is made up for; open-loop steering
    /// keeps its time.
    std::size_t preview() const { return driver_.tracks_path ? 1 + delay() / 2 : 1; }

    Input next(const Input& now, const Reference& ahead, double acceleration, const Seen& seen) {
        return {
            towards(now.steer_rad, steer(now, ahead, seen), driver_.steer_rate_limit_radps * dt_),
            towards(now.longitudinal, force(ahead, acceleration, seen),
                    driver_.force_rate_limit_nps * dt_),
        };
    }

  private:
    static double towards(double from, double to, double step) {
        return from + std::clamp(to - from, -step, step);
    }

    double steer(const Input& now, const Reference& ahead, const Seen& seen) {
        double angle = ahead.steer_rad;
        if (driver_.tracks_path) {
            const double v = std::max(seen.speed_mps, kLowestSpeed);
            const double steer_per_curvature =
                car_.wheelbase_m + driver_.understeer_radps2pm * v * v;
            const double error = seen.reference.curvature_radpm * v - seen.yaw_rate_radps;
            // Steering that has reached its stop must not wind up the integral.
            const double stop = std::copysign(driver_.steer_limit_rad, error);
            if (std::abs(now.steer_rad - stop) > 1e-9) integral_ += error * dt_;
            const double correction =
                driver_.yaw_rate_gain * error + driver_.yaw_rate_integral_ps * integral_;
            angle += steer_per_curvature * (ahead.curvature_radpm + correction / v);
        }
        return std::clamp(angle, -driver_.steer_limit_rad, driver_.steer_limit_rad);
    }

    double force(const Reference& ahead, double acceleration, const Seen& seen) const {
        const double v = std::max(seen.speed_mps, kLowestSpeed);
        const double error = seen.reference.speed_mps - seen.speed_mps;
        const double pull = car_.mass_kg * (acceleration + driver_.speed_gain_ps * error) +
                            car_.resistance(ahead.speed_mps);
        const double most = std::min(driver_.drive_limit_n, driver_.power_limit_w / v);
        return std::clamp(pull, -driver_.brake_limit_n, most);
    }

    DrivenCar car_;
    Driver driver_;
    double dt_;
    double integral_ = 0.0;
};

}  // namespace sysid
