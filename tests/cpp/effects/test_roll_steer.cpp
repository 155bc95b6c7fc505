// Wheels that steer and lean with the roll of the body: the equation, and what they are in a long
// corner.
#include <numbers>

#include "effect_pair.hpp"

namespace sysid::test {
namespace {

constexpr double kSteer = 0.015, kFollowing = 1.8, kDamped = 0.35;
constexpr double kRate = 2.0 * std::numbers::pi * kFollowing;

Parameters with_steer(const std::string& id, double steer = kSteer) {
    Parameters p = plain_parameters();
    p[parameter_of(id, 0)] = steer;
    p[parameter_of(id, 1)] = kFollowing;
    return p;
}

SingleTrack steering(const std::string& id) { return {saloon(), mask_of({id})}; }

TEST(RollSteer, AtOneInstant) {
    for (const std::string id : {"front_roll_steer", "rear_roll_steer"}) {
        ModelState<double> x = kCornering;
        const std::size_t angle = state_of(id, 0), rate = state_of(id, 1);
        x[angle] = 0.5;
        x[rate] = -2.0;
        const Pair it(id, {kSteer, kFollowing}, x, kDriving);
        const bool front = id == "front_roll_steer";
        EXPECT_NEAR(it.on.w.alpha_f - it.off.w.alpha_f, front ? 0.5 * kSteer : 0.0, 1e-15);
        EXPECT_NEAR(it.on.w.alpha_r - it.off.w.alpha_r, front ? 0.0 : 0.5 * kSteer, 1e-15);
        EXPECT_EQ(it.on.rate[angle], -2.0);
        EXPECT_NEAR(it.on.rate[rate],
                    kRate * kRate * (it.on.w.a_y / kGravity - 0.5) + 2.0 * kDamped * kRate * 2.0,
                    1e-11);
    }
}

TEST(RollSteer, InALongCornerIsASteeringAngleOfThatAxle) {
    // Of the front, so much more of the steering; of the rear, that much more sideslip, which the
    // front has to be steered out of.
    for (const std::string id : {"front_roll_steer", "rear_roll_steer"}) {
        const bool front = id == "front_roll_steer";
        const auto last = drive(steering(id), with_steer(id),
                                std::vector<Input>(1500, Input{0.03, 300.0}), 0.01, 20.0)
                              .back();
        const double turned = kSteer * last[kAy] / kGravity;
        EXPECT_GT(turned, 0.004);
        const Input other{0.03 + (front ? turned : -turned), 300.0};
        const auto plain =
            drive({saloon(), 0}, plain_parameters(), std::vector<Input>(1500, other), 0.01, 20.0)
                .back();
        EXPECT_NEAR(plain[kYawRate], last[kYawRate], 0.02 * last[kYawRate]);
        EXPECT_NEAR(plain[kAy], last[kAy], 0.02 * last[kAy]);
        EXPECT_NEAR(last[kVy] - plain[kVy], front ? 0.0 : turned * last[kVx], 0.015);
    }
}

TEST(RollSteer, InALongCornerIsAPartOfTheCorneringStiffness) {
    // Of small slip angles: what they make is less by what the roll makes.
    const auto yaw_rate = [](double steer, std::size_t samples) {
        Parameters p = with_steer("rear_roll_steer", steer);
        const double slip = 1.0 / (p[4] * p[5] * p[6]);  // of the rear axle at 1 g
        p[4] *= slip / (slip + steer);
        const std::vector<Input> inputs(samples, Input{0.005, 300.0});
        return drive(steering("rear_roll_steer"), p, inputs, 0.01, 25.0).back()[kYawRate];
    };
    const double soon = yaw_rate(0.0, 25), late = yaw_rate(0.0, 400);
    for (const double steer : {0.02, -0.02}) {
        EXPECT_NEAR(yaw_rate(steer, 400), late, 0.01 * late);
        EXPECT_GT(std::abs(yaw_rate(steer, 25) - soon), 0.02 * soon);  // not before
    }
}

}  // namespace
}  // namespace sysid::test
