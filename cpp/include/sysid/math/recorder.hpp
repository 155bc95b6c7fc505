// Makes a `Program` of what is done to `Recorded` numbers.
#pragma once

#include <bit>
#include <cstdint>
#include <unordered_map>
#include <utility>
#include <vector>

#include "sysid/math/program.hpp"
#include "sysid/math/recorded.hpp"

namespace sysid {

/// A step as it was spelled: `constant` is that of a `kUniform`, the limit of a `kIfBelow`, or -1
/// of a `kTimes`, which is a change of sign. No other step has one.
struct SpelledStep {
    Op op = Op::kInput;
    int a = -1, b = -1, c = -1;
    double constant = 0.0;
};

/// A calculation to be written as text; operands stand before what is made of them.
struct Spelled {
    std::vector<SpelledStep> steps;
    std::vector<int> inputs, outputs;                // their steps
    std::vector<std::pair<int, const char*>> names;  // of steps, in the order of their giving
    std::vector<std::pair<int, const char*>> parts;  // first steps and titles
};

class Recorder {
  public:
    Recorder() = default;
    /// One that spells: constants keep the place that they have in the source, conditions on
    /// parameters stay conditions, names are kept. For `spelled`, not for `program`.
    struct Spelling {};
    explicit Recorder(Spelling /*unused*/) : spells_(true) {}

    /// Lets an input stand for a constant wherever the source has it; where it spells.
    void stand_for(double constant, const Recorded& input);

    /// An input that differs from sample to sample; `active` where derivatives by it are wanted.
    Recorded input(bool active);
    /// One that has this value for all samples. Those without derivatives are steps too, so that a
    /// program is the same whatever it is differentiated by.
    Recorded parameter(double value, bool active);

    /// The steps that lead to these numbers; inputs are numbered in the order of their making.
    Program program(const std::vector<Recorded>& outputs) const;

    /// All steps, as they were spelled.
    Spelled spelled(const std::vector<Recorded>& outputs);

  private:
    friend struct RecordedAccess;

    struct Node {
        Op op = Op::kInput;
        int a = -1, b = -1, c = -1;
        double constant = 0.0, value = 0.0, slope_a = 0.0, slope_b = 0.0;
        bool uniform = false, active = false;
        bool same(const Node& o) const {
            return op == o.op && a == o.a && b == o.b && c == o.c &&
                   std::bit_cast<std::uint64_t>(constant) ==
                       std::bit_cast<std::uint64_t>(o.constant);
        }
    };

    /// What has been noted before is not noted twice.
    Recorded noted(const Node& node);
    /// A node of its own for a constant, where a step has no form for one.
    int node_of(const Recorded& x);
    /// The cosine of a sine and the other way round, which stand side by side; -1 for others.
    int partner_of(int node) const;
    void add_sweep(const std::vector<int>& nodes, const std::vector<int>& outputs,
                   const std::vector<int>& rows, Program& out) const;

    bool spells_ = false;
    std::vector<std::pair<int, const char*>> names_, parts_;
    std::unordered_map<std::uint64_t, int> stands_for_;  // constants, by their bits
    std::vector<Node> nodes_;
    std::vector<int> inputs_;
    std::unordered_multimap<std::size_t, int> known_;
};

}  // namespace sysid
