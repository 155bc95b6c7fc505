// Rauch-Tung-Striebel smoother over the steps an extended Kalman filter has kept.
#pragma once

#include <vector>

#include "sysid/estimate/kalman.hpp"

namespace sysid {

template <int NX>
struct SmoothedStep {
    Vec<NX> mean;
    Mat<NX, NX> covariance;
    Mat<NX, NX> lag_one;  // cov(x(k), x(k-1)) given all measurements; zero for the first sample
};

/// `ridge` is added to the predicted covariance where it is inverted.
template <int NX, int NY>
std::vector<SmoothedStep<NX>> smooth(const std::vector<FilterStep<NX, NY>>& steps,
                                     double ridge = 0.0) {
    std::vector<SmoothedStep<NX>> out(steps.size());
    if (steps.empty()) return out;
    const std::size_t last = steps.size() - 1;
    out[last].mean = steps[last].mean;
    out[last].covariance = steps[last].covariance;
    out[0].lag_one.setZero();
    for (std::size_t k = last; k-- > 0;) {
        const auto& now = steps[k];
        const auto& next = steps[k + 1];
        // States without noise make the predicted covariance singular: a pivoted factorisation
        // stands that, an inverse does not.
        const Mat<NX, NX> inverted = next.predicted_covariance + ridge * Mat<NX, NX>::Identity();
        const Mat<NX, NX> J = inverted.ldlt().solve(next.transition * now.covariance).transpose();
        out[k].mean = now.mean + J * (out[k + 1].mean - next.predicted_mean);
        out[k].covariance = now.covariance +
                            J * (out[k + 1].covariance - next.predicted_covariance) * J.transpose();
        symmetrise(out[k].covariance);
        out[k + 1].lag_one = out[k + 1].covariance * J.transpose();
    }
    return out;
}

}  // namespace sysid
