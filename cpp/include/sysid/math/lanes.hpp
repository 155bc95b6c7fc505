// Kernels that go through many samples or columns at once, compiled for several sets of
// instructions; which of them run is decided by the processor.
#pragma once

#include <cstddef>
#include <vector>

#include "sysid/math/program.hpp"

namespace sysid {

/// Samples of a regression on two friction curves, see `lab/tyre_fit.hpp`: slip angles, what a unit
/// of friction does to two readings, factors of three linear terms in the first, the readings.
struct CurveSamples {
    LaneRow alpha[2], first[2], second[2], rest[3], reading[2];
};
constexpr int kCurveParameters = 11;  // B, C, D, E of both curves, then the linear terms

struct LaneKernels {
    const char* name;
    void (*forward)(const ForwardStep* steps, std::size_t count, LaneRow* rows);
    /// `adjoints`: the slots, `outputs` rows each.
    void (*backward)(const BackwardStep* steps, std::size_t count, int outputs, const LaneRow* rows,
                     LaneRow* adjoints);
    /// Y += A X: `rows` rows of Y and `inner` rows of X of `width` numbers, a multiple of eight;
    /// the elements of A stand `row_stride` and `column_stride` apart. Those that are zero are left
    /// out.
    void (*add_product)(double* Y, const double* A, std::ptrdiff_t row_stride,
                        std::ptrdiff_t column_stride, const double* X, std::size_t rows,
                        std::size_t inner, std::size_t width);
    /// Adds G^T e and the lower triangle of G^T G of `rows` rows of `width` numbers; `e` may be
    /// nullptr.
    void (*add_squares)(const double* G, const double* e, std::size_t rows, std::size_t width,
                        double* gradient, double* information);
    /// Half the sum of squares of such a regression; where `gradient` is given, adds G^T e and the
    /// lower triangle of G^T G, minus the derivatives G by the first `wanted` parameters.
    double (*curve_squares)(const CurveSamples* samples, std::size_t count, const double* p,
                            int wanted, double* gradient, double* information);
};

/// The kernels for this processor; all give the same to rounding.
const LaneKernels& lane_kernels();

/// All that this processor can run, the plainest first.
std::vector<const LaneKernels*> all_lane_kernels();

/// Lets `lane_kernels` return these from now on, for tests and measurements.
void use_lane_kernels(const LaneKernels& kernels);

}  // namespace sysid
