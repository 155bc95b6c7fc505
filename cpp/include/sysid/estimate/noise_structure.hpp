// What may change in a noise covariance, and the best covariance of that form.
#pragma once

#include <array>
#include <vector>

#include "sysid/math/linear.hpp"

namespace sysid {

/// Sum of expected squares over `samples`, of which `count` told something of each element; the
/// others contributed the variance that was assumed. Of any size here, of a fixed one below.
struct AnySquareSum {
    Eigen::MatrixXd sum;
    double samples = 0.0;
    Eigen::VectorXd count;
};

template <int N>
struct SquareSum {
    Mat<N, N> sum = Mat<N, N>::Zero();
    double samples = 0.0;
    Vec<N> count = Vec<N>::Zero();

    /// One more sample that tells of all elements.
    void add_count() {
        samples += 1.0;
        count.array() += 1.0;
    }
    AnySquareSum any() const { return {sum, samples, count}; }
};

constexpr int kFixedNoise = -1;

/// Entries with the same `scale` number keep the ratio of their variances; those numbered
/// `kFixedNoise` keep their value. Entries with the same `block` number are correlated.
/// Blocks of more than one entry must be free and untied.
class NoiseForm {
  public:
    NoiseForm(std::vector<int> scale, std::vector<int> block, Eigen::VectorXd floor);

    bool uncorrelated() const;

    /// `C` without the correlations that this form does not have, lifted to the floor, and with the
    /// fixed variances of `now`.
    Eigen::MatrixXd admitted(Eigen::MatrixXd C, const Eigen::MatrixXd& now) const;

    /// The covariance C of this form of highest expected likelihood: it maximises
    /// -n log|C| - tr(C^-1 sum) over n samples. `now` is the one that was assumed.
    Eigen::MatrixXd best(const AnySquareSum& squares, const Eigen::MatrixXd& now) const;

  private:
    int scale(Eigen::Index i) const { return scale_[static_cast<std::size_t>(i)]; }
    int block(Eigen::Index i) const { return block_[static_cast<std::size_t>(i)]; }
    bool alone(Eigen::Index i) const;
    bool first_of_block(Eigen::Index i) const;
    double tied_variance(Eigen::Index i, const AnySquareSum& squares,
                         const Eigen::MatrixXd& now) const;
    double lifted_variance(Eigen::Index i, const Eigen::VectorXd& given) const;
    void lift_block(Eigen::Index first, Eigen::MatrixXd& C) const;

    std::vector<int> scale_, block_;
    Eigen::VectorXd floor_;
    Eigen::Index n_;
};

/// A `NoiseForm` of N entries.
template <int N>
struct NoiseStructure {
    std::array<int, N> scale;
    std::array<int, N> block;
    Vec<N> floor = Vec<N>::Constant(1e-12);  // smallest variance of each entry

    /// All entries free and uncorrelated.
    static NoiseStructure diagonal() {
        NoiseStructure s;
        for (int i = 0; i < N; ++i) s.scale[i] = s.block[i] = i;
        return s;
    }
    static NoiseStructure full() {
        NoiseStructure s = diagonal();
        s.block.fill(0);
        return s;
    }

    NoiseForm form() const {
        return {{scale.begin(), scale.end()}, {block.begin(), block.end()}, floor};
    }
    bool uncorrelated() const { return form().uncorrelated(); }
    Mat<N, N> best(const SquareSum<N>& squares, const Mat<N, N>& now) const {
        return form().best(squares.any(), now);
    }
};

}  // namespace sysid
