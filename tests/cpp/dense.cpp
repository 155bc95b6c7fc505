#include "dense.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <utility>

namespace sysid::test {
namespace {

// Each kind of operand of a product is compiled anew: here all are of one kind.
Eigen::MatrixXd times(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) { return a * b; }

Eigen::MatrixXd transposed(const Eigen::MatrixXd& a) { return a.transpose(); }

/// A^-1 B for a covariance A.
Eigen::MatrixXd solved(const Eigen::MatrixXd& A, const Eigen::MatrixXd& B) {
    return A.llt().solve(B);
}

}  // namespace

std::vector<std::complex<double>> eigenvalues(const Eigen::MatrixXd& A) {
    const Eigen::VectorXcd values = A.eigenvalues();
    return {values.begin(), values.end()};
}

double spectral_radius(const Eigen::MatrixXd& A) {
    double largest = 0.0;
    for (const std::complex<double>& value : eigenvalues(A))
        largest = std::max(largest, std::abs(value));
    return largest;
}

Eigen::VectorXd symmetric_eigenvalues(const Eigen::MatrixXd& A) {
    return Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(A, Eigen::EigenvaluesOnly).eigenvalues();
}

Stacked::Stacked(const Small& s, const Vec<3>& x0, const Mat<3, 3>& P0) {
    const auto n = static_cast<int>(s.size());
    states.resize(3 * n);
    state_covariance.setZero(3 * n, 3 * n);
    Vec<3> x = x0;
    Mat<3, 3> P = P0;
    for (int k = 0; k < n; ++k) {
        if (k > 0) {
            x = s.A * x + s.b[static_cast<std::size_t>(k)];
            P = s.A * P * s.A.transpose() + s.Q;
        }
        states.segment<3>(3 * k) = x;
        Mat<3, 3> across = P;  // cov(x(j), x(k)) = A^(j-k) P(k)
        for (int j = k; j < n; ++j) {
            state_covariance.block<3, 3>(3 * j, 3 * k) = across;
            state_covariance.block<3, 3>(3 * k, 3 * j) = across.transpose();
            across = s.A * across;
        }
    }
    std::vector<std::pair<int, int>> there;  // (sample, sensor)
    for (int k = 0; k < n; ++k)
        for (int i = 0; i < 2; ++i)
            if (!std::isnan(s.y[static_cast<std::size_t>(k)][i])) there.emplace_back(k, i);
    const auto m = static_cast<int>(there.size());
    H.setZero(m, 3 * n);
    measured.resize(m);
    Eigen::VectorXd offset(m);
    Eigen::MatrixXd noise = Eigen::MatrixXd::Zero(m, m);
    for (int row = 0; row < m; ++row) {
        const auto [k, i] = there[static_cast<std::size_t>(row)];
        H.block(row, 3 * k, 1, 3) = s.H.row(i);
        measured[row] = s.y[static_cast<std::size_t>(k)][i];
        offset[row] = s.d[static_cast<std::size_t>(k)][i];
        for (int other = 0; other < m; ++other) {
            const auto [l, j] = there[static_cast<std::size_t>(other)];
            if (l == k) noise(row, other) = s.R(i, j);
        }
    }
    mean = times(H, states) + offset;
    covariance = times(times(H, state_covariance), transposed(H)) + noise;
}

double Stacked::log_density() const {
    const Eigen::VectorXd away = measured - mean;
    const Eigen::VectorXd pulled = solved(covariance, away);
    double log_determinant = 0.0;
    for (const double value : symmetric_eigenvalues(covariance)) log_determinant += std::log(value);
    return -0.5 *
           (away.dot(pulled) + log_determinant + static_cast<double>(measured.size()) * kLogTwoPi);
}

Stacked::Posterior Stacked::posterior() const {
    const Eigen::MatrixXd cross = times(state_covariance, transposed(H));
    return {states + times(cross, solved(covariance, measured - mean)),
            state_covariance - times(cross, solved(covariance, transposed(cross)))};
}

void TextbookFilter::predict(const Small& s, std::size_t k) {
    mean = times(s.A, mean) + s.b[k];
    covariance = times(times(s.A, covariance), s.A.transpose()) + s.Q;
}

void TextbookFilter::update(const Small& s, std::size_t k) {
    there.clear();
    for (int i = 0; i < 2; ++i)
        if (!std::isnan(s.y[k][i])) there.push_back(i);
    const auto m = static_cast<int>(there.size());
    const Vec<2> all = s.y[k] - times(s.H, mean) - s.d[k];
    innovation.resize(m);
    Eigen::MatrixXd H(m, 3), R(m, m);
    for (int row = 0; row < m; ++row) {
        const int i = there[static_cast<std::size_t>(row)];
        innovation[row] = all[i];
        H.row(row) = s.H.row(i);
        for (int other = 0; other < m; ++other)
            R(row, other) = s.R(i, there[static_cast<std::size_t>(other)]);
    }
    const Eigen::MatrixXd HP = times(H, covariance);
    gain = transposed(solved(times(HP, transposed(H)) + R, HP));
    mean += times(gain, innovation);
    covariance -= times(gain, HP);
}

}  // namespace sysid::test
