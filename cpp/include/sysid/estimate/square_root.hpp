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
    const Mat<M, N> tall = A.transpose();
    const Eigen::HouseholderQR<Mat<M, N>> qr(tall);
    Mat<N, N> L =
        qr.matrixQR().template topRows<N>().template triangularView<Eigen::Upper>().transpose();
    for (int i = 0; i < N; ++i)
        if (L(i, i) < 0.0) L.col(i) *= -1.0;
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
    if (!(u.lower.diagonal().minCoeff() > 0.0))
        throw NumericalFailure("the innovation covariance is not positive definite", sample);
    const auto solver = u.lower.template triangularView<Eigen::Lower>();
    const Mat<NY, NY> whitening = solver.solve(Mat<NY, NY>::Identity());
    u.information = whitening.transpose() * whitening;
    u.gain = lower.template block<NX, NY>(NY, 0) * whitening;
    const Vec<NY> white = whitening * u.innovation;
    u.squares = white.squaredNorm();
    u.determinant = u.lower.diagonal().prod();
    u.determinant *= u.determinant;
    x += u.gain * u.innovation;
    L = lower.template bottomRightCorner<NX, NX>();
}

}  // namespace sysid
