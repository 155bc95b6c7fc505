// The filter against a textbook Kalman filter and against the joint density of all measurements.
#include "dense.hpp"
#include "sysid/estimate/kalman.hpp"

namespace sysid::test {
namespace {

TEST(Kalman, EqualsTheTextbookFilter) {
    const Small s = small_system(40);
    TextbookFilter textbook{kSmallMean, small_covariance(), {}, {}, {}};
    std::size_t samples = 0;
    extended_kalman_filter<3, 2>(
        s, kSmallMean, small_covariance(), [&](std::size_t k, const FilterStep<3, 2>& step) {
            if (k > 0) textbook.predict(s, k);
            EXPECT_LT((step.predicted_mean - textbook.mean).norm(), 1e-12);
            EXPECT_LT((step.predicted_covariance - textbook.covariance).norm(), 1e-12);
            textbook.update(s, k);
            EXPECT_LT((step.mean - textbook.mean).norm(), 1e-12) << k;
            EXPECT_LT((step.covariance - textbook.covariance).norm(), 1e-12) << k;
            const auto observed = static_cast<int>(textbook.there.size());
            EXPECT_EQ(step.update.observed, observed);
            for (int j = 0; j < observed; ++j) {
                const int i = textbook.there[static_cast<std::size_t>(j)];
                EXPECT_NEAR(step.update.innovation[i], textbook.innovation[j], 1e-12);
                EXPECT_LT((step.update.gain.col(i) - textbook.gain.col(j)).norm(), 1e-12);
            }
            ++samples;
        });
    EXPECT_EQ(samples, s.size());
}

TEST(Kalman, OneReadingAfterTheOtherIsTheSame) {
    const Uncorrelated s(small_system(40));
    std::vector<FilterStep<3, 2>> together;
    const double joint = extended_kalman_filter<3, 2>(
        s, kSmallMean, small_covariance(),
        [&](std::size_t, const auto& step) { together.push_back(step); });
    const double sequential = extended_kalman_filter<3, 2, SequentialUpdate<3, 2>>(
        s, kSmallMean, small_covariance(), [&](std::size_t k, const auto& step) {
            EXPECT_LT((step.mean - together[k].mean).norm(), 1e-12) << k;
            EXPECT_LT((step.covariance - together[k].covariance).norm(), 1e-12) << k;
            EXPECT_EQ(step.update.observed, together[k].update.observed);
            EXPECT_NEAR(LogDensity::of(step.update), LogDensity::of(together[k].update), 1e-12);
            EXPECT_EQ(step.covariance, step.covariance.transpose());
        });
    EXPECT_NEAR(sequential, joint, 1e-10);
}

TEST(Kalman, LogLikelihoodIsTheDensityOfAllMeasurements) {
    const Small s = small_system(30);
    const double filtered = extended_kalman_filter<3, 2>(s, kSmallMean, small_covariance(),
                                                         [](std::size_t, const auto&) {});
    const double direct = Stacked(s, kSmallMean, small_covariance()).log_density();
    EXPECT_NEAR(filtered, direct, 1e-10 * std::abs(direct));
}

TEST(Kalman, MissingEverythingOnlyPredicts) {
    const Small s = small_system(6);
    ASSERT_TRUE(s.y[3].array().isNaN().all());
    extended_kalman_filter<3, 2>(s, kSmallMean, small_covariance(),
                                 [&](std::size_t k, const auto& step) {
                                     if (k != 3) return;
                                     EXPECT_EQ(step.mean, step.predicted_mean);
                                     EXPECT_EQ(step.covariance, step.predicted_covariance);
                                     EXPECT_EQ(LogDensity::of(step.update), 0.0);
                                     EXPECT_EQ(step.update.observed, 0);
                                 });
}

TEST(Kalman, PredictFirstBeginsOneSampleEarlier) {
    const Small s = small_system(10);
    // Predicting by hand, then filtering as usual.
    const Vec<3> x = s.A * kSmallMean + s.b[0];
    const Mat<3, 3> P = s.A * small_covariance() * s.A.transpose() + s.Q;
    const auto ignore = [](std::size_t, const auto&) {};
    const double by_hand = extended_kalman_filter<3, 2>(s, x, P, ignore);
    const double by_flag =
        extended_kalman_filter<3, 2>(s, kSmallMean, small_covariance(), ignore, true);
    EXPECT_NEAR(by_flag, by_hand, 1e-12 * std::abs(by_hand));
}

TEST(Kalman, CovarianceStaysPositiveDefiniteWhenIllConditioned) {
    // A sensor a million times better than the other, states of very different size, hardly any
    // process noise.
    LinearSystem<3, 2> s;
    s.A << 1.0, 0.01, 0.0, 0.0, 1.0, 0.01, 0.0, 0.0, 0.999;
    s.Q = Vec<3>(1e-16, 1e-14, 1e-10).asDiagonal();
    s.H << 1.0, 0.0, 0.0, 1.0, 1e-3, 0.0;
    s.R = Vec<2>(1e-10, 1e2).asDiagonal();
    const std::size_t samples = 100000;
    s.b.assign(samples, Vec<3>::Zero());
    s.d.assign(samples, Vec<2>::Zero());
    s.y.assign(samples, Vec<2>::Zero());
    const Mat<3, 3> P = Vec<3>(1e6, 1e4, 1e2).asDiagonal();
    double smallest = 1.0;
    double unsymmetric = 0.0;
    std::size_t failed = 0;
    extended_kalman_filter<3, 2>(
        s, Vec<3>(10.0, -1.0, 0.1), P, [&](std::size_t, const FilterStep<3, 2>& step) {
            unsymmetric =
                std::max(unsymmetric, (step.covariance - step.covariance.transpose()).norm());
            // Scaled to a correlation, so that the sizes of the states do not decide.
            const Vec<3> scale = step.covariance.diagonal().cwiseSqrt().cwiseInverse();
            const Mat<3, 3> correlation = scale.asDiagonal() * step.covariance * scale.asDiagonal();
            if (Eigen::LLT<Mat<3, 3>>(correlation).info() != Eigen::Success ||
                !correlation.allFinite())
                ++failed;
            smallest = std::min(smallest, correlation.determinant());
        });
    EXPECT_EQ(unsymmetric, 0.0);
    EXPECT_EQ(failed, 0U);
    EXPECT_GT(smallest, 0.0);
}

TEST(Kalman, NotPositiveDefiniteNoiseNamesTheSample) {
    struct Broken : Small {
        Mat<2, 2> measurement_noise(std::size_t k) const {
            return k == 7 ? Mat<2, 2>(-100.0 * Mat<2, 2>::Identity()) : R;
        }
    };
    Broken s;
    static_cast<Small&>(s) = small_system(20);
    std::size_t kept = 0;
    try {
        extended_kalman_filter<3, 2>(s, kSmallMean, small_covariance(),
                                     [&](std::size_t, const auto&) { ++kept; });
        FAIL() << "nothing was thrown";
    } catch (const NumericalFailure& failure) {
        EXPECT_NE(std::string(failure.what()).find("sample 7"), std::string::npos)
            << failure.what();
    }
    EXPECT_EQ(kept, 7U);
}

TEST(Kalman, InfiniteMeasurementOrPredictionNamesTheSample) {
    for (double bad : {INFINITY, -INFINITY}) {
        Small s = small_system(20);
        s.y[4][1] = bad;
        const auto message = [&]() -> std::string {
            try {
                extended_kalman_filter<3, 2>(s, kSmallMean, small_covariance(),
                                             [](std::size_t, const auto&) {});
            } catch (const NumericalFailure& failure) {
                return failure.what();
            }
            return "nothing was thrown";
        };
        EXPECT_NE(message().find("sample 4"), std::string::npos) << message();
        s = small_system(20);
        s.b[4][1] = bad;
        EXPECT_NE(message().find("sample 4"), std::string::npos) << message();
    }
}

}  // namespace
}  // namespace sysid::test
