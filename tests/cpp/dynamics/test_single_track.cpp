// The equations of the single-track model: balance, symmetry, steady cornering, axle loads.
#include "dense.hpp"
#include "helpers.hpp"
#include "sysid/dynamics/single_track.hpp"

namespace sysid::test {
namespace {

/// Effects that do not tell left from right; of the others, the parameters that do not.
Parameters mirror_symmetric_parameters() {
    Parameters p = typical_parameters();
    for (std::size_t i = 0; i < kEffectCount; ++i)
        for (std::size_t j = 0; j < kEffectInfos[i].parameter_count(); ++j)
            if (kEffectInfos[i].parameters[j].mirrored)
                p[kBaseParameterCount + effect_offset(i) + j] = 0.0;
    return p;
}

TEST(SingleTrack, BalanceDrivingStraight) {
    const SingleTrack model{saloon()};
    const double v = 30.0;
    const double drag = 0.5 * model.car.air_density_kgpm3 * model.car.drag_area_m2 * v * v;
    const auto e = evaluate(model, {v}, {0.0, drag}, plain_parameters());
    for (double rate : e.rate) EXPECT_EQ(rate, 0.0);
    EXPECT_EQ(e.w.fy_f, 0.0);
    EXPECT_EQ(e.w.fy_r, 0.0);
    EXPECT_EQ(e.w.a_x, 0.0);
    EXPECT_EQ(e.y[kVx], v);
    // No acceleration, so the loads are the static ones.
    const VehicleData& car = model.car;
    const double weight = car.mass_kg * kGravity;
    EXPECT_DOUBLE_EQ(e.w.fz_f, weight * car.lr_m / (car.lf_m + car.lr_m));
    EXPECT_DOUBLE_EQ(e.w.fz_r, weight * car.lf_m / (car.lf_m + car.lr_m));
}

TEST(SingleTrack, NewtonAndEulerHoldAtRandomPoints) {
    // (1) to (4), written out once more from the forces the evaluation reports.
    std::mt19937 generator(3);
    std::uniform_real_distribution<double> part(-1.0, 1.0);
    const SingleTrack model{saloon()};
    const VehicleData& car = model.car;
    const Parameters p = plain_parameters();
    for (int n = 0; n < 20; ++n) {
        const double vx = 25.0 + 15.0 * part(generator);
        const double vy = 2.0 * part(generator);
        const double r = 0.5 * part(generator);
        const Input u{0.2 * part(generator), 8000.0 * part(generator)};
        const std::array<double, kExternals> external{300.0, -200.0, 150.0, -0.3, 0.4};
        const auto e = evaluate(model, {vx, vy, r}, u, p, external);
        const double c = std::cos(u.steer_rad);
        const double s = std::sin(u.steer_rad);
        const double share = u.longitudinal < 0.0 ? 0.6 : 0.0;
        const double fx_f = share * u.longitudinal;
        const double fx_r = (1.0 - share) * u.longitudinal;
        const double drag = 0.5 * 1.225 * car.drag_area_m2 * vx * vx;
        const double x_sum = fx_f * c - e.w.fy_f * s + fx_r - drag + external[kForceX];
        const double y_sum = e.w.fy_f * c + fx_f * s + e.w.fy_r + external[kForceY];
        const double z_sum =
            car.lf_m * (e.w.fy_f * c + fx_f * s) - car.lr_m * e.w.fy_r + external[kMomentZ];
        EXPECT_NEAR(e.y[kAx], x_sum / car.mass_kg, 1e-11);
        EXPECT_NEAR(e.y[kAy], y_sum / car.mass_kg, 1e-11);
        EXPECT_NEAR(e.rate[0], x_sum / car.mass_kg + vy * r + external[kGravityX], 1e-11);
        EXPECT_NEAR(e.rate[1], y_sum / car.mass_kg - vx * r + external[kGravityY], 1e-11);
        EXPECT_NEAR(e.rate[2], z_sum / p[kYawInertia], 1e-11);
        EXPECT_NEAR(e.w.alpha_f, u.steer_rad - std::atan((vy + car.lf_m * r) / vx), 1e-14);
        EXPECT_NEAR(e.w.alpha_r, -std::atan((vy - car.lr_m * r) / vx), 1e-14);
    }
}

TEST(SingleTrack, LoadTransferFollowsTheAccelerationAndKeepsTheWeight) {
    const SingleTrack model{saloon()};
    const VehicleData& car = model.car;
    const double wheelbase = car.lf_m + car.lr_m;
    const double weight = car.mass_kg * kGravity;
    for (double force : {-12000.0, -3000.0, 0.0, 5000.0}) {
        for (double steer : {-0.2, 0.0, 0.15}) {
            const auto e = evaluate(model, {25.0, 0.4, 0.3}, {steer, force}, plain_parameters());
            EXPECT_NEAR(e.w.fz_f + e.w.fz_r, weight, 1e-9);
            const double moved = car.mass_kg * e.w.a_x * car.cg_height_m / wheelbase;
            EXPECT_NEAR(e.w.fz_f, weight * car.lr_m / wheelbase - moved, 1e-8);
            EXPECT_NEAR(e.w.fz_r, weight * car.lf_m / wheelbase + moved, 1e-8);
        }
    }
    EXPECT_LT(evaluate(model, {25.0}, {0.0, 5000.0}, plain_parameters()).w.fz_f,
              weight * car.lr_m / wheelbase - 100.0);
}

TEST(SingleTrack, SteadyYawRateOfTheLinearBicycle) {
    // r/delta = v/(L + K v^2), K = m/L (l_r/C_f - l_f/C_r), C = B C D F_z0. Rajamani, eq. (3.12).
    VehicleData car = saloon();
    car.drag_area_m2 = 0.0;
    const SingleTrack model{car};
    const Parameters p = plain_parameters();
    const double wheelbase = car.lf_m + car.lr_m;
    const double weight = car.mass_kg * kGravity;
    const double c_f = p[kBFront] * p[kCFront] * p[kDFront] * weight * car.lr_m / wheelbase;
    const double c_r = p[kBRear] * p[kCRear] * p[kDRear] * weight * car.lf_m / wheelbase;
    const double understeer = car.mass_kg / wheelbase * (car.lr_m / c_f - car.lf_m / c_r);
    ASSERT_GT(understeer, 0.0);
    const double steer = 1e-5;
    for (double v : {8.0, 20.0, 35.0}) {
        using D = Dual<2>;
        double vy = 0.0;
        double r = 0.0;
        for (int newton = 0; newton < 8; ++newton) {  // dv_y/dt = dr/dt = 0 at constant v_x
            const ModelState<D> x{D(v), D::seeded(vy, 0), D::seeded(r, 1)};
            const std::array<D, kExternals> calm{};
            ModelState<D> rate;
            model.evaluate(x.data(), calm.data(), x.data() + kMotionStates, {steer, 0.0}, p.data(),
                           rate.data(), rate.data() + kMotionStates);
            const double det = rate[1].d[0] * rate[2].d[1] - rate[1].d[1] * rate[2].d[0];
            vy -= (rate[1].v * rate[2].d[1] - rate[2].v * rate[1].d[1]) / det;
            r -= (rate[2].v * rate[1].d[0] - rate[1].v * rate[2].d[0]) / det;
        }
        EXPECT_NEAR(r / steer, v / (wheelbase + understeer * v * v), 1e-6 * v / wheelbase);
        // Sideslip of the linear bicycle: beta = l_r/L delta-part minus what the rear slip takes.
        const double beta = steer *
                            (car.lr_m - car.lf_m * car.mass_kg * v * v / (c_r * wheelbase)) /
                            (wheelbase + understeer * v * v);
        EXPECT_NEAR(vy / v, beta, 1e-6 * steer);
    }
}

TEST(SingleTrack, MirrorSymmetry) {
    const Parameters p = mirror_symmetric_parameters();
    for (bool force_known : {true, false}) {
        const SingleTrack model{saloon(), kAllEffects, force_known};
        const double scale = force_known ? 1500.0 : 1.0;
        ModelState<double> left{22.0};
        ModelState<double> right{22.0};
        double most = 0.0;
        const double dt = 0.01;
        for (int k = 0; k < 200; ++k) {
            Input from = lively(k * dt);
            Input to = lively((k + 1) * dt);
            from.longitudinal *= scale / 1500.0;
            to.longitudinal *= scale / 1500.0;
            advance(model, left, kCalm.data(), from, to, p.data(), dt, 2);
            const auto y = sense(model, left, kCalm.data(), to, p.data());
            from.steer_rad *= -1.0;
            to.steer_rad *= -1.0;
            advance(model, right, kCalm.data(), from, to, p.data(), dt, 2);
            const auto z = sense(model, right, kCalm.data(), to, p.data());
            ASSERT_NEAR(z[kVx], y[kVx], 1e-12);
            ASSERT_NEAR(z[kVy], -y[kVy], 1e-12);
            ASSERT_NEAR(z[kYawRate], -y[kYawRate], 1e-12);
            ASSERT_NEAR(z[kAx], y[kAx], 1e-12);
            ASSERT_NEAR(z[kAy], -y[kAy], 1e-12);
            most = std::max(most, std::abs(y[kAy]));
        }
        EXPECT_GT(most, 2.0);  // the drive did corner
    }
}

TEST(SingleTrack, MeasuredAccelerationStandsInForTheForce) {
    // The a_x that a force brings about, given instead of the force, gives the same motion.
    const Parameters p = plain_parameters();
    VehicleData car = saloon();
    car.drive_front_share = 0.4;
    const SingleTrack by_force{car};
    const SingleTrack by_acceleration{car, 0, false};
    std::mt19937 generator(5);
    std::uniform_real_distribution<double> part(-1.0, 1.0);
    for (int n = 0; n < 30; ++n) {
        const ModelState<double> x{25.0 + 10.0 * part(generator), part(generator),
                                   0.4 * part(generator)};
        const Input u{0.2 * part(generator), 9000.0 * part(generator)};
        const auto force = evaluate(by_force, x, u, p);
        const auto acceleration = evaluate(by_acceleration, x, {u.steer_rad, force.w.a_x}, p);
        for (std::size_t i = 0; i < kMotionStates; ++i)
            EXPECT_NEAR(acceleration.rate[i], force.rate[i], 1e-10);
        EXPECT_NEAR(acceleration.w.fx, u.longitudinal, 1e-7);
        EXPECT_NEAR(acceleration.w.fz_f, force.w.fz_f, 1e-8);
        EXPECT_NEAR(acceleration.y[kAx], force.y[kAx], 1e-12);
    }
}

TEST(SingleTrack, ReadsBackTheMeasuredAccelerationWhateverTheSensorErrors) {
    // They are undone on the way in and redone on the way out.
    const EffectMask mask =
        mask_of({"accelerometer_bias", "accelerometer_scale", "imu_lever_arm", "body_attitude"});
    Parameters p = typical_parameters();
    p[parameter_of("imu_lever_arm", 1)] = 0.0;  // to the left: by iteration, tested elsewhere
    const auto e = evaluate({saloon(), mask, false}, {25.0, 0.3, 0.4}, {0.05, -3.0}, p);
    EXPECT_NEAR(e.y[kAx], -3.0, 1e-13);
}

TEST(SingleTrack, AnAccelerometerToTheLeftReadsWhatItMeasured) {
    // The yaw acceleration of which its reading consists depends on the force that is found. It
    // brakes: where the force changes its sign it goes to the other axle, and none may fit.
    std::mt19937 generator(7);
    std::uniform_real_distribution<double> part(-1.0, 1.0);
    Parameters p = plain_parameters();
    p[parameter_of("imu_lever_arm", 1)] = 0.4;
    const SingleTrack model{saloon(), mask_of({"imu_lever_arm"}), false};
    double turning = 0.0;
    for (int n = 0; n < 500; ++n) {
        const double vx = 22.0 + 14.0 * part(generator);
        const ModelState<double> motion{vx, 0.03 * vx * part(generator), 0.4 * part(generator)};
        const Input u{0.08 * part(generator), -6.0 + 2.0 * part(generator)};
        const auto e = evaluate(model, motion, u, p);
        EXPECT_NEAR(e.y[kAx], u.longitudinal, 1e-9);
        turning = std::max(turning, std::abs(e.rate[2]));
    }
    EXPECT_GT(turning, 5.0);
    const auto straight = evaluate(model, {25.0}, {0.0, -3.0}, p);
    EXPECT_EQ(straight.y[kAx], -3.0);
}

TEST(SingleTrack, BackwardsDragPushesForwards) {
    const SingleTrack model{saloon()};
    EXPECT_LT(evaluate(model, {20.0}, {}, plain_parameters()).w.a_x, 0.0);
    EXPECT_GT(evaluate(model, {-20.0}, {}, plain_parameters()).w.a_x, 0.0);
}

TEST(SingleTrack, FastestRateBoundsTheEigenvaluesOfTheMotion) {
    const SingleTrack model{saloon()};
    const Parameters p = plain_parameters();
    for (double v : {5.0, 15.0, 40.0}) {
        using D = Dual<3>;
        const ModelState<D> x{D::seeded(v, 0), D::seeded(0.0, 1), D::seeded(0.0, 2)};
        const std::array<D, kExternals> calm{};
        ModelState<D> rate;
        model.evaluate(x.data(), calm.data(), x.data() + kMotionStates, {}, p.data(), rate.data(),
                       rate.data() + kMotionStates);
        Mat<3, 3> jacobian;
        for (int i = 0; i < 3; ++i)
            for (int j = 0; j < 3; ++j)
                jacobian(i, j) = rate[static_cast<std::size_t>(i)].d[static_cast<std::size_t>(j)];
        const double fastest = spectral_radius(jacobian);
        const double claimed = model.fastest_rate(p.data(), v);
        // RK4 stays stable up to 2.8, and the steps are chosen for 0.6.
        EXPECT_LT(fastest, 2.0 * claimed);
        EXPECT_GT(fastest, 0.2 * claimed);
    }
}

}  // namespace
}  // namespace sysid::test
