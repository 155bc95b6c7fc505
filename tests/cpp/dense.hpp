// Linear algebra of any size, which tests compare with. The compiler takes seconds for each of
// these: they are compiled once, in dense.cpp.
#pragma once

#include <Eigen/Core>
#include <complex>
#include <vector>

#include "helpers.hpp"

namespace sysid::test {

/// Eigenvalues of a square matrix, in no order.
std::vector<std::complex<double>> eigenvalues(const Eigen::MatrixXd& A);

/// The largest absolute value among them.
double spectral_radius(const Eigen::MatrixXd& A);

/// Eigenvalues of a symmetric matrix, of which the lower triangle is read; the lowest one first.
Eigen::VectorXd symmetric_eigenvalues(const Eigen::MatrixXd& A);

/// A record of a linear system as one Gaussian vector: all states, and what is measured of them.
struct Stacked {
    Eigen::VectorXd states, mean, measured;  // of the states; of the readings
    Eigen::MatrixXd state_covariance, H, covariance;

    Stacked(const Small& s, const Vec<3>& x0, const Mat<3, 3>& P0);

    /// Logarithm of the density of all readings.
    double log_density() const;

    /// All states, given all readings.
    struct Posterior {
        Eigen::VectorXd mean;
        Eigen::MatrixXd covariance;
    };
    Posterior posterior() const;
};

/// Kalman's filter as a textbook has it: Anderson & Moore, Optimal Filtering, ch. 3. Missing rows
/// are left out, the gain comes by solving for it, P = (I - K H) P.
struct TextbookFilter {
    Eigen::VectorXd mean;
    Eigen::MatrixXd covariance;
    // Of the last update: the sensors that were there, and what belongs to each of them.
    std::vector<int> there;
    Eigen::VectorXd innovation;
    Eigen::MatrixXd gain;

    void predict(const Small& s, std::size_t k);
    void update(const Small& s, std::size_t k);
};

}  // namespace sysid::test
