// Each effect against its own equation, written down a second time by hand.
#include "effect_pair.hpp"

namespace sysid::test {
namespace {

TEST(EffectEquation, AeroDrag) {
    const Pair it("aero_drag", {0.4}, {30.0}, {0.0, 1000.0});
    const double drag = 0.5 * 1.225 * 0.4 * 30.0 * 30.0;
    EXPECT_NEAR(it.on.w.a_x - it.off.w.a_x, -drag / 1500.0, 1e-13);
    EXPECT_NEAR(it.on.w.a_x, (1000.0 - 0.5 * 1.225 * (0.7 + 0.4) * 900.0) / 1500.0, 1e-13);
}

TEST(EffectEquation, RollingResistance) {
    const Pair it("rolling_resistance", {0.012, 2e-4}, {30.0}, {0.0, 1000.0});
    EXPECT_NEAR(it.on.w.a_x - it.off.w.a_x, -(0.012 + 2e-4 * 30.0) * kGravity, 1e-13);
}

TEST(EffectEquation, AeroDownforce) {
    const Pair it("aero_downforce", {0.9, 1.3}, kCornering, kBraking);
    const double pressure = 0.5 * 1.225 * 25.0 * 25.0;
    EXPECT_NEAR(rest(it.on).front - rest(it.off).front, 0.9 * pressure, 1e-9);
    EXPECT_NEAR(rest(it.on).rear - rest(it.off).rear, 1.3 * pressure, 1e-9);
    // At the same slip angle the lateral force grows with the load.
    EXPECT_NEAR(it.on.w.fy_f / it.off.w.fy_f, it.on.w.fz_f / it.off.w.fz_f, 1e-12);
}

TEST(EffectEquation, LoadsFollowTheAccelerationThatEffectsLeave) {
    // By eq. (5), with downforce and less grip as without; a_x was that of a car without them.
    for (const Input& u : {kBraking, kDriving}) {
        Parameters p = plain_parameters();
        p[parameter_of("aero_downforce", 0)] = 4.0;
        p[parameter_of("aero_downforce", 1)] = 3.0;
        p[parameter_of("friction_change", 0)] = 0.4;
        const auto it =
            evaluate({saloon(), mask_of({"aero_downforce", "friction_change"})}, kCornering, u, p);
        const double weight = 1500.0 * kGravity, pressure = 0.5 * 1.225 * 25.0 * 25.0;
        EXPECT_NEAR(rest(it).front, weight * 1.5 / 2.7 + 4.0 * pressure, 1e-9);
        EXPECT_NEAR(rest(it).rear, weight * 1.2 / 2.7 + 3.0 * pressure, 1e-9);
    }
}

TEST(EffectEquation, TyreLoadSensitivity) {
    const Pair it("tyre_load_sensitivity", {0.25}, kCornering, kBraking);
    const double weight = 1500.0 * kGravity;
    const double front = it.off.w.fz_f / (weight * 1.5 / 2.7);
    const double rear = it.off.w.fz_r / (weight * 1.2 / 2.7);
    ASSERT_GT(front, 1.02);
    EXPECT_NEAR(per_load(it).front, 1.0 - 0.25 * (front - 1.0), 1e-12);
    EXPECT_NEAR(per_load(it).rear, 1.0 - 0.25 * (rear - 1.0), 1e-12);
}

TEST(EffectEquation, LateralLoadTransfer) {
    const Pair it("lateral_load_transfer", {0.08, 0.05}, kCornering, kDriving);
    const double in_g = 25.0 * 0.35 / kGravity;
    EXPECT_NEAR(per_load(it).front, 1.0 - 0.08 * in_g * in_g, 1e-12);
    EXPECT_NEAR(per_load(it).rear, 1.0 - 0.05 * in_g * in_g, 1e-12);
}

TEST(EffectEquation, CombinedSlip) {
    const Pair it("combined_slip", {0.8}, kCornering, kBraking);
    const double front = 0.6 * 4000.0 / (1.0 * it.off.w.fz_f);
    const double rear = 0.4 * 4000.0 / (1.1 * it.off.w.fz_r);
    EXPECT_NEAR(per_load(it).front, std::sqrt(1.0 - 0.8 * front * front), 1e-12);
    EXPECT_NEAR(per_load(it).rear, std::sqrt(1.0 - 0.8 * rear * rear), 1e-12);
}

TEST(EffectEquation, CombinedSlipKeepsAFifthOfALockedAxle) {
    const Pair it("combined_slip", {1.0}, kCornering, {0.06, -30000.0});
    EXPECT_NEAR(it.on.w.grip_f, 0.2, 1e-15);
    EXPECT_NEAR(it.on.w.grip_r, 0.2, 1e-15);
}

TEST(EffectEquation, RoadBank) {
    const Pair it("road_bank", {0.05}, kCornering, kDriving);
    const double factor = std::cos(0.05) + 25.0 * 0.35 / kGravity * std::sin(0.05);
    const double moved = it.off.w.fz_r - rest(it.off).rear;
    EXPECT_NEAR(rest(it.on).front, factor * it.off.w.fz_f + moved, 1e-9);
    EXPECT_NEAR(rest(it.on).rear, factor * it.off.w.fz_r - moved, 1e-9);
    // Gravity moves the car and no accelerometer feels it.
    EXPECT_NEAR(it.on.rate[1], it.on.y[kAy] - 25.0 * 0.35 + kGravity * std::sin(0.05), 1e-12);
    const Pair straight("road_bank", {0.05}, {25.0}, {});
    EXPECT_NEAR(straight.on.rate[1], kGravity * std::sin(0.05), 1e-13);
    EXPECT_EQ(straight.on.y[kAy], 0.0);
}

TEST(EffectEquation, RoadGrade) {
    const Pair it("road_grade", {0.03}, kCornering, kDriving);
    EXPECT_NEAR(it.on.rate[0] - it.off.rate[0], -kGravity * std::sin(0.03), 1e-13);
    EXPECT_EQ(it.on.y, it.off.y);
}

TEST(EffectEquation, SideWind) {
    const Pair it("side_wind", {450.0, -250.0}, kCornering, kDriving);
    EXPECT_NEAR(it.on.w.a_y - it.off.w.a_y, 450.0 / 1500.0, 1e-12);
    EXPECT_NEAR(it.on.rate[2] - it.off.rate[2], -250.0 / 2200.0, 1e-12);
    EXPECT_NEAR(it.on.rate[1] - it.off.rate[1], 450.0 / 1500.0, 1e-12);
}

TEST(EffectEquation, Mass) {
    const Pair it("mass", {0.12}, {30.0}, {0.0, 2000.0});
    EXPECT_NEAR(it.on.w.a_x, it.off.w.a_x / 1.12, 1e-13);
    EXPECT_NEAR(it.on.w.fz_f + it.on.w.fz_r, 1.12 * 1500.0 * kGravity, 1e-9);
}

TEST(EffectEquation, YawInertia) {
    const Pair it("yaw_inertia", {0.25}, kCornering, kDriving);
    EXPECT_NEAR(it.on.rate[2], it.off.rate[2] / 1.25, 1e-13);
    EXPECT_EQ(it.on.rate[1], it.off.rate[1]);
}

TEST(EffectEquation, CgPosition) {
    // Exactly the car whose file states the shifted distances.
    const Pair it("cg_position", {0.08}, kCornering, kDriving);
    VehicleData car = saloon();
    car.lf_m += 0.08;
    car.lr_m -= 0.08;
    const auto shifted = evaluate({car}, kCornering, kDriving, it.p);
    for (std::size_t i = 0; i < kMotionStates; ++i)
        EXPECT_NEAR(it.on.rate[i], shifted.rate[i], 1e-12);
    EXPECT_GT(std::abs(it.on.rate[2] - it.off.rate[2]), 0.01);
    // Sensors stay in the body: on that car they have lever arms, forward by what it was shifted.
    Parameters p = plain_parameters();
    p[parameter_of("imu_lever_arm")] = p[parameter_of("speed_sensor_lever_arm")] = 0.08;
    const EffectMask arms = mask_of({"imu_lever_arm", "speed_sensor_lever_arm"});
    for (bool force_known : {true, false}) {
        const Input u = force_known ? kDriving : Input{0.06, 2.0};
        const Pair moved("cg_position", {0.08}, kCornering, u, force_known);
        const auto wanted = evaluate({car, arms, force_known}, kCornering, u, p);
        for (std::size_t i = 0; i < kMotionStates; ++i)
            EXPECT_NEAR(moved.on.rate[i], wanted.rate[i], 1e-12);
        for (std::size_t i = 0; i < kChannels; ++i) EXPECT_NEAR(moved.on.y[i], wanted.y[i], 1e-12);
        EXPECT_GT(std::abs(wanted.y[kVy] - moved.off.y[kVy]), 0.02);
    }
}

TEST(EffectEquation, DriveYawMoment) {
    for (const Input& u : {kDriving, kBraking}) {
        const Pair it("drive_yaw_moment", {0.03, 0.05}, kCornering, u);
        const double moment = u.longitudinal * (0.03 + 0.05 * 25.0 * 0.35 / kGravity);
        EXPECT_NEAR(it.on.rate[2] - it.off.rate[2], moment / 2200.0, 1e-12);
    }
}

TEST(EffectEquation, SteeringAngles) {
    const Pair offset("steer_offset", {0.006}, kCornering, kDriving);
    EXPECT_NEAR(offset.on.w.delta, 0.066, 1e-15);
    const Pair ratio("steer_ratio", {0.08}, kCornering, kDriving);
    EXPECT_NEAR(ratio.on.w.delta, 0.06 * 1.08, 1e-15);
    // What acts is the angle: the same as steering so.
    const auto steered = evaluate({saloon()}, kCornering, {0.066, 3000.0}, offset.p);
    for (std::size_t i = 0; i < kMotionStates; ++i)
        EXPECT_NEAR(offset.on.rate[i], steered.rate[i], 1e-12);
}

TEST(EffectEquation, ComplianceTwistsByTheForceAtTheTwistedAngle) {
    const double load = 1500.0 * kGravity * 1.5 / 2.7;
    for (const auto& [c, near] : {std::pair{1.5e-6, 1e-8}, {1.5e-5, 1e-4}, {-1.5e-6, 1e-8}}) {
        for (const double steer : {-0.06, 0.01, 0.06, 0.15}) {
            const Input u{steer, 3000.0};
            const Pair it("steer_compliance", {c}, kCornering, u);
            const TyreCoefficients<double> tyre{it.p[kBFront], it.p[kCFront], it.p[kDFront],
                                                it.p[kEFront]};
            const double force = load * magic_formula(it.on.w.alpha_f, tyre);
            EXPECT_NEAR(it.on.w.delta, steer - c * force, near) << c << " " << steer;
        }
    }
    // The rear axle steers nothing; what turns less is the front one.
    const Pair it("steer_compliance", {1.5e-6}, kCornering, kDriving);
    EXPECT_LT(it.on.w.alpha_f, it.off.w.alpha_f);
    EXPECT_EQ(it.on.w.alpha_r, it.off.w.alpha_r);
}

TEST(EffectEquation, OffsetAndRatioComeBeforeTheLag) {
    Parameters p = plain_parameters();
    p[parameter_of("steer_offset")] = 0.01;
    p[parameter_of("steer_ratio")] = 0.1;
    p[parameter_of("steer_lag")] = 0.05;
    const SingleTrack model{saloon(), mask_of({"steer_offset", "steer_ratio", "steer_lag"})};
    ModelState<double> x{20.0};
    settle_auxiliary(model, x, kCalm.data(), {0.03, 0.0}, p.data());
    EXPECT_NEAR(x[state_of("steer_lag")], (0.03 + 0.01) * 1.1, 1e-9);
}

TEST(EffectEquation, SteerLagReaches63PercentAfterOneTimeConstant) {
    Parameters p = plain_parameters();
    const double tau = 0.06;
    p[parameter_of("steer_lag")] = tau;
    const SingleTrack model{saloon(), mask_of({"steer_lag"})};
    ModelState<double> x{20.0};
    const Input step{0.05, 0.0};
    advance(model, x, kCalm.data(), step, step, p.data(), tau, 50);
    EXPECT_NEAR(x[state_of("steer_lag")], 0.05 * (1.0 - std::exp(-1.0)), 1e-9);
    const auto e = evaluate(model, x, step, p);
    EXPECT_EQ(e.w.delta, x[state_of("steer_lag")]);
}

TEST(EffectEquation, RelaxationReaches63PercentAfterOneLength) {
    // The motion held: only the slip angles' own equation is integrated here, over the distance.
    Parameters p = plain_parameters();
    const double sigma = 0.45;
    p[parameter_of("tyre_relaxation")] = sigma;
    const SingleTrack model{saloon(), mask_of({"tyre_relaxation"})};
    for (double v : {10.0, 30.0}) {
        const Input steer{0.02, 0.0};
        ModelState<double> x{v, 0.1, 0.05};
        const double front = 0.02 - std::atan((0.1 + 1.2 * 0.05) / v);
        const double rear = -std::atan((0.1 - 1.5 * 0.05) / v);
        const int steps = 20000;
        for (int n = 0; n < steps; ++n) {
            const auto e = evaluate(model, x, steer, p);
            for (std::size_t i : {state_of("tyre_relaxation", 0), state_of("tyre_relaxation", 1)})
                x[i] += sigma / v / steps * e.rate[i];
        }
        const double part = 1.0 - std::exp(-1.0);
        EXPECT_NEAR(x[state_of("tyre_relaxation", 0)] / front, part, 1e-4);
        EXPECT_NEAR(x[state_of("tyre_relaxation", 1)] / rear, part, 1e-4);
        const auto e = evaluate(model, x, steer, p);
        EXPECT_EQ(e.w.alpha_f, x[state_of("tyre_relaxation", 0)]);
        EXPECT_EQ(e.w.alpha_r, x[state_of("tyre_relaxation", 1)]);
    }
}

TEST(EffectEquation, ImuLeverArm) {
    const Pair it("imu_lever_arm", {0.5, 0.3}, kCornering, kDriving);
    const double r = 0.35;
    const double r_dot = it.off.rate[2];
    ASSERT_GT(std::abs(r_dot), 0.1);
    EXPECT_NEAR(it.on.y[kAx], it.off.y[kAx] - 0.5 * r * r - 0.3 * r_dot, 1e-12);
    EXPECT_NEAR(it.on.y[kAy], it.off.y[kAy] + 0.5 * r_dot - 0.3 * r * r, 1e-12);
    EXPECT_EQ(it.on.rate, it.off.rate);
}

TEST(EffectEquation, InsLeverArmIsThatOfBothSensors) {
    const Pair it("ins_lever_arm", {0.5, 0.3}, kCornering, kDriving);
    const Pair inertial("imu_lever_arm", {0.5, 0.3}, kCornering, kDriving);
    EXPECT_EQ(it.on.y[kAx], inertial.on.y[kAx]);
    EXPECT_EQ(it.on.y[kAy], inertial.on.y[kAy]);
    EXPECT_NEAR(it.on.y[kVx], 25.0 - 0.3 * 0.35, 1e-12);
    EXPECT_NEAR(it.on.y[kVy], 0.5 + 0.5 * 0.35, 1e-12);
    EXPECT_EQ(it.on.rate, it.off.rate);
    const Input measured{0.06, 2.0};
    const Pair taken_off("ins_lever_arm", {0.5, 0.3}, kCornering, measured, false);
    const Pair alike("imu_lever_arm", {0.5, 0.3}, kCornering, measured, false);
    EXPECT_EQ(taken_off.on.w.a_x, alike.on.w.a_x);
}

TEST(EffectEquation, SensorErrors) {
    const Pair bias("accelerometer_bias", {0.15, 0.25}, kCornering, kDriving);
    EXPECT_NEAR(bias.on.y[kAx], bias.off.y[kAx] + 0.15, 1e-14);
    EXPECT_NEAR(bias.on.y[kAy], bias.off.y[kAy] + 0.25, 1e-14);
    EXPECT_EQ(bias.on.rate, bias.off.rate);
    const Pair scale("accelerometer_scale", {0.05, -0.04}, kCornering, kDriving);
    EXPECT_NEAR(scale.on.y[kAx], scale.off.y[kAx] * 1.05, 1e-14);
    EXPECT_NEAR(scale.on.y[kAy], scale.off.y[kAy] * 0.96, 1e-14);
    EXPECT_EQ(scale.on.rate, scale.off.rate);
    const Pair gyro("gyro_bias", {0.006}, kCornering, kDriving);
    EXPECT_NEAR(gyro.on.y[kYawRate], 0.356, 1e-15);
    EXPECT_EQ(gyro.on.rate, gyro.off.rate);
}

TEST(EffectEquation, SensorErrorsAreTakenOffTheMeasuredAcceleration) {
    const Input measured{0.06, 2.0};
    const Pair bias("accelerometer_bias", {0.15, 0.25}, kCornering, measured, false);
    EXPECT_NEAR(bias.on.w.a_x, 2.0 - 0.15, 1e-14);
    const Pair scale("accelerometer_scale", {0.05, 0.0}, kCornering, measured, false);
    EXPECT_NEAR(scale.on.w.a_x, 2.0 / 1.05, 1e-14);
    const Pair lever("imu_lever_arm", {0.5, 0.3}, kCornering, measured, false);
    const double yaw = lever.on.rate[2];
    ASSERT_GT(std::abs(yaw), 0.1);
    EXPECT_NEAR(lever.on.w.a_x, 2.0 + 0.5 * 0.35 * 0.35 + 0.3 * yaw, 1e-5);
    EXPECT_NEAR(lever.on.y[kAx], 2.0, 1e-5);
    const Pair lean("body_attitude", {0.04, 0.0}, kCornering, measured, false);
    const double angle = 0.04 * lean.on.w.a_x / kGravity;
    EXPECT_NEAR(lean.on.w.a_x * std::cos(angle) + kGravity * std::sin(angle), 2.0, 1e-13);
}

}  // namespace
}  // namespace sysid::test
