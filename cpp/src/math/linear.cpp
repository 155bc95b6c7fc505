#include "sysid/math/linear.hpp"

namespace sysid {

double lift_correlations(double* P, int n, double least) {
    Eigen::Map<Eigen::MatrixXd> covariance(P, n, n);
    if (!covariance.allFinite()) return std::nan("");
    const Eigen::VectorXd size = covariance.diagonal().cwiseAbs().cwiseSqrt();
    const Eigen::VectorXd unit = size.cwiseMax(1e-150);
    const Eigen::MatrixXd correlation =
        unit.cwiseInverse().asDiagonal() * covariance * unit.cwiseInverse().asDiagonal();
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(correlation);
    const Eigen::VectorXd lifted = eigen.eigenvalues().cwiseMax(least);
    covariance = unit.asDiagonal() * eigen.eigenvectors() * lifted.asDiagonal() *
                 eigen.eigenvectors().transpose() * unit.asDiagonal();
    for (int j = 0; j < n; ++j)
        for (int i = 0; i < j; ++i)
            covariance(i, j) = covariance(j, i) = 0.5 * (covariance(i, j) + covariance(j, i));
    return eigen.eigenvalues()[0];
}

}  // namespace sysid
