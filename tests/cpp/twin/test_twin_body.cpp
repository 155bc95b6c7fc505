// Sprung and unsprung masses, products of inertia, loads and tyres of the
// fourteen-degree-of-freedom car.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>

#include "sysid/twin/vehicle14.hpp"
#include "twin_cars.hpp"

using namespace sysid;
using namespace sysid::state14;

TEST(TwinVehicle, OnStiffTyresOnlyTheSprungMassRollsAndEveryMassLoadsTheOuterWheels) {
    // Barton and Fieldhouse (2018), eq. (3.18): phi = m_s d a_y/(K - m_s g d), d the height of the
    // sprung mass above the roll axis. Heavy wheels, so that the whole mass would be far off.
    CarData data = symmetric_car();
    for (AxleData* a : {&data.front, &data.rear}) {
        a->tyre_npm = 2e7;
        a->unsprung_kg = 100.0;
    }
    const Vehicle14 car{data};
    Input14 u;
    u.steer_rad = {0.004, 0.004};
    const State14 x = run(car, car.rest(20.0), u, 8.0, 5e-4);
    const Output14 y = car.output(x, u);
    const double ay = y[output14::kPlaneAy];
    ASSERT_NEAR(ay, 0.5, 0.3);
    const AxleData& a = data.front;
    const double sprung = data.design.mass_kg - 4.0 * a.unsprung_kg;
    const double height =
        (data.design.mass_kg * data.design.cg_z_m - 4.0 * a.unsprung_kg * a.radius_m) / sprung;
    const double lever = height - a.roll_centre_m;
    const double stiffness = 2.0 * a.track_m * a.track_m * (a.spring_npm / 2.0 + a.anti_roll_npm);
    const double angle = sprung * lever * ay / (stiffness - sprung * kGravity * lever);
    EXPECT_NEAR(x[Roll] / angle, 1.0, 0.005);
    // Of the whole car about the ground: the mass at its height and the body's weight beside.
    double transfer = 0.0;
    for (std::size_t i = 0; i < kWheels; ++i)
        transfer -= (i % 2 == 0 ? 0.5 : -0.5) * a.track_m * y[output14::kFz + i];
    const double expected =
        data.design.mass_kg * data.design.cg_z_m * ay + sprung * kGravity * lever * x[Roll];
    EXPECT_NEAR(transfer / expected, 1.0, 0.002);
}

TEST(TwinVehicle, WhatAPushDoesIsWhatTheEnergyGains) {
    // Without losses and tyre forces, at any state, with products of inertia: the power of a push
    // at the height of the centre of mass is that of the body's speed there.
    CarData data = without_losses(symmetric_car());
    data.design.jxy_kgm2 = 150.0;
    data.design.jxz_kgm2 = -120.0;
    data.design.jyz_kgm2 = 200.0;
    data.design.cg_y_m = 0.1;
    data.front.roll_centre_m = 0.15;
    const Vehicle14 car{data};
    const double unsprung = 4.0 * data.front.unsprung_kg;
    const double sprung = data.design.mass_kg - unsprung, h = data.design.cg_z_m;
    const double h_s = (data.design.mass_kg * h - unsprung * data.front.radius_m) / sprung;
    Input14 u;
    u.force_n = {0.0, 3000.0, 0.0};
    u.moment_nm = {100.0, -200.0, 300.0};
    unsigned seed = 1;
    const auto random = [&seed] {
        seed = seed * 1664525U + 1013904223U;
        return static_cast<double>(seed) / 4294967296.0 - 0.5;
    };
    for (int trial = 0; trial < 20; ++trial) {
        State14 x = car.rest(15.0);
        for (const std::size_t i : {Roll, Pitch}) x[i] += 0.05 * random();
        for (const std::size_t i : {P, Q, R, Vy, Vz}) x[i] += random();
        for (std::size_t i = 0; i < kWheels; ++i) {
            x[kWheelHeight + i] += 0.01 * random();
            x[kWheelHeightRate + i] += random();
        }
        State14 rate;
        car.evaluate(x, u, rate, nullptr);
        State14 before = x, after = x;
        constexpr double kStep = 1e-6;
        for (std::size_t i = 0; i < x.size(); ++i) {
            before[i] -= kStep * rate[i];
            after[i] += kStep * rate[i];
        }
        const double gained = (car.energy(after, u) - car.energy(before, u)) / (2.0 * kStep);
        // What sprung mass and wheels do sideways beside the common v_y.
        double beside = 0.0;
        for (std::size_t i = 0; i < kWheels; ++i) {
            const AxleData& a = i < 2 ? data.front : data.rear;
            const double half = (i % 2 == 0 ? 0.5 : -0.5) * a.track_m;
            const double tilt = h_s - a.roll_centre_m;
            const double y = half - data.design.cg_y_m + tilt * x[Roll];
            const double along = i < 2 ? 0.5 * data.wheelbase_m : -0.5 * data.wheelbase_m;
            const double opening =
                y * x[P] - (along - tilt * x[Pitch]) * x[Q] + x[Vz] - x[kWheelHeightRate + i];
            beside += a.unsprung_kg * (h_s * x[P] - a.roll_centre_m / half * opening -
                                       a.radius_m / half * x[kWheelHeightRate + i]);
        }
        const double speed = x[Vy] - beside / data.design.mass_kg + (h_s - h) * x[P];
        const double given = u.force_n[1] * speed + u.moment_nm[0] * x[P] + u.moment_nm[1] * x[Q] +
                             u.moment_nm[2] * x[R];
        EXPECT_NEAR(gained, given, 1e-5 * std::abs(given) + 1e-2) << trial;
    }
}

TEST(TwinVehicle, ATurningBodyKeepsItsMomentumAboutEveryAxis) {
    // Euler's equations with products of inertia: the tensor comes back from the accelerations.
    Load load;
    load.jxy_kgm2 = 100.0;
    load.jxz_kgm2 = -80.0;
    load.jyz_kgm2 = 250.0;
    const Vehicle14 car(CarData{}, load);
    const Vehicle14 same(CarData{}, load);
    Eigen::Matrix3d inertia;
    inertia << load.jxx_kgm2, -load.jxy_kgm2, -load.jxz_kgm2, -load.jxy_kgm2, load.jyy_kgm2,
        -load.jyz_kgm2, -load.jxz_kgm2, -load.jyz_kgm2, load.jzz_kgm2;
    const State14 x = car.rest(10.0);
    State14 calm, pushed;
    car.evaluate(x, {}, calm, nullptr);
    for (std::size_t axis = 0; axis < 3; ++axis) {
        Input14 u;
        u.moment_nm[axis] = 1000.0;
        same.evaluate(x, u, pushed, nullptr);
        const Eigen::Vector3d gained(pushed[P] - calm[P], pushed[Q] - calm[Q], pushed[R] - calm[R]);
        const Eigen::Vector3d moment = inertia * gained;
        for (std::size_t i = 0; i < 3; ++i)
            EXPECT_NEAR(moment[static_cast<Eigen::Index>(i)], i == axis ? 1000.0 : 0.0, 1e-6);
    }
}

TEST(TwinVehicle, ALoadThatNoBodyHasIsRefused) {
    Vehicle14 car{CarData{}};
    Load load = car.load();
    load.mass_kg = 4.0 * car.car().front.unsprung_kg;
    EXPECT_THROW(car.set_load(load), std::invalid_argument);
    load = car.load();
    load.jxz_kgm2 = 2000.0;  // beside J_xx = 834 and J_zz = 3933: its square is more than theirs
    EXPECT_THROW(car.set_load(load), std::invalid_argument);
    load.jxz_kgm2 = std::nan("");
    EXPECT_THROW(car.set_load(load), std::invalid_argument);
}

TEST(TwinVehicle, LongSlipNeverGivesMoreThanFriction) {
    const TyreData t;
    const TyreCurve<double> curve(t, t);
    for (double kappa = -3.0; kappa <= 3.0; kappa += 0.17) {
        for (double slip = -2.0; slip <= 2.0; slip += 0.13) {
            const TyreForce<double> f = tyre_force(curve, t.nominal_load_n, kappa, slip);
            const double use = std::hypot(f.fx / t.friction_x, f.fy / t.friction_y);
            EXPECT_LE(use, t.nominal_load_n * (1.0 + 1e-9));
            const TyreForce<double> mirrored = tyre_force(curve, t.nominal_load_n, kappa, -slip);
            EXPECT_DOUBLE_EQ(mirrored.fy, -f.fy);
        }
    }
    const TyreForce<double> small = tyre_force(curve, 4000.0, 0.0, 1e-4);
    const double load = 4000.0 / t.nominal_load_n;
    const double stiffness = t.cornering_stiffness * t.nominal_load_n *
                             std::sin(2.0 * std::atan(load / t.load_at_peak_stiffness));
    EXPECT_NEAR(small.fy / 1e-4, stiffness, 1e-3 * stiffness);
}

TEST(TwinVehicle, ArcTangentAndSineAreThoseOfTheLibrary) {
    for (double x = 0.0; x < 60.0; x = 1.01 * x + 1e-3) {
        EXPECT_NEAR(atan_of_positive(x), std::atan(x), 3e-16 * (1.0 + std::atan(x)));
        if (x < 4.7) {
            EXPECT_NEAR(sin_of_positive(x), std::sin(x), 3e-16);
        }
    }
}

TEST(TwinVehicle, EveryWheelHasTheForceOfItsOwnTyre) {
    TyreData front, rear;
    rear.friction_y = 1.2;
    rear.shape = 1.7;
    rear.curvature = 0.4;
    const TyreCurve<Wheels> all(front, rear);
    const Wheels load(Pair{3000.0, 0.0}, Pair{6000.0, 9000.0});
    const Wheels kappa(Pair{0.02, 0.1}, Pair{0.0, -0.5});
    const Wheels slip(Pair{-0.03, 0.1}, Pair{0.0, 0.9});
    const TyreForce<Wheels> found = tyre_force(all, load, kappa, slip);
    for (std::size_t i = 0; i < kWheels; ++i) {
        const TyreData& t = i < 2 ? front : rear;
        const auto one = tyre_force(TyreCurve<double>(t, t), load[i], kappa[i], slip[i]);
        EXPECT_DOUBLE_EQ(found.fx[i], one.fx) << i;
        EXPECT_DOUBLE_EQ(found.fy[i], one.fy) << i;
    }
}

TEST(TwinLoad, PointMassesFollowHuygensAndSteiner) {
    // A dumbbell of two equal masses: moments m d^2 about its middle.
    const Load point{10.0, 1e-12, 1e-12, 1e-12, 1.0, 0.0, 0.5, 0.0, 0.0, 0.0};
    const Load both = loaded(point, {{10.0, -1.0, 0.0, 0.5}});
    EXPECT_DOUBLE_EQ(both.mass_kg, 20.0);
    EXPECT_DOUBLE_EQ(both.cg_x_m, 0.0);
    EXPECT_NEAR(both.jxx_kgm2, 0.0, 1e-9);
    EXPECT_NEAR(both.jyy_kgm2, 20.0, 1e-9);
    EXPECT_NEAR(both.jzz_kgm2, 20.0, 1e-9);
    // Along a slope the products are the mass times both distances; a mirrored pair has none.
    const Load slope = loaded(Load{10.0, 1e-12, 1e-12, 1e-12, 1.0, 0.5, 0.8, 0.0, 0.0, 0.0},
                              {{10.0, -1.0, -0.5, 0.2}});
    EXPECT_NEAR(slope.jxy_kgm2, 20.0 * 1.0 * 0.5, 1e-9);
    EXPECT_NEAR(slope.jxz_kgm2, 20.0 * 1.0 * 0.3, 1e-9);
    EXPECT_NEAR(slope.jyz_kgm2, 20.0 * 0.5 * 0.3, 1e-9);
    // Adding in two goes is adding at once.
    const std::vector<PointMass> masses{{75.0, -1.5, 0.4, 0.9}, {80.0, -2.4, -0.4, 0.8}};
    const Load at_once = loaded(Load{}, masses);
    const Load in_two = loaded(loaded(Load{}, {masses[0]}), {masses[1]});
    const LoadVector a = to_vector(at_once), b = to_vector(in_two);
    for (std::size_t i = 0; i < a.size(); ++i) EXPECT_NEAR(a[i], b[i], 1e-9 * std::abs(a[i]));
}
