// Whitened errors of a problem as a vector.
#pragma once

#include "helpers.hpp"
#include "sysid/identify/prediction_error.hpp"

namespace sysid::test {

inline Eigen::VectorXd residuals_of(const Problem& problem, const Parameters& p,
                                    const FrozenFilter& filter) {
    Eigen::VectorXd e(static_cast<int>(problem.samples()) * kChannels);
    residuals(problem, p.data(), filter, e.data());
    return e;
}

/// A filter that tells nothing of its path: whoever asks for that walks it.
inline FrozenFilter silent(FrozenFilter filter) {
    for (FrozenRun& run : filter.runs) run.told.clear();
    return filter;
}

}  // namespace sysid::test
