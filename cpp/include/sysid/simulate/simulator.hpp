// A closed-loop drive: a driver follows references of speed and path curvature with the car.
#pragma once

#include <limits>
#include <vector>

#include "sysid/dynamics/step.hpp"
#include "sysid/simulate/driver.hpp"

namespace sysid {

/// How the car moves, and where the steering stands, when the drive begins.
struct Beginning {
    double v_x = 20.0;
    double v_y = 0.0;
    double yaw_rate = 0.0;
    double steer_rad = 0.0;  // beside the open-loop steering of the first reference
    double time_s = 0.0;     // since the log began
};

/// Channels that users' effects read: samples x `width`, row after row.
struct Logged {
    const double* values = nullptr;
    std::size_t width = 0;
};

/// Samples of a finished drive, row after row.
struct Drive {
    std::vector<double> inputs;   // samples x (steer, force)
    std::vector<double> states;   // samples x kModelStates
    std::vector<double> outputs;  // samples x kChannels, free of noise
    /// Sample at which the car spun, stopped or went too far; samples if it did not.
    std::size_t lost_at = 0;
};

/// `disturbance`: samples x kPushes. The drive ends where the car is lost, or farther than
/// `farthest_m` from where it began.
Drive simulate(const SingleTrack& model, const double* p, double dt,
               const std::vector<Reference>& references, const Driver& driver,
               const double* disturbance, const Beginning& beginning, const Logged& logged = {},
               double farthest_m = std::numeric_limits<double>::infinity());

}  // namespace sysid
