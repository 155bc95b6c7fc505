// The laboratory's plant: integrators against each other, late loads, place on the ground.
#include "helpers.hpp"
#include "sysid/lab/plant.hpp"

namespace sysid::lab::test {
namespace {

using sysid::test::kCalm;
using sysid::test::mask_of;
using sysid::test::plain_parameters;
using sysid::test::saloon;

constexpr double kStep = 0.01;

PlantState driven(Plant plant, int samples, double steer_rad, double force_n) {
    PlantState x = plant.at_rest(25.0);
    for (int k = 0; k < samples; ++k)
        plant.advance(x, {steer_rad * std::sin(0.05 * k), force_n},
                      {steer_rad * std::sin(0.05 * k), force_n}, kCalm, kStep);
    return x;
}

TEST(LabPlant, RungeKuttaHasOrderFour) {
    const auto p = plain_parameters();
    const SingleTrack model{saloon(), 0};
    const auto error = [&](int steps) {
        PlantOptions fixed, exact;
        fixed.steps = steps;
        exact.tolerance = 1e-13;
        const PlantState a = driven(Plant(model, p.data(), fixed), 100, 0.05, 1000.0);
        const PlantState b = driven(Plant(model, p.data(), exact), 100, 0.05, 1000.0);
        double worst = 0.0;
        for (std::size_t i = 0; i < kPlantStates; ++i)
            worst = std::max(worst, std::abs(a[i] - b[i]));
        return worst;
    };
    const double coarse = error(1), fine = error(2);
    EXPECT_LT(coarse, 1e-4);
    EXPECT_NEAR(std::log2(coarse / fine), 4.0, 0.6);
}

TEST(LabPlant, DormandPrinceFollowsAKnownSolution) {
    std::array<double, 2> x{1.0, 0.0};
    const int steps = dormand_prince(x, 10.0, 1e-10, [](double, const std::array<double, 2>& at) {
        return std::array<double, 2>{at[1], -at[0]};
    });
    EXPECT_NEAR(x[0], std::cos(10.0), 1e-8);
    EXPECT_NEAR(x[1], -std::sin(10.0), 1e-8);
    EXPECT_GT(steps, 10);
    EXPECT_LT(steps, 1000);
    EXPECT_THROW(dormand_prince(x, 1.0, 1e-6,
                                [](double, const std::array<double, 2>&) {
                                    return std::array<double, 2>{NAN, 0.0};
                                }),
                 NumericalFailure);
}

TEST(LabPlant, StepsRefineWhereTheCarIsQuick) {
    // At walking pace one step of 0.01 s would be unstable.
    const auto p = plain_parameters();
    const SingleTrack model{saloon(), 0};
    PlantOptions exact;
    exact.tolerance = 1e-12;
    Plant automatic(model, p.data(), {}), precise(model, p.data(), exact);
    PlantState a = automatic.at_rest(1.2), b = a;
    for (int k = 0; k < 50; ++k) {
        automatic.advance(a, {0.1, 100.0}, {0.1, 100.0}, kCalm, kStep);
        precise.advance(b, {0.1, 100.0}, {0.1, 100.0}, kCalm, kStep);
    }
    for (std::size_t i = 0; i < kPlantStates; ++i) EXPECT_NEAR(a[i], b[i], 2e-3) << i;
}

TEST(LabPlant, ACircleClosesOnTheGround) {
    const auto p = plain_parameters();
    const SingleTrack model{saloon(), 0};
    Plant plant(model, p.data(), {});
    PlantState x = plant.at_rest(10.0);
    const Input u{0.05, 30.0};
    for (int k = 0; k < 500; ++k) plant.advance(x, u, u, kCalm, kStep);
    const double radius = std::hypot(x[0], x[1]) / x[2];
    const PlantState begin = x;
    for (int k = 0; k < 500; ++k) plant.advance(x, u, u, kCalm, kStep);
    const double turned = x[kHeading] - begin[kHeading];
    const double chord = std::hypot(x[kPlaceX] - begin[kPlaceX], x[kPlaceY] - begin[kPlaceY]);
    EXPECT_NEAR(chord, 2.0 * radius * std::sin(0.5 * turned), 0.02 * chord);
}

TEST(LabPlant, HalfTheLoadIsHalfTheGrip) {
    const auto p = plain_parameters();
    const SingleTrack model{saloon(), 0};
    PlantOptions half;
    half.load_share = 0.5;
    const Plant whole(model, p.data(), {}), part(model, p.data(), half);
    PlantState x = whole.at_rest(20.0);
    x[1] = 0.3;
    const PlantTruth a = whole.look(x, {0.02, 0.0}, kCalm), b = part.look(x, {0.02, 0.0}, kCalm);
    EXPECT_NEAR(b.force_rear / a.force_rear, 0.5, 1e-3);
    // The front tyre's drag is halved too, and with it a little load transfer.
    EXPECT_NEAR(b.load_rear / a.load_rear, 0.5, 1e-3);
    EXPECT_NEAR(b.force_rear / b.load_rear, a.force_rear / a.load_rear, 1e-9);
}

TEST(LabPlant, LateLoadsAreThoseOfTheSampleBefore) {
    const auto p = plain_parameters();
    const SingleTrack model{saloon(), 0};
    PlantOptions late;
    late.late_loads = true;
    Plant plant(model, p.data(), late);
    const Plant prompt(model, p.data(), {});
    PlantState x = plant.at_rest(20.0);
    x[1] = 0.2;
    const Input brake{0.0, -8000.0};
    const PlantTruth first = plant.look(x, brake, kCalm);
    const PlantTruth at_once = prompt.look(x, brake, kCalm);
    const double per_load = at_once.force_rear / at_once.load_rear;
    const VehicleData car = saloon();
    const double still = car.mass_kg * kGravity * car.lf_m / (car.lf_m + car.lr_m);
    EXPECT_NEAR(first.force_rear, per_load * still, 1e-9);
    EXPECT_NEAR(first.load_rear, at_once.load_rear, 1e-9);
    const double load = first.load_rear;
    PlantState y = x;
    plant.advance(y, brake, brake, kCalm, kStep);
    EXPECT_NEAR(plant.look(x, brake, kCalm).force_rear, per_load * load, 1e-9);
}

TEST(LabPlant, EffectsAct) {
    auto p = plain_parameters();
    p[sysid::test::parameter_of("steer_lag")] = 0.05;
    Plant lagging({saloon(), mask_of({"steer_lag"})}, p.data(), {});
    Plant prompt({saloon(), 0}, p.data(), {});
    PlantState a = lagging.at_rest(20.0), b = prompt.at_rest(20.0);
    for (int k = 0; k < 5; ++k) {
        lagging.advance(a, {0.02, 0.0}, {0.02, 0.0}, kCalm, kStep);
        prompt.advance(b, {0.02, 0.0}, {0.02, 0.0}, kCalm, kStep);
    }
    EXPECT_LT(a[2], 0.7 * b[2]);
    EXPECT_GT(a[2], 0.0);
}

}  // namespace
}  // namespace sysid::lab::test
