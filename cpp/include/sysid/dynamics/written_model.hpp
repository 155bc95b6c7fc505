// The model as a calculation that can be written as text: for use where this library is not.
#pragma once

#include <array>
#include <utility>
#include <vector>

#include "sysid/dynamics/single_track.hpp"
#include "sysid/math/recorder.hpp"

namespace sysid {

/// Numbers that stand in `calculation.steps` are those of steps.
struct WrittenModel {
    struct State {
        const char* name = nullptr;  // those of users' effects have none here, and no unit
        const char* unit = nullptr;
        int step = -1, rate = -1;
        double start = 0.0;
    };
    Spelled calculation;
    std::vector<State> states;                     // v_x, v_y, r, then those of effects
    int steer = -1, force = -1;                    // what the driver does
    std::vector<std::pair<const char*, int>> car;  // its data, by the names in `VehicleData`
    std::vector<int> parameters;                   // all of the parameter vector
    int a_x = -1, a_y = -1;                        // at the centre of gravity
};

/// Writes the model of a car that is driven, with its wheel force known; `p` says which lags there
/// are. The states start as they settle where the car goes straight on at the speed `v_x`.
WrittenModel write_model(const SingleTrack& model, const double* p, double v_x);

}  // namespace sysid
