// Every operation of the dual numbers against central differences.
#include "helpers.hpp"
#include "sysid/math/dual.hpp"

namespace sysid::test {
namespace {

using D = Dual<2>;

const std::vector<std::array<double, 2>> kPoints{
    {0.3, 1.7}, {-0.8, 0.45}, {2.5, -1.2}, {-1.9, -3.1}, {0.02, 6.0}};

/// `f` of two numbers: value and both derivatives at every point where `fits` holds.
template <class F, class Fits>
void expect_derivatives(F&& f, Fits&& fits) {
    int checked = 0;
    for (const auto& [a, b] : kPoints) {
        if (!fits(a, b)) continue;
        ++checked;
        const D r = f(D::seeded(a, 0), D::seeded(b, 1));
        const double value = f(a, b);
        const double by_a = central_difference(
            [&, b = b](double x) { return static_cast<double>(f(x, b)); }, a, 1e-3);
        const double by_b = central_difference(
            [&, a = a](double x) { return static_cast<double>(f(a, x)); }, b, 1e-3);
        EXPECT_NEAR(r.v, value, 1e-15 * (1.0 + std::abs(value))) << "at " << a << ", " << b;
        EXPECT_NEAR(r.d[0], by_a, 1e-8 * (1.0 + std::abs(by_a))) << "at " << a << ", " << b;
        EXPECT_NEAR(r.d[1], by_b, 1e-8 * (1.0 + std::abs(by_b))) << "at " << a << ", " << b;
    }
    EXPECT_GE(checked, 2);
}

template <class F>
void expect_derivatives(F&& f) {
    expect_derivatives(f, [](double, double) { return true; });
}

const auto kNotNearZero = [](double a, double) { return std::abs(a) > 0.1; };
const auto kPositive = [](double a, double) { return a > 0.1; };

TEST(Dual, ArithmeticOfTwo) {
    expect_derivatives([](const auto& a, const auto& b) { return a + b; });
    expect_derivatives([](const auto& a, const auto& b) { return a - b; });
    expect_derivatives([](const auto& a, const auto& b) { return a * b; });
    expect_derivatives([](const auto& a, const auto& b) { return a / b; });
    expect_derivatives([](const auto& a, const auto& b) { return -a + 0.0 * b; });
}

TEST(Dual, ArithmeticWithPlainNumbers) {
    expect_derivatives([](const auto& a, const auto& b) { return (a + 2.5) + (2.5 + b); });
    expect_derivatives([](const auto& a, const auto& b) { return (a - 2.5) + (2.5 - b); });
    expect_derivatives([](const auto& a, const auto& b) { return (a * 2.5) + (2.5 * b); });
    expect_derivatives([](const auto& a, const auto& b) { return (a / 2.5) + (2.5 / b); });
}

TEST(Dual, CompoundAssignment) {
    expect_derivatives([](const auto& a, const auto& b) {
        auto r = a;
        r += b;
        r *= a;
        r -= 3.0 * b;
        r /= b;
        return r;
    });
    expect_derivatives([](const auto& a, const auto& b) {
        auto r = a * b;
        r *= r;  // its own operand
        return r;
    });
}

TEST(Dual, Functions) {
    expect_derivatives([](const auto& a, const auto& b) {
        using std::sin;
        return sin(a) * b;
    });
    expect_derivatives([](const auto& a, const auto& b) {
        using std::cos;
        return cos(a) * b;
    });
    expect_derivatives([](const auto& a, const auto& b) {
        using std::atan;
        return atan(a) * b;
    });
    expect_derivatives([](const auto& a, const auto& b) {
        using std::exp;
        return exp(a) * b;
    });
    expect_derivatives(
        [](const auto& a, const auto& b) {
            using std::sqrt;
            return sqrt(a) * b;
        },
        kPositive);
    expect_derivatives(
        [](const auto& a, const auto& b) {
            using std::abs;
            return abs(a) * b;
        },
        kNotNearZero);
}

TEST(Dual, ArcTangentOfTwoInAllQuadrants) {
    expect_derivatives([](const auto& a, const auto& b) {
        using std::atan2;
        return atan2(a, b);
    });
}

TEST(Dual, ChainOfManyOperations) {
    expect_derivatives([](const auto& a, const auto& b) {
        using std::atan;
        using std::atan2;
        using std::exp;
        using std::sin;
        using std::sqrt;
        const auto slip = a - atan2(b + 0.4 * a, 3.0 + b * b);
        const auto force = 1.3 * sin(1.4 * atan(8.0 * slip - 0.3 * (8.0 * slip - atan(slip))));
        return exp(-0.1 * b) * force / sqrt(1.0 + force * force) - 2.0 / (4.0 + a * a);
    });
}

TEST(Dual, DirectionsDoNotMix) {
    const D a = D::seeded(0.7, 0);
    const D b = D::seeded(-1.3, 1);
    const D r = sin(a) + exp(b);
    EXPECT_DOUBLE_EQ(r.d[0], std::cos(0.7));
    EXPECT_DOUBLE_EQ(r.d[1], std::exp(-1.3));
    EXPECT_EQ(D(4.0).d, (std::array<double, 2>{}));
}

TEST(Dual, ComparesByValue) {
    EXPECT_TRUE(D::seeded(1.0, 0) < D::seeded(2.0, 1));
    EXPECT_FALSE(D::seeded(2.0, 0) < D::seeded(2.0, 1));
    EXPECT_TRUE(D::seeded(3.0, 0) > 2.0);
    EXPECT_DOUBLE_EQ(value_of(D::seeded(3.0, 0)), 3.0);
    EXPECT_DOUBLE_EQ(value_of(3.0), 3.0);
}

}  // namespace
}  // namespace sysid::test
