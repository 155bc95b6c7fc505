// A driver takes the fourteen-degree-of-freedom car through references of speed and curvature, and
// what he did is kept: the same wheel torques and steering then go to the twin.
#pragma once

#include <cstddef>
#include <vector>

#include "sysid/simulate/simulator.hpp"
#include "sysid/twin/vehicle14.hpp"

namespace sysid {

struct Pedals {
    double drive_front_share = 0.0, brake_front_share = 0.65;
};

struct Drive14 {
    std::vector<double> inputs;  // rows of Input14
    std::vector<double> states, outputs;
    std::size_t lost_at = 0;  // sample at which the car spun or stopped; samples if it did not
};

/// `base` brings the road and the wrench; the driver adds steering and torques. The drive ends
/// where the car is lost.
Drive14 drive14(const Vehicle14& car, const Driver& driver, const Pedals& pedals,
                const std::vector<Reference>& references, const Input14* base, double dt);

}  // namespace sysid
