// Products of small matrices by plain loops over sizes the compiler knows.
//
// The covariance algebra of a filter is a dozen of these for each size of model. Eigen's own
// products give the same code, but each is a hundred templates to compile.
#pragma once

#include "sysid/math/linear.hpp"

namespace sysid {

/// out += sign A B, element by element over plain columns.
template <int R, int K, int C>
inline void add_product(const double* A, const double* B, double sign, double* out) {
    for (int j = 0; j < C; ++j)
        for (int k = 0; k < K; ++k) {
            const double b = sign * B[k + K * j];
            for (int i = 0; i < R; ++i) out[i + R * j] += A[i + R * k] * b;
        }
}

/// A B.
template <int R, int K, int C>
inline Mat<R, C> times(const Mat<R, K>& A, const Mat<K, C>& B) {
    Mat<R, C> out = Mat<R, C>::Zero();
    add_product<R, K, C>(A.data(), B.data(), 1.0, out.data());
    return out;
}

/// A'.
template <int R, int C>
inline Mat<C, R> transposed(const Mat<R, C>& A) {
    Mat<C, R> out;
    const double* from = A.data();
    double* to = out.data();
    for (int i = 0; i < R; ++i)
        for (int j = 0; j < C; ++j) to[j + C * i] = from[i + R * j];
    return out;
}

/// A B'.
template <int R, int K, int C>
inline Mat<R, C> times_transposed(const Mat<R, K>& A, const Mat<C, K>& B) {
    return times<R, K, C>(A, transposed<C, K>(B));
}

/// A' B.
template <int R, int K, int C>
inline Mat<R, C> transposed_times(const Mat<K, R>& A, const Mat<K, C>& B) {
    return times<R, K, C>(transposed<K, R>(A), B);
}

/// Adds the lower triangle of A A'.
template <int R, int K>
inline void add_square(const Mat<R, K>& A, Mat<R, R>& out) {
    for (int j = 0; j < R; ++j)
        for (int k = 0; k < K; ++k) {
            const double b = A(j, k);
            const double* from = A.data() + R * k;
            double* to = out.data() + R * j;
            for (int i = j; i < R; ++i) to[i] += from[i] * b;
        }
}

/// X - A B'.
template <int R, int K, int C>
inline Mat<R, C> less_times_transposed(const Mat<R, C>& X, const Mat<R, K>& A, const Mat<C, K>& B) {
    Mat<R, C> out = X;
    const Mat<K, C> turned = transposed<C, K>(B);
    add_product<R, K, C>(A.data(), turned.data(), -1.0, out.data());
    return out;
}

}  // namespace sysid
