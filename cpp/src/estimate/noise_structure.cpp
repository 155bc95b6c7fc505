#include "sysid/estimate/noise_structure.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace sysid {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

NoiseForm::NoiseForm(std::vector<int> scale, std::vector<int> block, VectorXd floor)
    : scale_(std::move(scale)),
      block_(std::move(block)),
      floor_(std::move(floor)),
      n_(floor_.size()) {}

bool NoiseForm::alone(Index i) const {
    for (Index j = 0; j < n_; ++j)
        if (j != i && block(j) == block(i)) return false;
    return true;
}

bool NoiseForm::first_of_block(Index i) const {
    for (Index j = 0; j < i; ++j)
        if (block(j) == block(i)) return false;
    return !alone(i);
}

bool NoiseForm::uncorrelated() const {
    for (Index i = 0; i < n_; ++i)
        if (!alone(i)) return false;
    return true;
}

MatrixXd NoiseForm::admitted(MatrixXd C, const MatrixXd& now) const {
    for (Index i = 0; i < n_; ++i)
        for (Index j = 0; j < n_; ++j)
            if (block(i) != block(j)) C(i, j) = 0.0;
    const VectorXd given = C.diagonal();
    for (Index i = 0; i < n_; ++i)
        C(i, i) = scale(i) == kFixedNoise ? now(i, i) : lifted_variance(i, given);
    for (Index i = 0; i < n_; ++i)
        if (first_of_block(i)) lift_block(i, C);
    return C;
}

MatrixXd NoiseForm::best(const AnySquareSum& squares, const MatrixXd& now) const {
    MatrixXd out = squares.sum / std::max(squares.samples, 1.0);
    for (Index i = 0; i < n_; ++i)
        if (scale(i) != kFixedNoise && alone(i)) out(i, i) = tied_variance(i, squares, now);
    return admitted(std::move(out), now);
}

// Only samples that tell something count: the others would hold the old value back.
double NoiseForm::tied_variance(Index i, const AnySquareSum& squares, const MatrixXd& now) const {
    double sum = 0.0, n = 0.0;
    for (Index j = 0; j < n_; ++j) {
        if (scale(j) != scale(i)) continue;
        sum += squares.sum(j, j) / now(j, j) - (squares.samples - squares.count[j]);
        n += squares.count[j];
    }
    return n > 0.0 ? sum / n * now(i, i) : now(i, i);
}

// Tied variances are lifted together, so that their ratio stays.
double NoiseForm::lifted_variance(Index i, const VectorXd& given) const {
    double lift = 1.0;
    for (Index j = 0; j < n_; ++j)
        if (j != i && scale(j) == scale(i)) lift = std::max(lift, floor_[j] / given[j]);
    return std::max(lift * given[i], floor_[i]);  // a variance of zero alone is lifted as well
}

// The best covariance that is nowhere below the floor: eigenvalues, measured by the floor, lifted
// to it.
void NoiseForm::lift_block(Index first, MatrixXd& C) const {
    MatrixXd scaled = MatrixXd::Identity(n_, n_);
    const auto each = [&](auto&& act) {
        for (Index i = first; i < n_; ++i)
            for (Index j = first; j < n_; ++j)
                if (block(i) == block(first) && block(j) == block(first))
                    act(i, j, std::sqrt(floor_[i] * floor_[j]));
    };
    each([&](Index i, Index j, double f) { scaled(i, j) = C(i, j) / f; });
    const auto [values, vectors] = spectrum(scaled);
    if (values[0] >= 1.0) return;
    scaled = vectors * values.cwiseMax(1.0).asDiagonal() * vectors.transpose();
    each([&](Index i, Index j, double f) { C(i, j) = scaled(i, j) * f; });
}

}  // namespace sysid
