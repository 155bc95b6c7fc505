// Formulas of users: what they give, on numbers and on dual numbers, and what is refused.
#include <gtest/gtest.h>

#include <cmath>

#include "sysid/effects/user_effect.hpp"

namespace sysid {
namespace {

using Op = Operation;

Instruction signal(Signal which) {
    return {Op::kSignal, {static_cast<std::size_t>(which), 0, 0}, 0.0};
}
Instruction parameter(std::size_t which) { return {Op::kParameter, {which, 0, 0}, 0.0}; }
Instruction step(Op operation, std::size_t a, std::size_t b = 0, std::size_t c = 0) {
    return {operation, {a, b, c}, 0.0};
}

// gain v_x^2 tanh(alpha_f)
Formula gust() {
    return {
        {
            parameter(0),
            signal(Signal::kVx),
            step(Op::kMultiply, 1, 1),
            step(Op::kMultiply, 0, 2),
            signal(Signal::kSlipFront),
            step(Op::kTanh, 4),
            step(Op::kMultiply, 3, 5),
        },
        1,
    };
}

TEST(Formula, GivesValuesAndExactDerivatives) {
    using D = Dual<2>;
    Workings<D> w;
    w.v_x = D::seeded(20.0, 0);
    w.alpha_f = D(0.3);
    const D p = D::seeded(0.5, 1);
    const D y = gust()(w, &p);
    EXPECT_DOUBLE_EQ(y.v, 0.5 * 400.0 * std::tanh(0.3));
    EXPECT_DOUBLE_EQ(y.d[0], 0.5 * 40.0 * std::tanh(0.3));
    EXPECT_DOUBLE_EQ(y.d[1], 400.0 * std::tanh(0.3));
}

TEST(Formula, ChoosesBetweenBranches) {
    const Formula larger({signal(Signal::kVy), signal(Signal::kYawRate), step(Op::kGreater, 0, 1),
                          step(Op::kSelect, 2, 0, 1)},
                         0);
    const Formula maximum({signal(Signal::kVy), signal(Signal::kYawRate), step(Op::kMaximum, 0, 1)},
                          0);
    const Formula minimum({signal(Signal::kVy), signal(Signal::kYawRate), step(Op::kMinimum, 0, 1)},
                          0);
    const double none = 0.0;
    Workings<double> w;
    for (const double v_y : {-1.0, 0.2, 3.0}) {
        w.v_y = v_y;
        w.r = 0.2;
        EXPECT_EQ(larger(w, &none), std::max(v_y, 0.2));
        EXPECT_EQ(maximum(w, &none), std::max(v_y, 0.2));
        EXPECT_EQ(minimum(w, &none), std::min(v_y, 0.2));
    }
}

TEST(Formula, RefusesWhatItCannotRead) {
    EXPECT_THROW(Formula({}, 1), std::invalid_argument);
    EXPECT_THROW(Formula({step(Op::kNegate, 0)}, 1), std::invalid_argument);
    EXPECT_THROW(Formula({parameter(1)}, 1), std::invalid_argument);
    EXPECT_THROW(Formula({signal(Signal::kSignals)}, 1), std::invalid_argument);
    EXPECT_THROW(Formula(std::vector<Instruction>(Formula::kLongest + 1), 1),
                 std::invalid_argument);
}

TEST(UserEffects, EachAddsWhereItIsMeantTo) {
    std::vector<UserEffect> two(2);
    two[0].slot = 0;
    two[0].acts = {{Target::kForceX, Formula({parameter(0)}, 1)},
                   {Target::kReadAy, Formula({parameter(0)}, 1)}};
    two[1].slot = 3;
    two[1].acts = {{Target::kMomentZ, Formula({parameter(1)}, 2)}};
    const UserEffects both = std::make_shared<const std::vector<UserEffect>>(two);
    std::array<double, user_offset(kUserEffects)> p{};
    p.at(user_offset(0)) = 7.0;
    p.at(user_offset(3) + 1) = 5.0;
    Workings<double> w;
    w.force_x = w.force_y = w.moment_z = w.fy_f = w.fy_r = 1.0;
    std::array<double, kChannels> y{};
    user_body(both, p.data(), w);
    EXPECT_EQ(w.force_x, 8.0);
    EXPECT_EQ(w.moment_z, 1.0);
    user_forces(both, p.data(), w);
    EXPECT_EQ(w.moment_z, 6.0);
    EXPECT_EQ(w.force_y, 1.0);
    user_sensors(both, p.data(), w, y.data());
    EXPECT_EQ(y[kAy], 7.0);
    EXPECT_EQ(y[kAx], 0.0);
    user_body(UserEffects(), p.data(), w);
    EXPECT_EQ(w.force_x, 8.0);
}

// The integrals by the rule of Simpson, with many pieces.
TEST(PhiWeights, AreTheirIntegrals) {
    for (const double z : {-3.0, -0.3, 0.0, 1e-9, 0.499, 0.501, 4.0, 60.0}) {
        const PhiWeights w(z);
        EXPECT_DOUBLE_EQ(w.value[0], std::exp(-z));
        constexpr int pieces = 20000;
        double factorial = 1.0;
        for (std::size_t n = 1; n < w.value.size(); ++n) {
            double value = 0.0, slope = 0.0;
            for (int i = 0; i <= pieces; ++i) {
                const double at = static_cast<double>(i) / pieces;
                const double weight = i == 0 || i == pieces ? 1.0 : (i % 2 == 1 ? 4.0 : 2.0);
                const double f = weight / (3.0 * pieces) * std::exp(-z * (1.0 - at)) *
                                 std::pow(at, static_cast<double>(n - 1)) / factorial;
                value += f;
                slope -= (1.0 - at) * f;
            }
            EXPECT_NEAR(w.value[n], value, 1e-8 * std::abs(value)) << z << ", " << n;
            EXPECT_NEAR(w.slope[n], slope, 1e-8 * std::abs(slope)) << z << ", " << n;
            factorial *= static_cast<double>(n);
        }
    }
}

}  // namespace
}  // namespace sysid
