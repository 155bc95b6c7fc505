#include "sysid/math/linear.hpp"

namespace sysid {

Spectrum<Eigen::VectorXd, Eigen::MatrixXd> spectrum(const Eigen::MatrixXd& S) {
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(S);
    return {eigen.eigenvalues(), eigen.eigenvectors()};
}

void solve_symmetric(const double* S, int n, double* B, int columns) {
    using Square = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, 16, 16>;
    const Eigen::LDLT<Square> factor(Eigen::Map<const Eigen::MatrixXd>(S, n, n));
    for (int j = 0; j < columns; ++j) {
        Eigen::Map<Eigen::VectorXd> b(B + static_cast<std::ptrdiff_t>(j) * n, n);
        b = factor.solve(b).eval();
    }
}

double lift_correlations(double* P, int n, double least) {
    Eigen::Map<Eigen::MatrixXd> covariance(P, n, n);
    if (!covariance.allFinite()) return std::nan("");
    const Eigen::VectorXd size = covariance.diagonal().cwiseAbs().cwiseSqrt();
    const Eigen::VectorXd unit = size.cwiseMax(1e-150);
    const Eigen::MatrixXd correlation =
        unit.cwiseInverse().asDiagonal() * covariance * unit.cwiseInverse().asDiagonal();
    const auto [values, vectors] = spectrum(correlation);
    const Eigen::MatrixXd scaled = unit.asDiagonal() * vectors;
    covariance = scaled * values.cwiseMax(least).asDiagonal() * scaled.transpose();
    for (int j = 0; j < n; ++j)
        for (int i = 0; i < j; ++i)
            covariance(i, j) = covariance(j, i) = 0.5 * (covariance(i, j) + covariance(j, i));
    return values[0];
}

}  // namespace sysid
