// The driver in the loop: follows, gives up when the car is lost, and repeats himself exactly.
#include <numbers>

#include "helpers.hpp"
#include "sysid/simulate/simulator.hpp"

namespace sysid::test {
namespace {

constexpr double kStep = 0.01;

Drive drive_along(const std::vector<Reference>& references, const Driver& driver,
                  double initial_speed, const std::array<double, kPushes>& disturbance = {},
                  EffectMask effects = 0) {
    std::vector<double> pushes;
    for (std::size_t k = 0; k < references.size(); ++k)
        pushes.insert(pushes.end(), disturbance.begin(), disturbance.end());
    const Parameters p = typical_parameters();
    return simulate({saloon(), effects}, p.data(), kStep, references, driver, pushes.data(),
                    {initial_speed});
}

std::size_t samples(const Drive& drive) { return drive.inputs.size() / 2; }

TEST(Simulator, FollowsConstantCurvature) {
    for (double curvature : {0.01, -0.01}) {
        const Drive drive = drive_along({2000, {20.0, curvature, 0.0}}, {}, 20.0);
        ASSERT_EQ(drive.lost_at, 2000U);
        for (std::size_t k = 1000; k < 2000; ++k) {
            const double* y = &drive.outputs[k * kChannels];
            ASSERT_NEAR(y[kYawRate], curvature * y[kVx], 0.01 * std::abs(curvature) * 20.0) << k;
            ASSERT_NEAR(y[kVx], 20.0, 0.5) << k;
        }
    }
}

TEST(Simulator, FollowsTheSpeed) {
    std::vector<Reference> references(3000, {30.0, 0.0, 0.0});
    for (std::size_t k = 0; k < 1000; ++k)
        references[k].speed_mps = 20.0 + 0.01 * static_cast<double>(k);
    const Drive drive = drive_along(references, {}, 20.0);
    ASSERT_EQ(drive.lost_at, 3000U);
    EXPECT_NEAR(drive.outputs[2999 * kChannels + kVx], 30.0, 0.2);
    EXPECT_NEAR(drive.outputs[500 * kChannels + kVx], 25.0, 1.0);
    for (std::size_t k = 0; k < 3000; ++k) EXPECT_EQ(drive.outputs[k * kChannels + kYawRate], 0.0);
}

TEST(Simulator, OpenLoopSteersWhatIsAsked) {
    Driver driver;
    driver.tracks_path = false;
    std::vector<Reference> references;
    for (int k = 0; k < 500; ++k) references.push_back({20.0, 0.02, 0.02 * std::sin(0.02 * k)});
    const Drive drive = drive_along(references, driver, 20.0);
    ASSERT_EQ(drive.lost_at, 500U);
    for (std::size_t k = 0; k < 500; ++k)
        EXPECT_NEAR(drive.inputs[2 * k], references[k].steer_rad, 1e-12) << k;
}

TEST(Simulator, HandsAndFeetAreLimited) {
    Driver driver;
    driver.tracks_path = false;
    driver.steer_limit_rad = 0.03;
    driver.steer_rate_limit_radps = 0.2;
    driver.drive_limit_n = 2000.0;
    driver.brake_limit_n = 1500.0;
    driver.force_rate_limit_nps = 5000.0;
    std::vector<Reference> references(400, {40.0, 0.0, 0.5});
    for (std::size_t k = 200; k < 400; ++k) references[k] = {5.0, 0.0, -0.5};
    const Drive drive = drive_along(references, driver, 20.0);
    double most_steer = 0.0;
    double most_drive = 0.0;
    double most_brake = 0.0;
    EXPECT_EQ(drive.inputs[0], 0.03);  // begins with the steering asked for, within the limit
    for (std::size_t k = 1; k < samples(drive); ++k) {
        const double steer = drive.inputs[2 * k];
        const double force = drive.inputs[2 * k + 1];
        EXPECT_LE(std::abs(steer - drive.inputs[2 * k - 2]), 0.2 * kStep + 1e-12) << k;
        EXPECT_LE(std::abs(force - drive.inputs[2 * k - 1]), 5000.0 * kStep + 1e-9) << k;
        most_steer = std::max(most_steer, std::abs(steer));
        most_drive = std::max(most_drive, force);
        most_brake = std::max(most_brake, -force);
    }
    EXPECT_NEAR(most_steer, 0.03, 1e-12);
    EXPECT_NEAR(most_drive, 2000.0, 1e-9);
    EXPECT_NEAR(most_brake, 1500.0, 1e-9);
}

TEST(Simulator, BeginsInTheMiddleOfACorner) {
    // The second half of a drive, begun where the first one ended, is the second half.
    const EffectMask effects = mask_of({"friction_change"});
    Parameters p = plain_parameters();
    p[parameter_of("friction_change", 0)] = 0.3;
    p[parameter_of("friction_change", 1)] = 4.0;
    Driver driver;
    driver.tracks_path = false;
    const auto drive = [&](std::size_t n, const Beginning& beginning) {
        const std::vector<Reference> steered(n, {20.0, 0.0, 0.03});
        const std::vector<double> calm(kPushes * n, 0.0);
        return simulate({saloon(), effects}, p.data(), kStep, steered, driver, calm.data(),
                        beginning);
    };
    const Drive whole = drive(600, {20.0});
    ASSERT_EQ(whole.lost_at, 600U);
    const double* middle = &whole.states[300 * kModelStates];
    const Drive half = drive(300, {middle[0], middle[1], middle[2], 0.0, 300 * kStep});
    double moved = 0.0;
    for (std::size_t k = 0; k < 300; ++k) {
        const double* there = &whole.states[(300 + k) * kModelStates];
        // The wheel force begins anew, and is right again soon.
        for (std::size_t i = 0; i < kMotionStates; ++i)
            EXPECT_NEAR(half.states[k * kModelStates + i], there[i], 0.02) << k;
        moved = std::max(moved, std::abs(there[1] - middle[1]));
    }
    EXPECT_GT(moved, 0.1);  // the loss of grip is felt
    EXPECT_EQ(drive(2, {20.0, 0.0, 0.0, 0.01, 0.0}).inputs[0], 0.03 + 0.01);
}

TEST(Simulator, EndsWhereItIsTooFarAway) {
    // Half a circle of 20 m radius, at 10 m/s: nowhere farther away than its width.
    const std::vector<Reference> circle(1000, {10.0, 0.05, 0.0});
    const std::vector<double> calm(kPushes * circle.size(), 0.0);
    const Parameters p = typical_parameters();
    const auto within = [&](double farthest_m) {
        return simulate({saloon(), 0}, p.data(), kStep, circle, {}, calm.data(), {10.0}, {},
                        farthest_m);
    };
    EXPECT_EQ(within(50.0).lost_at, 1000U);
    const Drive ended = within(20.0);
    ASSERT_LT(ended.lost_at, 1000U);
    // The chord of a sixth of a circle is as long as its radius; it has to turn in first.
    EXPECT_NEAR(static_cast<double>(ended.lost_at) * kStep, 20.0 * std::numbers::pi / 3.0 / 10.0,
                0.15);
    EXPECT_EQ(samples(ended), ended.lost_at + 1);
}

TEST(Simulator, EndsWhenSpun) {
    Driver driver;
    driver.tracks_path = false;
    const std::array<double, kPushes> spinning{0.0, 0.0, 30000.0};
    const Drive drive = drive_along({2000, {30.0, 0.0, 0.0}}, driver, 30.0, spinning);
    ASSERT_LT(drive.lost_at, 2000U);
    EXPECT_GT(drive.lost_at, 10U);
    EXPECT_EQ(samples(drive), drive.lost_at + 1);
    EXPECT_EQ(drive.states.size(), samples(drive) * kModelStates);
    EXPECT_EQ(drive.outputs.size(), samples(drive) * kChannels);
    const double* last = &drive.states[drive.lost_at * kModelStates];
    EXPECT_GT(std::abs(std::atan2(last[1], last[0])), 0.5);
    for (double value : drive.outputs) EXPECT_TRUE(std::isfinite(value));
}

TEST(Simulator, EndsWhenStopped) {
    const Drive drive = drive_along({2000, {0.0, 0.0, 0.0}}, {}, 15.0);
    ASSERT_LT(drive.lost_at, 2000U);
    EXPECT_LT(drive.states[drive.lost_at * kModelStates], kLowestSpeed);
    EXPECT_GT(drive.states[(drive.lost_at - 1) * kModelStates], kLowestSpeed - 1e-12);
}

TEST(Simulator, Deterministic) {
    std::vector<Reference> references;
    for (int k = 0; k < 800; ++k) references.push_back({22.0, 0.008 * std::sin(0.01 * k), 0.0});
    const std::array<double, kPushes> gust{50.0, -80.0, 30.0};
    const Drive a = drive_along(references, {}, 22.0, gust, kAllEffects);
    const Drive b = drive_along(references, {}, 22.0, gust, kAllEffects);
    EXPECT_EQ(a.lost_at, 800U);
    EXPECT_EQ(a.inputs, b.inputs);
    EXPECT_EQ(a.states, b.states);
    EXPECT_EQ(a.outputs, b.outputs);
}

TEST(Simulator, RecordsWhatTheModelComputes) {
    // From one recorded sample to the next with the recorded inputs, by the integrator itself.
    std::vector<Reference> references;
    for (int k = 0; k < 300; ++k) references.push_back({22.0, 0.008 * std::sin(0.02 * k), 0.0});
    const std::array<double, kPushes> gust{50.0, -80.0, 30.0};
    // What acts with a dead time is not what was recorded at that sample.
    const EffectMask effects = kAllEffects & ~mask_of({"steer_delay"});
    const Drive drive = drive_along(references, {}, 22.0, gust, effects);
    const SingleTrack model{saloon(), effects};
    const Parameters p = typical_parameters();
    const std::array<double, kExternals> external{50.0, -80.0, 30.0};
    for (std::size_t k = 0; k + 1 < samples(drive); ++k) {
        ModelState<double> x;
        std::copy_n(&drive.states[k * kModelStates], kModelStates, x.begin());
        const auto input = [&](std::size_t at) {
            return Input{drive.inputs[2 * at], drive.inputs[2 * at + 1],
                         static_cast<double>(at) * kStep};
        };
        const auto y = sense(model, x, external.data(), input(k), p.data());
        for (std::size_t i = 0; i < kChannels; ++i)
            EXPECT_EQ(drive.outputs[k * kChannels + i], y[i]);
        advance(model, x, external.data(), input(k), input(k + 1), p.data(), kStep, 60);
        for (std::size_t i = 0; i < kModelStates; ++i)
            EXPECT_NEAR(drive.states[(k + 1) * kModelStates + i], x[i], 1e-6);
    }
}

}  // namespace
}  // namespace sysid::test
