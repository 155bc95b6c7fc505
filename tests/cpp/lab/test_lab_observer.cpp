// The extended-state observer: its equations, its sampling, and its two ways of running.
#include "dense.hpp"
#include "helpers.hpp"
#include "sysid/published/observer_em.hpp"

namespace sysid::lab {
namespace {

using test::central_difference;

const ObserverCar kCar{780.0, 1000.0, 1.4, 1.6, 0.3};
const ObserverVec kState{(ObserverVec() << 18.0, -0.4, 0.3, 200.0, -700.0, 150.0).finished()};
const ObserverInput kBefore{900.0, 0.03, 110000.0, 130000.0};
const ObserverInput kNow{-500.0, -0.02, 125000.0, 120000.0};

ObserverNoise noise_of_a_good_car() {
    ObserverNoise noise;
    noise.process = (ObserverVec() << 1e-4, 1e-6, 1e-6, 20.0, 50.0, 20.0).finished().asDiagonal();
    noise.sensors = ObserverReading(1e-2, 1e-4, 1e-5, 1e-3).asDiagonal();
    return noise;
}

/// Readings of a car with linear tyres that is pushed aside by a constant unknown force.
ObserverLog pushed_car(ObserverForm form, std::size_t samples, double side_force) {
    constexpr double dt = 0.01;
    const ObserverModel model(kCar, form, dt);
    const ObserverModel truth(kCar, ObserverForm::corrected(), dt);
    ObserverLog log{model, {}, {}, {}};
    ObserverVec x = ObserverVec::Zero();
    x[0] = 12.0;
    x[4] = side_force;
    ObserverMat A = ObserverMat::Identity();
    ObserverRow H;
    std::mt19937 generator(4);
    std::normal_distribution<double> normal;
    const ObserverNoise noise = noise_of_a_good_car();
    for (std::size_t k = 0; k < samples; ++k) {
        const double t = dt * static_cast<double>(k);
        if (k > 0) x = truth.predict(x, log.inputs.back(), log.inputs.back(), A);
        log.inputs.push_back(
            {600.0 * std::cos(0.5 * t), 0.03 * std::sin(2.0 * t), 120000.0, 115000.0});
        ObserverReading y = truth.observe(x[0], x, log.inputs.back(), H);
        for (int i = 0; i < 4; ++i) y[i] += std::sqrt(noise.sensors(i, i)) * normal(generator);
        if (k % 7 == 3) y[1] = std::nan("");
        if (k % 50 == 9) y.setConstant(std::nan(""));
        log.readings.push_back(y);
    }
    log.start = form.coupling ? ObserverStart::from_reading(log.readings[0], noise, kCar)
                              : ObserverStart::certain(5.0);
    return log;
}

TEST(HeldResponse, IsTheIntegralOfTheExponential) {
    for (const double w : {0.01, 0.7, 6.0, 90.0}) {  // a rotation, up to fourteen turns
        Mat<2, 2> J;
        J << 0.0, -w, w, 0.0;
        Mat<2, 2> expected;
        expected << std::sin(w), std::cos(w) - 1.0, 1.0 - std::cos(w), std::sin(w);
        EXPECT_LT((held_response<2>(J, 1.0).response - expected / w).norm(), 1e-11);
    }
    const HeldResponse<3> still = held_response<3>(Mat<3, 3>::Zero(), 0.3);
    EXPECT_LT((still.response - 0.3 * Mat<3, 3>::Identity()).norm(), 1e-15);
    EXPECT_LT((still.transition - Mat<3, 3>::Identity()).norm(), 1e-15);
    const Mat<3, 3> stiff = Vec<3>(-1.0, -50.0, -4000.0).asDiagonal();
    const Mat<3, 3> response = held_response<3>(stiff, 0.1).response;
    for (int i = 0; i < 3; ++i)
        EXPECT_NEAR(response(i, i), std::expm1(0.1 * stiff(i, i)) / stiff(i, i), 1e-13);
}

TEST(HeldResponse, OfThreeStatesIsThatOfAnySize) {
    Mat<3, 3> J;
    J << -0.3, 0.4, 1.1, 2.0, -5.0, -28.0, -0.2, 1.5, -6.0;
    Mat<4, 4> wide = Mat<4, 4>::Zero();
    wide.topLeftCorner<3, 3>() = J;
    for (const double h : {1e-4, 0.01, 0.017, 0.3}) {
        const HeldResponse<3> three = held_response<3>(J, h);
        const HeldResponse<4> four = held_response<4>(wide, h);
        const double size = four.response.norm();
        EXPECT_LT((three.response - four.response.topLeftCorner<3, 3>()).norm(), 1e-13 * size);
        EXPECT_LT((three.transition - four.transition.topLeftCorner<3, 3>()).norm(), 1e-12);
        EXPECT_LT((three.transition - Mat<3, 3>::Identity() - J * three.response).norm(), 1e-12);
    }
}

TEST(ObserverModel, JacobiansAreDerivatives) {
    ObserverForm form;
    form.exact_sampling = false;  // Euler's rule is differentiated without remainder
    for (const double v_x : {18.0, 0.6}) {
        const ObserverModel model(kCar, form, 0.01);
        ObserverVec at = kState;
        at[0] = v_x;
        ObserverMat A = ObserverMat::Identity(), ignored;
        ObserverRow H, ignored_row;
        model.predict(at, kBefore, kNow, A);
        model.observe(at[0], at, kNow, H);
        for (int j = 0; j < kObserverStates; ++j) {
            const double step = 1e-3 * std::max(1.0, std::abs(at[j]));
            const auto moved = [&](double value) {
                ObserverVec x = at;
                x[j] = value;
                return x;
            };
            const ObserverVec column = central_difference(
                [&](double v) { return model.predict(moved(v), kBefore, kNow, ignored); }, at[j],
                step);
            const ObserverReading row = central_difference(
                [&](double v) { return model.observe(moved(v)[0], moved(v), kNow, ignored_row); },
                at[j], step);
            EXPECT_LT((A.col(j) - column).norm(), 1e-8) << j;
            EXPECT_LT((H.col(j) - row).norm(), 1e-8 * (1.0 + H.col(j).norm())) << j;
        }
    }
}

TEST(ObserverModel, ExactSamplingIsTheLimitOfFineSteps) {
    const auto after_a_second = [](ObserverForm form, int steps, double v_x) {
        const ObserverModel model(kCar, form, 0.01 / steps);
        ObserverVec x = kState;
        x[0] = v_x;
        ObserverMat A = ObserverMat::Identity();
        for (int i = 0; i < 100 * steps; ++i) x = model.predict(x, kBefore, kBefore, A);
        return x;
    };
    ObserverForm euler;
    euler.exact_sampling = false;
    for (const double v_x : {5.0, 40.0}) {
        const ObserverVec coarse = after_a_second(ObserverForm::corrected(), 1, v_x);
        const ObserverVec fine = after_a_second(ObserverForm::corrected(), 20, v_x);
        const ObserverVec reference = 2.0 * after_a_second(euler, 2000, v_x) -
                                      after_a_second(euler, 1000, v_x);  // Richardson
        EXPECT_LT((fine - reference).norm(), 1e-4);
        EXPECT_LT((coarse - reference).norm(), 2e-2);
    }
}

TEST(ObserverModel, StaysStableAtWalkingPaceUnlikeEuler) {
    const auto radius = [](ObserverForm form) {
        const ObserverModel model(kCar, form, 0.01);
        ObserverVec x = ObserverVec::Zero();
        x[0] = 1.0;
        ObserverMat A = ObserverMat::Identity();
        model.predict(x, kNow, kNow, A);
        return test::spectral_radius(A.topLeftCorner<3, 3>());
    };
    EXPECT_LE(radius(ObserverForm::corrected()), 1.0);
    EXPECT_GT(radius(published_form()), 2.0);
}

TEST(ObserverModel, PublishedFormIsItsMatrices) {
    const ObserverModel model(kCar, published_form(), 0.01);
    ObserverMat A = ObserverMat::Identity();
    ObserverRow H;
    const ObserverVec x = model.predict(kState, kBefore, kNow, A);
    const ObserverReading y = model.observe(kState[0], x, kNow, H);
    const double v = 18.0, f = 125000.0, r = 120000.0, m = 780.0, I = 1000.0;
    const double Yv = -(f + r) / (m * v), Yr = -v - (f * 1.4 - r * 1.6) / (m * v);
    const double Nv = -(f * 1.4 - r * 1.6) / (I * v);
    const double Nr = -(f * 1.4 * 1.4 + r * 1.6 * 1.6) / (I * v);
    ObserverMat expected = ObserverMat::Identity();
    expected.row(0) += 0.01 * (ObserverVec() << -0.3 / m, 0, 0, 1 / m, 0, 0).finished();
    expected.row(1) += 0.01 * (ObserverVec() << 0, Yv, Yr, 0, 1 / m, 0).finished();
    expected.row(2) += 0.01 * (ObserverVec() << 0, Nv, Nr, 0, 0, 1 / I).finished();
    Mat<6, 2> B = Mat<6, 2>::Zero();
    B(0, 0) = 0.01 / m;
    B(1, 1) = 0.01 * f / m;
    B(2, 1) = 0.01 * f * 1.4 / I;
    EXPECT_LT((A - expected).norm(), 1e-13);
    EXPECT_LT((x - expected * kState - B * Vec<2>(-500.0, -0.02)).norm(), 1e-12);
    EXPECT_NEAR(y[3], Yv * x[1] + (Yr + v) * x[2] + x[4] / m, 1e-12);
    EXPECT_NEAR(H(3, 2), Yr + v, 1e-12);
    EXPECT_EQ(H(3, 0), 0.0);
}

TEST(Observer, StepByStepIsTheFilterOverTheLog) {
    const ObserverNoise noise = noise_of_a_good_car();
    for (const auto& form : {ObserverForm::corrected(), published_form()}) {
        const ObserverLog log = pushed_car(form, 300, 400.0);
        const ObserverTrace whole = trace(log, noise, false);
        Observer observer(log.model, noise, log.start);
        for (std::size_t k = 0; k < log.size(); ++k) {
            const ObserverVec x = observer.step(log.inputs[k], log.readings[k]);
            for (int i = 0; i < 6; ++i)
                ASSERT_DOUBLE_EQ(x[i], whole.state[6 * k + static_cast<std::size_t>(i)]) << k;
        }
        EXPECT_DOUBLE_EQ(observer.log_likelihood(), whole.log_likelihood);
        EXPECT_DOUBLE_EQ(log_likelihood(log, noise), whole.log_likelihood);
    }
}

TEST(Observer, FeelsAnUnknownSideForce) {
    const ObserverLog log = pushed_car(ObserverForm::corrected(), 1500, 900.0);
    const ObserverTrace found = trace(log, noise_of_a_good_car(), true);
    double error = 0.0, spread = 0.0;
    for (std::size_t k = 0; k < log.size(); ++k) {
        error += std::abs(found.state[6 * k + 4] - 900.0);
        spread += std::sqrt(found.covariance[36 * k + 4 * 6 + 4]);
    }
    const auto n = static_cast<double>(log.size());
    EXPECT_LT(error / n, 40.0);
    EXPECT_LT(error / n, 2.0 * spread / n);
    EXPECT_TRUE(std::isnan(found.innovation[4 * 9]));
    EXPECT_FALSE(std::isnan(found.reading[4 * 9 + 3]));
}

TEST(Observer, CoastsThroughAMinuteWithoutReadings) {
    // The car brakes to walking pace and speeds up again while nothing is read.
    constexpr double dt = 0.01;
    constexpr std::size_t kLost = 1000, kBack = 7000, kSamples = 7300;
    const ObserverNoise noise = noise_of_a_good_car();
    for (const auto& form : {ObserverForm::corrected(), published_form()}) {
        const ObserverModel truth(kCar, ObserverForm::corrected(), dt);
        ObserverLog log{ObserverModel(kCar, form, dt), {}, {}, {}};
        ObserverVec x = ObserverVec::Zero();
        x[0] = 12.0;
        ObserverMat A = ObserverMat::Identity();
        ObserverRow H;
        std::mt19937 generator(9);
        std::normal_distribution<double> normal;
        std::vector<ObserverVec> states;
        for (std::size_t k = 0; k < kSamples; ++k) {
            const double t = dt * static_cast<double>(k);
            if (k > 0) x = truth.predict(x, log.inputs.back(), log.inputs.back(), A);
            states.push_back(x);
            const double wanted = t < 12.0 || t > 50.0 ? 12.0 : 1.2;
            const double force = std::clamp(800.0 * (wanted - x[0]), -1200.0, 1200.0);
            log.inputs.push_back({force, 0.02 * std::sin(2.0 * t), 120000.0, 115000.0});
            ObserverReading y = truth.observe(x[0], x, log.inputs.back(), H);
            for (int i = 0; i < 4; ++i) y[i] += std::sqrt(noise.sensors(i, i)) * normal(generator);
            log.readings.push_back(y);
        }
        log.start = form.coupling ? ObserverStart::from_reading(log.readings[0], noise, kCar)
                                  : ObserverStart::certain(5.0);
        const ObserverTrace whole = trace(log, noise, false);
        for (std::size_t k = kLost; k < kBack; ++k) log.readings[k].setConstant(std::nan(""));
        const ObserverTrace found = trace(log, noise, false);
        for (const double v : found.state) ASSERT_TRUE(std::isfinite(v));
        for (const double v : found.covariance) ASSERT_TRUE(std::isfinite(v));
        const auto std_of = [&](std::size_t k, std::size_t i) {
            return std::sqrt(found.covariance[36 * k + 7 * i]);
        };
        for (const std::size_t i : {0, 3, 4, 5})
            for (std::size_t k = kLost; k < kBack; k += 500)
                EXPECT_GT(std_of(k + 499, i), std_of(k, i)) << i << ' ' << k;
        for (const std::size_t i : {0, 1, 2}) {
            EXPECT_GT(std_of(kBack - 1, i), std_of(kLost - 1, i)) << i;
            // The published form has errors of its own: it is back where it would have been.
            const std::size_t at = 6 * (kBack + 200) + i;
            const double right =
                form.coupling ? states[kBack + 200][static_cast<Eigen::Index>(i)] : whole.state[at];
            const double error = found.state[at] - right;
            EXPECT_LT(std::abs(error), 3.0 * std_of(kBack + 200, i)) << i;
        }
    }
}

TEST(ObserverEm, LearnsTheSensorsWithoutFalling) {
    const ObserverLog log = pushed_car(ObserverForm::corrected(), 3000, 500.0);
    ObserverNoise start;
    start.process =
        (ObserverVec() << 1e-3, 1e-3, 1e-3, 500.0, 500.0, 500.0).finished().asDiagonal();
    start.sensors = ObserverReading(1e-3, 1e-2, 1e-3, 1e-1).asDiagonal();
    const std::vector<ObserverLog> logs{log};
    const auto out = learn(logs, start, NoiseStructure<6>::diagonal(),
                           NoiseStructure<4>::diagonal(), {60, 0.0, true, true});
    EXPECT_EQ(out.fell, 0);
    for (std::size_t i = 1; i < out.log_likelihood.size(); ++i)
        EXPECT_GE(out.log_likelihood[i], out.log_likelihood[i - 1]);
    const ObserverNoise truth = noise_of_a_good_car();
    for (int i = 0; i < 4; ++i)
        EXPECT_NEAR(out.noise.sensors(i, i) / truth.sensors(i, i), 1.0, 0.12) << i;
    EXPECT_LT(out.noise.process(4, 4), 50.0);
}

}  // namespace
}  // namespace sysid::lab
