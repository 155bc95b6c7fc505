// Products of sparse rows beside those of full matrices.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <array>
#include <cmath>
#include <stdexcept>
#include <vector>

#include "sysid/math/banded.hpp"

namespace sysid {
namespace {

// Three rows of six columns; their entries stand in no order, one row has none.
constexpr std::array<std::int32_t, 5> kPointers{0, 3, 3, 5, 6};
constexpr std::array<std::int32_t, 6> kColumns{2, 0, 1, 3, 5, 4};
constexpr std::array<double, 6> kValues{1.5, -2.0, 0.5, 3.0, -1.0, 4.0};
constexpr SparseRows kRows{kPointers, kColumns, kValues};

TEST(Banded, GramIsThatOfTheFullRows) {
    Eigen::MatrixXd full = Eigen::MatrixXd::Zero(4, 6);
    for (int k = 0; k < 4; ++k)
        for (int e = kPointers[k]; e < kPointers[k + 1]; ++e) full(k, kColumns[e]) = kValues[e];
    const Eigen::MatrixXd expected = full.transpose() * full;
    const LowerBand band = gram(kRows, 6);
    EXPECT_EQ(band.width, 2U);
    ASSERT_EQ(band.entries.size(), 18U);
    for (int j = 0; j < 6; ++j)
        for (int i = j; i < 6; ++i) {
            const double found = i - j <= 2 ? band.entries[3 * j + i - j] : 0.0;
            EXPECT_DOUBLE_EQ(found, expected(i, j)) << i << " " << j;
        }
}

TEST(Banded, EntriesOfOneColumnAddUp) {
    constexpr std::array<std::int32_t, 2> one_row{0, 2};
    constexpr std::array<std::int32_t, 2> twice{0, 0};
    constexpr std::array<double, 2> values{1.0, 2.0};
    EXPECT_DOUBLE_EQ(gram({one_row, twice, values}, 1).entries[0], 9.0);
}

TEST(Banded, EntriesOutsideTheMatrixAreRefused) {
    EXPECT_THROW(gram(kRows, 5), std::invalid_argument);
    constexpr std::array<std::int32_t, 2> too_many{0, 7};
    EXPECT_THROW(gram({too_many, kColumns, kValues}, 6), std::invalid_argument);
    constexpr std::array<std::int32_t, 3> backwards{0, 3, 2};
    EXPECT_THROW(gram({backwards, kColumns, kValues}, 6), std::invalid_argument);
}

TEST(Banded, SquaresAreVariancesOfTheInverse) {
    // A walk that is hardly read: what is known of a place reaches far.
    constexpr int n = 400;
    Eigen::MatrixXd factor = Eigen::MatrixXd::Zero(n, n);
    std::vector<double> band;
    for (int j = 0; j < n; ++j) {
        factor(j, j) = 1.0 + 0.1 * std::sin(j);
        if (j + 1 < n) factor(j + 1, j) = -0.95;
        if (j + 2 < n) factor(j + 2, j) = 0.02 * std::cos(j);
        for (int i = j; i < j + 3; ++i) band.push_back(i < n ? factor(i, j) : 0.0);
    }
    constexpr std::array<std::int32_t, 4> pointers{0, 2, 2, 5};
    constexpr std::array<std::int32_t, 5> columns{9, 3, 399, 200, 201};
    constexpr std::array<double, 5> values{1.0, -1.0, 2.0, 0.5, 0.25};
    const auto found = squares(band, n, {pointers, columns, values});
    ASSERT_EQ(found.size(), 3U);
    for (int k = 0; k < 3; ++k) {
        Eigen::VectorXd row = Eigen::VectorXd::Zero(n);
        for (int e = pointers[k]; e < pointers[k + 1]; ++e) row[columns[e]] = values[e];
        const double expected = factor.triangularView<Eigen::Lower>().solve(row).squaredNorm();
        EXPECT_NEAR(found[k], expected, 1e-11 * expected) << k;
    }
}

TEST(Banded, AFactorOfAnotherSizeIsRefused) {
    const std::vector<double> band(12, 1.0);
    EXPECT_EQ(squares(band, 6, kRows).size(), 4U);
    EXPECT_THROW(squares(band, 7, kRows), std::invalid_argument);
    EXPECT_THROW(squares(band, 4, kRows), std::invalid_argument);
    EXPECT_THROW(squares(std::vector<double>(12, 0.0), 6, kRows), std::invalid_argument);
}

}  // namespace
}  // namespace sysid
