// How sure a run's first state is.
#include "helpers.hpp"
#include "sysid/identify/start.hpp"

namespace sysid::test {
namespace {

const char* const kRelaxation = "tyre_relaxation";

struct Start {
    SingleTrack model{saloon(), mask_of({kRelaxation})};
    Parameters p = typical_parameters();
    ModelState<double> x{};
    Input u = lively(0.4);

    explicit Start(double relaxation_m) {
        p[parameter_of(kRelaxation)] = relaxation_m;
        x[0] = 20.0;
        x[1] = 0.3;
        x[2] = 0.2;
        settle_auxiliary(model, x, kCalm.data(), u, p.data());
    }
    Eigen::MatrixXd covariance() const { return start_covariance(model, x, u, p.data()); }
};

TEST(Start, TheMotionIsAsUnsureAsWithoutStates) {
    const Eigen::MatrixXd known = Start(0.4).covariance();
    ASSERT_EQ(known.rows(), kMotionStates + 2);
    for (int i = 0; i < kMotionStates; ++i)
        for (int j = 0; j < kMotionStates; ++j)
            EXPECT_EQ(known(i, j), i == j ? kFirstVariances[static_cast<std::size_t>(i)] : 0.0);
}

TEST(Start, AShortLagIsWhatItFollows) {
    // Both slip angles: front delta - (v_y + l_f r) / v_x, rear -(v_y - l_r r) / v_x, linearised.
    const Start start(1e-5);
    const double vx = start.x[0], vy = start.x[1], r = start.x[2];
    const VehicleData car = saloon();
    Eigen::Matrix<double, 2, kMotionStates> slopes;
    const double front = (vy + car.lf_m * r) / vx, rear = (vy - car.lr_m * r) / vx;
    slopes.row(0) << front / vx, -1.0 / vx, -car.lf_m / vx;
    slopes.row(1) << rear / vx, -1.0 / vx, car.lr_m / vx;
    slopes.row(0) /= 1.0 + front * front;
    slopes.row(1) /= 1.0 + rear * rear;
    const Eigen::Map<const Eigen::Vector3d> motion(kFirstVariances.data());
    const Eigen::Matrix2d expected = slopes * motion.asDiagonal() * slopes.transpose();
    const Eigen::MatrixXd known = start.covariance();
    EXPECT_TRUE(known.bottomRightCorner(2, 2).isApprox(expected, 1e-4));
    EXPECT_TRUE(
        known.bottomLeftCorner(2, kMotionStates).isApprox(slopes * motion.asDiagonal(), 1e-4));
}

TEST(Start, ALongLagIsWhereItWas) {
    const Eigen::MatrixXd known = Start(300.0).covariance();
    constexpr double spread = 0.02;  // [rad]
    for (int i = kMotionStates; i < known.rows(); ++i) {
        EXPECT_NEAR(known(i, i), spread * spread, 1e-6);
        EXPECT_LT(std::abs(known(i, 1)), 1e-4);
    }
}

TEST(Start, BetweenThemItIsACovariance) {
    for (const double relaxation_m : {0.1, 0.45, 3.0}) {
        const Eigen::MatrixXd known = Start(relaxation_m).covariance();
        EXPECT_TRUE(known.isApprox(known.transpose()));
        EXPECT_GT(known.selfadjointView<Eigen::Lower>().eigenvalues().minCoeff(), 0.0);
    }
}

}  // namespace
}  // namespace sysid::test
