// The extended-state observer over whole logs: filter, smoother, and learning its noise.
#pragma once

#include "sysid/estimate/em.hpp"
#include "sysid/lab/observer.hpp"

namespace sysid::lab {

/// One log and the model it is filtered with.
struct ObserverLog {
    ObserverModel model;
    std::vector<ObserverInput> inputs;
    std::vector<ObserverReading> readings;
    ObserverStart start;

    std::size_t size() const { return readings.size(); }
};

/// What filter or smoother says of each sample; row after row.
struct ObserverTrace {
    double log_likelihood = 0.0;
    std::vector<double> state;       // samples x 6
    std::vector<double> covariance;  // samples x 36
    std::vector<double> reading;     // samples x 4: sensors without their noise
    std::vector<double> reading_std;
    std::vector<double> innovation;  // samples x 4, by the filter; NaN where nothing was measured
    std::vector<double> innovation_std;
};

using ObserverNoisePair = NoisePair<kObserverStates, kObserverMeasurements>;
using ObserverEm = EmOutcome<kObserverStates, kObserverMeasurements>;

double log_likelihood(const ObserverLog& log, const ObserverNoise& noise);

ObserverTrace trace(const ObserverLog& log, const ObserverNoise& noise, bool smoothed);

/// Learns Q and R from all logs together.
ObserverEm learn(const std::vector<ObserverLog>& logs, const ObserverNoise& start,
                 const NoiseStructure<kObserverStates>& process,
                 const NoiseStructure<kObserverMeasurements>& sensors, const EmOptions& options);

}  // namespace sysid::lab
