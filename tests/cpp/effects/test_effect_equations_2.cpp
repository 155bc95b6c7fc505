// More effects against their own equations: grip that changes, drive line, sensors, delays.
#include "effect_pair.hpp"

namespace sysid::test {
namespace {

TEST(EffectEquation, LongitudinalLoadTransfer) {
    const Pair it("longitudinal_load_transfer", {0.12}, kCornering, kBraking);
    VehicleData car = saloon();
    car.cg_height_m += 0.12;
    const auto higher = evaluate({car}, kCornering, kBraking, it.p);
    for (std::size_t i = 0; i < kMotionStates; ++i)
        EXPECT_NEAR(it.on.rate[i], higher.rate[i], 1e-12);
    EXPECT_GT(it.on.w.fz_f - it.off.w.fz_f, 100.0);
}

TEST(EffectEquation, AligningMoment) {
    const Pair it("aligning_moment", {0.03}, kCornering, kDriving);
    const double front = 10.0 * it.off.w.alpha_f;
    const double rear = 12.0 * it.off.w.alpha_r;
    const double moment =
        -0.03 * (it.off.w.fy_f / (1.0 + front * front) + it.off.w.fy_r / (1.0 + rear * rear));
    EXPECT_NEAR(it.on.rate[2] - it.off.rate[2], moment / 2200.0, 1e-12);
    EXPECT_EQ(it.on.y[kAy], it.off.y[kAy]);
}

TEST(EffectEquation, FrictionChange) {
    for (const auto& [time, left] : {std::pair{0.0, 1.0}, {5.0, 0.9}, {1e4, 0.8}}) {
        Input u = kDriving;
        u.time_s = time;
        const Pair it("friction_change", {0.2, 5.0}, kCornering, u);
        EXPECT_NEAR(per_load(it).front, left, 1e-10);
        EXPECT_NEAR(per_load(it).rear, left, 1e-10);
        EXPECT_NEAR(it.on.w.mu_peak_r / it.off.w.mu_peak_r, left, 1e-10);
    }
    Input u = kDriving;
    u.time_s = 5.2;
    const Pair it("friction_change", {0.2, 5.0}, kCornering, u);
    EXPECT_NEAR(it.on.w.grip_f, 1.0 - 0.2 / (1.0 + std::exp(-1.0)), 1e-12);
}

TEST(EffectEquation, TyreTemperature) {
    ModelState<double> x = kCornering;
    x[state_of("tyre_temperature", 0)] = 3.0;
    x[state_of("tyre_temperature", 1)] = 5.0;
    const Pair it("tyre_temperature", {0.03, 20.0}, x, kDriving);
    EXPECT_NEAR(per_load(it).front, 1.0 - 0.03 * 3.0, 1e-12);
    EXPECT_NEAR(per_load(it).rear, 1.0 - 0.03 * 5.0, 1e-12);
    const double front = 1e-3 * 25.0 * std::abs(it.on.w.fy_f * it.on.w.alpha_f);  // [kW]
    const double rear = 1e-3 * 25.0 * std::abs(it.on.w.fy_r * it.on.w.alpha_r);
    EXPECT_NEAR(it.on.rate[state_of("tyre_temperature", 0)], (front - 3.0) / 20.0, 1e-12);
    EXPECT_NEAR(it.on.rate[state_of("tyre_temperature", 1)], (rear - 5.0) / 20.0, 1e-12);
    // However hot, a twentieth of the grip stays.
    x[state_of("tyre_temperature", 0)] = 1e3;
    EXPECT_NEAR(Pair("tyre_temperature", {0.03, 20.0}, x, kDriving).on.w.grip_f, 0.05, 1e-15);
}

TEST(EffectEquation, SteerNonlinearity) {
    const Pair it("steer_nonlinearity", {8.0}, kCornering, kDriving);
    EXPECT_NEAR(it.on.w.delta, 0.06 * (1.0 + 8.0 * 0.06 * 0.06), 1e-15);
}

TEST(EffectEquation, RearToe) {
    const Pair it("rear_toe", {0.004}, kCornering, kDriving);
    EXPECT_NEAR(it.on.w.alpha_r - it.off.w.alpha_r, 0.004, 1e-15);
    EXPECT_EQ(it.on.w.alpha_f, it.off.w.alpha_f);
}

TEST(EffectEquation, HeadWind) {
    const Pair it("head_wind", {6.0}, {30.0}, {0.0, 1000.0});
    const double drag = 0.5 * 1.225 * 0.7 * (36.0 * 36.0 - 30.0 * 30.0);
    EXPECT_NEAR(it.on.w.a_x - it.off.w.a_x, -drag / 1500.0, 1e-13);
}

TEST(EffectEquation, ForceGain) {
    const Pair drive("force_gain", {0.08, -0.05}, kCornering, kDriving);
    EXPECT_NEAR(drive.on.w.fx, 3000.0 * 1.08, 1e-9);
    const Pair brake("force_gain", {0.08, -0.05}, kCornering, kBraking);
    EXPECT_NEAR(brake.on.w.fx, -4000.0 * 0.95, 1e-9);
}

TEST(EffectEquation, ForceSplit) {
    const Pair brake("force_split", {0.1, 0.2}, kCornering, kBraking);
    EXPECT_NEAR(brake.on.w.fx_f, -0.7 * 4000.0, 1e-9);
    EXPECT_NEAR(brake.on.w.fx_r, -0.3 * 4000.0, 1e-9);
    const Pair drive("force_split", {0.1, 0.2}, kCornering, kDriving);
    EXPECT_NEAR(drive.on.w.fx_f, 0.2 * 3000.0, 1e-9);
}

TEST(EffectEquation, Differentials) {
    const Pair locked("locked_differential", {1.2e5}, kCornering, kDriving);
    EXPECT_NEAR(locked.on.rate[2] - locked.off.rate[2], -1.2e5 * 0.35 / 25.0 / 2200.0, 1e-12);
    const Pair limited("limited_slip_differential", {400.0}, kCornering, kDriving);
    const double sign = 0.35 / std::sqrt(0.35 * 0.35 + 0.02 * 0.02);
    EXPECT_NEAR(limited.on.rate[2] - limited.off.rate[2], -400.0 * sign / 2200.0, 1e-12);
}

TEST(EffectEquation, SpeedSensor) {
    const Pair turned("speed_sensor_misalignment", {0.02}, kCornering, kDriving);
    EXPECT_NEAR(turned.on.y[kVx], 25.0 * std::cos(0.02) - 0.5 * std::sin(0.02), 1e-12);
    EXPECT_NEAR(turned.on.y[kVy], 0.5 * std::cos(0.02) + 25.0 * std::sin(0.02), 1e-12);
    const Pair away("speed_sensor_lever_arm", {0.8, 0.4}, kCornering, kDriving);
    EXPECT_NEAR(away.on.y[kVx], 25.0 - 0.4 * 0.35, 1e-12);
    EXPECT_NEAR(away.on.y[kVy], 0.5 + 0.8 * 0.35, 1e-12);
    EXPECT_EQ(away.on.rate, away.off.rate);
}

TEST(EffectEquation, BodyAttitudeAndGyroScale) {
    const Pair lean("body_attitude", {0.04, 0.06}, kCornering, kBraking);
    const auto felt = [](double a, double k) {
        const double angle = k * a / kGravity;
        return a * std::cos(angle) + kGravity * std::sin(angle);
    };
    EXPECT_NEAR(lean.on.y[kAx], felt(lean.off.y[kAx], 0.04), 1e-12);
    EXPECT_NEAR(lean.on.y[kAy], felt(lean.off.y[kAy], 0.06), 1e-12);
    const Pair gyro("gyro_scale", {0.015}, kCornering, kDriving);
    EXPECT_NEAR(gyro.on.y[kYawRate], 0.35 * 1.015, 1e-15);
}

TEST(EffectEquation, SensorsThatAreLateReadWhatWas) {
    Parameters p = plain_parameters();
    p[parameter_of("sensor_delay", 0)] = 0.06;
    p[parameter_of("sensor_delay", 1)] = 0.02;
    const SingleTrack model{saloon(), mask_of({"sensor_delay"})};
    const double dt = 0.002;
    std::vector<Input> inputs;
    for (int k = 0; k < 1000; ++k) inputs.push_back({0.02 * std::sin(3.0 * k * dt), 300.0, k * dt});
    const auto late = drive(model, p, inputs, dt, 25.0);
    const auto prompt = drive({saloon()}, p, inputs, dt, 25.0);
    const std::array<double, kChannels> near{1e-4, 1e-3, 1e-4, 1e-3, 1e-3};
    for (std::size_t k = 300; k < 1000; ++k)
        for (int i = 0; i < kChannels; ++i)
            EXPECT_NEAR(late[k][i], prompt[k - (i < kYawRate ? 30 : 10)][i],
                        near[static_cast<std::size_t>(i)]);
}

TEST(EffectEquation, RelaxationOfBothAxlesIsThatOfEach) {
    Parameters p = plain_parameters();
    for (const char* id : {"tyre_relaxation", "front_tyre_relaxation", "rear_tyre_relaxation"})
        p[parameter_of(id)] = 0.4;
    const auto moved = [&](const std::vector<std::string>& ids) {
        const SingleTrack model{saloon(), mask_of(ids)};
        ModelState<double> x{20.0};
        for (int k = 0; k < 40; ++k)
            advance(model, x, kCalm.data(), lively(0.01 * k), lively(0.01 * k + 0.01), p.data(),
                    0.01, 1);
        return x;
    };
    const auto both = moved({"tyre_relaxation"});
    const auto each = moved({"front_tyre_relaxation", "rear_tyre_relaxation"});
    for (std::size_t i = 0; i < kMotionStates; ++i) EXPECT_EQ(both[i], each[i]);
    EXPECT_EQ(each[state_of("front_tyre_relaxation")], both[state_of("tyre_relaxation", 0)]);
    EXPECT_EQ(each[state_of("rear_tyre_relaxation")], both[state_of("tyre_relaxation", 1)]);
}

TEST(EffectEquation, RelaxationOfTheFrontDelaysTheYawAndOfTheRearLetsItOvershoot) {
    // A step of the steering: the front force is late; or the rear one, which holds the tail.
    Parameters p = plain_parameters();
    for (const char* id : {"front_tyre_relaxation", "rear_tyre_relaxation"})
        p[parameter_of(id)] = 0.6;
    const auto yaw = [&](EffectMask effects, int samples) {
        const SingleTrack model{saloon(), effects};
        ModelState<double> x{20.0};
        const Input step{0.02, 0.0};
        for (int k = 0; k < samples; ++k)
            advance(model, x, kCalm.data(), step, step, p.data(), 0.01, 2);
        return x[2];
    };
    const EffectMask front = mask_of({"front_tyre_relaxation"});
    const EffectMask rear = mask_of({"rear_tyre_relaxation"});
    EXPECT_LT(yaw(front, 4), 0.8 * yaw(0, 4));
    EXPECT_GT(yaw(rear, 15), 1.02 * yaw(0, 15));
    // Where nothing moves any more both are the model without.
    for (const EffectMask one : {front, rear}) EXPECT_NEAR(yaw(one, 300), yaw(0, 300), 1e-4);
}

TEST(EffectEquation, ForceLagReaches63PercentAfterOneTimeConstant) {
    Parameters p = plain_parameters();
    const double tau = 0.15;
    p[parameter_of("force_lag")] = tau;
    p[parameter_of("force_gain")] = 0.1;
    // What the logged force errs by is wrong before it lags.
    const SingleTrack model{saloon(), mask_of({"force_lag", "force_gain"})};
    ModelState<double> x{20.0};
    const Input step{0.0, 2000.0};
    advance(model, x, kCalm.data(), step, step, p.data(), tau, 10);
    EXPECT_NEAR(x[state_of("force_lag")], 2.2 * (1.0 - std::exp(-1.0)), 1e-9);  // [kN]
    const auto e = evaluate(model, x, step, p);
    EXPECT_EQ(e.w.fx, 1e3 * x[state_of("force_lag")]);
    settle_auxiliary(model, x, kCalm.data(), step, p.data());
    EXPECT_NEAR(x[state_of("force_lag")], 2.2, 1e-12);
}

TEST(EffectEquation, WheelInertiaTakesItsShareOfTheForce) {
    for (const Input& u : {kDriving, kBraking}) {
        const Pair it("wheel_inertia", {0.06}, kCornering, u);
        // What is taken turns the wheels as fast as the car moves: dv_x/dt = a_x + v_y r.
        const double taken = 0.06 * 1500.0 * it.on.rate[0];
        EXPECT_NEAR(it.on.w.fx_f, it.off.w.fx_f - 0.5 * taken, 1e-9);
        EXPECT_NEAR(it.on.w.fx_r, it.off.w.fx_r - 0.5 * taken, 1e-9);
        EXPECT_NEAR(it.on.w.a_x,
                    (it.off.w.a_x * 1500.0 - 0.5 * taken * (1.0 + std::cos(0.06))) / 1500.0, 1e-12);
        EXPECT_EQ(it.on.w.fz_f, it.off.w.fz_f);
    }
    // On a straight it is a car of more mass under the same force and the same drag.
    const Pair straight("wheel_inertia", {0.06}, {30.0}, {0.0, 2000.0});
    EXPECT_NEAR(straight.on.w.a_x, straight.off.w.a_x / 1.06, 1e-13);
}

}  // namespace
}  // namespace sysid::test
