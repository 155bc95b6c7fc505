// Prediction errors with frozen gains, and their derivatives.
#include "residuals.hpp"
#include "sysid/identify/run_system.hpp"

namespace sysid::test {
namespace {

using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

const auto kPlain = mask_of({"side_wind", "gyro_bias", "road_grade", "aero_drag", "mass",
                             "steer_offset", "combined_slip", "cg_position"});
const auto kLate =
    kPlain | mask_of({"steer_lag", "tyre_relaxation", "steer_ratio", "steer_compliance"});

/// Two runs of a car whose parameters differ from those asked about, with gaps in the data.
Problem two_runs(EffectMask effects, bool force_known = true, bool held = false) {
    SingleTrack truth{saloon(), effects};
    truth.loads_known = truth.inputs_held = held;
    Parameters p = typical_parameters();
    p[kBFront] *= 1.1;
    Problem problem{truth, {}};
    problem.model.force_known = force_known;
    problem.runs.push_back(noisy_run(truth, p, 80, 0.01, 1));
    problem.runs.push_back(noisy_run(truth, p, 60, 0.02, 2));
    for (Run& run : problem.runs) {
        for (std::size_t k = 0; k < run.size(); ++k) {
            if (k % 7 == 3) run.measurements[k][kVy] = std::nan("");
            if (k > 20 && k < 26) run.measurements[k].setConstant(std::nan(""));
            if (!force_known) {
                run.inputs[k].longitudinal = std::sin(0.05 * static_cast<double>(k));
                run.measurements[k][kAx] = std::nan("");
            }
        }
    }
    return problem;
}

Rows sensitivities_of(const Problem& problem, const Parameters& p, const FrozenFilter& filter,
                      const std::vector<int>& columns) {
    Rows G(static_cast<int>(problem.samples()) * kChannels, static_cast<int>(columns.size()));
    sensitivities(problem, p.data(), filter, columns, G.data());
    return G;
}

Rows signals_of(const Problem& problem, const Parameters& p, const FrozenFilter& filter,
                const Rows& signals, const std::vector<int>& targets) {
    Rows G(static_cast<int>(problem.samples()) * kChannels, static_cast<int>(targets.size()));
    signal_sensitivities(problem, p.data(), filter, signals.data(), targets, G.data());
    return G;
}

std::vector<int> all_columns() {
    std::vector<int> columns;
    // Users' effects have columns only where one acts.
    const auto own = static_cast<int>(kBaseParameterCount + kEffectParameterCount);
    for (int i = 0; i < own; ++i) columns.push_back(i);
    return columns;
}

int column_of(const std::string& effect, std::size_t which = 0) {
    return static_cast<int>(parameter_of(effect, which));
}

TEST(PredictionError, ResidualsAreTheFiltersWhitenedInnovations) {
    for (const auto& [effects, noise] :
         {std::pair{kPlain, ordinary_noise()}, std::pair{kLate, ordinary_noise()},
          std::pair{kPlain, sloping_noise()}, std::pair{kLate, sloping_noise()},
          std::pair{kPlain, coloured_noise()}}) {
        const Problem problem = two_runs(effects);
        const Parameters p = typical_parameters();
        const FrozenFilter filter = freeze(problem, p.data(), noise);
        const Eigen::VectorXd e = residuals_of(problem, p, filter);
        const Trace t = trace(problem, p.data(), noise, false);
        ASSERT_EQ(t.whitened.size(), static_cast<std::size_t>(e.size()));
        EXPECT_LT((e - Eigen::Map<const Eigen::VectorXd>(t.whitened.data(), e.size()))
                      .cwiseAbs()
                      .maxCoeff(),
                  1e-9);
        EXPECT_NEAR(filter.log_likelihood, t.log_likelihood, 1e-9);
        EXPECT_NEAR(half_sum_of_squares(problem, p.data(), filter), 0.5 * e.squaredNorm(),
                    1e-9 * e.squaredNorm());
        std::size_t there = 0;
        for (const auto& run : problem.runs)
            for (const auto& y : run.measurements)
                for (double value : y) there += std::isnan(value) ? 0 : 1;
        EXPECT_EQ(filter.observed, there);
        // White: about one per measured element, near the truth.
        EXPECT_NEAR(e.squaredNorm() / static_cast<double>(there), 1.0, 0.25);
    }
}

TEST(PredictionError, DisturbancesThatAreNotThereChangeNothing) {
    // Without them the filter has three states less.
    const Parameters p = typical_parameters();
    const Noise none = white_noise();
    Noise small = none;
    small.disturbance = {1e-7, 1e-7, 1e-7};
    ASSERT_TRUE(none.white() && !small.white());
    for (const EffectMask effects : {kPlain, kLate}) {
        const Problem problem = two_runs(effects);
        const FrozenFilter three = freeze(problem, p.data(), none);
        const FrozenFilter six = freeze(problem, p.data(), small);
        EXPECT_EQ(three.rows.size() + 3U, six.rows.size());
        EXPECT_EQ(small.disturbances(), 3U);
        EXPECT_NEAR(three.log_likelihood, six.log_likelihood, 1e-7);
        EXPECT_LT((residuals_of(problem, p, three) - residuals_of(problem, p, six)).norm(), 1e-6);
        const std::vector<int> columns{kBFront, kYawInertia, column_of("mass")};
        EXPECT_LT((sensitivities_of(problem, p, three, columns) -
                   sensitivities_of(problem, p, six, columns))
                      .norm(),
                  1e-6 * sensitivities_of(problem, p, six, columns).norm());
        using All = std::array<double, kNoiseParameters>;
        All score{}, other{};
        std::array<double, std::size_t{kNoiseParameters} * kNoiseParameters> information{};
        noise_score(problem, p.data(), none, score.data(), information.data());
        noise_score(problem, p.data(), small, other.data(), information.data());
        for (std::size_t i = 0; i < score.size(); ++i)
            EXPECT_NEAR(score[i], other[i], 1e-6 * (1.0 + std::abs(other[i]))) << i;
        const Trace filtered = trace(problem, p.data(), none, true);
        const Trace full = trace(problem, p.data(), small, true);
        for (std::size_t i = 0; i < filtered.state.size(); ++i) {
            if (!std::isnan(full.state[i])) {
                EXPECT_NEAR(filtered.state[i], full.state[i], 1e-6) << i;
            }
        }
    }
}

TEST(PredictionError, ObservationHasNoPlaceThatNothingWrites) {
    const Problem problem = two_runs(kAllEffects);
    const Parameters p = typical_parameters();
    const RunSystem<kStatesMost> system(problem.model, problem.runs[0], p.data(), ordinary_noise());
    Mat<kChannels, kStatesMost> H;
    H.setConstant(std::nan(""));
    EXPECT_TRUE(system.observe(0, system.initial_mean(), H).allFinite());
    EXPECT_TRUE(H.allFinite());
}

struct Case {
    const char* name;
    EffectMask effects;
    bool force_known = true, held = false;
};
class Sensitivities : public testing::TestWithParam<Case> {};
INSTANTIATE_TEST_SUITE_P(Models, Sensitivities,
                         testing::Values(Case{"Motion", kPlain}, Case{"Lagging", kLate},
                                         Case{"MotionByAcceleration", kPlain, false},
                                         Case{"All", kAllEffects},
                                         Case{"HeldWithLoads", kPlain, true, true}),
                         [](const auto& it) { return it.param.name; });

TEST_P(Sensitivities, AreTheDerivativesOfTheResiduals) {
    const Case& asked = GetParam();
    const Problem problem = two_runs(asked.effects, asked.force_known, asked.held);
    Parameters p = typical_parameters();
    // At the round values of the delays the number of integration steps changes: no derivative, and
    // differences that straddle it.
    for (const int i : {column_of("sensor_delay", 0), column_of("sensor_delay", 1)})
        p[static_cast<std::size_t>(i)] *= 1.03;
    const FrozenFilter filter = freeze(problem, p.data(), ordinary_noise());
    const std::vector<int> columns = all_columns();
    const Rows G = sensitivities_of(problem, p, filter, columns);
    ASSERT_TRUE(G.allFinite());
    int moved = 0;
    for (int i : columns) {
        const auto n = static_cast<std::size_t>(i);
        const Eigen::VectorXd difference = central_difference(
            [&](double value) {
                Parameters q = p;
                q[n] = value;
                return residuals_of(problem, q, filter);
            },
            p[n], 1e-3 * std::abs(p[n]));
        const double scale = difference.norm();
        // Rounding of the residuals, divided by the step.
        const double rounding = 1e-10 / (1e-3 * std::abs(p[n]));
        EXPECT_LT((G.col(i) + difference).norm(), 1e-5 * scale + rounding) << "parameter " << i;
        if (scale > 1e3 * rounding) ++moved;
    }
    EXPECT_GE(moved, 15);
}

TEST(PredictionError, ColumnsDoNotDependOnTheirCompany) {
    const Problem problem = two_runs(kLate);
    const Parameters p = typical_parameters();
    const FrozenFilter filter = freeze(problem, p.data(), ordinary_noise());
    const Rows all = sensitivities_of(problem, p, filter, all_columns());
    const std::vector<int> some{column_of("steer_lag"), kDRear, column_of("side_wind", 1)};
    const Rows few = sensitivities_of(problem, p, filter, some);
    for (std::size_t j = 0; j < some.size(); ++j)
        EXPECT_EQ((few.col(static_cast<int>(j)) - all.col(some[j])).norm(), 0.0);
}

TEST(PredictionError, NormalEquationsAreProducts) {
    const Problem problem = two_runs(kLate);
    const Parameters p = typical_parameters();
    const FrozenFilter filter = freeze(problem, p.data(), ordinary_noise());
    const std::vector<int> columns{kBFront,
                                   kDFront,
                                   kBRear,
                                   kYawInertia,
                                   column_of("steer_lag"),
                                   column_of("tyre_relaxation"),
                                   column_of("mass"),
                                   column_of("gyro_bias"),
                                   column_of("combined_slip"),
                                   column_of("cg_position")};
    const auto n = static_cast<int>(columns.size());
    Eigen::VectorXd gradient(n);
    Rows information(n, n);
    const double cost =
        normal_equations(problem, p.data(), filter, columns, gradient.data(), information.data());
    const Eigen::VectorXd e = residuals_of(problem, p, filter);
    const Rows G = sensitivities_of(problem, p, filter, columns);
    EXPECT_NEAR(cost, 0.5 * e.squaredNorm(), 1e-12 * cost);
    EXPECT_LT((gradient - G.transpose() * e).norm(), 1e-10 * gradient.norm());
    EXPECT_LT((information - G.transpose() * G).norm(), 1e-12 * information.norm());
    // The gradient of the cost is minus G^T e, the residuals' derivative being -G.
    const double slope = central_difference(
        [&](double value) {
            Parameters q = p;
            q[kDFront] = value;
            return half_sum_of_squares(problem, q.data(), filter);
        },
        p[kDFront], 1e-3);
    EXPECT_NEAR(gradient[1], -slope, 1e-5 * std::abs(slope));
}

TEST(PredictionError, ConstantSignalsAnswerLikeTheEffectsThatAreConstant) {
    const Problem problem = two_runs(kLate);
    const Parameters p = typical_parameters();
    const FrozenFilter filter = freeze(problem, p.data(), ordinary_noise());
    const std::vector<int> targets{kForceY, kMomentZ, kGravityX,
                                   kPushes + static_cast<int>(kYawRate)};
    const Rows ones = Rows::Ones(static_cast<int>(problem.samples()), 4);
    const Rows answers = signals_of(problem, p, filter, ones, targets);
    const Rows G = sensitivities_of(problem, p, filter,
                                    {column_of("side_wind", 0), column_of("side_wind", 1),
                                     column_of("road_grade"), column_of("gyro_bias")});
    const double slope = -kGravity * std::cos(p[parameter_of("road_grade")]);
    const std::array<double, 4> factor{1.0, 1.0, slope, 1.0};
    for (int j = 0; j < 4; ++j) {
        ASSERT_GT(G.col(j).norm(), 0.0);
        EXPECT_LT((factor[static_cast<std::size_t>(j)] * answers.col(j) - G.col(j)).norm(),
                  1e-9 * G.col(j).norm())
            << "target " << targets[static_cast<std::size_t>(j)];
    }
}

TEST(PredictionError, SignalOnAReadingIsTakenOffTheMeasurement) {
    // More signals than are differentiated in one pass, each its own shape, over both runs.
    const Problem problem = two_runs(kPlain);
    const Parameters p = typical_parameters();
    const FrozenFilter filter = freeze(problem, p.data(), ordinary_noise());
    const auto n = static_cast<int>(problem.samples());
    std::vector<int> targets;
    for (int j = 0; j < 10; ++j) targets.push_back(kPushes + j % kChannels);
    Rows signals(n, 10);
    for (int k = 0; k < n; ++k)
        for (int j = 0; j < 10; ++j) signals(k, j) = 1e-3 * std::sin(0.1 * (j + 1) * k + j);
    int first = 0;
    for (const auto& run : problem.runs) {
        signals.row(first).setZero();  // the start of the state is read off the first sample
        first += static_cast<int>(run.size());
    }
    const Rows answers = signals_of(problem, p, filter, signals, targets);
    for (int j = 0; j < 10; ++j) {
        // A reading expected higher by s leaves the same error as a measurement lower by s.
        const auto residuals_lowered = [&](double sign) {
            Problem moved = problem;
            int k = 0;
            for (auto& run : moved.runs)
                for (auto& y : run.measurements) y[j % kChannels] -= sign * signals(k++, j);
            return residuals_of(moved, p, filter);
        };
        const Eigen::VectorXd difference = 0.5 * (residuals_lowered(1.0) - residuals_lowered(-1.0));
        EXPECT_LT((answers.col(j) + difference).norm(), 1e-5 * difference.norm()) << j;
        EXPECT_GT(difference.norm(), 1e-3) << j;
    }
}

}  // namespace
}  // namespace sysid::test
