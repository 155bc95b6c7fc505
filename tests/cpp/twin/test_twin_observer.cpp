// Laws, batch and observers of the twin.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <string>

#include "sysid/math/errors.hpp"
#include "sysid/published/double_track.hpp"
#include "sysid/twin/observer.hpp"

using namespace sysid;

namespace {

constexpr double kDt = 1e-3;
constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

Estimates start() { return to_estimates(Load{}); }

ParameterLaw mass_law(double gain) {
    ParameterLaw law;
    law.gain = gain;
    return law;
}

/// A reading of one over the mass, by a car of 2000 kg.
double read(double mass, double t) { return 4000.0 * std::sin(t) / mass; }

}  // namespace

TEST(TwinLaws, AHeavierCarMakesTheParameterGrow) {
    ParameterLaws laws({mass_law(100.0)}, kDt, 1);
    Estimates load = start();
    const double before = load[kMass];
    const double car[2] = {0.9, 0.0}, twin[2] = {1.0, 0.0};
    laws.update(car, twin, load);
    EXPECT_NEAR(load[kMass] - before, 100.0 * 0.1 * kDt, 1e-12);
    // Braking: the same the other way round.
    const double slow[2] = {-0.9, 0.0}, slower[2] = {-1.0, 0.0};
    laws.update(slow, slower, load);
    EXPECT_NEAR(load[kMass] - before, 200.0 * 0.1 * kDt, 1e-12);
}

TEST(TwinLaws, LimitsGatesAndMissingReadingsHold) {
    ParameterLaw law = mass_law(1e6);
    law.upper = 2200.0;
    law.yaw_rate_below_radps = 0.05;
    ParameterLaws laws({law}, kDt, 1);
    Estimates load = start();
    const double twin[2] = {1.0, 0.0};
    const double turning[2] = {0.9, 0.1}, missing[2] = {kNone, 0.0}, straight[2] = {0.5, 0.0};
    laws.update(turning, twin, load);
    laws.update(missing, twin, load);
    EXPECT_EQ(load, start());
    for (int k = 0; k < 10; ++k) laws.update(straight, twin, load);
    EXPECT_EQ(load[kMass], 2200.0);
}

TEST(TwinLaws, AnUnknownYawRateClosesAGateThatAsksForIt) {
    const double car[2] = {0.9, kNone}, twin[2] = {1.0, 0.0};
    ParameterLaw straight = mass_law(100.0), bends = mass_law(100.0);
    straight.yaw_rate_below_radps = 0.05;
    bends.yaw_rate_above_radps = 0.05;
    for (const ParameterLaw& gated : {straight, bends}) {
        ParameterLaws laws({gated}, kDt, 1);
        Estimates load = start();
        laws.update(car, twin, load);
        EXPECT_EQ(load, start());
    }
    ParameterLaws open({mass_law(100.0)}, kDt, 1);
    Estimates load = start();
    open.update(car, twin, load);
    EXPECT_GT(load[kMass], start()[kMass]);
}

TEST(TwinLaws, TheDerivativeOfARampIsItsSlope) {
    Derivative derivative(20.0, kDt);
    double slope = 0.0;
    for (int k = 0; k < 500; ++k) slope = derivative(3.0 * k * kDt);
    EXPECT_NEAR(slope, 3.0, 1e-9);
}

TEST(TwinBatch, FindsTheMassOfALinearReading) {
    BatchEstimator batch({{kMass, 20.0, 300.0, 0.0, 1000.0, 3000.0}}, {{0, 0.05, 0.0}}, kDt);
    EXPECT_EQ(batch.twins(), 2U);
    Estimates estimate = start();
    std::mt19937 generator(1);
    std::normal_distribution<double> noise(0.0, 0.05);
    for (int k = 0; k < 40000; ++k) {
        const double t = k * kDt;
        const double car = read(2000.0, t) + noise(generator);
        const double twins[2] = {read(batch.of_twin(0, estimate)[kMass], t),
                                 read(batch.of_twin(1, estimate)[kMass], t)};
        batch.update(&car, twins, 1, estimate);
    }
    const double spread = 300.0 * std::sqrt(batch.covariance()(0, 0));
    EXPECT_NEAR(estimate[kMass], 2000.0, 5.0 * spread);
    EXPECT_LT(spread, 2.0);
}

TEST(TwinBatch, TwinsThatStepOftenerThanTheCarIsReadBelieveNoMore) {
    // Ten readings a second, with more noise than was promised; the twins step with them, or ten
    // times between.
    const auto spread = [](int between) {
        const double dt = 0.1 / between;
        BatchEstimator batch({{kMass, 20.0, 300.0, 0.0, 1000.0, 3000.0}}, {{0, 0.01, 0.0}}, dt);
        Estimates estimate = start();
        std::mt19937 generator(2);
        std::normal_distribution<double> noise(0.0, 0.1);
        for (int k = 0; k < 300 * between; ++k) {
            const double t = k * dt;
            const double car = k % between == 0 ? read(2000.0, t) + noise(generator) : kNone;
            const double twins[2] = {read(batch.of_twin(0, estimate)[kMass], t),
                                     read(batch.of_twin(1, estimate)[kMass], t)};
            batch.update(&car, twins, 1, estimate);
        }
        return std::sqrt(batch.covariance()(0, 0));
    };
    EXPECT_NEAR(spread(10) / spread(1), 1.0, 0.1);
}

TEST(TwinBatch, TheOrderOfTheChannelsDoesNotMatter) {
    // Two readings tell the same mass; wild ones, which are limited, come in one of them.
    const auto found = [](bool swapped) {
        const std::size_t first = swapped ? 1 : 0;
        BatchEstimator batch({{kMass, 20.0, 300.0, 0.0, 1000.0, 3000.0}},
                             {{first, 0.05, 0.0}, {1 - first, 0.05, 0.0}}, kDt);
        Estimates estimate = start();
        std::mt19937 generator(3);
        std::normal_distribution<double> noise(0.0, 0.05);
        for (int k = 0; k < 6000; ++k) {
            const double t = k * kDt;
            const double wild = k % 2000 == 1999 ? 5.0 : 0.0;
            const double car[2] = {read(2000.0, t) + noise(generator) + wild,
                                   2.0 * read(2000.0, t) + noise(generator)};
            const double one = read(batch.of_twin(0, estimate)[kMass], t);
            const double other = read(batch.of_twin(1, estimate)[kMass], t);
            const double twins[4] = {one, 2.0 * one, other, 2.0 * other};
            batch.update(car, twins, 2, estimate);
        }
        return std::pair{estimate[kMass], batch.spread()[0]};
    };
    const auto one = found(false), other = found(true);
    EXPECT_NEAR(one.first, other.first, 1e-9);
    EXPECT_NEAR(one.second, other.second, 1e-12);
}

TEST(TwinBatch, WithoutExcitationNothingIsClaimed) {
    BatchEstimator batch({{kMass, 20.0, 300.0, 0.0, 1000.0, 3000.0}}, {{0, 0.05, 0.0}}, kDt);
    Estimates estimate = start();
    const double car = 0.3, twins[2] = {0.0, 0.0};
    for (int k = 0; k < 20000; ++k) batch.update(&car, twins, 1, estimate);
    EXPECT_EQ(estimate, start());
    EXPECT_NEAR(batch.covariance()(0, 0), 1.0, 1e-9);
}

TEST(TwinBatch, ColouredResidualsWidenTheSpreadToWhatTheEstimatesScatter) {
    // Residuals with a memory of half a second: 1000 samples say as much as one.
    double scatter = 0.0, white = 0.0, shown = 0.0;
    constexpr int kRuns = 40;
    for (int run = 0; run < kRuns; ++run) {
        BatchEstimator batch({{kMass, 20.0, 300.0, 0.0, 1000.0, 3000.0}}, {{0, 0.05, 0.0}}, kDt);
        Estimates estimate = start();
        std::mt19937 generator(static_cast<unsigned>(run));
        std::normal_distribution<double> noise(0.0, 1.0);
        double coloured = 0.0;
        for (int k = 0; k < 60000; ++k) {
            const double t = 1.3 * k * kDt;
            coloured += -2e-3 * coloured + 0.05 * std::sqrt(4e-3) * noise(generator);
            const double car = read(2000.0, t) + coloured;
            const double twins[2] = {read(batch.of_twin(0, estimate)[kMass], t),
                                     read(batch.of_twin(1, estimate)[kMass], t)};
            batch.update(&car, twins, 1, estimate);
        }
        scatter += std::pow(estimate[kMass] - 2000.0, 2) / kRuns;
        white += std::pow(300.0, 2) * batch.covariance()(0, 0) / kRuns;
        shown += std::pow(300.0 * batch.spread()[0], 2) / kRuns;
    }
    EXPECT_GT(scatter, 9.0 * white);
    EXPECT_GT(shown, 0.5 * scatter);
    EXPECT_LT(shown, 3.0 * scatter);
}

TEST(TwinBatch, AConsideredDoubtStaysInTheSpreadOfWhatItCannotBeToldFrom) {
    // Readings s F/m tell s/m alone: the mass cannot be known better than the scale.
    for (const double scale : {1.0, 1.05}) {
        BatchEstimator batch({{kMass, 20.0, 300.0, 0.0, 1000.0, 3000.0},
                              {kInputScale, -0.01, 0.03, 0.0, 0.5, 1.5, true}},
                             {{0, 0.05, 0.0}}, kDt);
        Estimates estimate = start();
        for (int k = 0; k < 100000; ++k) {
            const double t = k * kDt, car = read(2000.0, t);
            double twins[3];
            for (std::size_t i = 0; i < 3; ++i) {
                const Estimates e = batch.of_twin(i, estimate);
                twins[i] = scale * e[kInputScale] * read(e[kMass], t);
            }
            batch.update(&car, twins, 1, estimate);
        }
        EXPECT_EQ(estimate[kInputScale], 1.0);
        EXPECT_NEAR(estimate[kMass], 2000.0 * scale, 2.0);
        EXPECT_NEAR(300.0 * batch.spread()[0] / estimate[kMass], 0.03, 0.0005);
        EXPECT_NEAR(batch.spread()[1], 1.0, 1e-9);
    }
}

TEST(TwinBatch, WhatIsConsideredCostsNothingWhereReadingsDoNotDependOnIt) {
    double spreads[2];
    for (const bool considered : {false, true}) {
        std::vector<BatchParameter> unknown{{kMass, 20.0, 300.0, 0.0, 1000.0, 3000.0}};
        if (considered) unknown.push_back({kInputScale, 0.01, 0.03, 0.0, 0.5, 1.5, true});
        BatchEstimator batch(unknown, {{0, 0.05, 0.0}}, kDt);
        Estimates estimate = start();
        std::mt19937 generator(5);
        std::normal_distribution<double> noise(0.0, 0.05);
        for (int k = 0; k < 30000; ++k) {
            const double t = k * kDt, car = read(2000.0, t) + noise(generator);
            double twins[3];
            for (std::size_t i = 0; i < batch.twins(); ++i)
                twins[i] = read(batch.of_twin(i, estimate)[kMass], t);
            batch.update(&car, twins, 1, estimate);
        }
        spreads[considered ? 1 : 0] = batch.spread()[0];
    }
    EXPECT_NEAR(spreads[1] / spreads[0], 1.0, 1e-9);
}

TEST(TwinBatch, PlacesStepsAndSpreadsOutOfRangeAreRefused) {
    const std::vector<BatchChannel> channels{{0, 0.05, 0.0}};
    const BatchParameter good{kMass, 20.0, 300.0, 0.0, 1000.0, 3000.0};
    EXPECT_NO_THROW(BatchEstimator({good}, channels, kDt));
    for (const int place : {-1, static_cast<int>(kEstimates)}) {
        BatchParameter bad = good;
        bad.parameter = place;
        EXPECT_THROW(BatchEstimator({bad}, channels, kDt), std::invalid_argument);
    }
    BatchParameter bad = good;
    bad.step = 0.0;
    EXPECT_THROW(BatchEstimator({bad}, channels, kDt), std::invalid_argument);
    bad = good;
    bad.spread = kNone;
    EXPECT_THROW(BatchEstimator({bad}, channels, kDt), std::invalid_argument);
    EXPECT_THROW(BatchEstimator({good}, {{0, 0.0, 0.0}}, kDt), std::invalid_argument);
    EXPECT_THROW(BatchEstimator({good}, channels, 0.0), std::invalid_argument);
    ParameterLaw law = mass_law(1.0);
    law.parameter = static_cast<int>(kLoadParameters);
    EXPECT_THROW(ParameterLaws({law}, kDt, 1), std::invalid_argument);
}

TEST(TwinObserver, PlacesOutOfRangeAreRefusedBeforeAnythingRuns) {
    const Vehicle14 car{CarData{}};
    const State14 x = car.rest(10.0);
    const Input14 u;
    const std::vector<double> measured(kReadings, kNone);
    const auto refused = [&](const TwinObserverSettings& settings) {
        EXPECT_THROW(observe14(car, x, &u, measured.data(), 1, kDt, settings),
                     std::invalid_argument);
    };
    TwinObserverSettings settings;
    settings.gains = {{1'000'000, 0, 1.0, false}};
    refused(settings);
    settings.gains = {{0, 1'000'000, 1.0, false}};
    refused(settings);
    settings = {};
    settings.scaled = {kTwinInputs};
    refused(settings);
    settings.scaled = {0};
    refused(settings);
    settings.scaled = {};
    settings.starts = {{1, 0, 0.1}};  // there is no second twin
    refused(settings);
    settings.starts = {{0, kTwinStatesWithTyres, 0.1}};
    refused(settings);
    settings = {};
    ParameterLaw law = mass_law(1.0);
    law.channel = kReadings;
    settings.laws = ParameterLaws({law}, kDt, output14::R);
    refused(settings);
    settings = {};
    settings.batch =
        BatchEstimator({{kMass, 20.0, 300.0, 0.0, 1000.0, 3000.0}}, {{kReadings, 0.05, 0.0}}, kDt);
    refused(settings);
}

TEST(TwinObserver, ALoadThatIsNoBodysEndsTheRunWithItsSample) {
    // A law without limits takes the mass below that of the wheels.
    const Vehicle14 car{CarData{}};
    const std::vector<Input14> inputs(200);
    std::vector<double> measured(inputs.size() * kReadings, kNone);
    for (std::size_t k = 0; k < inputs.size(); ++k) measured[k * kReadings] = -5.0;
    TwinObserverSettings settings;
    settings.laws = ParameterLaws({mass_law(1e6)}, kDt, output14::R);
    EXPECT_THROW(observe14(car, car.rest(20.0), inputs.data(), measured.data(), inputs.size(), kDt,
                           settings),
                 NumericalFailure);
}

TEST(TwinObserver, InputsThatAreNoNumbersAreRefusedByTheirPlace) {
    const Vehicle14 car{CarData{}};
    for (std::size_t place = 0; place < kTwinInputs; ++place) {
        std::vector<Input14> inputs(50);
        reinterpret_cast<double*>(&inputs[20])[place] = kNone;
        const std::vector<double> measured(inputs.size() * kReadings, kNone);
        try {
            observe14(car, car.rest(2.0), inputs.data(), measured.data(), inputs.size(), kDt, {});
            FAIL() << place;
        } catch (const std::invalid_argument& error) {
            EXPECT_NE(std::string(error.what()).find("sample 20"), std::string::npos);
        }
    }
}

TEST(TwinObserver, AStepFromWhatIsNoNumberEndsAsOne) {
    // The number of its parts is not cast from what no whole number can hold.
    const Vehicle14 car{CarData{}};
    Input14 u;
    u.brake_nm[1] = kNone;
    State14 x = car.rest(1.0);
    car.step(x, u, kDt);
    x[state14::Vx] = kNone;
    car.step(x, {}, kDt);
    EXPECT_TRUE(std::isnan(x[state14::Vx]));
}

TEST(TwinObserver, TheTruthIsAtRest) {
    const Vehicle14 car{CarData{}};
    std::vector<Input14> inputs(3000);
    for (std::size_t k = 0; k < inputs.size(); ++k) {
        const double pull = 300.0 * std::sin(2e-3 * static_cast<double>(k));
        inputs[k].drive_nm = {0.0, 0.0, pull, pull};
    }
    State14 x = car.rest(15.0);
    const State14 first = x;
    std::vector<double> states(inputs.size() * kTwinStates), outputs(inputs.size() * kTwinOutputs);
    simulate14(car, x, inputs.data(), inputs.size(), kDt, states.data(), outputs.data());
    std::vector<double> measured;
    for (std::size_t k = 0; k < inputs.size(); ++k) {
        const auto row = outputs.begin() + static_cast<std::ptrdiff_t>(k * kTwinOutputs);
        measured.insert(measured.end(), row, row + kReadings);
    }
    TwinObserverSettings settings;
    settings.stride = 0;
    EXPECT_THROW(observe14(car, first, inputs.data(), measured.data(), 1, kDt, settings),
                 std::invalid_argument);
    settings.stride = 10;
    settings.gains = {{output14::Q, state14::Q, 10.0, false}};
    settings.batch = BatchEstimator({{kMass, 20.0, 300.0, 0.0, 1000.0, 3000.0}},
                                    {{output14::Ax, 1e-3, 0.0}}, kDt);
    const Observation seen =
        observe14(car, first, inputs.data(), measured.data(), inputs.size(), kDt, settings);
    EXPECT_EQ(seen.loads.back(), 1.0);
    EXPECT_EQ(seen.loads[seen.loads.size() - kEstimates], car.load().mass_kg);
}

TEST(TwinDoubleTrack, ASteadyTurnIsThatOfTheBicycle) {
    DoubleTrackData car;
    car.front.dy = car.rear.dy = 1.0;
    std::vector<Input14> inputs(8000);
    std::vector<double> measured(inputs.size() * kReadings, kNone);
    const double speed = 15.0, steer = 0.01;
    const double turning = speed * steer / (car.lf_m + car.lr_m);
    for (std::size_t k = 0; k < inputs.size(); ++k) {
        inputs[k].steer_rad = {steer, steer};
        for (std::size_t w = 0; w < kWheels; ++w) {
            const double inwards = (w % 2 == 0 ? 0.5 : -0.5) * car.track_m * turning;
            measured[k * kReadings + output14::kWheelSpeed + w] = (speed - inwards) / car.radius_m;
        }
    }
    const std::vector<double> s = observe_double_track(
        car, {}, {speed, 0.0, 0.0, 0.0}, inputs.data(), measured.data(), inputs.size(), kDt);
    const double r = s[s.size() - 2];
    // Equal tyres per load: neutral steer.
    EXPECT_NEAR(r, turning, 0.02 * r);
}
