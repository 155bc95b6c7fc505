// Sideslip observers and recursive least squares, called from C++.
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

#include "sysid/online/cornering_rls.hpp"
#include "sysid/online/sideslip_dual.hpp"
#include "sysid/online/sideslip_ukf.hpp"
#include "sysid/published/sideslip_observer.hpp"

namespace sysid {
namespace {

ObservedCar car() {
    ObservedCar out;
    out.data.mass_kg = 1500.0;
    out.data.lf_m = 1.2;
    out.data.lr_m = 1.4;
    out.data.cg_height_m = 0.5;
    out.yaw_inertia_kgm2 = 2500.0;
    out.front = out.rear = {10.0, 1.4, 1.0, 0.0};
    return out;
}

/// A steady corner of 4 m/s2 at 20 m/s: sideslip by hand, then what the sensors say.
struct Corner {
    double beta, steer, rate = 0.2, ay = 4.0, vx = 20.0;

    Corner() {
        const ObservedCar c = car();
        const auto slip = [&](double share) {  // the Magic Formula, inverted by bisection
            double low = 0.0, high = 0.1;
            for (int i = 0; i < 60; ++i) {
                const double middle = 0.5 * (low + high);
                (magic_formula<double>(middle, c.front) < share ? low : high) = middle;
            }
            return low;
        };
        const double alpha = slip(ay / kGravity);  // each axle carries its share of mass
        beta = std::atan(c.data.lr_m * rate / vx - std::tan(alpha));
        steer = alpha + std::atan(std::tan(beta) + c.data.lf_m * rate / vx);
    }
    SensorSample sample() const { return {steer, vx, rate, 0.0, ay}; }
};

template <class Observer>
double settled(Observer& observer) {
    const Corner corner;
    SideslipEstimate out;
    for (int k = 0; k < 1000; ++k) out = observer.step(0.01, corner.sample());
    return out.beta_rad;
}

TEST(SideslipObservers, AgreeOnASteadyCorner) {
    ObserverSettings settings;
    settings.frozen_after_s = 1e9;   // nothing moves here
    settings.stiffness_prior = 0.4;  // the others do not doubt the tyres, which are right
    const double truth = Corner().beta;
    SideslipDual dual(car(), settings);
    SideslipUkf<Method::kUnscented> ukf(car(), settings, false);
    SideslipUkf<Method::kExtended> ekf(car(), settings, false);
    SideslipUkf<Method::kSquareRoot> root(car(), settings, false);
    EXPECT_NEAR(settled(dual), truth, 0.002);
    const double by_ukf = settled(ukf);
    EXPECT_NEAR(by_ukf, truth, 0.002);
    EXPECT_NEAR(settled(ekf), by_ukf, 1e-3);
    EXPECT_NEAR(settled(root), by_ukf, 1e-9);
}

TEST(SideslipObservers, TheDualDoubtsASideslipThatOnlyTheTyresTellOf) {
    // In a corner that never changes stiffness and sideslip cannot be told apart.
    ObserverSettings settings;
    settings.frozen_after_s = 1e9;
    SideslipDual dual(car(), settings);
    const Corner corner;
    SideslipEstimate out;
    for (int k = 0; k < 1000; ++k) out = dual.step(0.01, corner.sample());
    EXPECT_LT(std::abs(out.beta_rad - corner.beta), 2.0 * out.beta_std_rad);
    EXPECT_GT(out.beta_std_rad, 0.3 * std::abs(corner.beta));
}

/// 20 s straight on: the noise of the sensors, and `shift` [m/s2] of lateral acceleration that
/// comes and goes with no steering.
std::vector<SideslipEstimate> straight_on(double shift) {
    const ObserverSettings settings;
    SideslipDual dual(car(), settings);
    std::mt19937 random(1);
    std::normal_distribution<double> noise;
    std::vector<SideslipEstimate> out;
    for (int k = 0; k < 2000; ++k) {
        const double ay = k / 30 % 2 == 0 ? shift : -shift;
        const double r = settings.yaw_rate_radps * noise(random);
        const double ax = settings.ax_mps2 * noise(random);
        out.push_back(dual.step(0.01, {0.0, 20.0, r, ax, ay + settings.ay_mps2 * noise(random)}));
    }
    return out;
}

TEST(SideslipObservers, AStraightTeachesNoStiffness) {
    // Slip that is estimated from noise says nothing of tyres.
    const auto run = straight_on(0.0);
    EXPECT_NEAR(run.back().cf_npr / run.front().cf_npr, 1.0, 0.05);
    EXPECT_NEAR(run.back().cr_npr / run.front().cr_npr, 1.0, 0.05);
    EXPECT_GT(run.back().cf_std_npr, 0.9 * ObserverSettings().stiffness_prior * run.back().cf_npr);
}

TEST(SideslipObservers, TheBandIsWiderForACarThatDepartsFromTheModel) {
    const double quiet = straight_on(0.0).back().beta_std_rad;
    EXPECT_GT(quiet, ObserverSettings().error_slip_rad);  // which no straight tells
    EXPECT_GT(straight_on(0.2).back().beta_std_rad, 1.3 * quiet);
}

TEST(SideslipObservers, AFrozenSensorIsLeftOut) {
    SideslipDual dual(car(), ObserverSettings());
    const Corner corner;
    SideslipEstimate out;
    for (int k = 0; k < 100; ++k) {
        SensorSample s = corner.sample();
        s.yaw_rate_radps += 1e-4 * (k % 3);
        s.ax_mps2 += 1e-4 * (k % 3);
        out = dual.step(0.01, s);  // a_y stands still
        if (k == 10) {
            EXPECT_EQ(out.mode, ObserverMode::kRunning);
        }
    }
    EXPECT_EQ(out.mode, ObserverMode::kCoasting);
}

TEST(SideslipObservers, ThePublishedOneNeedsEverySensor) {
    PublishedDual published(car(), 1e5, 1e5);
    SensorSample s = Corner().sample();
    published.step(0.01, s);
    published.step(0.01, s);
    s.ay_mps2 = std::nan("");
    EXPECT_THROW(published.step(0.01, s), NumericalFailure);
}

TEST(CorneringRls, RefusesWhatCannotBe) {
    CorneringRlsSettings settings{1500.0, 2500.0, 1.2, 1.4};
    settings.forgetting = 0.9;
    EXPECT_THROW(CorneringRls(settings, 1e5, 1e5), std::invalid_argument);
    settings.forgetting = 0.99;
    settings.mass_kg = 0.0;
    EXPECT_THROW(CorneringRls(settings, 1e5, 1e5), std::invalid_argument);
    settings.mass_kg = 1500.0;
    CorneringRls rls(settings, 1e5, 1e5);
    EXPECT_FALSE(rls.step(std::nan(""), 0.01, 1.0, 0.0));
    EXPECT_THROW(rls.step(0.01, 0.01, HUGE_VAL, 0.0), NumericalFailure);
    EXPECT_TRUE(rls.step(0.01, 0.01, 1.0, std::nan("")));
    EXPECT_EQ(rls.used(), 1U);
}

TEST(AxleForceAgain, IsTheForceWhateverWasAskedBefore) {
    const TyreCoefficients<double> tyre{10.0, 1.4, 1.05, -0.5};
    AxleForceAgain again;
    std::array<double, 5> now{0.05, 4000.0, 500.0, 0.1, -0.05};
    const std::array<double, 5> step{0.01, 300.0, -200.0, 0.07, 0.04};
    for (int round = 0; round < 60; ++round) {
        const double asked = again(now[0], now[1], now[2], tyre, now[3], now[4]);
        EXPECT_EQ(asked, axle_force<double>(now[0], now[1], now[2], tyre, std::exp(now[3]),
                                            std::exp(now[4])));
        // One after the other, twice the same between: what has not changed is not worked out.
        const auto next = static_cast<std::size_t>(round / 2 % 5);
        if (round % 2 == 1) now[next] += step[next];
    }
}

TEST(AxleForceAgain, KnowsNothingAtFirst) {
    AxleForceAgain again;
    const TyreCoefficients<double> tyre{10.0, 1.4, 1.05, -0.5};
    EXPECT_EQ(again(0.0, 0.5, 0.0, tyre, 0.0, 0.0), 0.0);
    EXPECT_GT(again(0.02, 0.5, 0.0, tyre, 0.0, 0.0), 0.0);
}

}  // namespace
}  // namespace sysid
