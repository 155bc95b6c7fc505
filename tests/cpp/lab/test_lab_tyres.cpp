// Logged axle loads and held inputs of the car's model, and the regression losses.
#include "helpers.hpp"
#include "sysid/lab/tyre_fit.hpp"

namespace sysid::test {
namespace {

using namespace sysid::lab;

VehicleData racer() {
    VehicleData car;
    car.mass_kg = 780.0;
    car.lf_m = 1.4;
    car.lr_m = 1.6;
    car.cg_height_m = 0.35;
    car.drag_area_m2 = 0.7;
    car.brake_front_share = 0.0;
    return car;
}

Parameters racer_parameters() {
    Parameters p = plain_parameters();
    const std::array<double, kBaseParameterCount> base{20.0, 1.7, 1.5,  0.6,  18.0,
                                                       1.5,  1.4, -0.4, 950.0};
    std::copy(base.begin(), base.end(), p.begin());
    return p;
}

SingleTrack with_loads() {
    SingleTrack model{racer()};
    model.loads_known = model.inputs_held = true;
    return model;
}

Input input(double steer, double force = 300.0) {
    Input u{steer, force};
    u.loads_n = {2000.0, 1800.0};
    return u;
}

Workings<double> at(double speed, const Input& u, const LoadsSince<double>& since = {}) {
    const ModelState<double> x{speed, 0.5, 0.4};
    ModelState<double> rate;
    const Lags<double> lags(LagStage::kRates, x.data() + kMotionStates,
                            rate.data() + kMotionStates);
    const Parameters p = racer_parameters();
    return with_loads().evaluate(x.data(), kCalm.data(), lags, u, p.data(), rate.data(), since);
}

void expect_same(const Workings<double>& a, const Workings<double>& b) {
    EXPECT_NEAR(a.a_x, b.a_x, 1e-9);
    EXPECT_NEAR(a.a_y, b.a_y, 1e-9);
    EXPECT_NEAR(a.r_dot, b.r_dot, 1e-9);
}

TEST(LoggedLoads, AreThoseThatTheTyresFeel) {
    const Input u = input(0.1);
    Input more = u;
    more.loads_n = {2200.0, 1800.0};
    const auto w = at(25.0, u), heavier = at(25.0, more);
    EXPECT_NEAR(heavier.fy_f, 1.1 * w.fy_f, 1e-9);
    EXPECT_NEAR(heavier.fy_r, w.fy_r, 1e-9);
}

TEST(LoggedLoads, MoveWithinASampleByWhatPullsSince) {
    const Input u = input(0.1);
    const auto held = at(25.0, u);
    const double pull = 780.0 * held.a_x;
    expect_same(at(25.0, u, {true, pull, 625.0}), held);
    // 500 N less pull since then: 500 h/L newtons more in front, as many fewer behind.
    const auto later = at(25.0, u, {true, pull + 500.0, 625.0});
    Input moved = u;
    double shift = 500.0 * 0.35 / 3.0;
    for (int again = 0; again < 30; ++again) {  // the front force itself draws, until it agrees
        moved.loads_n = {u.loads_n.front + shift, u.loads_n.rear - shift};
        shift = (pull + 500.0 - 780.0 * at(25.0, moved).a_x) * 0.35 / 3.0;
    }
    expect_same(later, at(25.0, moved));
}

TEST(LoggedLoads, TheAirsPartGoesWithTheSquareOfTheSpeed) {
    Input u = input(0.0);
    // All that is not weight or acceleration's is the air's; from 25 to 30 m/s it grows by 0.44.
    const double pull = 780.0 * at(30.0, u).a_x;
    const double weight = 780.0 * kGravity / 3.0;
    const double shift = 0.35 / 3.0 * pull;
    const auto grown = at(30.0, u, {true, pull, 625.0});
    u.loads_n.front += 0.44 * (u.loads_n.front - weight * 1.6 + shift);
    u.loads_n.rear += 0.44 * (u.loads_n.rear - weight * 1.4 - shift);
    expect_same(grown, at(30.0, u));
}

TEST(LoggedLoads, AreThoseOfTheBeginningOfASampleInEveryPartOfIt) {
    // Two parts of a sample are one program: the second moves from where the first began.
    const Parameters p = racer_parameters();
    for (const double speed : {3.0, 12.0, 30.0}) {
        ModelState<double> coarse{speed, 0.2, 0.1}, fine = coarse;
        const Input u = input(0.05), other = input(-0.3, 9000.0);
        advance(with_loads(), coarse, kCalm.data(), u, other, p.data(), 0.01,
                substeps_for(with_loads(), p.data(), speed, 0.01));
        advance(with_loads(), fine, kCalm.data(), u, u, p.data(), 0.01, 400);
        EXPECT_NEAR(coarse[1], fine[1], 2e-5) << speed;
        EXPECT_NEAR(coarse[2], fine[2], 2e-5) << speed;
    }
}

TEST(LoggedLoads, KeepSlowDrivingStable) {
    const Parameters p = racer_parameters();
    const SingleTrack model = with_loads();
    const Input u = input(0.05, 0.0);
    ModelState<double> x{1.5, 0.2, 0.1};
    for (int k = 0; k < 200; ++k)
        advance(model, x, kCalm.data(), u, u, p.data(), 0.01,
                substeps_for(model, p.data(), x[0], 0.01));
    EXPECT_LT(std::abs(x[1]), 1.0);
    EXPECT_LT(std::abs(x[2]), 1.0);
}

TEST(TyreLoss, DerivativesAndTheirProductsAgree) {
    TyreLoss loss(racer(), 1000.0, true);
    std::mt19937 generator(6);
    std::normal_distribution<double> normal;
    for (int k = 0; k < 170; ++k)
        loss.add({25.0 + normal(generator), 0.5 * normal(generator), 0.3 * normal(generator),
                  0.05 * normal(generator), 2000.0, 1800.0, 8.0 * normal(generator), 0.3, 1.3,
                  0.7});
    using Tyres = std::array<double, kTyreParameters>;
    const Tyres p{20.0, 1.7, 1.5, 0.6, 18.0, 1.5, 1.4, -0.4, 1e-4, 0.02, -0.3};
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
