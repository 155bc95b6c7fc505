// What the filter and the smoother say of each sample, and prediction further ahead.
#include <algorithm>

#include "helpers.hpp"
#include "sysid/dynamics/steer_delay.hpp"
#include "sysid/identify/prediction_error.hpp"

namespace sysid::test {
namespace {

const auto kTwoLags = mask_of({"steer_lag", "tyre_relaxation"});

Problem one_run(EffectMask effects) {
    const SingleTrack model{saloon(), effects};
    Problem problem{model, {noisy_run(model, typical_parameters(), 200, 0.01, 7)}};
    problem.runs[0].measurements[10][kAy] = std::nan("");
    return problem;
}

TEST(Trace, SmoothingGainsCertaintyAndKeepsTheEnd) {
    for (EffectMask effects : {EffectMask{0}, kTwoLags}) {
        const Problem problem = one_run(effects);
        const Parameters p = typical_parameters();
        const Trace filtered = trace(problem, p.data(), ordinary_noise(), false);
        const Trace smoothed = trace(problem, p.data(), ordinary_noise(), true);
        EXPECT_EQ(filtered.log_likelihood, smoothed.log_likelihood);
        ASSERT_EQ(filtered.state_std.size(), problem.samples() * kStatesTold);
        ASSERT_EQ(smoothed.state_std.size(), filtered.state_std.size());
        const std::size_t last = filtered.state.size() - kStatesTold;
        const ActiveStates own = active_states(effects);
        const auto absent = [&](std::size_t state) {
            return state >= kStatesPlain &&
                   std::find(own.begin(), own.end(), state - kStatesPlain) == own.end();
        };
        for (std::size_t n = 0; n < filtered.state.size(); ++n) {
            if (absent(n % kStatesTold)) {
                EXPECT_TRUE(std::isnan(filtered.state[n]));
                EXPECT_TRUE(std::isnan(smoothed.state_std[n]));
                continue;
            }
            EXPECT_LE(smoothed.state_std[n], filtered.state_std[n] * (1.0 + 1e-6) + 1e-12);
            if (n >= last) {
                EXPECT_EQ(smoothed.state[n], filtered.state[n]);
            }
        }
        // In the middle of the record the sideslip is known much better afterwards.
        EXPECT_LT(smoothed.state_std[100 * kStatesTold + 1],
                  0.95 * filtered.state_std[100 * kStatesTold + 1]);
    }
}

TEST(Trace, MissingMeasurementsLeaveGaps) {
    const Trace t = trace(one_run(0), typical_parameters().data(), ordinary_noise(), false);
    for (std::size_t n = 0; n < t.innovation.size(); ++n) {
        const bool missing = n == 10 * kChannels + kAy;
        EXPECT_EQ(std::isnan(t.innovation[n]), missing) << n;
        EXPECT_EQ(std::isnan(t.spread[n]), missing) << n;
        EXPECT_FALSE(std::isnan(t.whitened[n])) << n;
    }
    EXPECT_EQ(t.whitened[10 * kChannels + kAy], 0.0);
}

TEST(Trace, FirstWhitenedElementIsInnovationOverSpread) {
    // The Cholesky factor is triangular: the first channel is scaled by its own spread only.
    const Trace t = trace(one_run(0), typical_parameters().data(), ordinary_noise(), false);
    for (std::size_t n = 0; n < t.innovation.size(); n += kChannels)
        EXPECT_NEAR(t.whitened[n], t.innovation[n] / t.spread[n],
                    1e-10 * (1.0 + std::abs(t.whitened[n])));
}

TEST(LookAhead, PerfectModelAndDataLeaveNoError) {
    for (EffectMask effects : {EffectMask{0}, kTwoLags}) {
        const SingleTrack model{saloon(), effects};
        const Parameters p = typical_parameters();
        Problem problem{model, {}};
        sysid::Run run;  // gtest has a Run of its own
        for (int k = 0; k < 100; ++k) run.inputs.push_back(lively(0.01 * k));
        run.measurements = drive(model, p, run.inputs, 0.01, 20.0);
        problem.runs = {run, run};
        for (std::size_t ahead : {1U, 20U}) {
            std::vector<double> errors(problem.samples() * kChannels);
            look_ahead(problem, p.data(), ordinary_noise(), {{ahead, 1}}, errors.data());
            for (std::size_t n = 0; n < errors.size(); ++n) {
                const std::size_t k = n / kChannels % run.size();
                if (k < ahead) {
                    EXPECT_TRUE(std::isnan(errors[n])) << n;
                } else {
                    EXPECT_NEAR(errors[n], 0.0, 1e-9) << n;
                }
            }
        }
    }
}

TEST(LookAhead, ErrorOfAWrongModelGrowsWithTheHorizon) {
    const Problem problem = one_run(0);
    Parameters p = typical_parameters();
    p[kBRear] *= 0.7;
    const auto yaw_rate_error = [&](std::size_t ahead) {
        std::vector<double> errors(problem.samples() * kChannels);
        look_ahead(problem, p.data(), ordinary_noise(), {{ahead, 1}}, errors.data());
        double sum = 0.0;
        for (std::size_t k = 60; k < problem.samples(); ++k)
            sum += std::pow(errors[k * kChannels + kYawRate], 2);
        return std::sqrt(sum);
    };
    // Starting fewer predictions, and reading them on the way, leaves them as they were.
    std::vector<double> all(problem.samples() * kChannels), both(2 * all.size());
    look_ahead(problem, p.data(), ordinary_noise(), {{30, 1}}, all.data());
    look_ahead(problem, p.data(), ordinary_noise(), {{44, 2}, {30, 7}}, both.data());
    const std::vector<double> few(both.begin() + static_cast<std::ptrdiff_t>(all.size()),
                                  both.end());
    for (std::size_t k = 0; k < problem.samples(); ++k) {
        const std::size_t n = k * kChannels + kYawRate;
        if (k >= 30 && (k - 30) % 7 == 0)
            EXPECT_EQ(few[n], all[n]) << k;
        else
            EXPECT_TRUE(std::isnan(few[n])) << k;
    }
    look_ahead(problem, p.data(), ordinary_noise(), {{44, 2}}, all.data());
    for (std::size_t n = 0; n < all.size(); ++n)
        if (!std::isnan(all[n]) || !std::isnan(both[n])) {
            EXPECT_EQ(both[n], all[n]) << n;
        }
    EXPECT_THROW(look_ahead(problem, p.data(), ordinary_noise(), {{30, 0}}, all.data()),
                 std::invalid_argument);
    EXPECT_GT(yaw_rate_error(30), 1.5 * yaw_rate_error(3));
}

TEST(LookAhead, ErrorsKnowTheSlopesThatAreToldOrTheGradeAloneAndReadingsNone) {
    Parameters p = typical_parameters();
    for (const std::size_t samples : {std::size_t{600}, std::size_t{6000}}) {  // in pieces, too
        const auto slopes = mask_of({"road_bank", "road_grade"});
        Problem problem{SingleTrack{saloon(), slopes}, {}};
        problem.runs = {noisy_run(problem.model, p, samples, 0.01, 11)};
        problem.model = SingleTrack{saloon(), 0};
        Noise noise = sloping_noise();
        noise.road_time_s = 0.5;
        const std::size_t ahead = 150;
        std::vector<double> told(samples * kChannels), alone(told.size()), foreseen(told.size());
        std::vector<double> means(samples * kStatesTold), road(samples * 2);
        smoothed_means(problem, p.data(), noise, means.data());
        for (std::size_t k = 0; k < samples; ++k)
            std::copy_n(&means[k * kStatesTold + kStatesFull], 2, &road[2 * k]);
        look_ahead(problem, p.data(), noise, {{ahead, 3}}, told.data(), false, road.data());
        look_ahead(problem, p.data(), noise, {{ahead, 3}}, alone.data());
        look_ahead(problem, p.data(), noise, {{ahead, 3}}, foreseen.data(), true);
        for (const int c : {kVx, kVy}) {
            const double sensor = noise.sensor[static_cast<std::size_t>(c)];
            double with = 0.0, by_grade = 0.0, without = 0.0, count = 0.0;
            for (std::size_t k = ahead; k < samples; k += 3) {
                const std::size_t n = k * kChannels + static_cast<std::size_t>(c);
                with += std::pow(told[n], 2);
                by_grade += std::pow(alone[n], 2);
                without += std::pow(problem.runs[0].measurements[k][c] - foreseen[n], 2);
                count += sensor * sensor;
            }
            EXPECT_LT(with, 1.5 * count) << c << " of " << samples;
            EXPECT_GT(without, 3.0 * count) << c << " of " << samples;
            const double limit = c == kVx ? 1.5 : 3.0;
            EXPECT_EQ(by_grade < limit * count, c == kVx) << c << " of " << samples;
        }
    }
}

TEST(Trace, TellsTheSlopeOfTheRoad) {
    const Parameters p = typical_parameters();
    Problem problem{SingleTrack{saloon(), mask_of({"road_bank", "road_grade"})}, {}};
    problem.runs = {noisy_run(problem.model, p, 600, 0.01, 11)};
    problem.model = SingleTrack{saloon(), 0};
    const Trace told = trace(problem, p.data(), sloping_noise(), true);
    const Trace level = trace(problem, p.data(), ordinary_noise(), true);
    const std::array<double, 2> angles{p[parameter_of("road_grade")], p[parameter_of("road_bank")]};
    for (std::size_t k = 100; k < 500; ++k)
        for (std::size_t i = 0; i < kRoadStates; ++i) {
            const std::size_t n = k * kStatesTold + kStatesFull + i;
            const double size = kGravity * std::sin(std::abs(angles[i]));
            EXPECT_GT(told.state_std[n], 0.0);
            EXPECT_NEAR(std::abs(told.state[n]), size, 4.0 * told.state_std[n]) << k << " " << i;
            EXPECT_TRUE(std::isnan(level.state[n]));
        }
}

TEST(LookAhead, SlopesAreThoseOfSteeringAsItActs) {
    const SingleTrack model{saloon(), mask_of({"steer_delay"})};
    const Parameters p = typical_parameters();
    ASSERT_GT(std::abs(steer_delay(model, p.data())), 1e-3);
    sysid::Run run;
    for (int k = 0; k < 300; ++k) run.inputs.push_back(lively(0.01 * k));
    run.measurements = drive(model, p, run.inputs, 0.01, 20.0);
    const Problem problem{model, {run}};
    std::vector<double> errors(problem.samples() * kChannels);
    look_ahead(problem, p.data(), sloping_noise(), {{50, 1}}, errors.data());
    for (std::size_t n = 50 * kChannels; n < errors.size(); ++n)
        EXPECT_NEAR(errors[n], 0.0, 1e-6) << n;
}

TEST(LookAhead, OnALevelRoadErrorsAreThoseOfReadings) {
    const Problem problem = one_run(0);
    const Parameters p = typical_parameters();
    std::vector<double> errors(problem.samples() * kChannels), foreseen(errors.size());
    look_ahead(problem, p.data(), ordinary_noise(), {{40, 1}}, errors.data());
    look_ahead(problem, p.data(), ordinary_noise(), {{40, 1}}, foreseen.data(), true);
    for (std::size_t k = 40; k < problem.samples(); ++k) {
        const std::size_t n = k * kChannels + kYawRate;
        EXPECT_EQ(errors[n], problem.runs[0].measurements[k][kYawRate] - foreseen[n]) << k;
    }
}

}  // namespace
}  // namespace sysid::test
