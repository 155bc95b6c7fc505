// The unscented transform, and the two halves of an unscented Kalman filter, for fixed sizes.
//
// The update is statistical linear regression (Lefebvre et al., 2002): the sigma points give the
// matrix H and the excess W that make y = H x + w + v the best linear description of the model over
// the spread of x. Missing elements, Joseph form and likelihood are then those of `kalman.hpp`, and
// on a linear model W is zero and the Kalman filter results.
#pragma once

#include <cmath>

#include "sysid/estimate/kalman.hpp"

namespace sysid {

/// Weights of 2 N + 1 points at the mean and at +-spread times the columns of a Cholesky factor.
struct SigmaWeights {
    double spread, mean_centre, covariance_centre, other;

    /// All weights equal, so that covariances stay positive definite (kappa = 1 of Julier).
    static SigmaWeights even(int n) {
        const double w = 1.0 / (n + 1.0);
        return {std::sqrt(n + 1.0), w, w, 0.5 * w};
    }
    /// Points at sqrt(3) standard deviations, where along every axis they have the fourth moment of
    /// a Gaussian however many states there are; those of `even` move outwards with N. The centre,
    /// whose weight in the mean is negative for N > 3, has none in covariances: these stay positive
    /// definite, and err on the large side where the model is curved.
    static SigmaWeights near(int n) { return {std::sqrt(3.0), 1.0 - n / 3.0, 0.0, 1.0 / 6.0}; }
    /// Scaled transform of van der Merwe (2004), kappa = 0; small alpha makes huge weights.
    static SigmaWeights scaled(int n, double alpha, double beta) {
        const double scale = alpha * alpha * n;
        const double centre = 1.0 - n / scale;
        return {std::sqrt(scale), centre, centre + 1.0 - alpha * alpha + beta, 0.5 / scale};
    }
};

/// Lower factor of a covariance. Rounding may leave one that is singular to the last digit: its
/// correlations are then lifted to positive ones. Throws where more than rounding is wrong.
template <int N>
Mat<N, N> factor_of(const Mat<N, N>& P, std::size_t sample) {
    constexpr double kRounding = 1e-9;
    Mat<N, N> lower, inverse;
    if (!P.allFinite()) throw NumericalFailure("the covariance is not finite", sample);
    if (cholesky<N>(P, lower, inverse)) return lower;
    Mat<N, N> mended = P;
    if (!(lift_correlations<N>(mended, 1e-3 * kRounding) > -kRounding))
        throw NumericalFailure("the covariance is not positive definite", sample);
    if (!cholesky<N>(mended, lower, inverse))
        throw NumericalFailure("the covariance is not positive definite", sample);
    return lower;
}

/// Any root of a covariance that may be singular, such as that of a noise.
template <int N>
Mat<N, N> root_of(const Mat<N, N>& Q, std::size_t sample) {
    Mat<N, N> lower, inverse;
    if (cholesky<N>(Q, lower, inverse)) return lower;
    if (!Q.allFinite()) throw NumericalFailure("a noise covariance is not finite", sample);
    const Eigen::SelfAdjointEigenSolver<Mat<N, N>> eigen(Q);
    const Vec<N>& values = eigen.eigenvalues();
    if (values[0] < -1e-12 * std::abs(values[N - 1]))
        throw NumericalFailure("a noise covariance has a negative variance", sample);
    return eigen.eigenvectors() * values.cwiseMax(0.0).cwiseSqrt().asDiagonal();
}

/// Mean of f over the sigma points of (x, L L'), and the deviations of its values from it.
template <int NX, int NZ>
struct Transformed {
    Vec<NZ> mean;
    Vec<NZ> centre;             // deviation of the value at the mean
    Mat<NZ, NX> plus, minus;    // deviations at x + spread L_i and x - spread L_i
    Mat<NZ, NX> slope_times_L;  // regression matrix H times L

    Mat<NZ, NZ> covariance(const SigmaWeights& w) const {
        Mat<NZ, NZ> P = w.covariance_centre * centre * centre.transpose();
        P.noalias() += w.other * plus * plus.transpose();
        P.noalias() += w.other * minus * minus.transpose();
        return P;
    }
};

template <int NZ, int NX, class F>
Transformed<NX, NZ> transform(F&& f, const Vec<NX>& x, const Mat<NX, NX>& L,
                              const SigmaWeights& w) {
    Transformed<NX, NZ> t;
    t.centre = f(x);
    t.mean = w.mean_centre * t.centre;
    for (int i = 0; i < NX; ++i) {
        t.plus.col(i) = f(Vec<NX>(x + w.spread * L.col(i)));
        t.minus.col(i) = f(Vec<NX>(x - w.spread * L.col(i)));
        t.mean += w.other * (t.plus.col(i) + t.minus.col(i));
    }
    t.slope_times_L = (w.other * w.spread) * (t.plus - t.minus);
    t.centre -= t.mean;
    t.plus.colwise() -= t.mean;
    t.minus.colwise() -= t.mean;
    return t;
}

/// Replaces X by X L^-1 of a lower factor L.
template <int R, int N>
void solve_from_the_right(const Mat<N, N>& L, Mat<R, N>& X) {
    const Mat<N, R> solved =
        L.transpose().template triangularView<Eigen::Upper>().solve(Mat<N, R>(X.transpose()));
    X = solved.transpose();
}

/// Best line through the values at the sigma points: y = expected + H (x - mean) + w + v, with the
/// variance of w, what the line leaves, added to that of v.
template <int NX, int NY>
struct Regression {
    Vec<NY> expected;
    Mat<NY, NX> H;
    Mat<NY, NY> noise;

    static Regression of(const Transformed<NX, NY>& t, const Mat<NX, NX>& L, const Mat<NY, NY>& R,
                         const SigmaWeights& w) {
        Regression out{t.mean, t.slope_times_L, R};
        solve_from_the_right<NY, NX>(L, out.H);
        out.noise += t.covariance(w) - t.slope_times_L * t.slope_times_L.transpose();
        symmetrise(out.noise);
        return out;
    }
    Vec<NY> innovation_variance(const Mat<NX, NX>& P) const {
        return (H * P).cwiseProduct(H).rowwise().sum() + noise.diagonal();
    }
};

}  // namespace sysid
