// The kernels of one filter, whose covariance stands row by row.
#include <random>

#include "kernels.hpp"
#include "sysid/math/linear.hpp"

namespace sysid::test {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

class Rows : public OfEachProcessor {};
INSTANTIATE_TEST_SUITE_P(All, Rows, testing::ValuesIn(all_lane_kernels()), kernels_name);

constexpr std::size_t kReadings = 5;

/// A matrix whose rows stand `stride` numbers apart, filled up with zeros.
std::vector<double> rows_of(const MatrixXd& M, std::size_t stride) {
    std::vector<double> out(static_cast<std::size_t>(M.rows()) * stride);
    for (int i = 0; i < M.rows(); ++i)
        for (int j = 0; j < M.cols(); ++j)
            out[static_cast<std::size_t>(i) * stride + static_cast<std::size_t>(j)] = M(i, j);
    return out;
}

MatrixXd matrix_of(const std::vector<double>& rows, int count, int columns, std::size_t stride) {
    MatrixXd out(count, columns);
    for (int i = 0; i < count; ++i)
        for (int j = 0; j < columns; ++j)
            out(i, j) = rows[static_cast<std::size_t>(i) * stride + static_cast<std::size_t>(j)];
    return out;
}

class Drawn {
  public:
    explicit Drawn(unsigned seed) : random_(seed) {}
    /// With some elements that are zero.
    MatrixXd matrix(int rows, int columns) {
        MatrixXd out(rows, columns);
        for (double& x : out.reshaped()) x = random_() % 4 == 0 ? 0.0 : normal_(random_);
        return out;
    }
    MatrixXd covariance(int n) {
        const MatrixXd root = matrix(n, n);
        const MatrixXd one = root * root.transpose() + 0.1 * MatrixXd::Identity(n, n);
        return 0.5 * (one + one.transpose());  // to the last digit
    }

  private:
    std::mt19937 random_;
    std::normal_distribution<double> normal_;
};

TEST_P(Rows, PropagateIsAProduct) {
    Drawn drawn(1);
    for (int n = 3; n <= 40; ++n) {
        const std::size_t stride = (static_cast<std::size_t>(n) + 7) / 8 * 8;
        const MatrixXd A = drawn.matrix(n, n), P = drawn.covariance(n);
        const VectorXd noise = drawn.matrix(n, 1).cwiseAbs();
        std::vector<double> found = rows_of(P, stride);
        GetParam()->propagate_rows(rows_of(A.transpose(), stride).data(), noise.data(),
                                   static_cast<std::size_t>(n), stride, found.data());
        MatrixXd expected = A * P * A.transpose();
        expected.diagonal() += noise;
        const MatrixXd after = matrix_of(found, n, n, stride);
        EXPECT_LT((after - expected).norm(), 1e-13 * expected.norm()) << n;
        EXPECT_EQ(after, after.transpose()) << n;
    }
}

TEST_P(Rows, CorrectIsTheUpdateByAllReadingsAtOnce) {
    Drawn drawn(2);
    for (int n = 3; n <= 40; ++n)
        for (const int missing : {-1, 0, 3}) {
            const std::size_t stride = (static_cast<std::size_t>(n) + 7) / 8 * 8;
            const MatrixXd P = drawn.covariance(n);
            MatrixXd H = drawn.matrix(kReadings, n);
            const VectorXd noise = drawn.matrix(kReadings, 1).cwiseAbs().array() + 0.1;
            VectorXd innovation = drawn.matrix(kReadings, 1);
            const std::vector<double> observation = rows_of(H, stride);
            std::array<bool, kReadings> present;
            present.fill(true);
            MatrixXd R = noise.asDiagonal();
            if (missing >= 0) {
                present[static_cast<std::size_t>(missing)] = false;
                innovation[missing] = 0.0;
                H.row(missing).setZero();
            }
            std::vector<double> after = rows_of(P, stride), gain(kReadings * stride);
            std::array<double, kReadings> one_after, variance;
            std::array<double, kReadings*(kReadings + 1) / 2> whitener;
            VectorXd mean = VectorXd::Zero(n);
            std::copy_n(innovation.data(), kReadings, one_after.begin());
            RowUpdate u;
            u.states = static_cast<std::size_t>(n);
            u.readings = kReadings;
            u.stride = u.observation_stride = stride;
            u.observation = observation.data();
            u.noise = noise.data();
            u.present = present.data();
            u.innovation = one_after.data();
            u.variance = variance.data();
            u.gain = gain.data();
            u.whitener = whitener.data();
            GetParam()->correct_rows(u, mean.data(), after.data());

            const MatrixXd S = H * P * H.transpose() + R;
            const MatrixXd K = P * H.transpose() * S.inverse();
            const MatrixXd found = matrix_of(gain, kReadings, n, stride).transpose();
            const MatrixXd posterior = P - K * S * K.transpose();
            const MatrixXd covariance = matrix_of(after, n, n, stride);
            EXPECT_LT((found - K).norm(), 1e-10 * K.norm()) << n;
            EXPECT_LT((mean - K * innovation).norm(), 1e-10 * K.norm() * innovation.norm()) << n;
            EXPECT_LT((covariance - posterior).norm(), 1e-10 * P.norm()) << n;
            EXPECT_EQ(covariance, covariance.transpose()) << n;
            MatrixXd W = MatrixXd::Zero(kReadings, kReadings);
            std::size_t at = 0;
            double squares = 0.0, determinant = 1.0;
            for (int i = 0; i < static_cast<int>(kReadings); ++i) {
                const auto reading = static_cast<std::size_t>(i);
                for (int j = 0; j <= i; ++j) W(i, j) = whitener[at++];
                if (!present[reading]) continue;
                squares += one_after[reading] * one_after[reading] / variance[reading];
                determinant *= variance[reading];
            }
            MatrixXd unit = MatrixXd::Identity(kReadings, kReadings);
            double left_out = 1.0;
            if (missing >= 0) {
                unit(missing, missing) = 0.0;
                left_out = noise[missing];
            }
            EXPECT_LT((W * S * W.transpose() - unit).norm(), 1e-10) << n;
            EXPECT_NEAR(squares, innovation.dot(S.inverse() * innovation), 1e-9 * squares) << n;
            EXPECT_NEAR(determinant * left_out, S.determinant(), 1e-9 * S.determinant()) << n;
        }
}

}  // namespace
}  // namespace sysid::test
