// Square-root filtering: the Cholesky factor is carried, a QR decomposition replaces every sum of
// covariances (array algorithm, Kailath, Sayed & Hassibi, Linear Estimation, ch. 12). Nothing is
// ever subtracted, so the covariance cannot lose its positive definiteness.
#pragma once

#include <cmath>

#include "sysid/estimate/unscented.hpp"

namespace sysid {

/// Lower factor of A A' with a positive diagonal.
template <int N, int M>
Mat<N, N> lower_of(const Mat<N, M>& A) {
    static_assert(M >= N, "the array has too few columns");
    // Rows of A as columns: a reflection leaves of each what stands in its triangle (Golub & Van
    // Loan, Matrix Computations (4th ed.), algorithm 5.2.1). Plain loops over sizes the compiler
    // knows.
    Mat<M, N> tall = A.transpose();
    Mat<N, N> L = Mat<N, N>::Zero();
    for (int k = 0; k < N; ++k) {
        double rest = 0.0;
        for (int i = k + 1; i < M; ++i) rest += tall(i, k) * tall(i, k);
        const double first = tall(k, k);
        const double length = std::sqrt(first * first + rest);
        L(k, k) = length;
        // Away from zero, where nothing cancels. A column of zeros needs no reflection.
        const double pivot = first + std::copysign(length, first);
        const double share = length > 0.0 ? 1.0 / (length * std::abs(pivot)) : 0.0;  // 2 / v'v
        tall(k, k) = pivot;
        for (int j = k + 1; j < N; ++j) {
            double along = 0.0;
            for (int i = k; i < M; ++i) along += tall(i, k) * tall(i, j);
            for (int i = k; i < M; ++i) tall(i, j) -= share * along * tall(i, k);
            // The reflection sets the pivot to minus its sign times the length: turned to plus.
            L(j, k) = -std::copysign(1.0, first) * tall(k, j);
        }
    }
    return L;
}

/// Replaces (x, L L') by the prediction that `t`, the transform of the motion, gives.
template <int NX>
void square_root_predict(const Transformed<NX, NX>& t, Vec<NX>& x, Mat<NX, NX>& L,
                         const Mat<NX, NX>& noise_lower, const SigmaWeights& w) {
    Mat<NX, 3 * NX + 1> array;
    array.col(0) = std::sqrt(w.covariance_centre) * t.centre;
    array.template middleCols<NX>(1) = std::sqrt(w.other) * t.plus;
    array.template middleCols<NX>(1 + NX) = std::sqrt(w.other) * t.minus;
    array.template rightCols<NX>() = noise_lower;
    x = t.mean;
    L = lower_of<NX, 3 * NX + 1>(array);
}

/// Measurement update of (x, L L') by `t`, the transform of the expected measurement; NaN marks a
/// missing element.
template <int NX, int NY>
void square_root_update(const Transformed<NX, NY>& t, Vec<NX>& x, Mat<NX, NX>& L, const Vec<NY>& y,
                        const Mat<NY, NY>& noise_lower, const SigmaWeights& w, std::size_t sample,
                        Update<NX, NY>& u) {
    // What the regression line leaves of each sigma point; H dx = H L (+-spread e_i).
    Mat<NX + NY, 3 * NX + NY + 1> array = Mat<NX + NY, 3 * NX + NY + 1>::Zero();
    array.template block<NY, NX>(0, 0) = t.slope_times_L;
    array.template block<NX, NX>(NY, 0) = L;
    array.template block<NY, NY>(0, NX) = noise_lower;
    array.template block<NY, 1>(0, NX + NY) = std::sqrt(w.covariance_centre) * t.centre;
    array.template block<NY, NX>(0, NX + NY + 1) =
        std::sqrt(w.other) * (t.plus - w.spread * t.slope_times_L);
    array.template block<NY, NX>(0, 2 * NX + NY + 1) =
        std::sqrt(w.other) * (t.minus + w.spread * t.slope_times_L);
    u.observed = NY;
    u.innovation = y - t.mean;
    u.observation = t.slope_times_L;  // times the inverse of the old factor, below
    for (int i = 0; i < NY; ++i) {
        if (!std::isnan(y[i])) continue;
        --u.observed;
        u.innovation[i] = 0.0;
        u.observation.row(i).setZero();
        array.row(i).setZero();
        array(i, NX + i) = 1.0;
    }
    if (!u.innovation.allFinite() || !array.allFinite())
        throw NumericalFailure("the innovation is not finite", sample);
    solve_from_the_right<NY, NX>(L, u.observation);
    const Mat<NX + NY, NX + NY> lower = lower_of<NX + NY, 3 * NX + NY + 1>(array);
    u.lower = lower.template topLeftCorner<NY, NY>();
    u.determinant = 1.0;
    for (int i = 0; i < NY; ++i) {
        if (!(u.lower(i, i) > 0.0))
            throw NumericalFailure("the innovation covariance is not positive definite", sample);
        u.determinant *= u.lower(i, i) * u.lower(i, i);
    }
    Mat<NY, NY> whitening = Mat<NY, NY>::Identity();
    solve_from_the_right<NY, NY>(u.lower, whitening);
    u.information = transposed_times<NY, NY, NY>(whitening, whitening);
    const Mat<NX, NY> below = lower.template block<NX, NY>(NY, 0);
    u.gain = times<NX, NY, NY>(below, whitening);
    const Vec<NY> white = times<NY, NY, 1>(whitening, u.innovation);
    u.squares = white.squaredNorm();
    add_product<NX, NY, 1>(u.gain.data(), u.innovation.data(), 1.0, x.data());
    L = lower.template bottomRightCorner<NX, NX>();
}

}  // namespace sysid
