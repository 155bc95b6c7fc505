// Exact sampling of linear dynamics.
#pragma once

#include "sysid/math/linear.hpp"

namespace sysid {

/// Of x' = J x + b with b held over h: x moves to x + response (J x + b), and exp(J h) is
/// `transition`.
template <int N>
struct HeldResponse {
    Mat<N, N> response;    // integral of exp(J s) over s from 0 to h
    Mat<N, N> transition;  // I + J response
};

namespace detail {

/// The same by the power series, for a J h small enough that twelve terms do.
template <int N>
HeldResponse<N> short_response(const Mat<N, N>& J, double h) {
    const Mat<N, N> X = J * h;
    const Mat<N, N> X2 = X * X;
    const Mat<N, N> X3 = X2 * X;
    // Powers grouped by threes (Paterson & Stockmeyer, SIAM J. Comput. 1973): fewer products.
    const auto three = [&](double first, double second, double third) {
        Mat<N, N> sum = second * X + third * X2;
        sum.diagonal().array() += first;
        return sum;
    };
    Mat<N, N> out = three(1.0 / 3628800.0, 1.0 / 39916800.0, 1.0 / 479001600.0);
    out = (three(1.0 / 5040.0, 1.0 / 40320.0, 1.0 / 362880.0) + X3 * out).eval();
    out = (three(1.0 / 24.0, 1.0 / 120.0, 1.0 / 720.0) + X3 * out).eval();
    out = (h * (three(1.0, 0.5, 1.0 / 6.0) + X3 * out)).eval();
    Mat<N, N> transition = J * out;
    transition.diagonal().array() += 1.0;
    return {out, transition};
}

/// Of three states: X^3 = t X^2 - s X + d (Cayley and Hamilton) turns the series into one of three
/// numbers, and leaves a single product of matrices. Even and odd powers are summed side by side,
/// since each step of such a sum waits for the one before.
inline HeldResponse<3> short_response(const Mat<3, 3>& J, double h) {
    const Mat<3, 3> X = J * h;
    const Mat<3, 3> Y = X.lazyProduct(X);
    const double t = X.trace();
    const double s = 0.5 * (t * t - Y.trace());
    const double d = X.determinant();
    // The same three of Y = X^2.
    const double t_y = t * t - 2.0 * s;
    const double s_y = s * s - 2.0 * t * d;
    const double d_y = d * d;
    // a + b Y + c Y^2, by Horner's rule from the highest term on.
    struct Sum {
        double a, b, c;
    };
    const auto grow = [&](Sum& x, double next) {
        x = {next + d_y * x.c, x.a - s_y * x.c, x.b + t_y * x.c};
    };
    // X^k / (k + 1)! with k = 12, 10, ... and with k = 11, 9, ...
    Sum even{1.0 / 6227020800.0, 0.0, 0.0};
    Sum odd{1.0 / 479001600.0, 0.0, 0.0};
    constexpr double kEven[] = {
        1.0 / 39916800.0, 1.0 / 362880.0, 1.0 / 5040.0, 1.0 / 120.0, 1.0 / 6.0, 1.0,
    };
    constexpr double kOdd[] = {1.0 / 3628800.0, 1.0 / 40320.0, 1.0 / 720.0, 1.0 / 24.0, 0.5};
    for (int i = 0; i < 5; ++i) {
        grow(even, kEven[i]);
        grow(odd, kOdd[i]);
    }
    grow(even, kEven[5]);
    // Y^2 = t d + (d - t s) X + (t^2 - s) Y, and X times the odd ones.
    const auto in_x = [&](const Sum& x) {
        return Sum{x.a + x.c * t * d, x.c * (d - t * s), x.b + x.c * (t * t - s)};
    };
    const auto times_x = [&](const Sum& x) { return Sum{d * x.c, x.a - s * x.c, x.b + t * x.c}; };
    const Sum e = in_x(even);
    const Sum o = times_x(in_x(odd));
    const Sum all{e.a + o.a, e.b + o.b, e.c + o.c};
    const Sum more = times_x(all);
    HeldResponse<3> out;
    out.response = (h * all.b) * X + (h * all.c) * Y;
    out.response.diagonal().array() += h * all.a;
    out.transition = more.b * X + more.c * Y;
    out.transition.diagonal().array() += 1.0 + more.a;
    return out;
}

}  // namespace detail

/// Scaling and doubling of the power series; relative error below 1e-12.
template <int N>
HeldResponse<N> held_response(const Mat<N, N>& J, double h) {
    int doublings = 0;
    double part = h;
    // The row-sum norm bounds the spectral radius; 0.6^12 / 13! is below rounding. A long series
    // costs fewer products than another doubling.
    const double size = J.cwiseAbs().rowwise().sum().maxCoeff() * h;
    while (size * part > 0.6 * h && doublings < 60) {
        ++doublings;
        part *= 0.5;
    }
    HeldResponse<N> out = detail::short_response(J, part);
    for (; doublings > 0; --doublings) {
        out.response = (out.response + out.response * out.transition).eval();
        out.transition = (out.transition * out.transition).eval();
    }
    return out;
}

}  // namespace sysid
