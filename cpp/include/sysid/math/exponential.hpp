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
    // The row-sum norm bounds the spectral radius; 0.25^9 / 10! is far below rounding.
    const double size = J.cwiseAbs().rowwise().sum().maxCoeff() * h;
    while (size * part > 0.25 * h && doublings < 60) {
        ++doublings;
        part *= 0.5;
    }
    const Mat<N, N> I = Mat<N, N>::Identity();
    const Mat<N, N> X = J * part;
    const Mat<N, N> X2 = X * X;
    const Mat<N, N> X3 = X2 * X;
    // Powers grouped by threes (Paterson & Stockmeyer, SIAM J. Comput. 1973): fewer products.
    const Mat<N, N> top = (1.0 / 5040.0) * I + (1.0 / 40320.0) * X + (1.0 / 362880.0) * X2;
    const Mat<N, N> middle = (1.0 / 24.0) * I + (1.0 / 120.0) * X + (1.0 / 720.0) * X2 + X3 * top;
    Mat<N, N> out = part * (I + 0.5 * X + (1.0 / 6.0) * X2 + X3 * middle);
    for (; doublings > 0; --doublings) out = (out * (2.0 * I + J * out)).eval();
    return out;
}

}  // namespace sysid
