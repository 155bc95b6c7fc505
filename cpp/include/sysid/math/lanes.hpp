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

/// Readings of a filter in each lane, with noise that is not correlated: one after the other.
struct LaneUpdate {
    std::size_t states = 0, readings = 0;
    const LaneRow* const* observation = nullptr;  // readings x states; nullptr for zero
    const LaneRow* noise = nullptr;               // variances
    const LaneRow* present = nullptr;             // one, or zero where there is no reading
    LaneRow* innovation = nullptr;  // becomes that of the state that has seen the readings before
    LaneRow* variance = nullptr;    // of that one
    LaneRow* gain = nullptr;        // states x readings, of the innovations of the whole sample
    LaneRow* whitener = nullptr;    // of those, a lower triangle
};
/// The same of one filter alone: matrices of states stand row after row, `stride` numbers each, a
/// multiple of eight.
struct RowUpdate {
    std::size_t states = 0, readings = 0, stride = 0, observation_stride = 0;
    const double* observation = nullptr;  // readings x states
    const double* noise = nullptr;        // variances
    const bool* present = nullptr;
    double* innovation = nullptr;  // becomes that of the state that has seen the readings before
    double* variance = nullptr;    // of that one
    double* gain = nullptr;        // readings x states, of the innovations of the whole sample
    double* whitener = nullptr;    // of those, a lower triangle
};
/// Derivatives of mean and covariance of one filter by `width` parameters of its noise, a multiple
/// of eight; the first are those of the `kScoredReadings` readings.
struct LaneScore {
    std::size_t states = 0, width = 0;
    const double* observation = nullptr;  // readings x states
    const double* gain = nullptr;         // states x readings
    const double* whitener = nullptr;     // lower triangle
    const double* innovation = nullptr;   // zero where there is no reading
    const double* sensor = nullptr;       // of each variance by its own parameter; zero likewise
    double* mean = nullptr;               // states x width
    double* covariance = nullptr;         // lower triangle x width
    /// Whose squares add up to the information: of L^-1 dS L^-T the lower triangle, with the
    /// diagonal over the root of two, each row followed by that of L^-1 H dx.
    double* rows = nullptr;
};
constexpr std::size_t kMostLaneStates = 40, kMostLaneReadings = 8, kScoredReadings = 5;

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
    /// Adds G^T e and the lower triangle of G^T G of `rows` rows of `width` numbers, a multiple of
    /// eight; what is above that triangle is left undefined. `e` may be nullptr.
    void (*add_squares)(const double* G, const double* e, std::size_t rows, std::size_t width,
                        double* gradient, double* information);
    /// Half the sum of squares of such a regression; where `gradient` is given, adds G^T e and the
    /// lower triangle of G^T G, minus the derivatives G by the first `wanted` parameters.
    double (*curve_squares)(const CurveSamples* samples, std::size_t count, const double* p,
                            int wanted, double* gradient, double* information);
    /// A P A' in place of P, of which the lower triangle is kept. The first `moving` of the `n`
    /// rows of A are given, nullptr for zero; the others are those of the unit matrix.
    void (*propagate)(const LaneRow* const* A, std::size_t moving, std::size_t n, LaneRow* P);
    /// Scales the other states by `forget`, then adds `noise` to the variances.
    void (*disturb)(const LaneRow* forget, const LaneRow* noise, std::size_t moving, std::size_t n,
                    LaneRow* P);
    /// Mean and covariance after the readings.
    void (*correct)(const LaneUpdate& u, LaneRow* x, LaneRow* P);
    /// A P A' plus the diagonal `noise` in place of P, of a filter alone; A stands column after
    /// column.
    void (*propagate_rows)(const double* A, const double* noise, std::size_t n, std::size_t stride,
                           double* P);
    /// Mean and covariance of a filter alone after the readings.
    void (*correct_rows)(const RowUpdate& u, double* x, double* P);
    /// The derivatives after the readings, and `rows`.
    void (*score_update)(const LaneScore& s);
    /// The derivatives at the next sample: the first `moving` states have rows of A (moving x
    /// states), the others are scaled.
    void (*score_predict)(const double* A, std::size_t moving, const double* forget,
                          const LaneScore& s);
};

/// The kernels for this processor; all give the same to rounding.
const LaneKernels& lane_kernels();

/// All that this processor can run, the plainest first.
std::vector<const LaneKernels*> all_lane_kernels();

/// Lets `lane_kernels` return these from now on, for tests and measurements.
void use_lane_kernels(const LaneKernels& kernels);

}  // namespace sysid
