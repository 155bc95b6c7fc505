// Score and information of the noise parameters against differences of the log-likelihood.
#include "dense.hpp"
#include "helpers.hpp"
#include "sysid/identify/prediction_error.hpp"

namespace sysid::test {
namespace {

using Table = Eigen::Matrix<double, kNoiseParameters, kNoiseParameters, Eigen::RowMajor>;
using Values = Vec<kNoiseParameters>;

Noise scaled(const Noise& noise, const Values& logs) {
    Noise out = noise;
    int i = 0;
    for (double& s : out.sensor) s *= std::exp(logs[i++]);
    for (double& s : out.motion) s *= std::exp(logs[i++]);
    for (double& s : out.disturbance) s *= std::exp(logs[i++]);
    for (double& s : out.correlation_time_s) s *= std::exp(logs[i++]);
    for (double& s : out.road) s *= std::exp(logs[i++]);
    out.road_time_s *= std::exp(logs[i++]);
    for (double& s : out.colour) s *= std::exp(logs[i++]);
    for (double& s : out.colour_time_s) s *= std::exp(logs[i++]);
    return out;
}

/// Mild driving, on which the model is close to linear: the score takes the linearisation as given.
Problem mild(EffectMask effects, unsigned seed) {
    const SingleTrack model{saloon(), effects};
    const Parameters p = typical_parameters();
    Problem problem{model, {}};
    problem.runs.push_back(noisy_run(model, p, 300, 0.01, seed, 0.2));
    problem.runs.push_back(noisy_run(model, p, 150, 0.02, seed + 1, 0.2));
    for (std::size_t k = 0; k < 300; ++k) {
        if (k % 4 != 0) problem.runs[0].measurements[k][kVy] = std::nan("");
        if (k > 100 && k < 120) problem.runs[0].measurements[k].setConstant(std::nan(""));
    }
    return problem;
}

struct Score {
    double value = 0.0;
    Values gradient;
    Table information;
};

Score score(const Problem& problem, const Parameters& p, const Noise& noise) {
    Score s;
    s.value = noise_score(problem, p.data(), noise, s.gradient.data(), s.information.data());
    return s;
}

class NoiseScore : public testing::TestWithParam<bool> {
  protected:
    EffectMask effects() const {
        return GetParam() ? mask_of({"steer_lag", "tyre_relaxation"}) : EffectMask{0};
    }
};
INSTANTIATE_TEST_SUITE_P(States, NoiseScore, testing::Bool(), [](const auto& it) {
    return it.param ? "WithStatesOfEffects" : "MotionOnly";
});

TEST_P(NoiseScore, IsTheGradientOfTheLogLikelihood) {
    const Problem problem = mild(effects(), 31);
    const Parameters p = typical_parameters();
    // Away from the optimum, so that every derivative is of a size.
    Values off;
    off << 0.3, -0.2, 0.3, -0.3, 0.2, 0.5, -0.5, 0.5, 0.4, -0.4, 0.4, 0.5, -0.2, 0.3, 0.2, -0.3,
        0.4, 0.3, -0.3, 0.2, -0.2, 0.3, 0.2;
    const Noise noise = scaled(coloured_noise(), off);
    const Score s = score(problem, p, noise);
    EXPECT_NEAR(s.value, freeze(problem, p.data(), noise).log_likelihood, 1e-9);
    for (int i = 0; i < kNoiseParameters; ++i) {
        const double difference = central_difference(
            [&](double by) {
                return freeze(problem, p.data(), scaled(noise, by * Values::Unit(i)))
                    .log_likelihood;
            },
            0.0, 1e-2);
        const double spread = std::sqrt(s.information(i, i));
        // A hundredth of the derivative, or of the statistical spread that one has.
        EXPECT_NEAR(s.gradient[i], difference, 0.01 * std::max(std::abs(difference), spread))
            << "noise parameter " << i;
    }
}

TEST_P(NoiseScore, InformationIsSymmetricAndPositive) {
    const Score s = score(mild(effects(), 37), typical_parameters(), coloured_noise());
    EXPECT_EQ((s.information - s.information.transpose()).norm(), 0.0);
    const Eigen::VectorXd values = symmetric_eigenvalues(s.information);
    EXPECT_GT(values.minCoeff(), -1e-9 * values.maxCoeff());
    EXPECT_GT(s.information.diagonal().minCoeff(), 0.0);
}

TEST_P(NoiseScore, ALevelRoadIsTheLimitOfOneThatHardlyWanders) {
    const Problem problem = mild(effects(), 39);
    const Parameters p = typical_parameters();
    const Score level = score(problem, p, ordinary_noise());
    Noise hardly = ordinary_noise();
    hardly.road = {1e-7, 1e-7};
    const Score limit = score(problem, p, hardly);
    EXPECT_NEAR(level.value, limit.value, 1e-6);
    const int plain = kPlainNoiseParameters;
    const double size = level.gradient.norm();
    EXPECT_LT((level.gradient - limit.gradient).head(plain).norm(), 1e-6 * size);
    EXPECT_EQ(level.gradient.tail(kNoiseParameters - plain).norm(), 0.0);
    EXPECT_EQ(level.information.rightCols(kNoiseParameters - plain).norm(), 0.0);
    EXPECT_EQ(level.information.bottomRows(kNoiseParameters - plain).norm(), 0.0);
}

TEST_P(NoiseScore, WhiteSensorsAreTheLimitOfThoseWithHardlyAnyColour) {
    const Problem problem = mild(effects(), 40);
    const Parameters p = typical_parameters();
    const Score white = score(problem, p, sloping_noise());
    Noise hardly = sloping_noise();
    hardly.colour = {1e-9, 1e-7, 1e-7};
    const Score limit = score(problem, p, hardly);
    EXPECT_NEAR(white.value, limit.value, 1e-6);
    const int plain = kRoadNoiseParameters;
    EXPECT_LT((white.gradient - limit.gradient).head(plain).norm(), 1e-6 * white.gradient.norm());
    EXPECT_EQ(white.gradient.tail(kNoiseParameters - plain).norm(), 0.0);
    EXPECT_EQ(white.information.rightCols(kNoiseParameters - plain).norm(), 0.0);
}

TEST_P(NoiseScore, InformationIsOfTheOrderOfTheCurvature) {
    // Expected information against the observed one, where the data are many: the sensors.
    const Problem problem = mild(effects(), 41);
    const Parameters p = typical_parameters();
    const Noise noise = ordinary_noise();
    const Score s = score(problem, p, noise);
    for (int i = 0; i < kChannels; ++i) {
        const double curvature = central_difference(
            [&](double by) {
                return score(problem, p, scaled(noise, by * Values::Unit(i))).gradient[i];
            },
            0.0, 1e-2);
        EXPECT_GT(-curvature, 0.5 * s.information(i, i)) << "noise parameter " << i;
        EXPECT_LT(-curvature, 2.0 * s.information(i, i)) << "noise parameter " << i;
    }
}

TEST_P(NoiseScore, HasMeanZeroAndTheInformationAsVariance) {
    // Over repeated records with the noise that was assumed for the sensors, and nothing else.
    const Parameters p = typical_parameters();
    Noise noise = ordinary_noise();
    for (double& s : noise.motion) s = 1e-6;
    for (double& s : noise.disturbance) s = 1e-3;
    const int records = 12;
    Values sum = Values::Zero();
    Values squares = Values::Zero();
    Values information = Values::Zero();
    for (int n = 0; n < records; ++n) {
        const Score s = score(mild(effects(), 100U + 2U * static_cast<unsigned>(n)), p, noise);
        sum += s.gradient / records;
        squares += s.gradient.cwiseAbs2() / records;
        information += s.information.diagonal() / records;
    }
    for (int i = 0; i < kChannels; ++i) {
        EXPECT_LT(std::abs(sum[i]), 4.0 * std::sqrt(information[i] / records)) << i;
        EXPECT_GT(squares[i], 0.2 * information[i]) << i;
        EXPECT_LT(squares[i], 3.0 * information[i]) << i;
    }
}

TEST_P(NoiseScore, AlongAFilterThatHasRunIsTheSame) {
    const Problem problem = mild(effects(), 43);
    const Parameters p = typical_parameters();
    Noise white = ordinary_noise();
    white.disturbance.fill(0.0);
    for (const Noise& noise : {ordinary_noise(), sloping_noise(), coloured_noise(), white}) {
        const Score whole = score(problem, p, noise);
        FrozenFilter filter = freeze(problem, p.data(), noise);
        ASSERT_TRUE(filter.tells());
        const auto along = [&] {
            Score s;
            s.value =
                noise_score(problem, p.data(), filter, s.gradient.data(), s.information.data());
            return s;
        };
        const Score s = along();
        EXPECT_NEAR(s.value, whole.value, 1e-12 * std::abs(whole.value));
        EXPECT_LT((s.gradient - whole.gradient).norm(), 1e-9 * whole.gradient.norm());
        EXPECT_LT((s.information - whole.information).norm(), 1e-9 * whole.information.norm());
        // A filter of so many samples that it keeps no states runs again.
        for (FrozenRun& run : filter.runs) run.told.clear();
        const Score again = along();
        EXPECT_EQ((again.gradient - whole.gradient).norm(), 0.0);
        EXPECT_EQ((again.information - whole.information).norm(), 0.0);
    }
}

TEST(NoiseScoreAlongAFilter, IsOfAnotherModelsStatesWorkedOutAnew) {
    const Problem lagging = mild(mask_of({"steer_lag", "tyre_relaxation"}), 45);
    Problem plain = lagging;
    plain.model = SingleTrack{saloon(), EffectMask{0}};
    const Parameters p = typical_parameters();
    const FrozenFilter filter = freeze(plain, p.data(), ordinary_noise());
    const Score whole = score(lagging, p, ordinary_noise());
    Score s;
    s.value = noise_score(lagging, p.data(), filter, s.gradient.data(), s.information.data());
    EXPECT_EQ(s.value, whole.value);
    EXPECT_EQ((s.gradient - whole.gradient).norm(), 0.0);
}

}  // namespace
}  // namespace sysid::test
