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
    Mat<N, N> lower;
    if (!P.allFinite()) throw NumericalFailure("the covariance is not finite", sample);
    if (cholesky<N>(P, lower)) return lower;
    Mat<N, N> repaired = P;
    if (!(lift_correlations<N>(repaired, 1e-3 * kRounding) > -kRounding))
        throw NumericalFailure("the covariance is not positive definite", sample);
    if (!cholesky<N>(repaired, lower))
        throw NumericalFailure("the covariance is not positive definite", sample);
    return lower;
}

/// Any root of a covariance that may be singular, such as that of a noise.
template <int N>
Mat<N, N> root_of(const Mat<N, N>& Q, std::size_t sample) {
    Mat<N, N> lower;
    if (cholesky<N>(Q, lower)) return lower;
    if (!Q.allFinite()) throw NumericalFailure("a noise covariance is not finite", sample);
    const auto [values, vectors] = spectrum<N>(Q);
    if (values[0] < -1e-12 * std::abs(values[N - 1]))
        throw NumericalFailure("a noise covariance has a negative variance", sample);
    return vectors * values.cwiseMax(0.0).cwiseSqrt().asDiagonal();
}

/// Mean of f over the sigma points of (x, L L'), and the deviations of its values from it.
template <int NX, int NZ>
struct Transformed {
    Vec<NZ> mean;
    Vec<NZ> centre;             // deviation of the value at the mean
    Mat<NZ, NX> plus, minus;    // deviations at x + spread L_i and x - spread L_i
    Mat<NZ, NX> slope_times_L;  // regression matrix H times L

    Mat<NZ, NZ> covariance(const SigmaWeights& w) const {
        Mat<NZ, NZ> P = Mat<NZ, NZ>::Zero();
        add_square<NZ, NX>(plus, P);
        add_square<NZ, NX>(minus, P);
        for (int j = 1; j < NZ; ++j)
            for (int i = 0; i < j; ++i) P(i, j) = P(j, i);
        for (int j = 0; j < NZ; ++j)
            for (int i = 0; i < NZ; ++i)
                P(i, j) = w.covariance_centre * centre[i] * centre[j] + w.other * P(i, j);
        return P;
    }
};

template <int NZ, int NX, class F>
Transformed<NX, NZ> transform(F&& f, const Vec<NX>& x, const Mat<NX, NX>& L,
                              const SigmaWeights& w) {
    Transformed<NX, NZ> t;
    t.centre = f(x);
    for (int n = 0; n < NZ; ++n) t.mean[n] = w.mean_centre * t.centre[n];
    for (int i = 0; i < NX; ++i) {
        Vec<NX> beyond, before;
        for (int n = 0; n < NX; ++n) {
            beyond[n] = x[n] + w.spread * L(n, i);
            before[n] = x[n] - w.spread * L(n, i);
        }
        const Vec<NZ> plus = f(beyond), minus = f(before);
        for (int n = 0; n < NZ; ++n) {
            t.plus(n, i) = plus[n];
            t.minus(n, i) = minus[n];
            t.mean[n] += w.other * (plus[n] + minus[n]);
            t.slope_times_L(n, i) = w.other * w.spread * (plus[n] - minus[n]);
        }
    }
    for (int n = 0; n < NZ; ++n) t.centre[n] -= t.mean[n];
    for (int i = 0; i < NX; ++i)
        for (int n = 0; n < NZ; ++n) {
            t.plus(n, i) -= t.mean[n];
            t.minus(n, i) -= t.mean[n];
        }
    return t;
}

/// Replaces X by X L^-1 of a lower factor L.
template <int R, int N>
void solve_from_the_right(const Mat<N, N>& L, Mat<R, N>& X) {
    for (int j = N; j-- > 0;) {
        const double per_pivot = 1.0 / L(j, j);
        for (int k = j + 1; k < N; ++k)
            for (int i = 0; i < R; ++i) X(i, j) -= X(i, k) * L(k, j);
        for (int i = 0; i < R; ++i) X(i, j) *= per_pivot;
    }
}

/// Diagonal of H P H'.
template <int NX, int NY>
Vec<NY> seen_variance(const Mat<NY, NX>& H, const Mat<NX, NX>& P) {
    const Mat<NY, NX> HP = times<NY, NX, NX>(H, P);
    Vec<NY> out = Vec<NY>::Zero();
    for (int j = 0; j < NX; ++j)
        for (int i = 0; i < NY; ++i) out[i] += HP(i, j) * H(i, j);
    return out;
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
        out.noise +=
            less_times_transposed<NY, NX, NY>(t.covariance(w), t.slope_times_L, t.slope_times_L);
        symmetrise(out.noise);
        return out;
    }
    Vec<NY> innovation_variance(const Mat<NX, NX>& P) const {
        Vec<NY> out = seen_variance<NX, NY>(H, P);
        for (int i = 0; i < NY; ++i) out[i] += noise(i, i);
        return out;
    }
};

}  // namespace sysid
