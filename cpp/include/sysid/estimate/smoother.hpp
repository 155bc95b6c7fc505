// Rauch-Tung-Striebel smoother over the steps an extended Kalman filter has kept.
#pragma once

#include <algorithm>
#include <array>
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
    Vec<NX> out;
    for (int i = 0; i < NX; ++i) out[i] = C(i, i) > 0.0 ? 1.0 / std::sqrt(C(i, i)) : 0.0;
    return out;
}

/// C with row and column i multiplied by element i of `by`.
template <int NX>
Mat<NX, NX> rescaled(const Mat<NX, NX>& C, const Vec<NX>& by) {
    Mat<NX, NX> out;
    for (int j = 0; j < NX; ++j)
        for (int i = 0; i < NX; ++i) out(i, j) = by[i] * C(i, j) * by[j];
    return out;
}

/// A covariance with ones in place of the variances of states that are no states: their rows are
/// zeros, as where there is room for more states than a model has. `unused` says which these are.
template <int NX>
Mat<NX, NX> without_gaps(const Mat<NX, NX>& C, std::array<bool, NX>& unused) {
    Mat<NX, NX> out = C;
    for (int i = 0; i < NX; ++i) {
        bool zeros = true;
        for (int j = 0; j < NX; ++j) zeros = zeros && C(i, j) == 0.0 && C(j, i) == 0.0;
        unused[static_cast<std::size_t>(i)] = zeros;
        if (zeros) out(i, i) = 1.0;
    }
    return out;
}

/// S^-1 X, by the inverse of a Cholesky factor, which is quick. States without noise make a
/// predicted covariance singular: it is then scaled to correlations, and the pseudo-inverse of
/// these stands for the inverse. Directions surer than `kSurest` get no gain: an inverse would
/// enlarge the rounding of all later samples, and of the covariance more than of what it gains.
template <int NX>
Mat<NX, NX> solved_by_covariance(const Mat<NX, NX>& S, const Mat<NX, NX>& X) {
    Mat<NX, NX> lower, whitening;
    std::array<bool, NX> unused;
    bool regular = cholesky<NX>(without_gaps<NX>(S, unused), lower, whitening);
    for (int i = 0; i < NX; ++i) {
        regular = regular && lower(i, i) * lower(i, i) > 1e-9 * S(i, i);
        if (unused[static_cast<std::size_t>(i)]) whitening(i, i) = 0.0;
    }
    if (regular) return transposed_times<NX, NX, NX>(whitening, times<NX, NX, NX>(whitening, X));
    const Vec<NX> per_size = inverse_sizes<NX>(S);
    const auto e = spectrum<NX>(rescaled<NX>(S, per_size));
    const double least = kSurest * std::max(e.values[NX - 1], 0.0);
    Mat<NX, NX> scaled, weighed;
    for (int j = 0; j < NX; ++j) {
        const double inverse = e.values[j] > least ? 1.0 / e.values[j] : 0.0;
        for (int i = 0; i < NX; ++i) {
            scaled(i, j) = per_size[i] * e.vectors(i, j);
            weighed(i, j) = scaled(i, j) * inverse;
        }
    }
    return times<NX, NX, NX>(weighed, transposed_times<NX, NX, NX>(scaled, X));
}

/// L with L L' the covariance `C`, which rounding may have pushed off the edge of covariances:
/// scaled by the variances of the prediction it came from, it loses its negative eigenvalues.
template <int NX>
Mat<NX, NX> covariance_root(const Mat<NX, NX>& C, const Mat<NX, NX>& predicted) {
    Mat<NX, NX> lower, inverse;
    std::array<bool, NX> unused;
    if (cholesky<NX>(without_gaps<NX>(C, unused), lower, inverse)) {
        for (int i = 0; i < NX; ++i)
            if (unused[static_cast<std::size_t>(i)]) lower(i, i) = 0.0;
        return lower;
    }
    const auto e = spectrum<NX>(rescaled<NX>(C, inverse_sizes<NX>(predicted)));
    Mat<NX, NX> root;
    for (int j = 0; j < NX; ++j)
        for (int i = 0; i < NX; ++i)
            root(i, j) = std::sqrt(std::max(predicted(i, i), 0.0)) * e.vectors(i, j) *
                         std::sqrt(std::max(e.values[j], 0.0));
    return root;
}

/// The covariance itself where it is one, else without its negative part.
template <int NX>
Mat<NX, NX> as_covariance(const Mat<NX, NX>& C, const Mat<NX, NX>& predicted) {
    Mat<NX, NX> lower, inverse;
    std::array<bool, NX> unused;
    if (cholesky<NX>(without_gaps<NX>(C, unused), lower, inverse)) return C;
    const Mat<NX, NX> root = covariance_root<NX>(C, predicted);
    return times_transposed<NX, NX, NX>(root, root);
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
        const Mat<NX, NX> carried = times<NX, NX, NX>(A, now.covariance);
        Mat<NX, NX> inverted = next.predicted_covariance;
        for (int i = 0; i < NX; ++i) inverted(i, i) += ridge;
        const Mat<NX, NX> turned = solved_by_covariance<NX>(inverted, carried);
        const Mat<NX, NX> J = transposed<NX, NX>(turned);
        const Vec<NX> ahead = out[k + 1].mean - next.predicted_mean;
        out[k].mean = now.mean;
        add_product<NX, NX, 1>(J.data(), ahead.data(), 1.0, out[k].mean.data());
        Mat<NX, NX>& covariance = out[k].covariance;
        if constexpr (kSum == SmoothedSum::kDifference) {
            const Mat<NX, NX> change = out[k + 1].covariance - next.predicted_covariance;
            const Mat<NX, NX> half = times<NX, NX, NX>(J, change);
            covariance = now.covariance;
            add_product<NX, NX, NX>(half.data(), turned.data(), 1.0, covariance.data());
        } else {
            Mat<NX, NX> entered =
                less_times_transposed<NX, NX, NX>(next.predicted_covariance, carried, A);
            symmetrise(entered);
            Mat<NX, NX> kept = Mat<NX, NX>::Identity();
            add_product<NX, NX, NX>(J.data(), A.data(), -1.0, kept.data());
            covariance.setZero();
            const auto add_square = [&](const Mat<NX, NX>& from, const Mat<NX, NX>& root) {
                const Mat<NX, NX> half = times<NX, NX, NX>(from, root);
                const Mat<NX, NX> back = transposed<NX, NX>(half);
                add_product<NX, NX, NX>(half.data(), back.data(), 1.0, covariance.data());
            };
            add_square(kept, covariance_root<NX>(now.covariance, now.predicted_covariance));
            add_square(J, covariance_root<NX>(entered, next.predicted_covariance));
            add_square(J, covariance_root<NX>(out[k + 1].covariance, next.predicted_covariance));
        }
        symmetrise(covariance);
        out[k + 1].lag_one = times<NX, NX, NX>(out[k + 1].covariance, turned);
    }
    return out;
}

}  // namespace sysid
