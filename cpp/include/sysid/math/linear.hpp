// Fixed-size matrices and the few operations on covariances that every filter shares.
#pragma once

#include <Eigen/Dense>

namespace sysid {

template <int N>
using Vec = Eigen::Matrix<double, N, 1>;
template <int R, int C>
using Mat = Eigen::Matrix<double, R, C>;

/// Rounding makes a covariance slightly unsymmetric; left alone it grows.
template <int N>
void symmetrise(Mat<N, N>& P) {
    P = (0.5 * (P + P.transpose())).eval();
}

}  // namespace sysid
