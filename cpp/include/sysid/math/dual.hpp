// Forward-mode differentiation: a value and its derivatives in N directions.
//
// The model is written once, templated on its scalar. With `double` it simulates; with `Dual<N>`
// the same text yields exact derivatives. Plain arrays keep the loops visible to the compiler.
#pragma once

#include <array>
#include <cmath>
#include <type_traits>

namespace sysid {

/// atan2(y, x); forwards, where it is nearly always asked for, in half the time.
inline double direction(double y, double x) {
    return x > 0.0 ? std::atan(y / x) : std::atan2(y, x);
}

template <int N>
struct Dual {
    // The slopes first: pairs of them are then copied as they were calculated, which processors do
    // without waiting.
    std::array<double, N> d{};
    double v = 0.0;

    Dual() = default;
    Dual(double value) : v(value) {}  // NOLINT(google-explicit-constructor): constants mix freely

    static Dual seeded(double value, int direction) {
        Dual x(value);
        x.d[static_cast<std::size_t>(direction)] = 1.0;
        return x;
    }

    Dual& operator+=(const Dual& o) { return *this = *this + o; }
    Dual& operator-=(const Dual& o) { return *this = *this - o; }
    Dual& operator*=(const Dual& o) { return *this = *this * o; }
    Dual& operator/=(const Dual& o) { return *this = *this / o; }

    // f(a) with derivative f'(a): the chain rule every unary function below uses.
    static Dual chain(const Dual& a, double value, double slope) {
        Dual r(value);
        for (std::size_t i = 0; i < N; ++i) r.d[i] = slope * a.d[i];
        return r;
    }
    static Dual chain2(const Dual& a, const Dual& b, double value, double slope_a, double slope_b) {
        Dual r(value);
        for (std::size_t i = 0; i < N; ++i) r.d[i] = slope_a * a.d[i] + slope_b * b.d[i];
        return r;
    }

    friend Dual operator-(const Dual& a) { return chain(a, -a.v, -1.0); }
    friend Dual operator+(const Dual& a, const Dual& b) {
        return chain2(a, b, a.v + b.v, 1.0, 1.0);
    }
    friend Dual operator-(const Dual& a, const Dual& b) {
        return chain2(a, b, a.v - b.v, 1.0, -1.0);
    }
    friend Dual operator*(const Dual& a, const Dual& b) {
        return chain2(a, b, a.v * b.v, b.v, a.v);
    }
    friend Dual operator/(const Dual& a, const Dual& b) {
        const double inverse = 1.0 / b.v;
        const double value = a.v * inverse;
        return chain2(a, b, value, inverse, -value * inverse);
    }
    // Mixed with plain numbers, without paying for derivatives that are zero.
    friend Dual operator+(const Dual& a, double b) { return chain(a, a.v + b, 1.0); }
    friend Dual operator+(double a, const Dual& b) { return chain(b, a + b.v, 1.0); }
    friend Dual operator-(const Dual& a, double b) { return chain(a, a.v - b, 1.0); }
    friend Dual operator-(double a, const Dual& b) { return chain(b, a - b.v, -1.0); }
    friend Dual operator*(const Dual& a, double b) { return chain(a, a.v * b, b); }
    friend Dual operator*(double a, const Dual& b) { return chain(b, a * b.v, a); }
    friend Dual operator/(const Dual& a, double b) { return chain(a, a.v / b, 1.0 / b); }
    friend Dual operator/(double a, const Dual& b) { return chain(b, a / b.v, -a / (b.v * b.v)); }
    friend bool operator<(const Dual& a, const Dual& b) { return a.v < b.v; }
    friend bool operator>(const Dual& a, const Dual& b) { return a.v > b.v; }

    friend Dual sin(const Dual& a) { return chain(a, std::sin(a.v), std::cos(a.v)); }
    friend Dual cos(const Dual& a) { return chain(a, std::cos(a.v), -std::sin(a.v)); }
    friend Dual atan(const Dual& a) { return chain(a, std::atan(a.v), 1.0 / (1.0 + a.v * a.v)); }
    friend Dual direction(const Dual& y, const Dual& x) {
        const double per_square = 1.0 / (x.v * x.v + y.v * y.v);
        return chain2(y, x, direction(y.v, x.v), x.v * per_square, -y.v * per_square);
    }
    friend Dual atan2(const Dual& y, const Dual& x) { return direction(y, x); }
    friend Dual sqrt(const Dual& a) {
        const double root = std::sqrt(a.v);
        return chain(a, root, 0.5 / root);
    }
    friend Dual exp(const Dual& a) {
        const double e = std::exp(a.v);
        return chain(a, e, e);
    }
    friend Dual log(const Dual& a) { return chain(a, std::log(a.v), 1.0 / a.v); }
    friend Dual tanh(const Dual& a) {
        const double t = std::tanh(a.v);
        return chain(a, t, 1.0 - t * t);
    }
    friend Dual abs(const Dual& a) { return chain(a, std::abs(a.v), a.v < 0.0 ? -1.0 : 1.0); }
};

inline double value_of(double x) { return x; }
template <int N>
double value_of(const Dual<N>& x) {
    return x.v;
}

/// A choice between two numbers by a third one, which programs can write down (`Recorded`) where a
/// condition would have to be the same for all samples.
template <class S>
S if_below(const S& x, double limit, const S& below, const S& otherwise) {
    return value_of(x) < limit ? below : otherwise;
}

}  // namespace sysid
