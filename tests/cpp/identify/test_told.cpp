// What a filter told of its path is what those find who walk it.
#include <functional>

#include "residuals.hpp"

namespace sysid::test {
namespace {

constexpr double kSame = 2e-11;  // of whitened residuals

const auto kLagAndDrag = mask_of({"tyre_relaxation", "steer_lag", "aero_drag"});

Problem runs_of(EffectMask effects, std::size_t samples) {
    const SingleTrack truth{saloon(), effects};
    Problem problem{truth,
                    {noisy_run(truth, typical_parameters(), samples, 0.02, 1),
                     noisy_run(truth, typical_parameters(), samples / 2, 0.01, 2)}};
    auto& y = problem.runs[0].measurements;
    for (std::size_t k = 3; k < samples; k += 7) y[k][kVy] = std::nan("");
    y[20].setConstant(std::nan(""));
    return problem;
}

double apart(const Eigen::VectorXd& one, const Eigen::VectorXd& other) {
    return (one - other).cwiseAbs().maxCoeff();
}

struct Linear {
    double cost;
    Eigen::Vector3d slope;
    Eigen::Matrix3d information;
};
Linear linear_of(const Problem& problem, const Parameters& p, const FrozenFilter& filter) {
    Linear out;
    out.cost = normal_equations(problem, p.data(), filter, {kBFront, kDRear, kYawInertia},
                                out.slope.data(), out.information.data());
    return out;
}

TEST(Told, PathIsThatOfAWalk) {
    const Parameters p = typical_parameters();
    for (const EffectMask effects : {EffectMask{0}, kLagAndDrag})
        for (const Noise& noise :
             {ordinary_noise(), sloping_noise(), coloured_noise(), white_noise()})
            for (const std::size_t samples : {120U, 2400U}) {
                const Problem problem = runs_of(effects, samples);
                const FrozenFilter filter = freeze(problem, p.data(), noise);
                ASSERT_TRUE(filter.made_of.is(problem, p.data()));
                const Eigen::VectorXd told = residuals_of(problem, p, filter);
                const Eigen::VectorXd walked = residuals_of(problem, p, silent(filter));
                EXPECT_LT(apart(told, walked), kSame);
                EXPECT_NE(told, walked);  // other roundings
                const Linear one = linear_of(problem, p, filter);
                const Linear other = linear_of(problem, p, silent(filter));
                EXPECT_NEAR(one.cost, other.cost, 1e-11 * other.cost);
                EXPECT_LT((one.slope - other.slope).norm(), 1e-9 * other.information.norm());
                EXPECT_LT((one.information - other.information).norm(),
                          1e-10 * other.information.norm());
            }
}

TEST(Told, IsWhereOthersBegin) {
    const Problem problem = runs_of(EffectMask{0}, 2400);
    const FrozenFilter filter = freeze(problem, typical_parameters().data(), ordinary_noise());
    for (const double more : {1e-9, 1e-3, 0.1}) {
        Parameters p = typical_parameters();
        p[kBFront] *= 1.0 + more;
        p[kYawInertia] *= 1.0 + more;
        EXPECT_LT(apart(residuals_of(problem, p, filter), residuals_of(problem, p, silent(filter))),
                  kSame);
    }
}

TEST(Told, IsNotTakenForThatOfOthers) {
    const Problem problem = runs_of(EffectMask{0}, 120);
    const Parameters p = typical_parameters();
    const FrozenFilter filter = freeze(problem, p.data(), ordinary_noise());
    const Eigen::VectorXd e = residuals_of(problem, p, filter);
    const auto expect_walked = [&](const std::function<void(Problem&, Parameters&)>& change,
                                   const char* what) {
        Problem other = problem;
        Parameters values = p;
        change(other, values);
        EXPECT_FALSE(filter.made_of.is(other, values.data())) << what;
        const Eigen::VectorXd found = residuals_of(other, values, filter);
        EXPECT_EQ(found, residuals_of(other, values, silent(filter))) << what;
        EXPECT_GT(apart(found, e), 1e-6) << what;
    };
    expect_walked([](Problem&, Parameters& v) { v[kBFront] *= 1.001; }, "parameters");
    expect_walked([](Problem& o, Parameters&) { o.model.car.mass_kg += 1.0; }, "car");
    expect_walked(
        [](Problem& o, Parameters& v) {
            o.model.effects = mask_of({"aero_drag"});
            v[parameter_of("aero_drag")] = 0.5;
        },
        "effects");
    expect_walked([](Problem& o, Parameters&) { o.model.force_known = false; }, "force");
    expect_walked([](Problem& o, Parameters&) { o.runs[1].measurements[5][kAy] += 0.1; },
                  "measurements");
    expect_walked(
        [](Problem& o, Parameters&) {
            std::swap(o.runs[0].inputs[8].steer_rad, o.runs[0].inputs[9].steer_rad);
        },
        "order");
    expect_walked(
        [](Problem& o, Parameters&) {
            for (sysid::Run& run : o.runs)
                for (Input& u : run.inputs) u.steer_rad = -u.steer_rad;
        },
        "signs");
    expect_walked([](Problem& o, Parameters&) { o.runs[1].dt *= 1.01; }, "time");

    Problem formula = problem;
    formula.model.user = std::make_shared<const std::vector<UserEffect>>();
    EXPECT_FALSE(filter.made_of.is(formula, p.data()));
    EXPECT_FALSE(MadeOf().is(problem, p.data()));
    EXPECT_TRUE(filter.made_of.is(Problem(problem), p.data()));
}

/// The log-likelihood is that of the careful filter to the last digit where care is needed alone.
TEST(Told, WhereRoundingMayCountTheFilterIsTheCarefulOne) {
    const Parameters p = typical_parameters();
    const Problem problem = runs_of(EffectMask{0}, 120);
    for (const double sure : {1.0, 1e-7}) {
        Noise noise = sloping_noise();
        noise.sensor[kVx] *= sure;
        const double found = freeze(problem, p.data(), noise).log_likelihood;
        const double careful = trace(problem, p.data(), noise, false).log_likelihood;
        EXPECT_NEAR(found, careful, 1e-9 * std::abs(careful)) << sure;
        EXPECT_EQ(found == careful, sure < 1.0);
    }
}

TEST(Told, TraceIsThatOfTheFilter) {
    const Parameters p = typical_parameters();
    for (const EffectMask effects : {EffectMask{0}, kLagAndDrag})
        for (const Noise& noise :
             {ordinary_noise(), sloping_noise(), coloured_noise(), white_noise()}) {
            const Problem problem = runs_of(effects, 240);
            const FrozenFilter filter = freeze(problem, p.data(), noise);
            const Trace whole = trace(problem, p.data(), noise, false);
            const Trace told = trace(problem, p.data(), filter);
            EXPECT_EQ(told.log_likelihood, filter.log_likelihood);
            for (const auto member : {&Trace::innovation, &Trace::spread, &Trace::whitened,
                                      &Trace::log_density, &Trace::state, &Trace::state_std}) {
                const std::vector<double>&one = told.*member, &other = whole.*member;
                ASSERT_EQ(one.size(), other.size());
                for (std::size_t i = 0; i < one.size(); ++i) {
                    EXPECT_EQ(std::isnan(one[i]), std::isnan(other[i])) << i;
                    if (std::isnan(other[i])) continue;
                    EXPECT_NEAR(one[i], other[i], 1e-9 * (1.0 + std::abs(other[i]))) << i;
                }
            }
            // One that tells nothing is run again.
            EXPECT_EQ(trace(problem, p.data(), silent(filter)).state_std.size(),
                      whole.state_std.size());
        }
}

TEST(Told, ProblemsOfOtherSlopesAreOthers) {
    const Parameters p = typical_parameters();
    Problem problem = runs_of(0, 120);
    problem.model.slope_known = true;
    const double level = freeze(problem, p.data(), ordinary_noise()).log_likelihood;
    const MadeOf made(problem, p.data());
    EXPECT_TRUE(made.is(problem, p.data()));
    for (Input& u : problem.runs[0].inputs) u.gravity_x_mps2 = 1.0;
    EXPECT_FALSE(made.is(problem, p.data()));
    EXPECT_LT(freeze(problem, p.data(), ordinary_noise()).log_likelihood, level - 1.0);
    problem.model.slope_known = false;
    EXPECT_NEAR(freeze(problem, p.data(), ordinary_noise()).log_likelihood, level, 1e-9);
}

TEST(Told, SmoothedMeansOfLateSteeringAreThoseOfTheSmoother) {
    const Parameters p = typical_parameters();
    const Problem problem = runs_of(mask_of({"steer_delay"}), 120);
    ASSERT_NE(p[parameter_of("steer_delay")], 0.0);
    const Trace smoothed = trace(problem, p.data(), ordinary_noise(), true);
    std::vector<double> means(problem.samples() * kStatesTold);
    smoothed_means(problem, p.data(), ordinary_noise(), means.data());
    for (std::size_t i = 0; i < means.size(); ++i)
        if (!std::isnan(means[i])) {
            EXPECT_NEAR(means[i], smoothed.state[i], 1e-9 * (smoothed.state_std[i] + 1e-9)) << i;
        }
}

}  // namespace
}  // namespace sysid::test
