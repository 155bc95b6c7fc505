#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <stdexcept>

#include "sysid/math/lag_weights.hpp"
#include "sysid/math/recorder.hpp"
#include "sysid/math/whole.hpp"

namespace sysid {

namespace {

/// Value and slopes of a step on numbers that are known.
struct Evaluated {
    double value, slope_a, slope_b;
};

Evaluated evaluated(Op op, double a, double b, double constant) {
    switch (op) {
        case Op::kAdd:
            return {a + b, 1.0, 1.0};
        case Op::kSubtract:
            return {a - b, 1.0, -1.0};
        case Op::kMultiply:
            return {a * b, b, a};
        case Op::kDivide:
            return {a / b, 1.0 / b, -a / (b * b)};
        case Op::kPlus:
            return {a + constant, 1.0, 0.0};
        case Op::kTakenFrom:
            return {constant - a, -1.0, 0.0};
        case Op::kTimes:
            return {a * constant, constant, 0.0};
        case Op::kUnder:
            return {constant / a, -constant / (a * a), 0.0};
        case Op::kSin:
            return {std::sin(a), std::cos(a), 0.0};
        case Op::kCos:
            return {std::cos(a), -std::sin(a), 0.0};
        case Op::kAtan:
            return {std::atan(a), 1.0 / (1.0 + a * a), 0.0};
        case Op::kDirection: {
            const double per_square = 1.0 / (a * a + b * b);
            return {direction(a, b), b * per_square, -a * per_square};
        }
        case Op::kSqrt:
            return {std::sqrt(a), 0.5 / std::sqrt(a), 0.0};
        case Op::kExp:
            return {std::exp(a), std::exp(a), 0.0};
        case Op::kLog:
            return {std::log(a), 1.0 / a, 0.0};
        case Op::kTanh:
            return {std::tanh(a), 1.0 - std::tanh(a) * std::tanh(a), 0.0};
        case Op::kAbs:
            return {std::abs(a), a < 0.0 ? -1.0 : 1.0, 0.0};
        case Op::kLagJ0:
        case Op::kLagJ1:
        case Op::kLagJ2: {
            const LagWeights<double> w(a);
            if (op == Op::kLagJ0) return {w.J0, w.kept, 0.0};
            if (op == Op::kLagJ1) return {w.J1, w.J1_slope, 0.0};
            return {w.J2, w.J2_slope, 0.0};
        }
        case Op::kPhi1:
        case Op::kPhi2:
        case Op::kPhi3: {
            const PhiWeights w(a);
            const auto n = static_cast<std::size_t>(op) - static_cast<std::size_t>(Op::kPhi1) + 1;
            return {w.value[n], w.slope[n], 0.0};
        }
        default:
            break;
    }
    throw std::logic_error("recorded: a step without a value");
}

}  // namespace

/// What the operators below need of a `Recorded`.
struct RecordedAccess {
    static Recorded one(Op op, const Recorded& a, double constant = 0.0) {
        if (a.to_ == nullptr) return evaluated(op, a.v_, 0.0, constant).value;
        Recorder::Node n;
        n.op = op;
        n.a = a.node_;
        n.constant = constant;
        return a.to_->noted(n);
    }
    static Recorded two(Op op, const Recorded& a, const Recorded& b) {
        Recorder* to = a.to_ != nullptr ? a.to_ : b.to_;
        if (to == nullptr) return evaluated(op, a.v_, b.v_, 0.0).value;
        Recorder::Node n;
        n.op = op;
        n.a = to->node_of(a);
        n.b = to->node_of(b);
        if ((op == Op::kAdd || op == Op::kMultiply) && n.a > n.b) std::swap(n.a, n.b);
        return to->noted(n);
    }
    static Recorded choice(const Recorded& x, double limit, const Recorded& below,
                           const Recorded& otherwise) {
        if (same_for_all(x)) return x.v_ < limit ? below : otherwise;
        Recorder::Node n;
        n.op = Op::kIfBelow;
        n.a = x.node_;
        n.b = x.to_->node_of(below);
        n.c = x.to_->node_of(otherwise);
        n.constant = limit;
        return n.b == n.c ? below : x.to_->noted(n);
    }
    static bool same_for_all(const Recorded& x) {
        return x.to_ == nullptr || x.to_->nodes_[static_cast<std::size_t>(x.node_)].uniform;
    }
};

Recorded operator-(const Recorded& a) { return RecordedAccess::one(Op::kTimes, a, -1.0); }

Recorded operator+(const Recorded& a, const Recorded& b) {
    if (a.to_ != nullptr && b.to_ != nullptr) return RecordedAccess::two(Op::kAdd, a, b);
    const Recorded& varying = a.to_ != nullptr ? a : b;
    const Recorded& constant = a.to_ != nullptr ? b : a;
    return constant.v_ == 0.0 ? varying : RecordedAccess::one(Op::kPlus, varying, constant.v_);
}

Recorded operator-(const Recorded& a, const Recorded& b) {
    if (a.to_ != nullptr && b.to_ != nullptr) return RecordedAccess::two(Op::kSubtract, a, b);
    if (b.to_ == nullptr) return a + Recorded(-b.v_);
    return RecordedAccess::one(Op::kTakenFrom, b, a.v_);
}

Recorded operator*(const Recorded& a, const Recorded& b) {
    if (a.to_ != nullptr && b.to_ != nullptr) return RecordedAccess::two(Op::kMultiply, a, b);
    const Recorded& varying = a.to_ != nullptr ? a : b;
    const double constant = a.to_ != nullptr ? b.v_ : a.v_;
    if (constant == 0.0) return 0.0;
    return constant == 1.0 ? varying : RecordedAccess::one(Op::kTimes, varying, constant);
}

Recorded operator/(const Recorded& a, const Recorded& b) {
    if (a.to_ != nullptr && b.to_ != nullptr) return RecordedAccess::two(Op::kDivide, a, b);
    if (b.to_ == nullptr) return a.to_ == nullptr ? Recorded(a.v_ / b.v_) : a * (1.0 / b.v_);
    return a.v_ == 0.0 ? Recorded(0.0) : RecordedAccess::one(Op::kUnder, b, a.v_);
}

// Sine and cosine are worked out together: each is the other's slope.
Recorded sin(const Recorded& a) {
    Recorded sine = RecordedAccess::one(Op::kSin, a);
    RecordedAccess::one(Op::kCos, a);
    return sine;
}
Recorded cos(const Recorded& a) {
    RecordedAccess::one(Op::kSin, a);
    return RecordedAccess::one(Op::kCos, a);
}
Recorded atan(const Recorded& a) { return RecordedAccess::one(Op::kAtan, a); }
Recorded sqrt(const Recorded& a) { return RecordedAccess::one(Op::kSqrt, a); }
Recorded exp(const Recorded& a) { return RecordedAccess::one(Op::kExp, a); }
Recorded log(const Recorded& a) { return RecordedAccess::one(Op::kLog, a); }
Recorded tanh(const Recorded& a) { return RecordedAccess::one(Op::kTanh, a); }
Recorded abs(const Recorded& a) { return RecordedAccess::one(Op::kAbs, a); }
Recorded direction(const Recorded& y, const Recorded& x) {
    return RecordedAccess::two(Op::kDirection, y, x);
}

Recorded lag_integral(const Recorded& z, int n) {
    constexpr std::array<Op, 3> kOps{Op::kLagJ0, Op::kLagJ1, Op::kLagJ2};
    return RecordedAccess::one(kOps.at(static_cast<std::size_t>(n)), z);
}

Recorded phi_weight(const Recorded& z, int n) {
    constexpr std::array<Op, 3> kOps{Op::kPhi1, Op::kPhi2, Op::kPhi3};
    return RecordedAccess::one(kOps.at(static_cast<std::size_t>(n - 1)), z);
}

Recorded if_below(const Recorded& x, double limit, const Recorded& below,
                  const Recorded& otherwise) {
    return RecordedAccess::choice(x, limit, below, otherwise);
}

double value_of(const Recorded& x) {
    if (!RecordedAccess::same_for_all(x))
        throw std::logic_error("recorded: a condition on what differs from sample to sample");
    return x.v_;
}

Recorded Recorder::input(bool active) {
    Node n;
    n.active = active;
    n.value = std::numeric_limits<double>::quiet_NaN();
    nodes_.push_back(n);
    const int at = static_cast<int>(nodes_.size()) - 1;
    inputs_.push_back(at);
    return {n.value, at, this};
}

Recorded Recorder::parameter(double value, bool active) {
    const int at = input(active).node_;
    Node& n = nodes_[static_cast<std::size_t>(at)];
    n.uniform = true;
    n.value = value;
    return {value, at, this};
}

int Recorder::node_of(const Recorded& x) {
    if (x.to_ != nullptr) return x.node_;
    Node n;
    n.op = Op::kUniform;
    n.constant = x.v_;
    return noted(n).node_;
}

Recorded Recorder::noted(const Node& node) {
    std::size_t key = std::hash<double>{}(node.constant);
    for (const int part : {static_cast<int>(node.op), node.a, node.b, node.c})
        key = key * 1000003U + static_cast<std::size_t>(part + 1);
    const auto [first, last] = known_.equal_range(key);
    for (auto it = first; it != last; ++it)
        if (const Node& old = nodes_[static_cast<std::size_t>(it->second)]; old.same(node))
            return {old.value, it->second, this};
    Node n = node;
    n.uniform = n.op != Op::kIfBelow;
    n.value = std::numeric_limits<double>::quiet_NaN();
    const auto at = [&](int i) -> const Node& { return nodes_[static_cast<std::size_t>(i)]; };
    for (const int operand : {n.a, n.b, n.c}) {
        if (operand < 0) continue;
        n.uniform = n.uniform && at(operand).uniform;
        n.active = n.active || at(operand).active;
    }
    if (n.op == Op::kUniform) {
        n.value = n.constant;
    } else if (n.uniform) {
        const Evaluated k =
            evaluated(n.op, at(n.a).value, n.b < 0 ? 0.0 : at(n.b).value, n.constant);
        n.value = k.value;
        n.slope_a = k.slope_a;
        n.slope_b = k.slope_b;
    }
    nodes_.push_back(n);
    const int place = static_cast<int>(nodes_.size()) - 1;
    known_.emplace(key, place);
    return {n.value, place, this};
}

int Recorder::partner_of(int node) const {
    const Node& n = nodes_[index(node)];
    if (n.uniform) return -1;
    if (n.op == Op::kSin) return node + 1;
    return n.op == Op::kCos ? node - 1 : -1;
}

Program Recorder::program(const std::vector<Recorded>& outputs) const {
    std::vector<bool> needed(nodes_.size(), false), kept(nodes_.size(), false);
    for (const Recorded& x : outputs)
        if (x.to_ != nullptr) needed[index(x.node_)] = kept[index(x.node_)] = true;
    for (std::size_t i = nodes_.size(); i-- > 0;) {
        if (!needed[i]) continue;
        if (const int partner = partner_of(static_cast<int>(i)); partner >= 0)
            needed[index(partner)] = kept[index(partner)] = true;
        for (const int operand : {nodes_[i].a, nodes_[i].b, nodes_[i].c}) {
            if (operand < 0) continue;
            needed[index(operand)] = true;
            if (!nodes_[i].uniform) kept[index(operand)] = true;
        }
    }
    Program out;
    std::vector<int> rows(nodes_.size() + 1, -1);
    for (std::size_t i = 0; i < nodes_.size(); ++i) {
        const Node& n = nodes_[i];
        if (!needed[i] || (n.uniform && !kept[i])) continue;
        rows[i] = out.rows++;
        if (n.uniform) out.uniform.emplace_back(rows[i], n.value);
    }
    for (std::size_t i = 0; i < nodes_.size(); ++i) {
        const Node& n = nodes_[i];
        if (rows[i] < 0 || n.uniform || n.op == Op::kInput || n.op == Op::kCos) continue;
        ForwardStep step;
        step.op = n.op;
        step.to = rows[i];
        step.constant = n.constant;
        if (n.a >= 0) step.a = rows[index(n.a)];
        if (n.b >= 0) step.b = rows[index(n.b)];
        if (n.c >= 0) step.c = rows[index(n.c)];
        if (n.op == Op::kSin) step.b = rows[index(partner_of(static_cast<int>(i)))];
        out.steps.push_back(step);
    }
    for (const int i : inputs_) out.inputs.push_back(rows[index(i)]);
    std::vector<int> nodes, group;
    for (std::size_t o = 0; o < outputs.size(); ++o) {
        const Recorded& x = outputs[o];
        int same_as = -1;
        if (x.to_ == nullptr) {
            out.outputs.push_back(out.rows++);
            out.uniform.emplace_back(out.outputs.back(), x.v_);
        } else {
            out.outputs.push_back(rows[index(x.node_)]);
            for (std::size_t i = 0; i < inputs_.size(); ++i)
                if (inputs_[i] == x.node_ && nodes_[index(x.node_)].active)
                    same_as = static_cast<int>(i);
        }
        out.same_as.push_back(same_as);
        nodes.push_back(x.node_);
        if (x.to_ != nullptr && same_as < 0 && nodes_[index(x.node_)].active)
            group.push_back(static_cast<int>(o));
    }
    for (std::size_t first = 0; first < group.size(); first += kSweep) {
        const std::size_t last = std::min(group.size(), first + kSweep);
        add_sweep(nodes,
                  {group.begin() + static_cast<std::ptrdiff_t>(first),
                   group.begin() + static_cast<std::ptrdiff_t>(last)},
                  rows, out);
    }
    return out;
}

void Recorder::add_sweep(const std::vector<int>& nodes, const std::vector<int>& outputs,
                         const std::vector<int>& rows, Program& out) const {
    Sweep sweep;
    sweep.outputs = outputs;
    std::vector<int> slots(nodes_.size(), -1), unused;
    const auto slot_for = [&](int node) {
        int& slot = slots[index(node)];
        if (slot >= 0) return false;
        if (unused.empty()) {
            slot = sweep.slots++;
        } else {
            slot = unused.back();
            unused.pop_back();
        }
        return true;
    };
    for (const int o : outputs) {
        slot_for(nodes[index(o)]);
        sweep.seeds.push_back(slots[index(nodes[index(o)])]);
    }
    for (std::size_t i = nodes_.size(); i-- > 0;) {
        const Node& n = nodes_[i];
        if (slots[i] < 0 || n.op == Op::kInput) continue;
        BackwardStep step;
        step.op = n.uniform ? Op::kUniform : n.op;
        step.slot = slots[i];
        step.to = rows[i];
        step.constant = n.constant;
        step.slope_a = n.slope_a;
        step.slope_b = n.slope_b;
        if (n.a >= 0) step.a = rows[index(n.a)];
        if (n.b >= 0) step.b = rows[index(n.b)];
        if (const int partner = partner_of(static_cast<int>(i)); partner >= 0)
            step.b = rows[index(partner)];
        const auto operand = [&](int node, std::int32_t& slot, bool& first) {
            if (node < 0 || !nodes_[index(node)].active) return;
            first = slot_for(node);
            slot = slots[index(node)];
        };
        if (n.op != Op::kIfBelow) operand(n.a, step.slot_a, step.first_a);
        operand(n.b, step.slot_b, step.first_b);
        operand(n.c, step.slot_c, step.first_c);
        sweep.steps.push_back(step);
        unused.push_back(slots[i]);
    }
    for (const int i : inputs_) sweep.inputs.push_back(slots[index(i)]);
    out.slots = std::max(out.slots, sweep.slots);
    out.sweeps.push_back(std::move(sweep));
}

}  // namespace sysid
