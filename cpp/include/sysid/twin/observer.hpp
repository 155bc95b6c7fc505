// The observer loop on the native twin, eqs. (1) to (5): the twin runs beside the car, its readings
// are compared with the car's, its states and its load are corrected, and it takes the next step.
#pragma once

#include <optional>
#include <vector>

#include "sysid/twin/batch.hpp"
#include "sysid/twin/laws.hpp"
#include "sysid/twin/vehicle14.hpp"

namespace sysid {

/// One entry of the matrix K of eq. (4), sparse as in sec. 5.1 of the paper.
struct StateGain {
    std::size_t channel = 0;  // of the readings
    std::size_t state = 0;
    double gain = 0.0;  // per second; or per sample, as table 8 of the paper has it
    bool per_sample = false;
};

/// What the observer recorded, every `stride` samples.
struct Observation {
    std::vector<double> loads;     // seven per row, in the order of `LoadParameter`
    std::vector<double> readings;  // kTwinOutputs per row: the twin before its correction
    std::vector<int> stages;
    std::vector<double> spread;  // of the batch, in parts of the first spread
};

struct ObserverSettings {
    std::vector<StateGain> gains;
    std::optional<ParameterLaws> laws;
    std::optional<BatchEstimator> batch;
    std::size_t stride = 10;
};

/// Runs the observer over `n` samples; `measured` has kReadings columns, NaN where nothing was
/// read.
Observation observe14(const Vehicle14& twin, const State14& start, const Input14* inputs,
                      const double* measured, std::size_t n, double dt, ObserverSettings settings);

}  // namespace sysid
