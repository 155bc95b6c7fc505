// Friction curves, their derivatives, and the estimators on readings with a known answer.
#include "dense.hpp"
#include "helpers.hpp"
#include "sysid/online/mu_slip.hpp"

namespace sysid::test {
namespace {

const Vec<2> kTruth{0.35, 0.15};

CurveReadings readings(unsigned seed = 0, double noise_std = 0.0) {
    CurveReadings out;
    std::mt19937 generator(seed);
    std::normal_distribution<double> normal;
    for (int k = 0; k <= 40; ++k) {
        const double s = (k / 40.0) * (k / 40.0);
        out.slip.push_back(s);
        out.mu.push_back(TwoParameterCurve::mu(s, kTruth.data()) + noise_std * normal(generator));
    }
    return out;
}

CurvePrior<TwoParameterCurve> prior() {
    return {Vec<2>(0.6, 0.2), Vec<2>(0.36, 0.04).asDiagonal()};
}

CurveFilterSettings<TwoParameterCurve> published() {
    CurveFilterSettings<TwoParameterCurve> settings;
    settings.noise_std = 0.12;
    return settings;
}

template <class Curve>
void expect_exact_derivatives(const CurveVec<Curve>& at) {
    constexpr int n = Curve::kParameters;
    for (const double s : {-0.3, 0.02, 0.15, 0.4, 1.0}) {
        const auto point = curve_point<Curve>(s, at);
        EXPECT_NEAR(point.mu, Curve::mu(s, at.data()), 1e-15);
        for (int i = 0; i < n; ++i) {
            const auto moved = [&](double to) {
                CurveVec<Curve> x = at;
                x[i] = to;
                return x;
            };
            const double slope = central_difference(
                [&](double to) { return Curve::mu(s, moved(to).data()); }, at[i], 1e-3);
            EXPECT_NEAR(point.gradient[i], slope, 1e-8) << s << " " << i;
            const CurveVec<Curve> bend = central_difference(
                [&](double to) { return curve_point<Curve>(s, moved(to)).gradient; }, at[i], 1e-3);
            EXPECT_LT((point.hessian.col(i) - bend).norm(), 1e-5) << s << " " << i;
        }
    }
}

TEST(MuSlip, DerivativesAreExact) {
    expect_exact_derivatives<TwoParameterCurve>(kTruth);
    expect_exact_derivatives<MagicFormulaCurve>(Vec<4>(0.9, 0.12, 1.65, 2.4));
}

TEST(MuSlip, PeakIsWhereTheParametersSay) {
    const Vec<2> two = kTruth;
    const Vec<4> four(0.9, 0.12, 1.65, 2.4);
    EXPECT_NEAR(TwoParameterCurve::mu(two[1], two.data()), two[0], 1e-15);
    EXPECT_NEAR(MagicFormulaCurve::mu(four[1], four.data()), four[0], 1e-15);
    for (const double s : {0.11, 0.13}) {
        EXPECT_LT(MagicFormulaCurve::mu(s, four.data()), four[0]);
    }
    EXPECT_NEAR(MagicFormulaCurve::mu(1e-7, four.data()) / 1e-7, 2.4 * 0.9 / 0.12, 1e-5);
}

TEST(MuSlip, PseudoNoiseIsThePublishedFormula) {
    const double s = 0.07, mup = 0.5, sp = 0.18, p11 = 0.2, p22 = 0.03;
    Mat<2, 2> P;
    P << p11, -0.05, -0.05, p22;
    const double s2 = s * s, sp2 = sp * sp;
    const double own = mup * mup * p22 * sp2 * std::pow(sp2 - 3.0 * s2, 2);
    const double cross = p11 * std::pow(s2 * s2 - sp2 * sp2, 2);
    const double expected = 4.0 * p22 * s2 * (own + cross) / std::pow(s2 + sp2, 6);
    const auto point = curve_point<TwoParameterCurve>(s, Vec<2>(mup, sp));
    EXPECT_NEAR(pseudo_noise<2>(point.hessian, P), expected, 1e-12);
}

TEST(MuSlip, FilterGivesThePublishedNumbersWithoutNoise) {
    const auto steps = filter_curve(readings(), prior(), published());
    const auto& last = steps.back().filter;
    EXPECT_NEAR(last.mean[0], 0.34314887, 1e-8);
    EXPECT_NEAR(last.mean[1], 0.15529258, 1e-8);
    EXPECT_NEAR(std::sqrt(last.covariance(0, 0)), 0.040034, 1e-6);
    EXPECT_NEAR(std::sqrt(last.covariance(1, 1)), 0.030074, 1e-6);
}

TEST(MuSlip, IteratedFilterMinimisesTheCostOfOneReading) {
    auto settings = published();
    settings.pseudo_noise = false;
    settings.iterations = 100;
    CurveFilter<TwoParameterCurve> filter(prior(), settings);
    filter.update(0.1, 0.3);
    const auto cost = [&](const Vec<2>& x) {
        const Vec<2> away = x - prior().mean;
        const double error = 0.3 - TwoParameterCurve::mu(0.1, x.data());
        return error * error / 0.0144 + away.dot(prior().covariance.inverse() * away);
    };
    for (int i = 0; i < 2; ++i) {
        const double slope = central_difference(
            [&](double to) {
                Vec<2> x = filter.mean();
                x[i] = to;
                return cost(x);
            },
            filter.mean()[i], 1e-4);
        EXPECT_NEAR(slope, 0.0, 1e-4) << i;
    }
}

TEST(MuSlip, SmootherRestsAtTheMaximumOfThePosterior) {
    CurveReadings r = readings(3, 0.04);
    r.mu[7] = std::nan("");
    auto settings = published();
    settings.noise_std = 0.04;
    const auto found = smooth_curve(r, prior(), settings, 50);
    EXPECT_TRUE(found.converged);
    Mat<2, 2> information = prior().covariance.inverse();
    Vec<2> gradient = information * (prior().mean - found.mean[0]);
    for (std::size_t k = 0; k < r.size(); ++k) {
        if (k == 7) continue;
        const auto at = curve_point<TwoParameterCurve>(r.slip[k], found.mean[0]);
        gradient += at.gradient * (r.mu[k] - at.mu) / 0.0016;
        information += at.gradient * at.gradient.transpose() / 0.0016;
    }
    EXPECT_LT((information.inverse() * gradient).norm(), 1e-6);
    EXPECT_LT((found.covariance[0] - information.inverse()).norm(), 1e-7);
    EXPECT_LT((found.mean[0] - found.mean.back()).norm(), 1e-12);  // nothing drifts
}

TEST(MuSlip, SmootherFollowsASurfaceThatChanges) {
    CurveReadings r;
    const auto peak = [](int k) { return 0.8 - 0.5 * k / 159.0; };
    for (int k = 0; k < 160; ++k) {
        const Vec<2> truth(peak(k), 0.12);
        r.slip.push_back((1 + k % 40) / 80.0);
        r.mu.push_back(TwoParameterCurve::mu(r.slip.back(), truth.data()));
    }
    auto settings = published();
    settings.noise_std = 0.02;
    const auto fixed = smooth_curve(r, prior(), settings, 50);
    settings.drift_std = Vec<2>(0.005, 1e-5);
    const auto drifting = smooth_curve(r, prior(), settings, 50);
    for (const int k : {20, 80, 140}) {
        const auto at = static_cast<std::size_t>(k);
        EXPECT_NEAR(drifting.mean[at][0], peak(k), 0.01) << k;
        if (k != 80) {
            EXPECT_GT(std::abs(fixed.mean[at][0] - peak(k)), 0.1) << k;
        }
    }
}

TEST(MuSlip, LeastSquaresFindsTheTruthAndKeepsInsideItsBox) {
    const Vec<2> lower(0.0, 1e-3), upper(10.0, 10.0);
    for (const double start : {0.02, 0.2, 0.9}) {
        const auto fit =
            fit_curve<TwoParameterCurve>(readings(), Vec<2>(0.6, start), lower, upper, 100);
        EXPECT_TRUE(fit.converged);
        EXPECT_LT((fit.mean - kTruth).norm(), 1e-8) << start;
    }
    const auto held =
        fit_curve<TwoParameterCurve>(readings(), Vec<2>(0.6, 0.3), lower, Vec<2>(0.2, 10.0), 100);
    EXPECT_EQ(held.mean[0], 0.2);
}

TEST(MuSlip, ReadingsThatTellNothingDetermineNothing) {
    const CurveReadings r{{0.0, 0.0, 0.0}, {0.1, 0.0, -0.1}};
    const Vec<2> lower(0.0, 1e-3), upper(10.0, 10.0);
    EXPECT_FALSE(fit_curve<TwoParameterCurve>(r, kTruth, lower, upper, 10).determined);
    EXPECT_TRUE(fit_curve<TwoParameterCurve>(readings(), kTruth, lower, upper, 10).determined);
    CurveReadings infinite = readings();
    infinite.mu[5] = std::numeric_limits<double>::infinity();
    EXPECT_FALSE(fit_curve<TwoParameterCurve>(infinite, kTruth, lower, upper, 10).determined);
    EXPECT_THROW(filter_curve(infinite, prior(), published()), NumericalFailure);
}

TEST(MuSlip, CovarianceStaysPositiveForAMillionReadings) {
    auto settings = published();
    settings.noise_std = 1e-4;
    CurveFilter<TwoParameterCurve> filter(prior(), settings);
    for (int k = 0; k < 1000000; ++k)
        filter.update(1e-4 * (k % 3), TwoParameterCurve::mu(1e-4 * (k % 3), kTruth.data()));
    const Vec<2> sizes = symmetric_eigenvalues(filter.covariance());
    EXPECT_GT(sizes.minCoeff(), 0.0);
    EXPECT_TRUE(filter.mean().allFinite());
}

}  // namespace
}  // namespace sysid::test
