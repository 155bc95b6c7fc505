// Exact sampling of linear dynamics.
#pragma once

#include "sysid/math/linear.hpp"

namespace sysid {

/// Integral of exp(J s) over s from 0 to h. With it x' = J x + b moves to x + result (J x + b), and
/// exp(J h) = I + J result.
///
/// Scaling and doubling of the power series; relative error below 1e-12.
template <int N>
Mat<N, N> held_response(const Mat<N, N>& J, double h) {
    int doublings = 0;
    double part = h;
    // The row-sum norm bounds the spectral radius; 0.6^12 / 13! is below rounding. A long series
    // costs fewer products than another doubling.
    const double size = J.cwiseAbs().rowwise().sum().maxCoeff() * h;
    while (size * part > 0.6 * h && doublings < 60) {
        ++doublings;
        part *= 0.5;
    }
    const Mat<N, N> X = J * part;
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
    out = (part * (three(1.0, 0.5, 1.0 / 6.0) + X3 * out)).eval();
    const Mat<N, N> I = Mat<N, N>::Identity();
    for (; doublings > 0; --doublings) out = (out * (2.0 * I + J * out)).eval();
    return out;
}

}  // namespace sysid
