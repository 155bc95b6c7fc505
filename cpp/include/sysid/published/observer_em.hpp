// The extended-state observer in its published form, and learning its noise as published.
#pragma once

#include "sysid/lab/lab_em.hpp"

namespace sysid::lab {

/// The published equations, with their defects.
inline ObserverForm published_form() { return {false, false, false, false, false, true}; }

/// Learns Q and R as published: expectations from a smoother whose transition matrix is one sample
/// late, moments of the model linearised at the smoothed states, with the inputs of the sample
/// before.
ObserverEm learn_as_published(const std::vector<ObserverLog>& logs, const ObserverNoise& start,
                              const NoiseStructure<kObserverStates>& process,
                              const NoiseStructure<kObserverMeasurements>& sensors,
                              const EmOptions& options);

}  // namespace sysid::lab
