// The smoother against the joint posterior of all states, computed in one go.
#include "dense.hpp"
#include "sysid/estimate/smoother.hpp"

namespace sysid::test {
namespace {

std::vector<FilterStep<3, 2>> filtered(const Small& s, const Vec<3>& x, const Mat<3, 3>& P) {
    std::vector<FilterStep<3, 2>> steps;
    extended_kalman_filter<3, 2>(s, x, P,
                                 [&](std::size_t, const auto& step) { steps.push_back(step); });
    return steps;
}

void expect_batch_posterior(const Small& s, const Vec<3>& x, const Mat<3, 3>& P) {
    const auto smoothed = smooth(filtered(s, x, P));
    const auto [mean, covariance] = Stacked(s, x, P).posterior();
    ASSERT_EQ(smoothed.size(), s.size());
    for (std::size_t k = 0; k < s.size(); ++k) {
        const auto at = 3 * static_cast<int>(k);
        EXPECT_LT((smoothed[k].mean - mean.segment<3>(at)).norm(), 1e-10) << k;
        EXPECT_LT((smoothed[k].covariance - covariance.block<3, 3>(at, at)).norm(), 1e-10) << k;
        if (k > 0) {
            EXPECT_LT((smoothed[k].lag_one - covariance.block<3, 3>(at, at - 3)).norm(), 1e-10)
                << k;
        } else {
            EXPECT_EQ(smoothed[k].lag_one.norm(), 0.0);
        }
    }
}

TEST(Smoother, EqualsTheBatchPosterior) {
    expect_batch_posterior(small_system(25), kSmallMean, small_covariance());
}

TEST(Smoother, StandsStatesWithoutNoise) {
    // A constant that is known, and one that is not: predicted covariances are singular.
    Small s = small_system(15);
    s.A << 0.9, 0.2, 0.1, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0;
    s.Q = Vec<3>(0.05, 0.0, 0.0).asDiagonal();
    const Mat<3, 3> P = Vec<3>(1.0, 0.5, 0.0).asDiagonal();
    expect_batch_posterior(s, kSmallMean, P);
}

TEST(Smoother, RoomForMoreStatesChangesNothing) {
    const auto steps = filtered(small_system(25), kSmallMean, small_covariance());
    const auto place = [](int i) { return i == 0 ? 0 : i + 1; };
    std::vector<StateStep<5>> wide(steps.size());
    for (std::size_t k = 0; k < steps.size(); ++k) {
        StateStep<5>& to = wide[k];
        to.predicted_mean.setZero();
        to.mean.setZero();
        to.predicted_covariance.setZero();
        to.covariance.setZero();
        to.transition.setIdentity();
        for (int i = 0; i < 3; ++i) {
            to.predicted_mean[place(i)] = steps[k].predicted_mean[i];
            to.mean[place(i)] = steps[k].mean[i];
            for (int j = 0; j < 3; ++j) {
                to.predicted_covariance(place(i), place(j)) = steps[k].predicted_covariance(i, j);
                to.covariance(place(i), place(j)) = steps[k].covariance(i, j);
                to.transition(place(i), place(j)) = steps[k].transition(i, j);
            }
        }
    }
    const auto narrow = smooth(steps);
    const auto smoothed = smooth(wide);
    for (std::size_t k = 0; k < steps.size(); ++k) {
        Mat<5, 5> rest = smoothed[k].covariance;
        for (int i = 0; i < 3; ++i) {
            EXPECT_NEAR(smoothed[k].mean[place(i)], narrow[k].mean[i], 1e-13) << k;
            for (int j = 0; j < 3; ++j) {
                EXPECT_NEAR(rest(place(i), place(j)), narrow[k].covariance(i, j), 1e-13) << k;
                rest(place(i), place(j)) = 0.0;
            }
        }
        EXPECT_EQ(rest.norm(), 0.0) << k;
    }
}

TEST(Smoother, NeverLessCertainThanTheFilter) {
    const Small s = small_system(25);
    const auto steps = filtered(s, kSmallMean, small_covariance());
    const auto smoothed = smooth(steps);
    for (std::size_t k = 0; k + 1 < steps.size(); ++k) {
        const Mat<3, 3> gained = steps[k].covariance - smoothed[k].covariance;
        const Vec<3> sizes = symmetric_eigenvalues(gained);
        EXPECT_GT(sizes.minCoeff(), -1e-12) << k;
        EXPECT_GT(sizes.maxCoeff(), 1e-4) << k;
    }
    EXPECT_EQ(smoothed.back().mean, steps.back().mean);
}

/// A covariance in units of the standard deviations of `unit`.
Mat<3, 3> in_units_of(const Mat<3, 3>& unit, const Mat<3, 3>& P) {
    const Vec<3> per_size = unit.diagonal().cwiseSqrt().cwiseInverse();
    return per_size.asDiagonal() * P * per_size.asDiagonal();
}

TEST(Smoother, CovarianceStaysOneWhateverTheNoise) {
    std::mt19937 generator(11);
    std::normal_distribution<double> normal;
    for (const double noise : {0.0, 1e-300, 1e-12, 1.0}) {
        for (int trial = 0; trial < 40; ++trial) {
            Small s = small_system(200);
            s.A = Mat<3, 3>::NullaryExpr([&] { return normal(generator); });
            s.A *= 0.98 / spectral_radius(s.A);
            s.Q = noise * Vec<3>(1.0, trial % 2 == 0 ? 0.0 : 1.0, 1e-3).asDiagonal();
            const auto steps = filtered(s, kSmallMean, small_covariance());
            const auto smoothed = smooth(steps);
            for (std::size_t k = 0; k < smoothed.size(); ++k) {
                const Mat<3, 3>& P = smoothed[k].covariance;
                ASSERT_TRUE(P.allFinite()) << noise << ' ' << trial << ' ' << k;
                ASSERT_TRUE(smoothed[k].mean.allFinite()) << noise << ' ' << trial << ' ' << k;
                ASSERT_GE(P.diagonal().minCoeff(), 0.0) << noise << ' ' << trial << ' ' << k;
                // Rounding is relative to what is rounded, the prediction of the filter.
                const Mat<3, 3>& prior = steps[k].predicted_covariance;
                if (!(prior.diagonal().minCoeff() > 1e-290)) continue;
                const Mat<3, 3> scaled = in_units_of(prior, P);
                ASSERT_GE(symmetric_eigenvalues(scaled)[0], -1e-14)
                    << noise << ' ' << trial << ' ' << k;
                if (noise > 1e-300) {
                    ASSERT_LT(scaled.diagonal().maxCoeff(), 1.0 + 1e-8)
                        << noise << ' ' << trial << ' ' << k;
                }
            }
        }
    }
}

TEST(Smoother, SquaresAreTheDifferenceForOrdinaryNoise) {
    const auto steps = filtered(small_system(100), kSmallMean, small_covariance());
    const auto squares = smooth(steps);
    const auto difference = smooth<SmoothedSum::kDifference>(steps);
    for (std::size_t k = 0; k < steps.size(); ++k) {
        EXPECT_LT((squares[k].covariance - difference[k].covariance).norm(), 1e-12) << k;
        EXPECT_EQ(squares[k].mean, difference[k].mean) << k;
    }
}

TEST(Smoother, NothingComesOfNothing) {
    EXPECT_TRUE(smooth(std::vector<FilterStep<3, 2>>{}).empty());
}

}  // namespace
}  // namespace sysid::test
