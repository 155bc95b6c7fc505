// Fixed-size matrices and the few operations on covariances that every filter shares.
#pragma once

#include <Eigen/Dense>
#include <cmath>

namespace sysid {

template <int N>
using Vec = Eigen::Matrix<double, N, 1>;
template <int R, int C>
using Mat = Eigen::Matrix<double, R, C>;

/// Rounding makes a covariance slightly unsymmetric; left alone it grows.
template <int N>
void symmetrise(Mat<N, N>& P) {
    for (int j = 1; j < N; ++j)
        for (int i = 0; i < j; ++i) P(i, j) = P(j, i) = 0.5 * (P(i, j) + P(j, i));
}

/// Cholesky factor of `S`; false where `S` is not positive definite.
/// Plain loops over a size the compiler knows, along columns as they are stored: several times
/// faster than a general factorisation.
template <int N>
bool cholesky(const Mat<N, N>& S, Mat<N, N>& lower) {
    lower.setZero();
    for (int j = 0; j < N; ++j) {
        double* column = lower.data() + N * j;
        for (int i = j; i < N; ++i) column[i] = S(i, j);
        for (int k = 0; k < j; ++k) {
            const double* before = lower.data() + N * k;
            const double share = before[j];
            for (int i = j; i < N; ++i) column[i] -= before[i] * share;
        }
        if (!(column[j] > 0.0)) return false;
        column[j] = std::sqrt(column[j]);
        const double per_pivot = 1.0 / column[j];
        for (int i = j + 1; i < N; ++i) column[i] *= per_pivot;
    }
    return true;
}

/// The same and the inverse of the factor.
template <int N>
bool cholesky(const Mat<N, N>& S, Mat<N, N>& lower, Mat<N, N>& inverse) {
    inverse.setZero();
    if (!cholesky<N>(S, lower)) return false;
    for (int j = 0; j < N; ++j) inverse(j, j) = 1.0 / lower(j, j);
    for (int j = 0; j < N; ++j)
        for (int i = j + 1; i < N; ++i) {
            double s = 0.0;
            for (int k = j; k < i; ++k) s += lower(i, k) * inverse(k, j);
            inverse(i, j) = -s * inverse(i, i);
        }
    return true;
}

/// A reading surer than the prediction by more than this would leave of some variances what
/// rounding made of them.
constexpr double kSurest = 1e-12;

/// Makes a covariance again of a symmetric matrix that rounding took its positive definiteness:
/// eigenvalues of its correlations below `least` become `least`, which never makes anything surer.
/// Returns the lowest eigenvalue there was; NaN, and `P` untouched,
/// where an element is not finite.
double lift_correlations(double* P, int n, double least);

template <int N>
double lift_correlations(Mat<N, N>& P, double least) {
    return lift_correlations(P.data(), N, least);
}

/// S^-1 B of a symmetric S of at most 16 rows, without negative eigenvalues but for rounding.
/// Directions in which S is zero get none of it. `B` becomes the result, column after column.
void solve_symmetric(const double* S, int n, double* B, int columns);

template <int N, int M>
Mat<N, M> solved_by(const Mat<N, N>& S, Mat<N, M> B) {
    static_assert(N <= 16, "too large for what solves it");
    solve_symmetric(S.data(), N, B.data(), M);
    return B;
}

/// Eigenvalues in rising order, and the eigenvectors that belong to them.
template <class Values, class Vectors>
struct Spectrum {
    Values values;
    Vectors vectors;
};

/// Of a symmetric matrix. Its algorithm is long: it is compiled once, for all sizes.
Spectrum<Eigen::VectorXd, Eigen::MatrixXd> spectrum(const Eigen::MatrixXd& S);

template <int N>
Spectrum<Vec<N>, Mat<N, N>> spectrum(const Mat<N, N>& S) {
    const auto any = spectrum(Eigen::MatrixXd(S));
    return {any.values, any.vectors};
}

}  // namespace sysid
