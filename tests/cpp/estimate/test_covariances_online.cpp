// Covariances of the estimators that run beside a controller, and of twins.
#include "covariances.hpp"
#include "sysid/online/cornering_rls.hpp"
#include "sysid/online/mu_slip.hpp"
#include "sysid/online/sideslip_dual.hpp"
#include "sysid/online/sideslip_ukf.hpp"
#include "sysid/twin/batch.hpp"

namespace sysid::test {
namespace {

template <class Curve>
void of_a_curve() {
    for (const double noise_std : {1e-12, 1e-6, 1.0, 1e6}) {
        for (const double drift : {0.0, 1e-12, 1e-3}) {
            SCOPED_TRACE(testing::Message() << noise_std << ", " << drift);
            CurvePrior<Curve> prior;
            for (int i = 0; i < Curve::kParameters; ++i) {
                const auto at = static_cast<std::size_t>(i);
                prior.mean[i] = 0.5 * (Curve::kLower[at] + std::min(Curve::kUpper[at], 10.0));
            }
            prior.covariance = prior.mean.cwiseAbs2().asDiagonal();
            CurveFilterSettings<Curve> settings;
            settings.noise_std = noise_std;
            settings.drift_std.setConstant(drift);
            const CurveVec<Curve> truth = 0.9 * prior.mean;
            CurveReadings readings;
            for (std::size_t k = 0; k < kSteps / 2; ++k) {
                readings.slip.push_back(0.005 + 0.2 * static_cast<double>(k % 40) / 40.0);
                readings.mu.push_back(Curve::mu(readings.slip.back(), truth.data()));
            }
            std::size_t lost = 0, k = 0;
            for (const auto& step : filter_curve<Curve>(readings, prior, settings))
                if (worth_a_look(k++) && !positive(step.filter.covariance)) ++lost;
            EXPECT_EQ(lost, 0U);
        }
    }
}

TEST(Covariances, OfTheMuSlipFilters) {
    of_a_curve<TwoParameterCurve>();
    of_a_curve<MagicFormulaCurve>();
}

TEST(Covariances, OfRecursiveLeastSquares) {
    for (const double ratio : kRatios) {
        SCOPED_TRACE(ratio);
        CorneringRlsSettings settings{1500.0, 2500.0, 1.2, 1.4};
        settings.ay_std_mps2 = settings.yaw_acceleration_std_radps2 = 0.1 / ratio;
        CorneringRls rls(settings, 8e4, 9e4);
        std::mt19937 generator(3);
        std::normal_distribution<double> normal;
        std::size_t lost = 0;
        for (std::size_t k = 0; k < kSteps; ++k) {
            const double alpha = 0.02 * std::sin(0.01 * static_cast<double>(k));
            // In most samples both axles tell of one direction only.
            rls.step(alpha, k % 100 == 0 ? 0.5 * alpha : alpha, 110.0 * alpha + normal(generator),
                     -10.0 * alpha);
            if (worth_a_look(k) && !positive(rls.covariance())) ++lost;
        }
        EXPECT_EQ(lost, 0U);
    }
}

TEST(Covariances, OfTwinsSideBySide) {
    for (const double ratio : kRatios) {
        SCOPED_TRACE(ratio);
        BatchEstimator batch({{kMass, 10.0, 100.0, 0.0, 0.0, 1e4}, {1, 0.01, 0.1, 0.0, -1.0, 1.0}},
                             {{0, std::min(1.0, 1.0 / ratio)}, {1, std::min(1.0, 1.0 / ratio)}},
                             0.01);
        Estimates estimate{};
        estimate[kMass] = 1000.0;
        std::mt19937 generator(3);
        std::normal_distribution<double> normal;
        std::size_t lost = 0;
        for (std::size_t k = 0; k < kSteps; ++k) {
            const double e = std::min(1.0, 1.0 / ratio) * normal(generator);
            const double s = std::sin(0.01 * static_cast<double>(k));
            // Both parameters move both readings nearly alike.
            const std::array<double, 2> car{e, e};
            const std::array<double, 6> twins{0.0, 0.0, s, s, s, s * (1.0 + 1e-7)};
            batch.update(car.data(), twins.data(), 2, estimate);
            if (worth_a_look(k) && !positive(batch.covariance())) ++lost;
        }
        EXPECT_EQ(lost, 0U);
    }
}

ObservedCar observed_car() {
    ObservedCar out;
    out.data = saloon();
    out.yaw_inertia_kgm2 = 2500.0;
    out.front = out.rear = {10.0, 1.4, 1.0, 0.0};
    return out;
}

ObserverSettings scaled_settings(double ratio) {
    const double sensor = std::min(1.0, 1.0 / ratio), process = std::min(1.0, ratio);
    ObserverSettings s;
    for (double* v : {&s.vx_mps, &s.yaw_rate_radps, &s.ax_mps2, &s.ay_mps2, &s.model_ay_mps2})
        *v *= sensor;
    for (double* v : {&s.force_walk, &s.yaw_walk_radps, &s.sideslip_walk_rad, &s.stiffness_walk,
                      &s.fx_walk, &s.beta_walk_radps})
        *v *= process;
    return s;
}

template <class Observer>
void of_an_observer(Observer&& observer, std::size_t steps) {
    std::mt19937 generator(3);
    std::normal_distribution<double> normal;
    std::size_t lost = 0;
    for (std::size_t k = 0; k < steps; ++k) {
        const double swing = std::sin(0.01 * static_cast<double>(k));
        const auto e =
            observer.step(0.01, {0.03 * swing, 20.0 + 0.05 * normal(generator),
                                 0.2 * swing + 0.003 * normal(generator), 0.1 * normal(generator),
                                 4.0 * swing + 0.1 * normal(generator)});
        if (!(e.beta_std_rad > 0.0 && std::isfinite(e.beta_rad))) ++lost;
    }
    EXPECT_EQ(lost, 0U);
}

TEST(Covariances, OfTheSideslipObservers) {
    for (const double ratio : kRatios) {
        SCOPED_TRACE(ratio);
        const ObserverSettings s = scaled_settings(ratio);
        of_an_observer(SideslipUkf<Method::kExtended>(observed_car(), s, false), kSteps / 5);
        of_an_observer(SideslipUkf<Method::kUnscented>(observed_car(), s, false), kSteps / 5);
        of_an_observer(SideslipUkf<Method::kSquareRoot>(observed_car(), s, false), kSteps / 5);
        of_an_observer(SideslipDual(observed_car(), s), kSteps / 45);  // three filters each
    }
}

}  // namespace
}  // namespace sysid::test
