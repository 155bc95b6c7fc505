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

/// How one of the batch's twins starts beside the first, for a `BatchParameter::start`.
struct StartStep {
    std::size_t twin = 1;
    std::size_t state = 0;
    double step = 0.0;
};

/// What the observer recorded, every `stride` samples.
struct Observation {
    std::vector<double> loads;     // kEstimates per row: a load and the scale of the inputs
    std::vector<double> readings;  // kTwinOutputs per row: the twin before its correction
    std::vector<int> stages;
    std::vector<double> spread;  // of the batch, in parts of the first spread
};

struct TwinObserverSettings {
    std::vector<StateGain> gains;
    std::optional<ParameterLaws> laws;
    std::optional<BatchEstimator> batch;
    std::size_t stride = 10;
    /// Inputs that the estimated scale multiplies, by their places in `Input14`; not the steering.
    std::vector<std::size_t> scaled;
    /// Steps of the batch's parameters that are states at the start.
    std::vector<StartStep> starts;
};

/// Runs the observer over `n` samples; `measured` has kReadings columns, NaN where nothing was
/// read. Throws std::invalid_argument if a place among readings, states or inputs is out of range,
/// and NumericalFailure where the twin is lost or its load is no body's.
Observation observe14(const Vehicle14& twin, const State14& start, const Input14* inputs,
                      const double* measured, std::size_t n, double dt,
                      TwinObserverSettings settings);

}  // namespace sysid
