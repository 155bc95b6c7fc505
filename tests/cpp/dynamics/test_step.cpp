// One sampling interval: order of the integration, inputs in between, derivatives through it.
#include "helpers.hpp"
#include "sysid/dynamics/step.hpp"

namespace sysid::test {
namespace {

const ModelState<double> kStart{25.0, 0.3, 0.2, 0.02, 0.01, 0.005};
const std::array<double, kExternals> kPush{200.0, -150.0, 100.0, 0.1, -0.2};
const std::array<double, kChannels> kSensorNoise{0.05, 0.03, 0.003, 0.1, 0.1};

double distance(const ModelState<double>& a, const ModelState<double>& b) {
    double sum = 0.0;
    for (std::size_t i = 0; i < kModelStates; ++i) sum += (a[i] - b[i]) * (a[i] - b[i]);
    return std::sqrt(sum);
}

/// Error after 0.2 s in so many steps, then by which factor each doubling of their number lowers
/// it.
std::vector<double> convergence(EffectMask effects, const Parameters& p, int substeps) {
    const SingleTrack model{saloon(), effects};
    const auto moved = [&](int n) {
        ModelState<double> x = kStart;
        advance(model, x, kPush.data(), {0.02, 1000.0}, {0.05, 3000.0}, p.data(), 0.2, n);
        return x;
    };
    const auto exact = moved(16000);
    std::vector<double> out{distance(moved(substeps), exact)};
    double error = out.front();
    for (int doubled : {2 * substeps, 4 * substeps}) {
        const double halved = distance(moved(doubled), exact);
        out.push_back(error / halved);
        error = halved;
    }
    return out;
}

TEST(Step, ErrorFallsWithTheFourthPowerAndOfLagsBehindEachOtherWithTheSecond) {
    const EffectMask lags = lagging_effects();
    const EffectMask roll_steer = mask_of({"front_roll_steer", "rear_roll_steer"});
    const auto motion = convergence(kAllEffects & ~(lags | roll_steer), typical_parameters(), 16);
    const EffectMask axles = mask_of({"front_tyre_relaxation", "rear_tyre_relaxation"});
    // The rate of roll, in 1/s, multiplies errors of a_y by its frequency; it has a test of its
    // own.
    const EffectMask roll = mask_of({"body_roll"}) | roll_steer;
    const auto all = convergence(kAllEffects & ~(axles | roll), typical_parameters(), 64);
    const auto twice = convergence(kAllEffects, typical_parameters(), 64);
    for (std::size_t i : {1, 2}) {
        EXPECT_GT(motion[i], 13.0);
        EXPECT_GT(all[i], 4.0);
        EXPECT_GT(twice[i], 4.0);
    }
    EXPECT_LT(motion[0], 1e-5);
    EXPECT_LT(all[0], 1e-6);
    // Of slip angles that lag twice it is a thousandth of what a sensor of a_y resolves.
    EXPECT_LT(twice[0], 1e-3 * kSensorNoise[kAy]);
}

TEST(Step, AKnownSlopePullsAsAnUnknownOneOfItsSize) {
    const Parameters p = typical_parameters();
    SingleTrack model{saloon(), lagging_effects()};
    Input from{0.02, 1000.0}, to{0.05, 3000.0};
    for (Input* u : {&from, &to}) {
        u->gravity_x_mps2 = 0.3;
        u->gravity_y_mps2 = -0.2;
    }
    const std::array<double, kExternals> calm{};
    auto slope = calm;
    slope[kGravityX] = 0.3;
    slope[kGravityY] = -0.2;
    const auto moved = [&](const std::array<double, kExternals>& external) {
        ModelState<double> x = kStart;
        advance(model, x, external.data(), from, to, p.data(), 0.1, 4);
        return x;
    };
    const ModelState<double> unknown = moved(slope), level = moved(calm);
    EXPECT_GT(distance(unknown, level), 0.02);
    model.slope_known = true;
    EXPECT_LT(distance(moved(calm), unknown), 1e-13);
    to.gravity_x_mps2 = 0.5;  // linear in between: twice as much of the difference at its end
    const double half = moved(calm)[0] - unknown[0];
    from.gravity_x_mps2 = 0.5;
    EXPECT_NEAR(moved(calm)[0] - unknown[0], 2.0 * half, 0.01 * half);
}

TEST(Step, LagsOfAnySizeNeedNoShorterSteps) {
    // Against 40 steps per sample, which 400 would not change: the error stays below a hundredth
    // of what sensors read, and what it would do to the size of the effect below half a percent.
    const double dt = 0.01;
    const int fine_steps = 40, samples_finest = 50;
    for (const EffectInfo& info : kEffectInfos) {
        if (!info.scored_at_typical) continue;
        const std::string id = info.id;
        const SingleTrack model{saloon(), mask_of({id})};
        for (double size : {0.0005, 0.002, 0.005, 0.01, 0.03, 0.1}) {
            Parameters p = plain_parameters();
            const bool length = std::string(info.parameters[0].unit) == "m";
            for (std::size_t j = 0; j < info.parameter_count(); ++j)
                p[parameter_of(id, j)] = length ? 20.0 * size : size;
            ModelState<double> x{25.0};
            settle_auxiliary(model, x, kCalm.data(), lively(0.0), p.data());
            ModelState<double> fine = x, finest = x, plain{25.0};
            double worst = 0.0, worst_fine = 0.0, along = 0.0, whole = 0.0;
            for (int k = 0; k < 300; ++k) {
                const Input from = lively(k * dt), to = lively((k + 1) * dt);
                const int substeps = substeps_for(model, p.data(), x[0], dt);
                ASSERT_EQ(substeps, 1);
                advance(model, x, kCalm.data(), from, to, p.data(), dt, substeps);
                advance(model, fine, kCalm.data(), from, to, p.data(), dt, fine_steps);
                advance({saloon()}, plain, kCalm.data(), from, to, p.data(), dt, 1);
                const auto y = sense(model, x, kCalm.data(), to, p.data());
                const auto z = sense(model, fine, kCalm.data(), to, p.data());
                const auto without = sense({saloon()}, plain, kCalm.data(), to, p.data());
                for (std::size_t i = 0; i < kChannels; ++i) {
                    const double error = (y[i] - z[i]) / kSensorNoise[i];
                    const double effect = (z[i] - without[i]) / kSensorNoise[i];
                    worst = std::max(worst, std::abs(error));
                    along += error * effect;
                    whole += effect * effect;
                }
                if (k < samples_finest) {
                    advance(model, finest, kCalm.data(), from, to, p.data(), dt, 400);
                    const auto best = sense(model, finest, kCalm.data(), to, p.data());
                    for (std::size_t i = 0; i < kChannels; ++i)
                        worst_fine =
                            std::max(worst_fine, std::abs(z[i] - best[i]) / kSensorNoise[i]);
                }
            }
            EXPECT_LT(worst_fine, 0.001) << id << " " << size;
            EXPECT_LT(worst, 0.06) << id << " " << size;
            EXPECT_LT(std::abs(along / whole), 0.005) << id << " " << size;
        }
    }
}

TEST(Step, LagWeightsAreTheIntegralsTheyClaimToBe) {
    for (double z : {-0.3, 1e-9, 0.01, 0.4999, 0.5001, 3.0, 80.0, 1e5}) {
        const LagWeights<double> w(z);
        EXPECT_NEAR(w.kept, std::exp(-z), 1e-15);
        EXPECT_NEAR(w.J0, 1.0 - std::exp(-z), 1e-13);
        if (z < 100.0) {
            std::array<double, 3> sum{};  // Simpson over theta
            const int n = 20000;
            for (int i = 0; i <= n; ++i) {
                const double theta = static_cast<double>(i) / n;
                const double weight = (i == 0 || i == n ? 1.0 : i % 2 ? 4.0 : 2.0) / (3.0 * n);
                for (int k = 0; k < 3; ++k)
                    sum[static_cast<std::size_t>(k)] +=
                        weight * z * std::exp(-z * (1.0 - theta)) * std::pow(theta, k);
            }
            EXPECT_NEAR(w.J1, sum[1], 1e-10) << z;
            EXPECT_NEAR(w.J2, sum[2], 1e-10) << z;
        }
        const double step = 1e-4 * std::max(std::abs(z), 1e-3);
        const LagWeights<double> up(z + step), down(z - step);
        EXPECT_NEAR(w.J1_slope, (up.J1 - down.J1) / (2.0 * step), 1e-7) << z;
        EXPECT_NEAR(w.J2_slope, (up.J2 - down.J2) / (2.0 * step), 1e-7) << z;
    }
}

TEST(Step, ChosenSubstepsAreAccurate) {
    const SingleTrack model{saloon(), kAllEffects};
    const Parameters p = typical_parameters();
    for (double v : {3.0, 10.0, 40.0}) {
        const Input from{0.01, 500.0};
        ModelState<double> x{v, 0.0, 0.0};
        settle_auxiliary(model, x, kCalm.data(), from, p.data());
        ModelState<double> fine = x;
        const Input to{0.015, 650.0};
        advance(model, x, kPush.data(), from, to, p.data(), 0.01,
                substeps_for(model, p.data(), v, 0.01));
        advance(model, fine, kPush.data(), from, to, p.data(), 0.01, 2000);
        for (std::size_t i = 0; i < kMotionStates; ++i) EXPECT_NEAR(x[i], fine[i], 1e-5) << v;
        // Of lags it shows in the readings, and there by less than a hundredth of their noise.
        const auto y = sense(model, x, kPush.data(), to, p.data());
        const auto z = sense(model, fine, kPush.data(), to, p.data());
        for (std::size_t i = 0; i < kChannels; ++i)
            EXPECT_NEAR(y[i], z[i], 0.01 * kSensorNoise[i]) << v;
    }
}

TEST(Step, SubstepsGrowWithTheFastestRateWithinLimits) {
    const Parameters p = typical_parameters();
    const SingleTrack plain{saloon()};
    EXPECT_EQ(substeps_for(plain, p.data(), 40.0, 0.001), 1);
    EXPECT_GT(substeps_for(plain, p.data(), 2.0, 0.01), substeps_for(plain, p.data(), 40.0, 0.01));
    EXPECT_EQ(substeps_for(plain, p.data(), 0.0, 0.01),
              substeps_for(plain, p.data(), kLowestSpeed, 0.01));
    EXPECT_EQ(substeps_for(plain, p.data(), 0.0, 100.0), kMostSubsteps);
}

TEST(Step, InputsAreLinearInBetween) {
    const Input a{0.1, 100.0};
    const Input b{0.3, 500.0};
    EXPECT_DOUBLE_EQ(between(a, b, 0.25).steer_rad, 0.15);
    EXPECT_DOUBLE_EQ(between(a, b, 0.25).longitudinal, 200.0);
    // A measured acceleration that rises linearly: the speed gains its trapezium exactly.
    const SingleTrack model{saloon(), 0, false};
    const Parameters p = plain_parameters();
    for (int substeps : {1, 3}) {
        ModelState<double> x{20.0};
        advance(model, x, kCalm.data(), {0.0, 1.0}, {0.0, 3.0}, p.data(), 0.5, substeps);
        EXPECT_NEAR(x[0], 20.0 + 0.5 * 2.0, 1e-13);
    }
}

TEST(Step, LaggedRampHasItsClosedForm) {
    // tau x' + x = s t from x = 0:  x = s (t - tau (1 - exp(-t/tau))).
    Parameters p = plain_parameters();
    const double tau = 0.05;
    p[parameter_of("steer_lag")] = tau;
    const SingleTrack model{saloon(), mask_of({"steer_lag"})};
    ModelState<double> x{20.0};
    const double dt = 0.01;
    for (int k = 0; k < 10; ++k)
        advance(model, x, kCalm.data(), {0.2 * k * dt, 0.0}, {0.2 * (k + 1) * dt, 0.0}, p.data(),
                dt, 2);
    const double t = 10 * dt;
    EXPECT_NEAR(x[state_of("steer_lag")], 0.2 * (t - tau * (1.0 - std::exp(-t / tau))), 1e-8);
}

TEST(Step, SettledAuxiliaryStatesStandStill) {
    const SingleTrack model{saloon(), kAllEffects};
    const Parameters p = typical_parameters();
    ModelState<double> x{25.0, 0.3, 0.2};
    settle_auxiliary(model, x, kCalm.data(), {0.04, 1000.0}, p.data());
    const auto rate = evaluate(model, x, {0.04, 1000.0}, p).rate;
    for (std::size_t i = kMotionStates; i < kModelStates - kUserStates; ++i) {
        EXPECT_NEAR(rate[i], 0.0, 1e-7);
        // A body at rest does not turn.
        const bool turns = i == state_of("body_roll", 1) || i == state_of("front_roll_steer", 1) ||
                           i == state_of("rear_roll_steer", 1);
        EXPECT_TRUE(std::abs(x[i]) > 1e-4 || turns) << i;
    }
    EXPECT_EQ(x[0], 25.0);  // the motion is left alone
}

// --- derivatives of state and readings with respect to everything that goes in ----------------

struct Point {
    const char* name;
    ModelState<double> x;
    std::array<double, kExternals> external;
    Input from, to;
};

std::vector<Point> points() {
    std::vector<Point> all{
        {"straight", {25.0}, {}, {0.0, 800.0}, {0.0, 900.0}},
        {"near the limit",
         {22.0, -0.8, 0.4},
         {50.0, 80.0, -60.0, 0.0, 0.0},
         {0.12, 1500.0},
         {0.13, 1700.0}},
        {"braking into a corner", {30.0, 0.2, -0.25}, {}, {-0.04, -3000.0}, {-0.05, -3500.0}}};
    std::mt19937 generator(17);
    std::uniform_real_distribution<double> part(-1.0, 1.0);
    for (int n = 0; n < 4; ++n) {
        Point point{"random", {}, {}, {}, {}};
        point.x = {25.0 + 12.0 * part(generator), part(generator), 0.4 * part(generator)};
        point.external.fill(0.1);
        for (int i = 0; i < kPushes; ++i) point.external.at(i) = 0.3 * part(generator);
        point.from = {0.08 * part(generator), 2000.0 + 1000.0 * part(generator)};
        point.to = {point.from.steer_rad + 0.01, point.from.longitudinal + 200.0};
        all.push_back(point);
    }
    for (Point& point : all) {
        for (std::size_t i = kMotionStates; i < kModelStates; ++i)
            point.x[i] = 0.05 * part(generator);
        point.from.time_s = 4.9;  // while the friction changes
        point.to.time_s = 4.91;
    }
    return all;
}

using Readings = Vec<kModelStates + kChannels>;

template <class S, class T>
std::array<S, kModelStates + kChannels> step_and_read(const SingleTrack& model, ModelState<S> x,
                                                      const S* external, const Point& at,
                                                      const T* p) {
    advance(model, x, external, at.from, at.to, p, 0.01, 3);
    const auto y = sense(model, x, external, at.to, p);
    std::array<S, kModelStates + kChannels> out;
    std::copy(x.begin(), x.end(), out.begin());
    std::copy(y.begin(), y.end(), out.begin() + kModelStates);
    return out;
}

Readings values(const std::array<double, kModelStates + kChannels>& a) {
    return Eigen::Map<const Readings>(a.data());
}

template <class D>
void expect_column(const std::array<D, kModelStates + kChannels>& dual, std::size_t direction,
                   const Readings& difference, double step, const std::string& what) {
    const double scale = difference.cwiseAbs().maxCoeff();
    for (std::size_t i = 0; i < dual.size(); ++i) {
        const double expected = difference[static_cast<int>(i)];
        const double rounding = 1e-14 * (1.0 + std::abs(dual[i].v)) / step;  // of the difference
        EXPECT_NEAR(dual[i].d[direction], expected,
                    1e-7 * std::abs(expected) + 1e-8 * scale + rounding)
            << what << ", row " << i;
    }
}

class StepDerivatives : public testing::TestWithParam<bool> {};
INSTANTIATE_TEST_SUITE_P(Mode, StepDerivatives, testing::Bool(), [](const auto& it) {
    return it.param ? "ForceKnown" : "AccelerationMeasured";
});

Point in_mode(Point point, bool force_known) {
    if (force_known) return point;
    point.from.longitudinal /= 1500.0;
    point.to.longitudinal /= 1500.0;
    return point;
}

TEST_P(StepDerivatives, OfStateAndPush) {
    using D = Dual<kModelStates + kExternals>;
    const SingleTrack model{saloon(), kAllEffects, GetParam()};
    const Parameters p = typical_parameters();
    for (const Point& plain : points()) {
        const Point at = in_mode(plain, GetParam());
        ModelState<D> x;
        std::array<D, kExternals> external;
        for (int i = 0; i < kModelStates; ++i)
            x[static_cast<std::size_t>(i)] = D::seeded(at.x[static_cast<std::size_t>(i)], i);
        for (int i = 0; i < kExternals; ++i)
            external[static_cast<std::size_t>(i)] =
                D::seeded(at.external[static_cast<std::size_t>(i)], kModelStates + i);
        const auto dual = step_and_read(model, x, external.data(), at, p.data());
        for (std::size_t i = 0; i < kModelStates + kExternals; ++i) {
            const bool state = i < kModelStates;
            const bool newtons = i >= kModelStates && i < kModelStates + kGravityX;
            // A longer one reaches where the friction ellipse is cut off.
            const double step = newtons ? 10.0 : 4e-5;
            const double middle = state ? at.x[i] : at.external[i - kModelStates];
            const auto difference = central_difference(
                [&](double value) {
                    ModelState<double> moved = at.x;
                    auto pushed = at.external;
                    (state ? moved[i] : pushed[i - kModelStates]) = value;
                    return values(step_and_read(model, moved, pushed.data(), at, p.data()));
                },
                middle, step);
            expect_column(dual, i, difference, step,
                          std::string(at.name) + ", input " + std::to_string(i));
        }
    }
}

TEST_P(StepDerivatives, OfParameters) {
    using D = Dual<static_cast<int>(kParameterCount)>;
    const SingleTrack model{saloon(), kAllEffects, GetParam()};
    const Parameters p = typical_parameters();
    for (const Point& plain : points()) {
        const Point at = in_mode(plain, GetParam());
        ModelState<D> x;
        std::copy(at.x.begin(), at.x.end(), x.begin());
        std::array<D, kExternals> external;
        std::copy(at.external.begin(), at.external.end(), external.begin());
        std::vector<D> parameters;
        for (std::size_t i = 0; i < kParameterCount; ++i)
            parameters.push_back(D::seeded(p[i], static_cast<int>(i)));
        const auto dual = step_and_read(model, x, external.data(), at, parameters.data());
        for (std::size_t i = 0; i < kParameterCount; ++i) {
            const double step = std::max(1e-3 * std::abs(p[i]), 1e-9);
            const auto difference = central_difference(
                [&](double value) {
                    Parameters q = p;
                    q[i] = value;
                    return values(step_and_read(model, at.x, at.external.data(), at, q.data()));
                },
                p[i], step);
            expect_column(dual, i, difference, step,
                          std::string(at.name) + ", parameter " + std::to_string(i));
        }
    }
}

}  // namespace
}  // namespace sysid::test
