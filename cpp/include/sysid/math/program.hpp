// A calculation written down as a list of steps, to be done for many samples at once.
//
// The steps are those that `Recorded` numbers took (`math/recorded.hpp`). Each is done for
// `kLanes` samples side by side in whatever vector registers the processor has. Their derivatives
// come from one walk backwards: it costs the same for any number of inputs (Griewank & Walther,
// Evaluating Derivatives, 2nd ed., ch. 3).
#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

namespace sysid {

/// Samples that go through a program together.
constexpr int kLanes = 16;

/// One number for each of them.
struct alignas(64) LaneRow {
    double at[kLanes];
};

enum class Op : std::uint8_t {
    kInput,
    kUniform,  // the same in all lanes; its slopes by `a` and `b` are constants
    kAdd,
    kSubtract,
    kMultiply,
    kDivide,
    kPlus,       // a + constant
    kTakenFrom,  // constant - a
    kTimes,      // a * constant
    kUnder,      // constant / a
    kSin,
    kCos,
    kAtan,
    kDirection,  // atan2(a, b)
    kSqrt,
    kExp,
    kLog,
    kTanh,
    kAbs,
    kIfBelow,  // a < constant ? b : c
    kLagJ0,    // integrals J_n of a lag, see `LagWeights`
    kLagJ1,
    kLagJ2,
    kPhi1,  // phi_n(-z) of a stiff state, see `PhiWeights`
    kPhi2,
    kPhi3,
};

/// One step of a program: rows of its operands and of its result.
struct ForwardStep {
    Op op = Op::kInput;
    std::int32_t to = -1, a = -1, b = -1, c = -1;
    double constant = 0.0;
};

/// One step backwards: from the adjoint of a result to those of its operands. A slot holds as many
/// rows as the sweep has outputs; -1 where an operand has no derivative.
struct BackwardStep {
    Op op = Op::kInput;
    bool first_a = false, first_b = false, first_c = false;  // nothing stands in the slot yet
    std::int32_t to = -1, a = -1, b = -1;                    // rows of the values
    std::int32_t slot = -1, slot_a = -1, slot_b = -1, slot_c = -1;
    double constant = 0.0, slope_a = 0.0, slope_b = 0.0;
};

/// Outputs of one walk backwards.
constexpr int kSweep = 4;

/// A walk backwards from a few outputs.
struct Sweep {
    std::vector<int> outputs;         // their numbers
    std::vector<std::int32_t> seeds;  // slot of each of them, set to zero before
    std::vector<BackwardStep> steps;
    std::vector<std::int32_t> inputs;  // slot of each input; -1 where it has no part
    std::int32_t slots = 0;
};

/// `inputs` and `outputs`: rows; -1 for an input that has no part. An output that is an input
/// itself, or a constant, is in no sweep.
struct Program {
    std::vector<ForwardStep> steps;
    std::vector<std::int32_t> inputs, outputs;
    std::vector<int> same_as;                              // output: the input that it is, or -1
    std::vector<std::pair<std::int32_t, double>> uniform;  // rows and their values
    std::vector<Sweep> sweeps;
    std::int32_t rows = 0, slots = 0;
};

}  // namespace sysid
