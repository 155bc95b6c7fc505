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

}  // namespace sysid::test
