// Filters over pieces of driving side by side are those over whole runs.
#include "kernels.hpp"
#include "residuals.hpp"
#include "sysid/identify/logwise.hpp"
#include "sysid/identify/row_filter.hpp"
#include "sysid/identify/side_by_side.hpp"
#include "sysid/math/lanes.hpp"

namespace sysid::test {
namespace {

constexpr double kClose = 2e-11;  // of whitened residuals

const auto kLagging = mask_of({"tyre_relaxation", "steer_lag", "aero_drag", "side_wind"});

/// Steps of 50 ms have several parts, more of them where the car is slow.
Problem long_run(EffectMask effects, std::size_t samples = 2480, bool held = false) {
    SingleTrack truth{saloon(), effects};
    truth.loads_known = truth.inputs_held = held;
    Parameters p = typical_parameters();
    p[kBFront] *= 1.1;
    Problem problem{truth, {noisy_run(truth, p, samples, 0.05, 1)}};
    auto& y = problem.runs[0].measurements;
    for (std::size_t k = 0; k < samples; ++k) {
        if (k % 7 == 3) y[k][kVy] = std::nan("");
        if (k > 100 && k < 106) y[k].setConstant(std::nan(""));
    }
    return problem;
}

/// The error of a speed that is not read stays.
Problem without_speed(Problem problem) {
    for (auto& y : problem.runs[0].measurements) y[kVx] = y[kVy] = y[kAx] = std::nan("");
    return problem;
}

/// Nothing tells where the motion is.
Problem unread(Problem problem) {
    for (auto& y : problem.runs[0].measurements) y.setConstant(std::nan(""));
    return problem;
}

/// The first samples of a run and of its filter: too few to be cut.
FrozenFilter beginning_of(FrozenFilter filter, Problem& problem, std::size_t samples) {
    for (std::size_t i = 0; i < problem.runs.size(); ++i) {
        problem.runs[i].inputs.resize(samples);
        problem.runs[i].measurements.resize(samples);
        filter.runs[i].substeps.resize(samples);
        filter.runs[i].numbers.resize(samples * filter.size());
    }
    return filter;
}

/// Log-likelihood of the filter, one sample after the other.
double in_one_go(const Problem& problem, const Parameters& p, const Noise& noise) {
    double sum = 0.0;
    with_state_size(problem.model.effects, noise, [&](auto nx) {
        for (const sysid::Run& run : problem.runs)
            sum +=
                filter_rows_of(RunSystem<decltype(nx)::value>(problem.model, run, p.data(), noise),
                               [](std::size_t /*k*/, const auto& /*sample*/) {});
    });
    return sum;
}

/// Returns whether pieces were used: sums of other pieces differ in their last digits.
bool expect_whole(const Problem& problem, const Noise& noise) {
    const Parameters p = typical_parameters();
    const FrozenFilter filter = freeze(problem, p.data(), noise);
    const Trace whole = trace(problem, p.data(), noise, false);
    EXPECT_NEAR(filter.log_likelihood, whole.log_likelihood,
                1e-12 * std::abs(whole.log_likelihood));
    const Eigen::VectorXd e = residuals_of(problem, p, silent(filter));
    for (int i = 0; i < e.size(); ++i)
        EXPECT_NEAR(e[i], whole.whitened[static_cast<std::size_t>(i)], kClose) << i;
    return filter.log_likelihood != in_one_go(problem, p, noise);
}

class SideBySide : public OfEachProcessor {};
INSTANTIATE_TEST_SUITE_P(All, SideBySide, testing::ValuesIn(all_lane_kernels()), kernels_name);

TEST_P(SideBySide, PredictionsAreThoseFromOneSampleAfterTheOther) {
    const Parameters p = typical_parameters();
    const std::vector<Horizon> horizons{{9, 3}, {25, 4}, {2, 1}};
    for (const EffectMask effects : {EffectMask{0}, kLagging}) {
        const Problem problem = long_run(effects);
        const sysid::Run& run = problem.runs[0];
        const Trace known = trace(problem, p.data(), ordinary_noise(), false);
        std::vector<double> errors(horizons.size() * run.size() * kChannels);
        look_ahead(problem, p.data(), ordinary_noise(), horizons, errors.data());
        const double* error = errors.data();
        for (const Horizon& h : horizons)
            for (std::size_t end = 0; end < run.size(); ++end, error += kChannels) {
                const std::size_t begin = end - h.ahead;
                if (end < h.ahead || begin % h.every != 0) {
                    EXPECT_TRUE(std::isnan(error[kVx])) << end;
                    continue;
                }
                ModelState<double> x = initial_state(problem.model, run, p.data());
                const double* state = known.state.data() + begin * kStatesTold;
                std::copy_n(state, kMotionStates, x.begin());
                for (const std::size_t i : active_states(effects))
                    x[kMotionStates + i] = state[kStatesPlain + i];
                const std::array<double, kExternals> calm{};
                for (std::size_t k = begin; k < end; ++k)
                    advance(problem.model, x, calm.data(), run.inputs[k], run.inputs[k + 1],
                            p.data(), run.dt, substeps_for(problem.model, p.data(), x[0], run.dt));
                const auto y = sense(problem.model, x, calm.data(), run.inputs[end], p.data());
                for (std::size_t c = 0; c < kChannels; ++c) {
                    const double e = run.measurements[end][static_cast<int>(c)] - y[c];
                    EXPECT_EQ(std::isnan(error[c]), std::isnan(e)) << end;
                    if (!std::isnan(e)) {
                        EXPECT_NEAR(error[c], e, 1e-9) << end;
                    }
                }
            }
    }
}

TEST_P(SideBySide, SmoothedMeansAreThoseOfTheWholeSmoother) {
    const Parameters p = typical_parameters();
    for (const EffectMask effects : {EffectMask{0}, kLagging}) {
        // States without noise make a covariance singular that the whole smoother inverts: it
        // leaves out directions that are surer than rounding. Means alone need no inverse.
        const double close = effects == EffectMask{0} ? 1e-9 : 5e-3;
        for (const Noise& noise :
             {ordinary_noise(), sloping_noise(), coloured_noise(), white_noise()}) {
            const Problem problem = long_run(effects);
            const Trace smoothed = trace(problem, p.data(), noise, true);
            std::vector<double> means(problem.samples() * kStatesTold);
            smoothed_means(problem, p.data(), noise, means.data());
            double apart = 0.0;
            for (std::size_t i = 0; i < means.size(); ++i) {
                EXPECT_EQ(std::isnan(means[i]), std::isnan(smoothed.state[i])) << i;
                if (std::isnan(means[i])) continue;
                const double std = smoothed.state_std[i] + 1e-9;
                EXPECT_NEAR(means[i], smoothed.state[i], close * std) << i;
                apart = std::max(apart, std::abs(means[i] - smoothed.state[i]));
            }
            EXPECT_GT(apart, 0.0);  // other roundings: pieces were used
            std::vector<double> along(means.size());
            smoothed_means(problem, p.data(), freeze(problem, p.data(), noise), along.data());
            for (std::size_t i = 0; i < means.size(); ++i) {
                EXPECT_EQ(std::isnan(means[i]), std::isnan(along[i])) << i;
                if (std::isnan(means[i])) continue;
                EXPECT_NEAR(along[i], means[i], 1e-9 * (smoothed.state_std[i] + 1e-9)) << i;
            }
        }
    }
}

TEST_P(SideBySide, FiltersAreThoseOfWholeRuns) {
    bool cut = false;
    for (const EffectMask effects : {EffectMask{0}, kLagging})
        for (const Noise& noise :
             {ordinary_noise(), sloping_noise(), coloured_noise(), white_noise()}) {
            const Problem problem = long_run(effects);
            ASSERT_EQ(pieces_of(problem.runs).size(), 16U);
            cut = expect_whole(problem, noise) || cut;
        }
    EXPECT_TRUE(cut);
    EXPECT_TRUE(expect_whole(long_run(kLagging, 2480, true), ordinary_noise()));
}

TEST_P(SideBySide, OtherParametersAndModelsGoTheSameWay) {
    Problem problem = long_run(EffectMask{0});
    Parameters p = typical_parameters();
    const FrozenFilter filter = freeze(problem, p.data(), ordinary_noise());
    p[kBFront] *= 1.2;
    problem.model = {saloon(), kLagging};
    const Eigen::VectorXd together = residuals_of(problem, p, filter);
    constexpr std::size_t kFew = 150;
    const FrozenFilter few = beginning_of(filter, problem, kFew);
    ASSERT_TRUE(pieces_of(problem.runs).empty());
    const Eigen::VectorXd alone = residuals_of(problem, p, few);
    EXPECT_LT((together.head(alone.size()) - alone).cwiseAbs().maxCoeff(), kClose);
    EXPECT_NE(together.head(alone.size()), alone);  // other roundings: pieces were used
}

TEST(Pieces, AreNoneWhereTheFilterHoldsTheSpeedForLong) {
    const Problem problem = long_run(EffectMask{0});
    Noise noise = ordinary_noise();
    ASSERT_FALSE(pieces_of(problem.runs, forgets_s(problem, noise)).empty());
    noise.motion[0] = 1e-4;
    noise.disturbance[0] = 1.0;
    EXPECT_TRUE(pieces_of(problem.runs, forgets_s(problem, noise)).empty());
}

/// Lanes take steps of one length together: the clocks of loggers differ by less than is known.
TEST(Pieces, TakeIntervalsThatClocksDoNotTellForOne) {
    const SingleTrack car{saloon(), EffectMask{0}};
    for (const double off : {1e-15, 2e-6, 1e-3}) {
        LogwiseProblem joined(car);
        std::vector<sysid::Run> apart;
        for (unsigned i = 0; i < 5; ++i) {
            apart.push_back(noisy_run(car, typical_parameters(), 400, 0.02 * (1.0 + i * off), i));
            joined.add({}, apart.back());
        }
        const std::vector<sysid::Run>& runs = joined.parts[0].problem.runs;
        const bool same = off < 1e-5;
        EXPECT_EQ(runs[1].dt == runs[0].dt, same) << off;
        // Five lengths take five steps for one, and there are no more than five lanes.
        EXPECT_EQ(pieces_of(runs, 100.0).empty(), !same) << off;
        EXPECT_TRUE(pieces_of(apart, 100.0).empty()) << off;
    }
}

/// Of a force and a slope that are read as one, the slower forgets with the zero of their sum.
TEST(Pieces, WaitUntilAForceIsToldFromTheSlopeOfTheRoad) {
    Problem problem = long_run(EffectMask{0});
    for (auto& y : problem.runs[0].measurements) y[kAx] = y[kAy] = std::nan("");
    Noise noise = ordinary_noise();
    noise.sensor.fill(1e-4);
    noise.motion = {1e-4, 1e-4, 1e-4};
    const double force_mps2 = 0.3, force_s = 1.0, road_mps2 = 0.2, road_s = 5.0;
    noise.disturbance.fill(force_mps2 * problem.model.car.mass_kg);
    noise.correlation_time_s.fill(force_s);
    noise.road.fill(road_mps2);
    noise.road_time_s = road_s;
    const double force = force_mps2 * force_mps2 / force_s, road = road_mps2 * road_mps2 / road_s;
    const double zero = (force / (road_s * road_s) + road / (force_s * force_s)) / (force + road);
    EXPECT_NEAR(forgets_s(problem, noise) * std::sqrt(zero) / -std::log(kMet), 1.0, 1e-3);
}

struct WholeScore {
    double value;
    Vec<kNoiseParameters> gradient;
    Mat<kNoiseParameters, kNoiseParameters> information;
};
WholeScore score_of(const Problem& problem, const Noise& noise) {
    WholeScore out;
    out.value = noise_score(problem, typical_parameters().data(), noise, out.gradient.data(),
                            out.information.data());
    return out;
}

TEST_P(SideBySide, NoiseScoresOfRunsAddUp) {
    for (const EffectMask effects : {EffectMask{0}, kLagging})
        for (const Noise& noise : {ordinary_noise(), sloping_noise()}) {
            Problem problem = long_run(effects, 130);
            ASSERT_TRUE(pieces_of(problem.runs).empty());
            const WholeScore one = score_of(problem, noise);
            problem.runs.resize(16, problem.runs[0]);
            ASSERT_EQ(pieces_of(problem.runs).size(), 16U);
            const WholeScore all = score_of(problem, noise);
            EXPECT_NEAR(all.value, 16.0 * one.value, 1e-12 * std::abs(all.value));
            EXPECT_LT((all.gradient - 16.0 * one.gradient).norm(), 1e-11 * all.gradient.norm());
            EXPECT_LT((all.information - 16.0 * one.information).norm(),
                      1e-11 * all.information.norm());
        }
}

TEST_P(SideBySide, LikelihoodsOfSetsOfParametersAreThoseOfEach) {
    Problem problem = long_run(kLagging, 60);
    problem.runs.push_back(noisy_run(problem.model, typical_parameters(), 40, 0.01, 3));
    std::vector<Parameters> values(18, typical_parameters());
    for (std::size_t i = 0; i < values.size(); ++i) {
        values[i][kBFront] *= 1.0 + 0.03 * static_cast<double>(i);
        values[i][parameter_of("steer_lag")] *= 1.0 + 0.1 * static_cast<double>(i);
    }
    std::vector<const double*> sets;
    for (const Parameters& p : values) sets.push_back(p.data());
    const auto expect_each = [&] {
        std::vector<double> found(sets.size());
        log_likelihoods(problem, sets, sloping_noise(), found.data());
        double off = 0.0;
        for (std::size_t i = 0; i < sets.size(); ++i) {
            const double alone = freeze(problem, sets[i], sloping_noise()).log_likelihood;
            EXPECT_NEAR(found[i], alone, 1e-12 * std::abs(alone)) << i;
            off += std::abs(found[i] - alone);
        }
        return off;
    };
    EXPECT_GT(expect_each(), 0.0);  // other roundings: they went together
    // A lag of nothing takes other steps than the others.
    values[3][parameter_of("steer_lag")] = 0.0;
    expect_each();
    values[3][kBFront] = std::nan("");
    std::vector<double> found(sets.size());
    log_likelihoods(problem, sets, sloping_noise(), found.data());
    EXPECT_EQ(found[3], -std::numeric_limits<double>::infinity());
    EXPECT_TRUE(std::isfinite(found[2]) && std::isfinite(found[17]));
}

TEST(SideBySideToo, NoiseScoreOfPiecesIsThatOfTheWholeRun) {
    const Noise noise = ordinary_noise();
    const Problem quick = long_run(kLagging), slow = without_speed(quick);
    Problem both = quick;  // all in one go, for the sake of the second run
    both.runs.push_back(slow.runs[0]);
    const WholeScore pieces = score_of(quick, noise), rest = score_of(slow, noise);
    const WholeScore whole = score_of(both, noise);
    EXPECT_NEAR(pieces.value + rest.value, whole.value, 1e-11 * std::abs(whole.value));
    EXPECT_LT((pieces.gradient + rest.gradient - whole.gradient).norm(),
              1e-10 * pieces.gradient.norm());
    EXPECT_LT((pieces.information + rest.information - whole.information).norm(),
              1e-10 * pieces.information.norm());
}

struct Equations {
    double cost = 0.0;
    Vec<4> slope;
    Mat<4, 4> information;
};
Equations equations_of(const Problem& problem, const Noise& noise) {
    const Parameters p = typical_parameters();
    const FrozenFilter filter = freeze(problem, p.data(), noise);
    Equations out;
    out.cost = normal_equations(problem, p.data(), filter, {kBFront, kBRear, kDFront, kERear},
                                out.slope.data(), out.information.data());
    return out;
}

/// Noise whose white part is next to nothing, on driving that the model explains.
Noise hardly_any(double force_n, double time_s, double road_mps2 = 0.0) {
    Noise noise = ordinary_noise();
    noise.motion = {1e-4, 1e-4, 1e-5};
    noise.disturbance = {force_n, force_n, 0.7 * force_n};
    noise.correlation_time_s = {time_s, time_s, time_s};
    noise.road = {road_mps2, road_mps2};
    noise.road_time_s = 10.0;
    return noise;
}

TEST(SideBySideToo, AForceMakesTheFilterForgetWhereNoWhiteNoiseDoes) {
    const std::vector<Noise> pushed = {hardly_any(300.0, 0.3), hardly_any(600.0, 0.03),
                                       hardly_any(1000.0, 5.0), hardly_any(1.0, 0.01, 0.3)};
    for (std::size_t i = 0; i < pushed.size(); ++i) {
        SCOPED_TRACE(i);
        const Noise& noise = pushed[i];
        const Problem quick = long_run(i % 2 == 0 ? EffectMask{0} : kLagging);
        const Problem slow = unread(quick);
        ASSERT_FALSE(pieces_of(quick.runs, forgets_s(quick, noise)).empty());
        EXPECT_TRUE(expect_whole(quick, noise));
        Problem both = quick;  // all in one go, for the sake of the second run
        both.runs.push_back(slow.runs[0]);
        ASSERT_FALSE(expect_whole(both, noise));
        const Equations pieces = equations_of(quick, noise), rest = equations_of(slow, noise);
        const Equations whole = equations_of(both, noise);
        EXPECT_NEAR(pieces.cost + rest.cost, whole.cost, 1e-11 * whole.cost);
        EXPECT_LT((pieces.slope + rest.slope - whole.slope).norm(), 1e-10 * whole.slope.norm());
        EXPECT_LT((pieces.information + rest.information - whole.information).norm(),
                  1e-10 * whole.information.norm());
        const WholeScore score = score_of(quick, noise), left = score_of(slow, noise);
        const WholeScore all = score_of(both, noise);
        EXPECT_NEAR(score.value + left.value, all.value, 1e-11 * std::abs(all.value));
        EXPECT_LT((score.gradient + left.gradient - all.gradient).norm(),
                  1e-10 * all.gradient.norm());
        EXPECT_LT((score.information + left.information - all.information).norm(),
                  1e-10 * all.information.norm());
    }
}

TEST(SideBySideToo, WhatIsNotForgottenIsDoneInOneGo) {
    const Problem problem = without_speed(long_run(EffectMask{0}));
    ASSERT_FALSE(pieces_of(problem.runs).empty());
    EXPECT_FALSE(expect_whole(problem, ordinary_noise()));
}

TEST(SideBySideToo, RunsOfAnyNumberAndLength) {
    Problem problem = long_run(EffectMask{0}, 3200);  // two intervals take two steps for one
    const SingleTrack& truth = problem.model;
    for (unsigned i = 0; i < 20; ++i)
        problem.runs.push_back(
            noisy_run(truth, typical_parameters(), 2 + 7 * i, i % 3 == 0 ? 0.05 : 0.04, i));
    const auto pieces = pieces_of(problem.runs);
    ASSERT_GT(pieces.size(), 21U);
    std::size_t at = 0, run = 0;
    for (const Piece& piece : pieces) {
        if (piece.run != run) {
            ASSERT_EQ(at, problem.runs[run].size());
            run = piece.run;
            at = 0;
        }
        ASSERT_EQ(piece.begin, at);
        ASSERT_GT(piece.end, piece.begin);
        at = piece.end;
    }
    EXPECT_EQ(run, problem.runs.size() - 1);
    EXPECT_EQ(at, problem.runs.back().size());
    expect_whole(problem, ordinary_noise());
}

}  // namespace
}  // namespace sysid::test
