// Sensors, actuators, controller and the driver on the track, each alone.
#include "helpers.hpp"
#include "sysid/lab/adrc.hpp"
#include "sysid/lab/sensors.hpp"
#include "sysid/lab/track.hpp"

namespace sysid::lab::test {
namespace {

constexpr double kStep = 0.01;

std::vector<Readings> ramp(std::size_t samples) {
    std::vector<Readings> all(samples);
    for (std::size_t k = 0; k < samples; ++k) all[k].fill(static_cast<double>(k));
    return all;
}

TEST(LabSensors, NoiseBiasAndDelayAddUp) {
    std::array<SensorData, kSensorCount> data{};
    data[kSenseVx] = {0.5, 2.0, 0.0, 0.0};
    data[kSenseVy] = {0.0, 0.0, 0.03, 0.0};
    data[kSenseAy] = {0.0, 0.0, 0.025, 0.0};
    const Sensors sensors(data, kStep);
    Readings normal{};
    normal.fill(3.0);
    const Readings y = sensors.read(ramp(11), normal.data());
    EXPECT_DOUBLE_EQ(y[kSenseVx], 10.0 + 2.0 + 1.5);
    EXPECT_NEAR(y[kSenseVy], 7.0, 1e-9);
    EXPECT_NEAR(y[kSenseAy], 7.5, 1e-9);
    EXPECT_DOUBLE_EQ(y[kSenseYawRate], 10.0);
    EXPECT_DOUBLE_EQ(sensors.read(ramp(2), normal.data())[kSenseVy], 0.0);  // before the drive
}

TEST(LabSensors, ASlowSensorReadsAtItsOwnRate) {
    std::array<SensorData, kSensorCount> data{};
    data[kSenseHeading].rate_hz = 20.0;
    data[kSensePlaceX].rate_hz = 30.0;
    const Sensors sensors(data, kStep);
    const Readings normal{};
    int headings = 0, places = 0;
    for (std::size_t n = 1; n <= 100; ++n) {
        const Readings y = sensors.read(ramp(n), normal.data());
        if (!std::isnan(y[kSenseHeading])) {
            ++headings;
            EXPECT_EQ((n - 1) % 5, 0U);
        }
        if (!std::isnan(y[kSensePlaceX])) ++places;
        EXPECT_FALSE(std::isnan(y[kSenseVx]));
    }
    EXPECT_EQ(headings, 20);
    EXPECT_EQ(places, 30);
}

TEST(LabActuators, RangeRateAndLag) {
    Actuator a;
    a.least = -1.0;
    a.most = 2.0;
    std::uint32_t limits = 0;
    EXPECT_EQ(follow(a, 0.0, 1.5, kStep, kSteerLimits, limits), 1.5);
    EXPECT_EQ(limits, 0U);
    EXPECT_EQ(follow(a, 0.0, 5.0, kStep, kSteerLimits, limits), 2.0);
    EXPECT_EQ(limits, static_cast<std::uint32_t>(kSteerAtMost));
    limits = 0;
    EXPECT_EQ(follow(a, 0.0, -5.0, kStep, kForceLimits, limits), -1.0);
    EXPECT_EQ(limits, static_cast<std::uint32_t>(kForceAtLeast));
    a.rate_limit = 10.0;
    limits = 0;
    EXPECT_NEAR(follow(a, 0.5, -0.9, kStep, kSteerLimits, limits), 0.4, 1e-15);
    EXPECT_EQ(limits, static_cast<std::uint32_t>(kSteerRateLimited));
    a.rate_limit = 1e9;
    a.lag_s = 0.1;
    double x = 0.0;
    for (int k = 0; k < 10; ++k) x = follow(a, x, 1.0, kStep, kSteerLimits, limits);
    EXPECT_NEAR(x, 1.0 - std::exp(-1.0), 1e-12);
}

NominalCar nominal() {
    NominalCar car;
    car.mass_kg = 800.0;
    car.yaw_inertia_kgm2 = 1000.0;
    car.lf_m = 1.4;
    car.lr_m = 1.6;
    car.cg_height_m = 0.3;
    return car;
}

TEST(LabController, LoadsMoveWithTheForce) {
    const NominalCar car = nominal();
    const Axles<double> still = car.loads(0.0), brakes = car.loads(-6000.0);
    EXPECT_NEAR(still.front + still.rear, 800.0 * 9.80665, 1e-9);
    EXPECT_NEAR(brakes.front - still.front, 600.0, 1e-9);
    EXPECT_NEAR(brakes.rear - still.rear, -600.0, 1e-9);
    EXPECT_GT(car.loads(1e6).front, 0.0);
}

TEST(LabController, CancelsTheLinearCarExactly) {
    // Put back into the linear model, the command must leave the wanted accelerations alone.
    const NominalCar car = nominal();
    const Adrc adrc({}, car);
    Estimate x;
    x << 20.0, 0.4, 0.1, 150.0, -300.0, 200.0;
    const Axles<double> loads = car.loads(0.0);
    std::uint32_t limits = 0;
    const double delta = adrc.steer(0.13, x, loads, limits);
    const double cf = car.stiffness_front * loads.front;
    const double cr = car.stiffness_rear * loads.rear;
    const double front = cf * (delta - (x[1] + car.lf_m * x[2]) / x[0]);
    const double rear = -cr * (x[1] - car.lr_m * x[2]) / x[0];
    const double r_dot = (car.lf_m * front - car.lr_m * rear + x[5]) / car.yaw_inertia_kgm2;
    EXPECT_NEAR(r_dot, 30.0 * (0.13 - 0.1), 1e-9);
    Wanted wanted;
    wanted.speed_mps = 20.5;
    wanted.acceleration_mps2 = 0.7;
    const double force = adrc.force(wanted, x, limits);
    const double v_dot = (force + x[3] - car.drag_nspm * x[0]) / car.mass_kg + x[1] * x[2];
    EXPECT_NEAR(v_dot, 4.0 * 0.5 + 0.7, 1e-9);
    EXPECT_EQ(limits, 0U);
}

TEST(LabController, LimitsAreKeptAndTold) {
    AdrcData data;
    data.slip_limit_rad = 0.05;
    data.brakes_from_mps2 = 1.0;
    data.lateral_limit_mps2 = 5.0;
    Adrc adrc(data, nominal());
    Estimate x = Estimate::Zero();
    x[0] = 20.0;
    std::uint32_t limits = 0;
    EXPECT_NEAR(adrc.steer(0.5, x, {4000.0, 4000.0}, limits), 0.05, 1e-12);
    EXPECT_EQ(limits, static_cast<std::uint32_t>(kSlipLimited));
    limits = 0;
    EXPECT_EQ(adrc.force({19.9, 0.0, 0.0, 0.0, 0.0}, x, limits), 0.0);
    EXPECT_EQ(limits, static_cast<std::uint32_t>(kBrakesIdle));
    EXPECT_LT(adrc.force({15.0, 0.0, 0.0, 0.0, 0.0}, x, limits), -1000.0);
    limits = 0;
    EXPECT_NEAR(adrc.yaw_rate({20.0, 0.0, 1.0, 0.0, 0.0}, 0.0, 20.0, kStep, limits), 0.01, 1e-12);
    EXPECT_EQ(limits, static_cast<std::uint32_t>(kYawAccelerationLimited));
    for (int k = 0; k < 200; ++k) {
        limits = 0;
        const double rate = adrc.yaw_rate({20.0, 0.0, 1.0, 0.0, 0.0}, 0.0, 20.0, kStep, limits);
        ASSERT_LE(rate, 0.25 + 1e-12);
    }
    EXPECT_TRUE(limits & kYawRateLimited);
}

TEST(LabController, TheRearTyreComesNoNearerToItsLimitThanTheBarrierLets) {
    AdrcData data;
    data.rear_slip_limit_rad = 0.1;
    data.rear_slip_gain_ps = 10.0;
    const Adrc adrc(data, nominal());
    const Axles<double> loads{4000.0, 4000.0};
    Estimate x = Estimate::Zero();
    x[kEstVx] = 20.0;
    std::uint32_t limits = 0;
    EXPECT_EQ(adrc.guarded(0.9, x, 0.0, loads, limits), 0.9);
    EXPECT_EQ(limits, 0U);
    // Nose turned in by 0.15 rad: no force but that of the rear tyre, which pushes to the left.
    x[kEstVy] = -3.0;
    const double front = 0.15;  // steered along the way the car goes, it has none
    const double slip = std::atan2(3.0, 20.0);
    const double pushed = 50.0 * 4000.0 * 0.15 / (800.0 * 20.0);
    EXPECT_NEAR(adrc.guarded(9.0, x, -front, loads, limits), pushed - 10.0 * (slip - 0.1), 1e-9);
    EXPECT_EQ(limits, static_cast<std::uint32_t>(kRearSlipLimited));
    x[kEstVy] = 3.0;
    EXPECT_NEAR(adrc.guarded(-9.0, x, front, loads, limits), -pushed + 10.0 * (slip - 0.1), 1e-9);
}

TEST(LabController, TurnsTheShorterWay) {
    Adrc adrc({}, nominal());
    std::uint32_t limits = 0;
    EXPECT_LT(adrc.yaw_rate({20.0, 0.0, 3.1, 0.0, 0.0}, -3.1, 20.0, kStep, limits), 0.0);
}

TEST(LabTrack, TheDriverLooksAheadOnACircle) {
    Track track;
    const double radius = 100.0;
    for (int i = 0; i < 628; ++i)
        track.points.push_back({radius * std::cos(0.01 * i), radius * std::sin(0.01 * i)});
    track.look_ahead_m = 10.0;
    track.look_ahead_s = 0.5;
    TrackDriver driver(track);
    for (double turn = 0.0; turn < 6.0; turn += 0.05) {
        const double x = (radius - 2.0) * std::cos(turn), y = (radius - 2.0) * std::sin(turn);
        const double along = turn + 0.5 * 3.14159265358979;
        const auto sight = driver.look(x, y, along, 20.0);
        ASSERT_NEAR(sight.left_of_track_m, 2.0, 0.02);  // inside a left-hand circle is left of it
        // To a point 20 m away on the circle: half its angle, less the two metres to come back.
        const double ahead = std::remainder(sight.heading_rad - along, 2.0 * 3.14159265358979);
        ASSERT_NEAR(ahead, 0.1 - 0.1, 0.03) << turn;
    }
}

}  // namespace
}  // namespace sysid::lab::test
