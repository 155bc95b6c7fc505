// The whole loop: it follows, tells what limits it met, and uses nothing but readings.
#include "helpers.hpp"
#include "sysid/lab/closed_loop.hpp"

namespace sysid::lab::test {
namespace {

using sysid::test::plain_parameters;
using sysid::test::saloon;

constexpr std::size_t kSamples = 2000;

LoopData loop_data() {
    LoopData data;
    const VehicleData car = saloon();
    data.car.mass_kg = car.mass_kg;
    data.car.yaw_inertia_kgm2 = 2200.0;
    data.car.lf_m = car.lf_m;
    data.car.lr_m = car.lr_m;
    data.car.cg_height_m = car.cg_height_m;
    data.car.stiffness_front = data.car.stiffness_rear = 20.0;
    data.force = {-12000.0, 6000.0, 60e3, 0.0};
    data.steer = {-0.35, 0.35, 2.0, 0.0};
    data.controller.yaw_rate_gain_ps = 15.0;
    data.controller.heading_gain_ps = 4.0;
    data.controller.yaw_rate_limit_radps = 1.0;
    data.controller.yaw_acceleration_limit_radps2 = 5.0;
    data.first_speed_mps = 20.0;
    for (std::size_t i = 0; i < kSensorCount; ++i) data.sensors[i].noise_std = 0.0;
    data.sensors[kSenseVx].noise_std = 0.05;
    for (const Sensor s : {kSenseVy, kSenseYawRate, kSenseAy}) data.sensors[s].noise_std = 3e-3;
    return data;
}

LoopObserverData observer_data() {
    LoopObserverData data;
    data.noise.process.setZero();
    data.noise.process.diagonal() << 1e-6, 1e-6, 1e-8, 100.0, 3000.0, 1000.0;
    data.noise.sensors.setZero();
    data.noise.sensors.diagonal() << 2.5e-3, 1e-5, 1e-5, 1e-5;
    return data;
}

/// A heading that swings, at held speed.
std::vector<Wanted> swinging(double amplitude_rad, double speed_mps) {
    std::vector<Wanted> all(kSamples);
    const double w = 2.0 * 3.14159265358979 * 0.25;
    for (std::size_t k = 0; k < kSamples; ++k) {
        const double t = 0.01 * static_cast<double>(k);
        all[k] = {speed_mps, 0.0, amplitude_rad * std::sin(w * t),
                  w * amplitude_rad * std::cos(w * t), 0.0};
    }
    return all;
}

LoopRecord drive(const LoopData& data, const std::vector<Wanted>& wanted,
                 const PlantOptions& options = {}) {
    const auto p = plain_parameters();
    std::mt19937 generator(5);
    std::normal_distribution<double> normal;
    std::vector<double> noise(kSensorCount * wanted.size()), external(3 * wanted.size(), 0.0);
    for (double& v : noise) v = normal(generator);
    return run_closed_loop(data, Plant({saloon(), 0}, p.data(), options), observer_data(), wanted,
                           noise.data(), external.data());
}

double truth(const LoopRecord& r, std::size_t k, int column) {
    return r.truth[k * LoopRecord::kTruths + static_cast<std::size_t>(column)];
}

TEST(LabLoop, FollowsHeadingAndSpeedWithGuessedTyres) {
    for (double guess : {10.0, 20.0, 30.0}) {  // the plant's own: 14 and 18.5
        LoopData data = loop_data();
        data.car.stiffness_front = data.car.stiffness_rear = guess;
        const auto wanted = swinging(0.1, 20.0);
        const LoopRecord r = drive(data, wanted);
        ASSERT_EQ(r.lost_at, kSamples) << guess;
        for (std::size_t k = 500; k < kSamples; ++k) {
            ASSERT_NEAR(truth(r, k, 0), 20.0, 0.3) << guess << ' ' << k;
            ASSERT_NEAR(truth(r, k, 5), wanted[k].heading_rad, 0.012) << guess << ' ' << k;
        }
    }
}

TEST(LabLoop, ObserverAndInputsFollowFromReadingsAlone) {
    const LoopData data = loop_data();
    const LoopRecord r = drive(data, swinging(0.1, 20.0));
    LoopObserver observer(observer_data(), data.car, data.dt);
    for (std::size_t k = 0; k < kSamples; ++k) {
        const double* y = &r.sensed[k * kSensorCount];
        observer.step(y[kSenseForce], y[kSenseSteer], data.car.loads(y[kSenseForce]),
                      {y[kSenseVx], y[kSenseVy], y[kSenseYawRate], y[kSenseAy]});
        for (int i = 0; i < kEstimated; ++i)
            ASSERT_EQ(observer.state()[i],
                      r.estimate[k * kEstimated + static_cast<std::size_t>(i)]);
    }
}

TEST(LabLoop, TheSameDriveWithInputsThatMoveEvenly) {
    // Half a sample earlier, and no more: the drives stay near each other.
    LoopData data = loop_data();
    const LoopRecord held = drive(data, swinging(0.1, 20.0));
    data.inputs_linear = true;
    const LoopRecord even = drive(data, swinging(0.1, 20.0));
    ASSERT_EQ(even.lost_at, kSamples);
    double apart = 0.0;
    for (std::size_t k = 500; k < kSamples; ++k)
        apart = std::max(apart, std::abs(truth(held, k, 5) - truth(even, k, 5)));
    EXPECT_GT(apart, 1e-6);
    EXPECT_LT(apart, 5e-3);
    // Moving evenly from one sample's input to the next's repeats the drive.
    Plant plant({saloon(), 0}, plain_parameters().data(), {});
    PlantState x = plant.at_rest(data.first_speed_mps);
    const Plant::Externals calm{};
    for (std::size_t k = 0; k + 1 < kSamples; ++k) {
        const double* now = &even.inputs[LoopRecord::kInputs * k];
        const double* next = now + LoopRecord::kInputs;
        plant.advance(x, {now[1], now[0]}, {next[1], next[0]}, calm, data.dt);
        ASSERT_NEAR(x[2], truth(even, k + 1, 2), 1e-9) << k;
    }
}

TEST(LabLoop, ABiasedSensorDeceivesTheController) {
    LoopData data = loop_data();
    data.sensors[kSenseVx].bias = 2.0;
    const LoopRecord r = drive(data, swinging(0.0, 20.0));
    EXPECT_NEAR(truth(r, kSamples - 1, 0), 18.0, 0.2);
}

TEST(LabLoop, TellsWhatLimitsItMet) {
    const auto met = [](const LoopRecord& r, std::uint32_t bits) {
        std::size_t count = 0;
        for (std::uint32_t l : r.limits) count += (l & bits) != 0;
        return count;
    };
    const LoopRecord easy = drive(loop_data(), swinging(0.05, 20.0));
    EXPECT_EQ(met(easy, kSteerAtMost | kSteerAtLeast | kForceAtMost | kYawRateLimited), 0U);
    const LoopRecord hard = drive(loop_data(), swinging(0.9, 20.0));
    EXPECT_GT(met(hard, kYawRateLimited | kSteerAtMost | kSteerAtLeast), 100U);
    const LoopRecord fast = drive(loop_data(), swinging(0.0, 60.0));
    EXPECT_GT(met(fast, kForceAtMost), 300U);
    EXPECT_LE(fast.inputs[LoopRecord::kInputs * 400], 6000.0);
}

TEST(LabLoop, EndsWhereTheCarIsLost) {
    LoopData data = loop_data();
    data.steer_by = SteerBy::kAngle;
    std::vector<Wanted> wanted = swinging(0.0, 35.0);
    for (std::size_t k = 300; k < kSamples; ++k) wanted[k].steer_rad = k < 350 ? 0.3 : -0.3;
    data.first_speed_mps = 35.0;
    data.steer.rate_limit = 100.0;
    PlantOptions slippery;
    slippery.load_share = 0.4;
    auto p = plain_parameters();
    std::swap(p[kDFront], p[kDRear]);
    p[kDRear] = 0.6;  // a rear that lets go first
    std::vector<double> zeros(kSensorCount * kSamples, 0.0);
    const LoopRecord r = run_closed_loop(data, Plant({saloon(), 0}, p.data(), slippery),
                                         observer_data(), wanted, zeros.data(), zeros.data());
    EXPECT_LT(r.lost_at, kSamples);
    EXPECT_EQ(r.limits.size(), r.lost_at + 1);
}

TEST(LabLoop, SlowAndMissingReadingsAreEnough) {
    LoopData data = loop_data();
    data.sensors[kSenseVx].rate_hz = 10.0;
    data.sensors[kSenseVy].rate_hz = 5.0;
    data.sensors[kSenseHeading] = {0.002, 0.0, 0.0, 10.0};
    data.pose_gain = 0.3;
    const auto wanted = swinging(0.1, 20.0);
    const LoopRecord r = drive(data, wanted);
    ASSERT_EQ(r.lost_at, kSamples);
    for (std::size_t k = 500; k < kSamples; ++k)
        ASSERT_NEAR(truth(r, k, 5), wanted[k].heading_rad, 0.02) << k;
}

}  // namespace
}  // namespace sysid::lab::test
