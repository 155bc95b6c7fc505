// The way of a filter's mean with frozen gains, with the prediction errors on it.
#pragma once

#include <vector>

#include "sysid/identify/prediction_error.hpp"

namespace sysid {

/// Runs stand one after the other. States are packed as in `filter_rows`, with places for all
/// externals.
struct FrozenPath {
    std::vector<double> whitened;  // kChannels for each sample
    std::size_t states = 0;        // numbers for each sample in:
    std::vector<double> predicted, corrected;
    std::vector<int> parts;  // of the step to the sample

    const double* before(std::size_t k) const { return corrected.data() + (k - 1) * states; }
    const double* here(std::size_t k) const { return predicted.data() + k * states; }
    void resize(std::size_t samples, std::size_t states_kept);
};

/// With states and parts only where they are asked for.
FrozenPath frozen_path(const Problem& problem, const double* p, const FrozenFilter& filter,
                       bool with_states);

}  // namespace sysid
