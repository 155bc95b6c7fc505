// The grey-box car, its likelihood and the regression losses: derivatives, filter, noise.
#include "helpers.hpp"
#include "sysid/lab/tyre_fit.hpp"
#include "sysid/lab/tyre_likelihood.hpp"

namespace sysid::test {
namespace {

using namespace sysid::lab;
using Tyres = std::array<double, kTyreParameters>;

GreyBoxCar racer() {
    GreyBoxCar car;
    car.mass_kg = 780.0;
    car.yaw_inertia_kgm2 = 1000.0;
    car.lf_m = 1.4;
    car.lr_m = 1.6;
    car.cg_height_m = 0.35;
    return car;
}

Tyres tyres() {
    return {20.0, 1.7, 1.5, 0.6, 18.0, 1.5, 1.4, -0.4, 1e-4, 0.02, -0.3, 1.05, 0.95, 0.7};
}

GreyBoxInput input(double steer, double force = 300.0) {
    return {force, steer, std::sin(steer), std::cos(steer), 2000.0, 1800.0};
}

/// A weave that brings both axles near their peaks, read with noise and some readings missing.
TyreRun weave(std::size_t n, unsigned seed) {
    TyreRun run;
    std::mt19937 generator(seed);
    std::normal_distribution<double> normal;
    const auto p = tyres();
    std::array<double, kGreyStates> x{25.0, 0.0, 0.0};
    for (std::size_t k = 0; k < n; ++k) {
        const double t = 0.01 * static_cast<double>(k);
        run.inputs.push_back(input(0.07 * std::sin(5.0 * t)));
        const double a_y = grey_box(racer(), x, run.inputs[k], p.data())[3];
        run.measurements.emplace_back(
            x[0] + 0.05 * normal(generator), x[1] + 0.01 * normal(generator),
            x[2] + 0.003 * normal(generator), a_y + 0.03 * normal(generator));
        if (k % 7 == 3) run.measurements[k][1] = std::nan("");
        grey_box_step(racer(), x, run.inputs[k], p.data(), 0.01, 4);
    }
    return run;
}

const std::array<double, kGreyNoises> kNoise{0.05, 0.01, 0.003, 0.03, 0.02, 0.03, 0.01};

TEST(GreyBox, LoadsMoveWithinASampleOnlyByWhatIsDrawnSince) {
    const Tyres p = tyres();
    const std::array<double, kGreyStates> x{25.0, 0.5, 0.4};
    const GreyBoxInput u = input(0.1);
    const auto held = grey_box(racer(), x, u, p.data());
    const double drawn = drawn_along(racer(), x, u, p.data(), held);
    const auto at_once = grey_box(racer(), x, u, p.data(), LoadsSince<double>{true, drawn, 625.0});
    const auto later =
        grey_box(racer(), x, u, p.data(), LoadsSince<double>{true, drawn - 500.0, 625.0});
    // 500 N drawn since then: 500 h/L newtons more in front, as many fewer behind.
    GreyBoxInput moved = u;
    for (int i = 0; i < 4; ++i) EXPECT_NEAR(at_once[i], held[i], 1e-9);
    double shift = 500.0 * 0.35 / 3.0;
    for (int again = 0; again < 30; ++again) {  // the front force itself draws, until it agrees
        moved.fz_front_n = u.fz_front_n + shift;
        moved.fz_rear_n = u.fz_rear_n - shift;
        const auto now = grey_box(racer(), x, moved, p.data());
        shift = (drawn_along(racer(), x, moved, p.data(), now) - drawn + 500.0) * 0.35 / 3.0;
    }
    const auto agreed = grey_box(racer(), x, moved, p.data());
    for (int i = 0; i < 4; ++i) EXPECT_NEAR(later[i], agreed[i], 1e-9);
}

TEST(GreyBox, TheAirsPartOfTheLoadsGoesWithTheSquareOfTheSpeed) {
    const Tyres p = tyres();
    GreyBoxInput u = input(0.0);
    const std::array<double, kGreyStates> x{30.0, 0.5, 0.4};
    // All that is not weight or acceleration's is the air's; from 25 to 30 m/s it grows by 0.44.
    const double drag = 0.5 * 1.225 * 0.7 * 900.0;
    const double weight = 780.0 * 1.05 * kGravity / 3.0;
    const double shift = 0.35 / 3.0 * (u.fx_n - drag);
    const auto grown = grey_box(racer(), x, u, p.data(), LoadsSince<double>{true, drag, 625.0});
    u.fz_front_n += 0.44 * (u.fz_front_n - weight * 1.6 + shift);
    u.fz_rear_n += 0.44 * (u.fz_rear_n - weight * 1.4 - shift);
    const auto held = grey_box(racer(), x, u, p.data());
    for (int i = 0; i < 4; ++i) EXPECT_NEAR(grown[i], held[i], 1e-9);
}

TEST(GreyBox, SubstepsFollowTheFastestMotion) {
    const Tyres p = tyres();
    for (const double speed : {3.0, 12.0, 30.0}) {
        const GreyBoxInput u = input(0.05);
        std::array<double, kGreyStates> coarse{speed, 0.2, 0.1};
        std::array<double, kGreyStates> fine = coarse;
        grey_box_step(racer(), coarse, u, p.data(), 0.01,
                      grey_box_substeps(racer(), u, p.data(), speed, 0.01));
        grey_box_step(racer(), fine, u, p.data(), 0.01, 400);
        EXPECT_NEAR(coarse[1], fine[1], 2e-5) << speed;
        EXPECT_NEAR(coarse[2], fine[2], 2e-5) << speed;
    }
}

TEST(GreyBox, SubstepsKeepSlowDrivingStable) {
    const Tyres p = tyres();
    std::array<double, kGreyStates> x{1.5, 0.2, 0.1};
    for (int k = 0; k < 200; ++k) {
        const int steps = grey_box_substeps(racer(), input(0.05, 0.0), p.data(), x[0], 0.01);
        grey_box_step(racer(), x, input(0.05, 0.0), p.data(), 0.01, steps);
    }
    EXPECT_LT(std::abs(x[1]), 1.0);
    EXPECT_LT(std::abs(x[2]), 1.0);
}

TEST(TyreProblem, SensitivitiesAreDifferencesOfTheResiduals) {
    TyreProblem problem{racer(), {}};
    problem.runs.push_back(weave(150, 1));
    problem.runs.push_back(weave(120, 2));
    const Tyres p = tyres();
    const FrozenGains gains = freeze(problem, p.data(), kNoise.data());
    std::vector<int> columns;
    for (int c = 0; c < kTyreParameters; ++c) columns.push_back(c);
    const std::size_t rows = problem.samples() * kGreyChannels;
    std::vector<double> slopes(rows * columns.size());
    sensitivities(problem, p.data(), gains, columns, slopes.data());
    std::vector<double> high(rows), low(rows);
    for (std::size_t c = 0; c < columns.size(); ++c) {
        const double h = 1e-6 * std::max(0.1, std::abs(p[c]));
        Tyres q = p;
        q[c] = p[c] + h;
        residuals(problem, q.data(), gains, high.data());
        q[c] = p[c] - h;
        residuals(problem, q.data(), gains, low.data());
        double most = 1e-3;
        for (std::size_t k = 0; k < rows; ++k)
            most = std::max(most, std::abs(slopes[k * columns.size() + c]));
        for (std::size_t k = 0; k < rows; ++k)
            ASSERT_NEAR(slopes[k * columns.size() + c], -(high[k] - low[k]) / (2.0 * h),
                        2e-5 * most)
                << "parameter " << c << ", residual " << k;
    }
}

TEST(TyreProblem, NormalEquationsAreProductsOfTheSensitivities) {
    TyreProblem problem{racer(), {}};
    problem.runs.push_back(weave(150, 3));
    Tyres p = tyres();
    const FrozenGains gains = freeze(problem, p.data(), kNoise.data());
    p[0] *= 1.1;
    const std::vector<int> columns{kDragArea, 2, 0, kMassFactor};
    const std::size_t w = columns.size();
    const std::size_t rows = problem.samples() * kGreyChannels;
    std::vector<double> slopes(rows * w), e(rows), gradient(w), information(w * w);
    sensitivities(problem, p.data(), gains, columns, slopes.data());
    residuals(problem, p.data(), gains, e.data());
    const double cost =
        normal_equations(problem, p.data(), gains, columns, gradient.data(), information.data());
    EXPECT_NEAR(cost, half_sum_of_squares(problem, p.data(), gains), 1e-9 * cost);
    for (std::size_t i = 0; i < w; ++i) {
        double g = 0.0;
        for (std::size_t k = 0; k < rows; ++k) g += slopes[k * w + i] * e[k];
        EXPECT_NEAR(gradient[i], g, 1e-9 * (1.0 + std::abs(g)));
        for (std::size_t j = 0; j < w; ++j) {
            double n = 0.0;
            for (std::size_t k = 0; k < rows; ++k) n += slopes[k * w + i] * slopes[k * w + j];
            EXPECT_NEAR(information[i * w + j], n, 1e-9 * (1.0 + std::abs(n)));
        }
    }
}

TEST(TyreProblem, NoiseScoreIsTheDerivativeOfTheLogLikelihood) {
    TyreProblem problem{racer(), {}};
    problem.runs.push_back(weave(200, 4));
    const Tyres p = tyres();
    std::array<double, kGreyNoises> gradient{};
    std::array<double, kGreyNoises * kGreyNoises> information{};
    const double value =
        noise_score(problem, p.data(), kNoise.data(), gradient.data(), information.data());
    EXPECT_NEAR(value, freeze(problem, p.data(), kNoise.data()).log_likelihood, 1e-9);
    for (std::size_t i = 0; i < kGreyNoises; ++i) {
        auto noise = kNoise;
        noise[i] = kNoise[i] * std::exp(1e-5);
        const double high = freeze(problem, p.data(), noise.data()).log_likelihood;
        noise[i] = kNoise[i] * std::exp(-1e-5);
        const double low = freeze(problem, p.data(), noise.data()).log_likelihood;
        // Where the filter linearises is taken as given, though it hangs on the noise a little.
        EXPECT_NEAR(gradient[i], (high - low) / 2e-5, 2e-3 * (1.0 + std::abs(gradient[i])));
        EXPECT_GT(information[i * kGreyNoises + i], 0.0);
    }
}

TEST(TyreProblem, WithoutNoiseTheTruthLeavesNoError) {
    TyreProblem problem{racer(), {}};
    TyreRun run = weave(300, 5);
    const Tyres p = tyres();
    std::array<double, kGreyStates> x{25.0, 0.0, 0.0};
    for (std::size_t k = 0; k < run.size(); ++k) {
        const auto& u = run.inputs[k];
        run.measurements[k] = {x[0], x[1], x[2], grey_box(racer(), x, u, p.data())[3]};
        grey_box_step(racer(), x, u, p.data(), run.dt,
                      grey_box_substeps(racer(), u, p.data(), x[0], run.dt));
    }
    problem.runs.push_back(run);
    const FrozenGains gains = freeze(problem, p.data(), kNoise.data());
    EXPECT_EQ(gains.observed, run.size() * kGreyChannels);
    EXPECT_LT(half_sum_of_squares(problem, p.data(), gains), 1e-18);
    std::vector<double> ahead(run.size() * kGreyChannels);
    look_ahead(problem, p.data(), gains, 0, ahead.data());
    for (std::size_t k = 0; k < run.size(); ++k)
        for (std::size_t c = 0; c < kGreyChannels; ++c)
            ASSERT_NEAR(ahead[k * kGreyChannels + c], run.measurements[k][c], 1e-9);
}

TEST(TyreLoss, DerivativesAndTheirProductsAgree) {
    TyreLoss loss(racer(), true);
    const TyreRun run = weave(200, 6);
    for (std::size_t k = 0; k < run.size(); ++k) {
        if (std::isnan(run.measurements[k][1])) continue;
        const auto& y = run.measurements[k];
        loss.add({y[0], y[1], y[2], run.inputs[k].steer_rad, 2000.0, 1800.0, y[3], 0.3, 1.3, 0.7});
    }
    Tyres p = tyres();
    const std::vector<int> columns{0, 1, 2, 3, 4, 5, 6, 7, kP1, kP2, kP3};
    const std::size_t w = columns.size();
    const std::size_t rows = 2 * loss.samples();
    std::vector<double> slopes(rows * w), e(rows), high(rows), low(rows), gradient(w),
        information(w * w);
    residuals(loss, p.data(), nullptr, e.data());
    sensitivities(loss, p.data(), nullptr, columns, slopes.data());
    const double cost =
        normal_equations(loss, p.data(), nullptr, columns, gradient.data(), information.data());
    EXPECT_NEAR(cost, half_sum_of_squares(loss, p.data(), nullptr), 1e-10 * cost);
    for (std::size_t i = 0; i < w; ++i) {
        const auto c = static_cast<std::size_t>(columns[i]);
        const double h = 1e-6 * std::max(0.01, std::abs(p[c]));
        Tyres q = p;
        q[c] = p[c] + h;
        residuals(loss, q.data(), nullptr, high.data());
        q[c] = p[c] - h;
        residuals(loss, q.data(), nullptr, low.data());
        double g = 0.0;
        for (std::size_t k = 0; k < rows; ++k) {
            ASSERT_NEAR(slopes[k * w + i], -(high[k] - low[k]) / (2.0 * h),
                        1e-5 * (1.0 + std::abs(slopes[k * w + i])));
            g += slopes[k * w + i] * e[k];
        }
        EXPECT_NEAR(gradient[i], g, 1e-9 * (1.0 + std::abs(g)));
        for (std::size_t j = 0; j < w; ++j) {
            double n = 0.0;
            for (std::size_t k = 0; k < rows; ++k) n += slopes[k * w + i] * slopes[k * w + j];
            EXPECT_NEAR(information[i * w + j], n, 1e-9 * (1.0 + std::abs(n)));
        }
    }
}

}  // namespace
}  // namespace sysid::test
