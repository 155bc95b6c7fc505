// The Magic Formula: zero, slope, symmetry, peak and what lies beyond it.
#include "helpers.hpp"
#include "sysid/math/dual.hpp"
#include "sysid/model/tyre.hpp"

namespace sysid::test {
namespace {

using Tyre = TyreCoefficients<double>;

const std::vector<Tyre> kTyres{
    {10.0, 1.4, 1.0, 0.0}, {12.0, 1.3, 1.1, -1.5}, {8.0, 1.6, 0.9, 0.6}, {20.0, 1.0, 1.4, -4.0}};

TEST(Tyre, NoForceWithoutSlip) {
    for (const Tyre& tyre : kTyres) EXPECT_EQ(magic_formula(0.0, tyre), 0.0);
}

TEST(Tyre, SlopeAtZeroIsBCD) {
    for (const Tyre& t : kTyres) {
        const auto f = magic_formula(Dual<1>::seeded(0.0, 0), t);
        EXPECT_NEAR(f.d[0], t.B * t.C * t.D, 1e-12 * t.B * t.C * t.D);
    }
}

TEST(Tyre, OddInTheSlipAngle) {
    for (const Tyre& tyre : kTyres)
        for (double alpha = 0.01; alpha < 0.6; alpha += 0.05)
            EXPECT_DOUBLE_EQ(magic_formula(-alpha, tyre), -magic_formula(alpha, tyre));
}

TEST(Tyre, PeakIsD) {
    for (const Tyre& tyre : kTyres) {
        double most = 0.0;
        for (double alpha = 0.0; alpha < 4.0; alpha += 1e-4)
            most = std::max(most, magic_formula(alpha, tyre));
        EXPECT_LE(most, tyre.D * (1.0 + 1e-15));
        // With C = 1 the argument of the sine only tends to its peak at pi/2.
        EXPECT_NEAR(most, tyre.D, tyre.C > 1.0 ? 1e-6 : 1e-2);
    }
}

TEST(Tyre, PeakSlipAngleOfSimplifiedFormula) {
    // Without E the sine peaks where C atan(B alpha) = pi/2.
    const Tyre tyre{10.0, 1.4, 1.0, 0.0};
    const double peak = std::tan(std::acos(-1.0) / (2.0 * tyre.C)) / tyre.B;
    EXPECT_NEAR(magic_formula(peak, tyre), tyre.D, 1e-14);
    EXPECT_LT(magic_formula(peak + 0.05, tyre), tyre.D - 1e-3);
    EXPECT_LT(magic_formula(peak - 0.05, tyre), tyre.D - 1e-3);
}

TEST(Tyre, TendsToSineOfC) {
    // Far beyond the peak F_y/(D F_z) = sin(C pi/2), independent of B (and of E below 1).
    const double half_pi = std::acos(0.0);
    for (const Tyre& tyre : kTyres)
        EXPECT_NEAR(magic_formula(1e6, tyre), tyre.D * std::sin(tyre.C * half_pi), 1e-4);
}

TEST(Tyre, CurvatureFactorActsBeyondTheLinearRange) {
    const Tyre round{10.0, 1.4, 1.0, 0.5};
    const Tyre sharp{10.0, 1.4, 1.0, -2.0};
    EXPECT_NEAR(magic_formula(1e-4, round), magic_formula(1e-4, sharp), 1e-8);
    EXPECT_LT(magic_formula(0.1, round), magic_formula(0.1, sharp) - 0.01);
}

}  // namespace
}  // namespace sysid::test
