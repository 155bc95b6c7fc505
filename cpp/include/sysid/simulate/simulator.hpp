// A closed-loop drive: a driver follows references of speed and path curvature with the car.
#pragma once

#include <vector>

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

/// How the car moves, and where the steering stands, when the drive begins.
struct Beginning {
    double v_x = 20.0;
    double v_y = 0.0;
    double yaw_rate = 0.0;
    double steer_rad = 0.0;  // beside the open-loop steering of the first reference
    double time_s = 0.0;     // since the log began
};

/// Samples of a finished drive, row after row.
struct Drive {
    std::vector<double> inputs;   // samples x (steer, force)
    std::vector<double> states;   // samples x kModelStates
    std::vector<double> outputs;  // samples x kChannels, free of noise
    std::size_t lost_at = 0;      // sample at which the car spun or stopped; samples if it did not
};

/// `disturbance`: samples x (F_x, F_y, M_z). The drive ends where the car is lost.
Drive simulate(const SingleTrack& model, const double* p, double dt,
               const std::vector<Reference>& references, const Driver& driver,
               const double* disturbance, const Beginning& beginning);

}  // namespace sysid
