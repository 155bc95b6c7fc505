// The body that rolls: its equation, its motion against fine steps, and the same car in the
// coordinates of the roll axis.
#include <numbers>

#include "effect_pair.hpp"

namespace sysid::test {
namespace {

constexpr double kRoll = 0.06, kHertz = 1.5, kDamping = 0.35;
constexpr double kOmega = 2.0 * std::numbers::pi * kHertz;

SingleTrack rolling() { return {saloon(), mask_of({"body_roll"})}; }

Parameters with_roll(double roll = kRoll, double hertz = kHertz) {
    Parameters p = plain_parameters();
    p[parameter_of("body_roll", 0)] = roll;
    p[parameter_of("body_roll", 1)] = hertz;
    return p;
}

TEST(BodyRoll, AtOneInstant) {
    ModelState<double> x = kCornering;
    const std::size_t angle = state_of("body_roll", 0), rate = state_of("body_roll", 1);
    x[angle] = 0.5;
    x[rate] = -2.0;
    const Pair it("body_roll", {kRoll, kHertz}, x, kDriving);
    const double phi = kRoll * 0.5, turning = kRoll * -2.0, arm = 0.8 * saloon().cg_height_m;
    const double across = x[1] + arm * turning;
    EXPECT_NEAR(it.on.w.alpha_f, kDriving.steer_rad - std::atan((across + 1.2 * 0.35) / 25.0),
                1e-15);
    EXPECT_NEAR(it.on.w.alpha_r, -std::atan((across - 1.5 * 0.35) / 25.0), 1e-15);
    EXPECT_NEAR(it.on.y[kAy], it.on.w.a_y * std::cos(phi) + kGravity * std::sin(phi), 1e-14);
    EXPECT_EQ(it.on.y[kVy], x[1]);
    EXPECT_EQ(it.on.rate[angle], -2.0);
    EXPECT_NEAR(it.on.rate[rate],
                kOmega * kOmega * (it.on.w.a_y / kGravity - 0.5) + 2.0 * kDamping * kOmega * 2.0,
                1e-11);
}

TEST(BodyRoll, InALongCornerIsTheLeanOfBodyAttitude) {
    Parameters p = with_roll();
    p[parameter_of("body_attitude", 1)] = kRoll;
    const std::vector<Input> inputs(800, Input{0.03, 300.0});
    const auto swung = drive(rolling(), p, inputs, 0.01, 20.0).back();
    const auto leant = drive({saloon(), mask_of({"body_attitude"})}, p, inputs, 0.01, 20.0).back();
    EXPECT_GT(leant[kAy], 3.0);
    for (int i = 0; i < kChannels; ++i) EXPECT_NEAR(swung[i], leant[i], 1e-3);
}

TEST(BodyRoll, AfterAStepIsLateAndSwingsBeyond) {
    // Against the convolution of a_y with the answer of an oscillator to an impulse.
    const SingleTrack model = rolling();
    const Parameters p = with_roll();
    const double dt = 0.002, slower = kOmega * std::sqrt(1.0 - kDamping * kDamping);
    ModelState<double> x{20.0};
    std::vector<double> felt, angle;
    for (int k = 0; k < 1000; ++k) {
        if (k > 0) advance(model, x, kCalm.data(), {0.02, 300.0}, {0.02, 300.0}, p.data(), dt, 1);
        felt.push_back(evaluate(model, x, {0.02, 300.0}, p).w.a_y / kGravity);
        angle.push_back(x[state_of("body_roll")]);
    }
    for (std::size_t k = 0; k < felt.size(); k += 50) {
        double sum = 0.0;
        for (std::size_t i = 0; i <= k; ++i) {
            const double ago = dt * static_cast<double>(k - i);
            sum += (i == 0 ? 0.5 : 1.0) * dt * felt[i] * std::exp(-kDamping * kOmega * ago) *
                   std::sin(slower * ago) * kOmega * kOmega / slower;
        }
        EXPECT_NEAR(angle[k], sum, 1e-4 * felt.back());
    }
    const auto most = std::max_element(angle.begin(), angle.end());
    EXPECT_GT(*most, 1.05 * felt.back());
    EXPECT_GT(dt * static_cast<double>(most - angle.begin()), 0.5 / kHertz);
}

TEST(BodyRoll, IsTheCarOfTheRollAxis) {
    // Segel's equations have the velocity of the roll axis, whose mass follows it only with
    // m h phi''. Integrated with steps so fine that any rule would do.
    const VehicleData car = saloon();
    const Parameters p = with_roll();
    const double arm = 0.8 * car.cg_height_m;
    const SingleTrack plain{car};
    ModelState<double> x{22.0};
    std::array<double, 5> axis{22.0, 0.0, 0.0, 0.0, 0.0};  // v_x, v_y, r, phi, phi'
    const double dt = 0.01;
    double most = 0.0;
    for (int k = 0; k < 300; ++k) {
        const Input from = lively(k * dt), to = lively((k + 1) * dt);
        advance(rolling(), x, kCalm.data(), from, to, p.data(), dt, 1);
        const int parts = 200;
        const auto rates = [&](double time, const std::array<double, 5>& at) {
            // Forces of the plain car at the velocity that its tyres have.
            const Input u = between(from, to, (time - k * dt) / dt);
            const auto e = evaluate(plain, {at[0], at[1], at[2]}, u, p);
            const double a_y = e.w.a_y;
            const double swing = kOmega * kOmega * (kRoll * a_y / kGravity - at[3]) -
                                 2.0 * kDamping * kOmega * at[4];
            // v_y of the centre of gravity is v_y - h phi'.
            return std::array<double, 5>{e.w.a_x + (at[1] - arm * at[4]) * at[2],
                                         a_y - at[0] * at[2] + arm * swing, e.rate[2], at[4],
                                         swing};
        };
        for (int n = 0; n < parts; ++n) {
            const double h = dt / parts, now = (k + static_cast<double>(n) / parts) * dt;
            const auto first = rates(now, axis);
            std::array<double, 5> middle = axis;
            for (std::size_t i = 0; i < 5; ++i) middle[i] += 0.5 * h * first[i];
            const auto then = rates(now + 0.5 * h, middle);
            for (std::size_t i = 0; i < 5; ++i) axis[i] += h * then[i];
        }
        EXPECT_NEAR(x[0], axis[0], 1e-5);
        EXPECT_NEAR(x[1], axis[1] - arm * axis[4], 2e-5);
        EXPECT_NEAR(x[2], axis[2], 2e-5);
        EXPECT_NEAR(kRoll * x[state_of("body_roll", 0)], axis[3], 1e-6);
        EXPECT_NEAR(kRoll * x[state_of("body_roll", 1)], axis[4], 1e-5);
        most = std::max(most, std::abs(axis[4]));
    }
    EXPECT_GT(most, 0.1);  // it did roll
}

TEST(BodyRoll, ErrorFallsWithTheFourthPowerOfTheStep) {
    for (const std::string id : {"body_roll", "front_roll_steer", "rear_roll_steer"}) {
        const SingleTrack model{saloon(), mask_of({id})};
        Parameters p = plain_parameters();
        p[parameter_of(id, 0)] = kRoll;
        p[parameter_of(id, 1)] = 4.0;
        const auto moved = [&](int parts) {
            ModelState<double> x{25.0, 0.3, 0.2};
            x[state_of(id, 0)] = 0.3;
            x[state_of(id, 1)] = -4.0;
            advance(model, x, kCalm.data(), {0.02, 1000.0}, {0.05, 3000.0}, p.data(), 0.2, parts);
            return x;
        };
        const auto finest = moved(4000);
        const auto error = [&](int parts) {
            const auto x = moved(parts);
            double most = 0.0;
            for (std::size_t i = 0; i < kModelStates; ++i)
                most = std::max(most, std::abs(x[i] - finest[i]));
            return most;
        };
        for (int parts : {8, 16}) EXPECT_GT(error(parts) / error(2 * parts), 13.0) << id;
    }
}

TEST(BodyRoll, OneStepASampleIsEnough) {
    // The error stays below a hundredth of what sensors read, where a period has ten samples.
    const std::array<double, kChannels> noise{0.05, 0.03, 0.003, 0.1, 0.1};
    const SingleTrack model = rolling();
    for (const double hertz : {0.5, 1.5, 3.0, 5.0}) {
        for (const double dt : {0.01, 0.02, 0.04}) {
            if (hertz * dt > 0.1) continue;
            const Parameters p = with_roll(kRoll, hertz);
            ModelState<double> x{25.0}, fine{25.0};
            for (int k = 0; k * dt < 3.0; ++k) {
                const Input from = lively(k * dt), to = lively((k + 1) * dt);
                advance(model, x, kCalm.data(), from, to, p.data(), dt,
                        substeps_for(model, p.data(), x[0], dt));
                advance(model, fine, kCalm.data(), from, to, p.data(), dt, 100);
                const auto y = sense(model, x, kCalm.data(), to, p.data());
                const auto z = sense(model, fine, kCalm.data(), to, p.data());
                for (std::size_t i = 0; i < kChannels; ++i)
                    EXPECT_NEAR(y[i], z[i], 0.01 * noise[i]) << hertz << " Hz, " << dt << " s";
            }
        }
    }
}

TEST(BodyRoll, StaysBoundedWhereAStepIsLongerThanItsPeriod) {
    VehicleData low = saloon();
    low.cg_height_m = 0.0;
    const SingleTrack model{low, mask_of({"body_roll"})};
    const Parameters p = with_roll(kRoll, 5.0);
    ModelState<double> x{20.0};
    x[state_of("body_roll", 0)] = 1.0;
    x[state_of("body_roll", 1)] = 20.0;
    for (int k = 0; k < 10; ++k) {
        advance(model, x, kCalm.data(), {}, {}, p.data(), 0.5, 1);
        EXPECT_LT(std::abs(x[state_of("body_roll", 0)]), 1.1);
    }
    EXPECT_NEAR(x[state_of("body_roll", 0)], 0.0, 1e-12);
}

TEST(Swing, FreeMotionIsExactWithItsDerivatives) {
    // Two halves make a whole, and it obeys its equation.
    using D = Dual<1>;
    for (const double w : {0.5, 9.0, 40.0}) {
        for (const double damping : {0.0, 0.3, 0.9}) {
            const double t = 0.17, h = 1e-4;
            const Swing<double> from{0.4, -3.0};
            const SwingFree<double> half(w, damping, 0.5 * t), whole(w, damping, t);
            const auto twice = half(half(from)), once = whole(from);
            EXPECT_NEAR(twice.angle, once.angle, 1e-14);
            EXPECT_NEAR(twice.rate, once.rate, 1e-12);
            const auto up = SwingFree<double>(w, damping, t + h)(from);
            const auto down = SwingFree<double>(w, damping, t - h)(from);
            EXPECT_NEAR(once.rate, (up.angle - down.angle) / (2.0 * h), 1e-4);
            EXPECT_NEAR((up.rate - down.rate) / (2.0 * h),
                        -2.0 * damping * w * once.rate - w * w * once.angle, 1e-2);
            const auto slope = SwingFree<D>(D::seeded(w, 0), damping, t)({D(0.4), D(-3.0)});
            const auto faster = SwingFree<double>(w + h, damping, t)(from);
            const auto slower = SwingFree<double>(w - h, damping, t)(from);
            EXPECT_NEAR(slope.angle.d[0], (faster.angle - slower.angle) / (2.0 * h), 1e-6);
            EXPECT_NEAR(slope.rate.d[0], (faster.rate - slower.rate) / (2.0 * h), 1e-5);
        }
    }
}

}  // namespace
}  // namespace sysid::test
