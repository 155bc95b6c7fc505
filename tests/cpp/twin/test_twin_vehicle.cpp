// The fourteen-degree-of-freedom car against physics it was not written from.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "dense.hpp"
#include "sysid/twin/vehicle14.hpp"
#include "twin_cars.hpp"

using namespace sysid;
using namespace sysid::state14;

namespace {

/// Frequencies [rad/s] of the undamped motions of body and wheels, slowest first.
std::vector<double> frequencies(const Vehicle14& car) {
    constexpr std::array<std::size_t, 7> place{Z, Roll, Pitch, 12, 13, 14, 15};
    constexpr std::array<std::size_t, 7> speed{Vz, P, Q, 16, 17, 18, 19};
    const State14 rest = car.rest(0.0);
    Eigen::Matrix<double, 7, 7> stiffness;
    for (Eigen::Index j = 0; j < 7; ++j) {
        State14 up = rest, down = rest, rate_up, rate_down;
        up[place[static_cast<std::size_t>(j)]] += 1e-5;
        down[place[static_cast<std::size_t>(j)]] -= 1e-5;
        car.evaluate(up, {}, rate_up, nullptr);
        car.evaluate(down, {}, rate_down, nullptr);
        for (Eigen::Index i = 0; i < 7; ++i) {
            const std::size_t row = speed[static_cast<std::size_t>(i)];
            stiffness(i, j) = -(rate_up[row] - rate_down[row]) / 2e-5;
        }
    }
    std::vector<double> out;
    for (const auto& value : test::eigenvalues(stiffness)) out.push_back(std::sqrt(value.real()));
    std::sort(out.begin(), out.end());
    return out;
}

/// The two frequencies of a mass on a spring on a wheel on a tyre.
std::array<double, 2> quarter_car(double body, double wheel, double spring, double tyre,
                                  double body_extra = 0.0) {
    // det [[k - e - w2 m, -k], [-k, k + kt - w2 mu]] = 0
    const double a = body * wheel;
    const double b = -((spring - body_extra) * wheel + body * (spring + tyre));
    const double c = (spring - body_extra) * (spring + tyre) - spring * spring;
    const double root = std::sqrt(b * b - 4.0 * a * c);
    return {std::sqrt((-b - root) / (2.0 * a)), std::sqrt((-b + root) / (2.0 * a))};
}

}  // namespace

TEST(TwinVehicle, TheDesignLoadRestsInTheDesignPosition) {
    const Vehicle14 car{CarData{}};
    State14 x{}, rate;
    car.evaluate(x, {}, rate, nullptr);
    for (const double r : rate) EXPECT_NEAR(r, 0.0, 1e-9);
}

TEST(TwinVehicle, AnotherLoadSagsAndTheWheelsCarryIt) {
    Vehicle14 car{CarData{}};
    Load heavy = car.load();
    heavy.mass_kg += 355.0;
    heavy.cg_x_m -= 0.1;
    car.set_load(heavy);
    const State14 x = car.rest(0.0);
    EXPECT_LT(x[Z], -0.015);
    const Output14 y = car.output(x, {});
    const double wheels = 2.0 * car.car().rear.unsprung_kg * kGravity;
    const double rear = y[output14::kFz + 2] + y[output14::kFz + 3] - wheels;
    const double all = rear + y[output14::kFz] + y[output14::kFz + 1] - wheels;
    EXPECT_NEAR(all, heavy.mass_kg * kGravity - 2.0 * wheels, 1e-3);
    // The lever of weight over a pitched body is small beside the wheelbase.
    EXPECT_NEAR(rear / all, -heavy.cg_x_m / car.car().wheelbase_m, 0.003);
    EXPECT_NEAR(y[output14::Az], kGravity, 1e-6);
}

TEST(TwinVehicle, WithoutLossesEnergyStays) {
    CarData data = without_losses(symmetric_car());
    const Vehicle14 car{data};
    State14 x = car.rest(0.0);
    x[Z] += 0.02;
    x[Roll] += 0.02;
    x[Pitch] += 0.01;
    x[12] += 0.005;
    const double at_rest = car.energy(car.rest(0.0), {});
    const double before = car.energy(x, {});
    const State14 after = run(car, x, {}, 5.0, 1e-4);
    EXPECT_NEAR(car.energy(after, {}), before, 2e-3 * (before - at_rest));
    EXPECT_GT(std::abs(after[Vz]) + std::abs(after[P]), 1e-3);
}

TEST(TwinVehicle, DampersAndTyresTakeEnergyOut) {
    const Vehicle14 car{symmetric_car()};
    Input14 u;
    u.steer_rad = {0.03, 0.03};
    State14 x = car.rest(20.0);
    double last = car.energy(x, u);
    for (int k = 0; k < 50; ++k) {
        x = run(car, x, u, 0.1, 1e-3);
        const double now = car.energy(x, u);
        EXPECT_LT(now, last);
        last = now;
    }
}

TEST(TwinVehicle, MirroredDrivingMirrorsTheMotion) {
    CarData data;
    data.design.cg_y_m = data.design.jxy_kgm2 = data.design.jyz_kgm2 = 0.0;
    const Vehicle14 car{data};
    Input14 left, right;
    left.steer_rad = {0.05, 0.045};
    right.steer_rad = {-0.045, -0.05};
    left.drive_nm = {0.0, 0.0, 300.0, 200.0};
    right.drive_nm = {0.0, 0.0, 200.0, 300.0};
    left.road_m = {0.02, 0.0, 0.01, 0.0};
    right.road_m = {0.0, 0.02, 0.0, 0.01};
    const State14 a = run(car, car.rest(15.0), left, 2.0, 1e-3);
    const State14 b = run(car, car.rest(15.0), right, 2.0, 1e-3);
    for (const std::size_t same : {X, Z, Pitch, Vx, Vz, Q}) EXPECT_NEAR(a[same], b[same], 1e-9);
    for (const std::size_t turned : {Y, Roll, Yaw, Vy, P, R})
        EXPECT_NEAR(a[turned], -b[turned], 1e-9);
    for (const std::size_t wheels : {kWheelHeight, kWheelSpeed})
        for (std::size_t i = 0; i < kWheels; ++i)
            EXPECT_NEAR(a[wheels + i], b[wheels + (i ^ 1U)], 1e-9);
    EXPECT_GT(a[R], 0.1);
}

TEST(TwinVehicle, EigenfrequenciesAreThoseOfQuarterCars) {
    const CarData data = without_losses(symmetric_car());
    const Vehicle14 car{data};
    const AxleData& a = data.front;
    const double sprung = data.design.mass_kg - 4.0 * a.unsprung_kg;
    const double half_track = 0.5 * a.track_m, half_base = 0.5 * data.wheelbase_m;
    // Weight over a tilted body works against the springs.
    const double height =
        (data.design.mass_kg * data.design.cg_z_m - 4.0 * a.unsprung_kg * a.radius_m) / sprung;
    const double tip = sprung * kGravity * (height - a.roll_centre_m) / 4.0;
    std::vector<double> expected;
    const auto add = [&](std::array<double, 2> pair) {
        expected.insert(expected.end(), pair.begin(), pair.end());
    };
    add(quarter_car(sprung / 4.0, a.unsprung_kg, a.spring_npm, a.tyre_npm));
    add(quarter_car(data.design.jyy_kgm2 / (4.0 * half_base * half_base), a.unsprung_kg,
                    a.spring_npm, a.tyre_npm, tip / (half_base * half_base)));
    add(quarter_car(data.design.jxx_kgm2 / (4.0 * half_track * half_track), a.unsprung_kg,
                    a.spring_npm + 2.0 * a.anti_roll_npm, a.tyre_npm,
                    tip / (half_track * half_track)));
    // The seventh: wheels crosswise, the body at rest.
    expected.push_back(
        std::sqrt((a.spring_npm + 2.0 * a.anti_roll_npm + a.tyre_npm) / a.unsprung_kg));
    std::sort(expected.begin(), expected.end());
    const std::vector<double> found = frequencies(car);
    ASSERT_EQ(found.size(), expected.size());
    for (std::size_t i = 0; i < found.size(); ++i) EXPECT_NEAR(found[i] / expected[i], 1.0, 1e-4);
}

TEST(TwinVehicle, RollGradientIsThatOfSpringsBarsAndTyres) {
    const CarData data = symmetric_car();
    const Vehicle14 car{data};
    Input14 u;
    u.steer_rad = {0.004, 0.004};
    const State14 x = run(car, car.rest(20.0), u, 8.0, 1e-3);
    const double ay = car.output(x, u)[output14::kPlaneAy];
    ASSERT_NEAR(ay, 0.5, 0.3);
    // Per axle, with f the gain of load of the outer wheel, phi the body's roll and phi_u the
    // wheels': t f = (h M a_y + m_s g h' phi)/2,  phi_u = 2 f/(k_t t),
    // f - 2 R m_u a_y/t = (k + 2 k_b) t/2 (phi - phi_u) + h_rc m_s a_y/(2 t).
    const AxleData& a = data.front;
    const double m = data.design.mass_kg, h = data.design.cg_z_m, t = a.track_m;
    const double sprung = m - 4.0 * a.unsprung_kg;
    const double unsprung = 4.0 * a.unsprung_kg * a.radius_m;
    const double lever = (m * h - unsprung) / sprung - a.roll_centre_m;
    const double stiff = (a.spring_npm + 2.0 * a.anti_roll_npm) * t / 2.0;
    const double series = 1.0 + 2.0 * stiff / (a.tyre_npm * t);
    const double gradient = (h * m * series - a.roll_centre_m * sprung - unsprung) /
                            (2.0 * t * stiff - series * sprung * kGravity * lever);
    EXPECT_NEAR(x[Roll] / ay, gradient, 0.005 * gradient);
}

TEST(TwinVehicle, YawRateIsThatOfTheLinearBicycle) {
    CarData data;
    data.design.cg_x_m = -1.15;
    data.design.cg_y_m = 0.0;
    data.rear.tyre.cornering_stiffness = 24.0;
    const Vehicle14 car{data};
    Input14 u;
    u.steer_rad = {0.004, 0.004};
    for (const double speed : {10.0, 20.0, 30.0}) {
        // The speed is held by hand, so that nothing but cornering is compared.
        State14 x = car.rest(speed);
        for (int k = 0; k < 6000; ++k) {
            car.step(x, u, 1e-3);
            x[Vx] = speed;
        }
        const double base = data.wheelbase_m, lf = -data.design.cg_x_m, lr = base - lf;
        const double wheels = 2.0 * data.front.unsprung_kg * kGravity;
        const double weight = data.design.mass_kg * kGravity - 2.0 * wheels;
        const auto stiffness = [](const TyreData& t, double load) {
            return t.cornering_stiffness * t.nominal_load_n *
                   std::sin(2.0 * std::atan(load / (t.load_at_peak_stiffness * t.nominal_load_n)));
        };
        const double cf = 2.0 * stiffness(data.front.tyre, (weight * lr / base + wheels) / 2.0);
        const double cr = 2.0 * stiffness(data.rear.tyre, (weight * lf / base + wheels) / 2.0);
        const double understeer = data.design.mass_kg / base * (lr / cf - lf / cr);
        const double expected = speed * 0.004 / (base + understeer * speed * speed);
        EXPECT_NEAR(x[R] / expected, 1.0, 0.01) << speed;
    }
}

TEST(TwinVehicle, TheStepIsOfFourthOrder) {
    const Vehicle14 car{symmetric_car()};
    Input14 u;
    u.steer_rad = {0.03, 0.03};
    u.drive_nm = {0.0, 0.0, 200.0, 200.0};
    const State14 start = car.rest(25.0);
    const auto error = [&](double dt, const State14& exact) {
        const State14 x = run(car, start, u, 0.4, dt);
        double worst = 0.0;
        for (const std::size_t i : {Vx, Vy, P, R, Roll})
            worst = std::max(worst, std::abs(x[i] - exact[i]));
        return worst;
    };
    const State14 exact = run(car, start, u, 0.4, 1e-4);
    const double order = std::log2(error(2e-3, exact) / error(1e-3, exact));
    EXPECT_NEAR(order, 4.0, 0.4);
}

TEST(TwinVehicle, BrakedToAStandstillItStandsAndStaysFinite) {
    const Vehicle14 car{CarData{}};
    Input14 u;
    u.brake_nm = {1200.0, 1200.0, 700.0, 700.0};
    u.steer_rad = {0.1, 0.1};
    State14 x = run(car, car.rest(5.0), u, 4.0, 1e-3);
    for (const double value : x) EXPECT_TRUE(std::isfinite(value));
    EXPECT_NEAR(x[Vx], 0.0, 0.02);
    const double where = x[X];
    x = run(car, x, u, 3.0, 1e-3);
    EXPECT_NEAR(x[X], where, 0.05);
    EXPECT_NEAR(x[Vx], 0.0, 0.01);
}

TEST(TwinVehicle, AnExternalWrenchGivesItsMomentum) {
    const CarData data = without_losses(symmetric_car());
    const Vehicle14 car{data};
    Input14 u;
    u.force_n = {1000.0, 500.0, 0.0};
    u.moment_nm = {0.0, 0.0, 300.0};
    const State14 x = run(car, car.rest(10.0), u, 1.0, 1e-3);
    EXPECT_NEAR(x[R], 300.0 / data.design.jzz_kgm2, 1e-6);
    // The force turns with the car; its work is what the motion gained.
    EXPECT_NEAR(std::hypot(x[Vx], x[Vy]), std::hypot(10.0 + 0.5, 0.25), 0.01);
}

TEST(TwinVehicle, ReadingAndSteppingTogetherIsOneAfterTheOther) {
    CarData data = symmetric_car();
    data.front.tyre.relaxation_m = 0.4;  // the rear follows at once
    const Vehicle14 car{data};
    Input14 u;
    u.steer_rad = {0.03, 0.028};
    u.brake_nm = {900.0, 900.0, 0.0, 0.0};
    State14 apart = car.rest(4.0), together = apart;
    for (int k = 0; k < 1500; ++k) {
        const Output14 y = car.output(apart, u);
        car.step(apart, u, 1e-3);
        Output14 read;
        car.read_and_step(together, u, 1e-3, read);
        ASSERT_EQ(read, y) << k;
        ASSERT_EQ(together, apart) << k;
    }
    EXPECT_EQ(apart[kSlip + 2], 0.0);
    EXPECT_NE(apart[kSlip], 0.0);
}

TEST(TwinVehicle, WhatIsFasterThanTheStepIsTakenInParts) {
    // The right wheel stands, the left one turns; the left one alone would not need parts.
    Input14 u;
    u.brake_nm = {0.0, 8000.0, 0.0, 0.0};
    const Vehicle14 car{symmetric_car()};
    State14 x = run(car, car.rest(30.0), u, 1.0, 1e-3);
    EXPECT_NEAR(x[kWheelSpeed + 1], 0.0, 0.5);
    EXPECT_GT(x[kWheelSpeed], 50.0);
    // A relaxation length shorter than a step's way.
    CarData data = symmetric_car();
    data.front.tyre.relaxation_m = data.rear.tyre.relaxation_m = 0.004;
    const Vehicle14 short_lag{data};
    u = {};
    u.steer_rad = {0.01, 0.01};
    x = run(short_lag, short_lag.rest(30.0), u, 1.0, 1e-3);
    EXPECT_NEAR(x[R], run(car, car.rest(30.0), u, 1.0, 1e-3)[R], 1e-3);
    // Absurd torques end, if not well.
    u.brake_nm = {1e300, 1e300, 1e300, 1e300};
    run(car, car.rest(1.0), u, 2e-3, 1e-3);
}

TEST(TwinVehicle, RelaxedTyresFollowAfterTheirLength) {
    CarData data = symmetric_car();
    data.front.tyre.relaxation_m = data.rear.tyre.relaxation_m = 0.5;
    const Vehicle14 lagging{data};
    const Vehicle14 prompt{symmetric_car()};
    Input14 u;
    u.steer_rad = {0.02, 0.02};
    const State14 early = run(lagging, lagging.rest(20.0), u, 0.02, 1e-3);
    EXPECT_LT(early[R], 0.7 * run(prompt, prompt.rest(20.0), u, 0.02, 1e-3)[R]);
    EXPECT_NEAR(run(lagging, lagging.rest(20.0), u, 5.0, 1e-3)[R],
                run(prompt, prompt.rest(20.0), u, 5.0, 1e-3)[R], 1e-3);
}
