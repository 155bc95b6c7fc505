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

/// S^-1 X. States without noise make a predicted covariance singular: a pivoted factorisation
/// stands that, an inverse does not, though it is much faster.
template <int NX>
Mat<NX, NX> solved_by_covariance(const Mat<NX, NX>& S, const Mat<NX, NX>& X) {
    Mat<NX, NX> lower, whitening;
    const bool regular = cholesky<NX>(S, lower, whitening) &&
                         (lower.diagonal().array().square() > 1e-9 * S.diagonal().array()).all();
    if (!regular) return S.ldlt().solve(X);
    return whitening.transpose() * (whitening * X);
}

/// `Step` is a `StateStep`. `ridge` is added to the predicted covariance where it is inverted.
template <class Step, int NX = decltype(Step::mean)::RowsAtCompileTime>
std::vector<SmoothedStep<NX>> smooth(const std::vector<Step>& steps, double ridge = 0.0) {
    std::vector<SmoothedStep<NX>> out(steps.size());
    if (steps.empty()) return out;
    const std::size_t last = steps.size() - 1;
    out[last].mean = steps[last].mean;
    out[last].covariance = steps[last].covariance;
    out[0].lag_one.setZero();
    for (std::size_t k = last; k-- > 0;) {
        const auto& now = steps[k];
        const auto& next = steps[k + 1];
        const Mat<NX, NX> inverted = next.predicted_covariance + ridge * Mat<NX, NX>::Identity();
        const Mat<NX, NX> J =
            solved_by_covariance<NX>(inverted, next.transition * now.covariance).transpose();
        out[k].mean = now.mean + J * (out[k + 1].mean - next.predicted_mean);
        out[k].covariance = now.covariance +
                            J * (out[k + 1].covariance - next.predicted_covariance) * J.transpose();
        symmetrise(out[k].covariance);
        out[k + 1].lag_one = out[k + 1].covariance * J.transpose();
    }
    return out;
}

}  // namespace sysid
