// What may change in a noise covariance, and the best covariance of that form.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include "sysid/math/linear.hpp"

namespace sysid {

/// Sum of expected squares over `samples`, of which `count` told something of each element; the
/// others contributed the variance that was assumed.
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
};

constexpr int kFixedNoise = -1;

/// Entries with the same `scale` number keep the ratio of their variances; those numbered
/// `kFixedNoise` keep their value. Entries with the same `block` number are correlated.
/// Blocks of more than one entry must be free and untied.
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

    bool uncorrelated() const {
        for (int i = 0; i < N; ++i)
            if (!alone(i)) return false;
        return true;
    }

    /// `C` without the correlations that this form does not have, lifted to the floor, and with the
    /// fixed variances of `now`.
    Mat<N, N> admitted(Mat<N, N> C, const Mat<N, N>& now) const {
        for (int i = 0; i < N; ++i)
            for (int j = 0; j < N; ++j)
                if (block[i] != block[j]) C(i, j) = 0.0;
        const Vec<N> given = C.diagonal();
        for (int i = 0; i < N; ++i)
            C(i, i) = scale[i] == kFixedNoise ? now(i, i) : lifted_variance(i, given);
        for (int i = 0; i < N; ++i)
            if (first_of_block(i)) lift_block(i, C);
        return C;
    }

    /// The covariance C of this form of highest expected likelihood: it maximises
    /// -n log|C| - tr(C^-1 sum) over n samples. `now` is the one that was assumed.
    Mat<N, N> best(const SquareSum<N>& squares, const Mat<N, N>& now) const {
        Mat<N, N> out = squares.sum / std::max(squares.samples, 1.0);
        for (int i = 0; i < N; ++i)
            if (scale[i] != kFixedNoise && alone(i)) out(i, i) = tied_variance(i, squares, now);
        return admitted(out, now);
    }

  private:
    // Only samples that tell something count: the others would hold the old value back.
    double tied_variance(int i, const SquareSum<N>& squares, const Mat<N, N>& now) const {
        double sum = 0.0, n = 0.0;
        for (int j = 0; j < N; ++j) {
            if (scale[j] != scale[i]) continue;
            sum += squares.sum(j, j) / now(j, j) - (squares.samples - squares.count[j]);
            n += squares.count[j];
        }
        return n > 0.0 ? sum / n * now(i, i) : now(i, i);
    }

    // Tied variances are lifted together, so that their ratio stays.
    double lifted_variance(int i, const Vec<N>& given) const {
        double lift = 1.0;
        for (int j = 0; j < N; ++j)
            if (j != i && scale[j] == scale[i]) lift = std::max(lift, floor[j] / given[j]);
        return std::max(lift * given[i], floor[i]);  // a variance of zero alone is lifted as well
    }

    bool alone(int i) const {
        for (int j = 0; j < N; ++j)
            if (j != i && block[j] == block[i]) return false;
        return true;
    }

    bool first_of_block(int i) const {
        for (int j = 0; j < i; ++j)
            if (block[j] == block[i]) return false;
        return !alone(i);
    }

    // The best covariance that is nowhere below the floor: eigenvalues, measured by the floor,
    // lifted to it.
    void lift_block(int first, Mat<N, N>& C) const {
        Mat<N, N> scaled = Mat<N, N>::Identity();
        const auto each = [&](auto&& act) {
            for (int i = first; i < N; ++i)
                for (int j = first; j < N; ++j)
                    if (block[i] == block[first] && block[j] == block[first])
                        act(i, j, std::sqrt(floor[i] * floor[j]));
        };
        each([&](int i, int j, double f) { scaled(i, j) = C(i, j) / f; });
        const Eigen::SelfAdjointEigenSolver<Mat<N, N>> eigen(scaled);
        if (eigen.eigenvalues()[0] >= 1.0) return;
        const Vec<N> lifted = eigen.eigenvalues().cwiseMax(1.0);
        scaled = eigen.eigenvectors() * lifted.asDiagonal() * eigen.eigenvectors().transpose();
        each([&](int i, int j, double f) { C(i, j) = scaled(i, j) * f; });
    }
};

}  // namespace sysid
