// Rauch-Tung-Striebel smoother over the steps an extended Kalman filter has kept.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "sysid/estimate/kalman.hpp"

namespace sysid {

template <int NX>
struct SmoothedStep {
    Vec<NX> mean;
    Mat<NX, NX> covariance;
    Mat<NX, NX> lag_one;  // cov(x(k), x(k-1)) given all measurements; zero for the first sample
};

/// One over the standard deviations of a covariance; zero for what is certain.
template <int NX>
Vec<NX> inverse_sizes(const Mat<NX, NX>& C) {
    return C.diagonal().unaryExpr([](double v) { return v > 0.0 ? 1.0 / std::sqrt(v) : 0.0; });
}

/// S^-1 X, by the inverse of a Cholesky factor, which is quick. States without noise make a
/// predicted covariance singular: it is then scaled to correlations, and the pseudo-inverse of
/// these stands for the inverse. Directions surer than `kSurest` get no gain: an inverse would
/// enlarge the rounding of all later samples, and of the covariance more than of what it gains.
template <int NX>
Mat<NX, NX> solved_by_covariance(const Mat<NX, NX>& S, const Mat<NX, NX>& X) {
    Mat<NX, NX> lower, whitening;
    const bool regular = cholesky<NX>(S, lower, whitening) &&
                         (lower.diagonal().array().square() > 1e-9 * S.diagonal().array()).all();
    if (regular) return whitening.transpose() * (whitening * X);
    const Vec<NX> per_size = inverse_sizes<NX>(S);
    const Mat<NX, NX> correlation = per_size.asDiagonal() * S * per_size.asDiagonal();
    const Eigen::SelfAdjointEigenSolver<Mat<NX, NX>> e(correlation);
    const double least = kSurest * std::max(e.eigenvalues()[NX - 1], 0.0);
    const Vec<NX> inverse =
        e.eigenvalues().unaryExpr([least](double v) { return v > least ? 1.0 / v : 0.0; });
    const Mat<NX, NX> scaled = per_size.asDiagonal() * e.eigenvectors();
    return scaled * (inverse.asDiagonal() * (scaled.transpose() * X));
}

/// L with L L' the covariance `C`, which rounding may have pushed off the edge of covariances:
/// scaled by the variances of the prediction it came from, it loses its negative eigenvalues.
template <int NX>
Mat<NX, NX> covariance_root(const Mat<NX, NX>& C, const Mat<NX, NX>& predicted) {
    Mat<NX, NX> lower, inverse;
    if (cholesky<NX>(C, lower, inverse)) return lower;
    const Vec<NX> per_size = inverse_sizes<NX>(predicted);
    const Mat<NX, NX> scaled = per_size.asDiagonal() * C * per_size.asDiagonal();
    const Eigen::SelfAdjointEigenSolver<Mat<NX, NX>> e(scaled);
    return predicted.diagonal().cwiseMax(0.0).cwiseSqrt().asDiagonal() * e.eigenvectors() *
           e.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal();
}

/// The covariance itself where it is one, else without its negative part.
template <int NX>
Mat<NX, NX> as_covariance(const Mat<NX, NX>& C, const Mat<NX, NX>& predicted) {
    Mat<NX, NX> lower, inverse;
    if (cholesky<NX>(C, lower, inverse)) return C;
    const Mat<NX, NX> root = covariance_root<NX>(C, predicted);
    return root * root.transpose();
}

/// Which sum the smoothed covariance is.
enum class SmoothedSum {
    kSquares,     // (I - J A) P (I - J A)' + J (Q + P_next) J', with the noise Q that entered
    kDifference,  // P + J (P_next - P_predicted) J', for any `transition`
};

/// `Step` is a `StateStep`. `ridge` is added to the predicted covariance where it is inverted.
///
/// The textbook's difference of covariances loses every figure, and the sign of variances, where
/// hardly any noise enters. The sum of squares equals it for the gain J = P A' P_predicted^-1, and
/// errs by the square of an error of J only (as Joseph's form of the measurement update does). No
/// variance of it can be negative, nor an eigenvalue beyond rounding: that of the predicted
/// covariance, since a smoothed variance may be far below what one rounds. It wants
/// P_predicted = A P A' + Q.
template <SmoothedSum kSum = SmoothedSum::kSquares, class Step,
          int NX = decltype(Step::mean)::RowsAtCompileTime>
std::vector<SmoothedStep<NX>> smooth(const std::vector<Step>& steps, double ridge = 0.0) {
    std::vector<SmoothedStep<NX>> out(steps.size());
    if (steps.empty()) return out;
    const std::size_t last = steps.size() - 1;
    out[last].mean = steps[last].mean;
    out[last].covariance =
        as_covariance<NX>(steps[last].covariance, steps[last].predicted_covariance);
    out[0].lag_one.setZero();
    for (std::size_t k = last; k-- > 0;) {
        const auto& now = steps[k];
        const auto& next = steps[k + 1];
        const Mat<NX, NX>& A = next.transition;
        const Mat<NX, NX> carried = A * now.covariance;
        const Mat<NX, NX> inverted = next.predicted_covariance + ridge * Mat<NX, NX>::Identity();
        const Mat<NX, NX> J = solved_by_covariance<NX>(inverted, carried).transpose();
        out[k].mean = now.mean + J * (out[k + 1].mean - next.predicted_mean);
        if constexpr (kSum == SmoothedSum::kDifference) {
            out[k].covariance =
                now.covariance +
                J * (out[k + 1].covariance - next.predicted_covariance) * J.transpose();
            symmetrise(out[k].covariance);
        } else {
            Mat<NX, NX> entered = next.predicted_covariance - carried * A.transpose();
            symmetrise(entered);
            Mat<NX, 3 * NX> roots;
            roots.template leftCols<NX>().noalias() =
                (Mat<NX, NX>::Identity() - J * A) *
                covariance_root<NX>(now.covariance, now.predicted_covariance);
            roots.template middleCols<NX>(NX).noalias() =
                J * covariance_root<NX>(entered, next.predicted_covariance);
            roots.template rightCols<NX>().noalias() =
                J * covariance_root<NX>(out[k + 1].covariance, next.predicted_covariance);
            for (int j = 0; j < NX; ++j)
                for (int i = 0; i <= j; ++i)
                    out[k].covariance(i, j) = out[k].covariance(j, i) =
                        roots.row(i).dot(roots.row(j));
        }
        out[k + 1].lag_one = out[k + 1].covariance * J.transpose();
    }
    return out;
}

}  // namespace sysid
