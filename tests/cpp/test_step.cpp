// One sampling interval: order of the integration, inputs in between, derivatives through it.
#include "helpers.hpp"
#include "sysid/dynamics/step.hpp"

namespace sysid::test {
namespace {

const ModelState<double> kStart{25.0, 0.3, 0.2, 0.02, 0.01, 0.005};
const std::array<double, kPushes> kPush{200.0, -150.0, 100.0, 0.1, -0.2};

double distance(const ModelState<double>& a, const ModelState<double>& b) {
    double sum = 0.0;
    for (std::size_t i = 0; i < kModelStates; ++i) sum += (a[i] - b[i]) * (a[i] - b[i]);
    return std::sqrt(sum);
}

TEST(Step, ErrorFallsWithTheFourthPower) {
    const SingleTrack model{saloon(), kAllEffects};
    const Parameters p = typical_parameters();
    const Input from{0.02, 1000.0};
    const Input to{0.05, 3000.0};
    const auto moved = [&](int substeps) {
        ModelState<double> x = kStart;
        advance(model, x, kPush.data(), from, to, p.data(), 0.2, substeps);
        return x;
    };
    const auto exact = moved(8000);
    double error = distance(moved(64), exact);
    for (int substeps : {128, 256}) {
        const double halved = distance(moved(substeps), exact);
        EXPECT_GT(error / halved, 13.0) << substeps;
        EXPECT_LT(error / halved, 20.0) << substeps;
        error = halved;
    }
    EXPECT_LT(error, 1e-6);
}

TEST(Step, ChosenSubstepsAreAccurate) {
    const SingleTrack model{saloon(), kAllEffects};
    const Parameters p = typical_parameters();
    for (double v : {3.0, 10.0, 40.0}) {
        ModelState<double> x{v, 0.0, 0.0};
        ModelState<double> fine = x;
        const Input from{0.01, 500.0};
        const Input to{0.02, 800.0};
        advance(model, x, kPush.data(), from, to, p.data(), 0.02,
                substeps_for(model, p.data(), v, 0.02));
        advance(model, fine, kPush.data(), from, to, p.data(), 0.02, 2000);
        EXPECT_LT(distance(x, fine), 2e-5) << v;
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
    Parameters quick = p;
    for (double tau : {0.05, 0.01, 0.002}) {
        // Well inside the stability limit of 2.8, and not shorter than that needs.
        quick[parameter_of("steer_lag")] = tau;
        const SingleTrack lagging{saloon(), mask_of({"steer_lag"})};
        const int substeps = substeps_for(lagging, quick.data(), 40.0, 0.01);
        EXPECT_LE(0.01 / tau / substeps, 1.0);
        if (substeps > 1) {
            EXPECT_GT(0.01 / tau / (substeps - 1), 0.5);
        }
    }
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
    const auto rate = model_rate(model, x, kCalm.data(), {0.04, 1000.0}, p.data());
    for (std::size_t i = kMotionStates; i < kModelStates; ++i) {
        EXPECT_NEAR(rate[i], 0.0, 1e-7);
        EXPECT_GT(std::abs(x[i]), 1e-4);
    }
    EXPECT_EQ(x[0], 25.0);  // the motion is left alone
}

// --- derivatives of state and readings with respect to everything that goes in ----------------

struct Point {
    const char* name;
    ModelState<double> x;
    std::array<double, kPushes> push;
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
        for (double& push : point.push) push = 0.3 * part(generator);
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
                                                      const S* push, const Point& at, const T* p) {
    advance(model, x, push, at.from, at.to, p, 0.01, 3);
    const auto y = sense(model, x, push, at.to, p);
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
    using D = Dual<kModelStates + kPushes>;
    const SingleTrack model{saloon(), kAllEffects, GetParam()};
    const Parameters p = typical_parameters();
    for (const Point& plain : points()) {
        const Point at = in_mode(plain, GetParam());
        ModelState<D> x;
        std::array<D, kPushes> push;
        for (int i = 0; i < kModelStates; ++i)
            x[static_cast<std::size_t>(i)] = D::seeded(at.x[static_cast<std::size_t>(i)], i);
        for (int i = 0; i < kPushes; ++i)
            push[static_cast<std::size_t>(i)] =
                D::seeded(at.push[static_cast<std::size_t>(i)], kModelStates + i);
        const auto dual = step_and_read(model, x, push.data(), at, p.data());
        for (std::size_t i = 0; i < kModelStates + kPushes; ++i) {
            const bool state = i < kModelStates;
            const bool newtons = i >= kModelStates && i < kModelStates + kGravityX;
            const double step = newtons ? 10.0 : 4e-4;
            const double middle = state ? at.x[i] : at.push[i - kModelStates];
            const auto difference = central_difference(
                [&](double value) {
                    ModelState<double> moved = at.x;
                    auto pushed = at.push;
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
        std::array<D, kPushes> push;
        std::copy(at.push.begin(), at.push.end(), push.begin());
        std::vector<D> parameters;
        for (std::size_t i = 0; i < kParameterCount; ++i)
            parameters.push_back(D::seeded(p[i], static_cast<int>(i)));
        const auto dual = step_and_read(model, x, push.data(), at, parameters.data());
        for (std::size_t i = 0; i < kParameterCount; ++i) {
            const double step = std::max(1e-3 * std::abs(p[i]), 1e-9);
            const auto difference = central_difference(
                [&](double value) {
                    Parameters q = p;
                    q[i] = value;
                    return values(step_and_read(model, at.x, at.push.data(), at, q.data()));
                },
                p[i], step);
            expect_column(dual, i, difference, step,
                          std::string(at.name) + ", parameter " + std::to_string(i));
        }
    }
}

}  // namespace
}  // namespace sysid::test
