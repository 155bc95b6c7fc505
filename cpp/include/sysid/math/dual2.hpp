// Forward-mode differentiation to the second order: a value, its gradient and its Hessian.
//
// For functions of a few parameters that are linearised and whose curvature is asked for as well;
// `Dual` is the faster choice where the gradient is enough.
#pragma once

#include <cmath>

#include "sysid/math/linear.hpp"

namespace sysid {

template <int N>
struct Dual2 {
    double v = 0.0;
    Vec<N> d = Vec<N>::Zero();
    Mat<N, N> dd = Mat<N, N>::Zero();

    Dual2() = default;
    Dual2(double value) : v(value) {}  // NOLINT(google-explicit-constructor): constants mix freely

    static Dual2 seeded(double value, int direction) {
        Dual2 x(value);
        x.d[direction] = 1.0;
        return x;
    }

    // f(a) with derivatives f'(a) and f''(a).
    static Dual2 chain(const Dual2& a, double value, double slope, double curvature) {
        Dual2 r(value);
        for (int j = 0; j < N; ++j) {
            r.d[j] = slope * a.d[j];
            for (int i = 0; i < N; ++i)
                r.dd(i, j) = slope * a.dd(i, j) + curvature * a.d[i] * a.d[j];
        }
        return r;
    }

    friend Dual2 operator-(const Dual2& a) { return chain(a, -a.v, -1.0, 0.0); }
    friend Dual2 operator+(const Dual2& a, const Dual2& b) {
        Dual2 r(a.v + b.v);
        for (int j = 0; j < N; ++j) {
            r.d[j] = a.d[j] + b.d[j];
            for (int i = 0; i < N; ++i) r.dd(i, j) = a.dd(i, j) + b.dd(i, j);
        }
        return r;
    }
    friend Dual2 operator-(const Dual2& a, const Dual2& b) { return a + (-b); }
    friend Dual2 operator*(const Dual2& a, const Dual2& b) {
        Dual2 r(a.v * b.v);
        for (int j = 0; j < N; ++j) {
            r.d[j] = a.v * b.d[j] + b.v * a.d[j];
            for (int i = 0; i < N; ++i)
                r.dd(i, j) =
                    a.v * b.dd(i, j) + b.v * a.dd(i, j) + a.d[i] * b.d[j] + b.d[i] * a.d[j];
        }
        return r;
    }
    friend Dual2 operator/(const Dual2& a, const Dual2& b) {
        const double inverse = 1.0 / b.v;
        return a * chain(b, inverse, -inverse * inverse, 2.0 * inverse * inverse * inverse);
    }

    friend Dual2 sin(const Dual2& a) {
        const double s = std::sin(a.v);
        return chain(a, s, std::cos(a.v), -s);
    }
    friend Dual2 tan(const Dual2& a) {
        const double t = std::tan(a.v);
        const double slope = 1.0 + t * t;
        return chain(a, t, slope, 2.0 * t * slope);
    }
    friend Dual2 atan(const Dual2& a) {
        const double slope = 1.0 / (1.0 + a.v * a.v);
        return chain(a, std::atan(a.v), slope, -2.0 * a.v * slope * slope);
    }
};

}  // namespace sysid
