#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <stdexcept>

#include "sysid/math/lag_weights.hpp"
#include "sysid/math/recorder.hpp"

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
        const bool either = !to->spells_ && (op == Op::kAdd || op == Op::kMultiply);
        if (either && n.a > n.b) std::swap(n.a, n.b);
        return to->noted(n);
    }
    static Recorded choice(const Recorded& x, double limit, const Recorded& below,
                           const Recorded& otherwise) {
        if (x.to_ == nullptr || (same_for_all(x) && !x.to_->spells_))
            return x.v_ < limit ? below : otherwise;
        Recorder::Node n;
        n.op = Op::kIfBelow;
        n.a = x.node_;
        n.b = x.to_->node_of(below);
        n.c = x.to_->node_of(otherwise);
        n.constant = limit;
        return n.b == n.c ? below : x.to_->noted(n);
    }
    static void name(const char* name, const Recorded& x) {
        if (x.to_ == nullptr || !x.to_->spells_) return;
        auto& names = x.to_->names_;
        const auto of = [&](const auto& known) { return known.first == x.node_; };
        const Op op = x.to_->nodes_[static_cast<std::size_t>(x.node_)].op;
        if (op != Op::kInput && !std::ranges::any_of(names, of)) names.emplace_back(x.node_, name);
    }
    static void part(const char* title, const Recorded& x) {
        if (x.to_ != nullptr && x.to_->spells_)
            x.to_->parts_.emplace_back(static_cast<int>(x.to_->nodes_.size()), title);
    }
    static bool spells(const Recorded& a, const Recorded& b) {
        return (a.to_ != nullptr && a.to_->spells_) || (b.to_ != nullptr && b.to_->spells_);
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
    if (constant.v_ == 0.0) return varying;
    return RecordedAccess::spells(a, b) ? RecordedAccess::two(Op::kAdd, a, b)
                                        : RecordedAccess::one(Op::kPlus, varying, constant.v_);
}

Recorded operator-(const Recorded& a, const Recorded& b) {
    if (a.to_ != nullptr && b.to_ != nullptr) return RecordedAccess::two(Op::kSubtract, a, b);
    if (RecordedAccess::spells(a, b)) {
        if (a.to_ == nullptr && a.v_ == 0.0) return -b;
        return b.to_ == nullptr && b.v_ == 0.0 ? a : RecordedAccess::two(Op::kSubtract, a, b);
    }
    if (b.to_ == nullptr) return a + Recorded(-b.v_);
    return RecordedAccess::one(Op::kTakenFrom, b, a.v_);
}

Recorded operator*(const Recorded& a, const Recorded& b) {
    if (a.to_ != nullptr && b.to_ != nullptr) return RecordedAccess::two(Op::kMultiply, a, b);
    const Recorded& varying = a.to_ != nullptr ? a : b;
    const double constant = a.to_ != nullptr ? b.v_ : a.v_;
    if (constant == 0.0) return 0.0;
    if (constant == 1.0) return varying;
    return RecordedAccess::spells(a, b) ? RecordedAccess::two(Op::kMultiply, a, b)
                                        : RecordedAccess::one(Op::kTimes, varying, constant);
}

Recorded operator/(const Recorded& a, const Recorded& b) {
    if (a.to_ != nullptr && b.to_ != nullptr) return RecordedAccess::two(Op::kDivide, a, b);
    if (a.to_ == nullptr && b.to_ == nullptr) return a.v_ / b.v_;
    if (a.to_ == nullptr && a.v_ == 0.0) return 0.0;
    if (RecordedAccess::spells(a, b))
        return b.to_ == nullptr && b.v_ == 1.0 ? a : RecordedAccess::two(Op::kDivide, a, b);
    if (b.to_ == nullptr) return a * (1.0 / b.v_);
    return RecordedAccess::one(Op::kUnder, b, a.v_);
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

bool spells(const Recorded& x) { return RecordedAccess::spells(x, x); }
void name_step(const char* name, const Recorded& x) { RecordedAccess::name(name, x); }
void begin_part(const char* title, const Recorded& x) { RecordedAccess::part(title, x); }

void Recorder::stand_for(double constant, const Recorded& input) {
    stands_for_[std::bit_cast<std::uint64_t>(constant)] = input.node_;
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
    const auto stands = stands_for_.find(std::bit_cast<std::uint64_t>(x.v_));
    if (stands != stands_for_.end()) return stands->second;
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
    n.uniform = n.op != Op::kIfBelow || spells_;
    n.value = std::numeric_limits<double>::quiet_NaN();
    const auto at = [&](int i) -> const Node& { return nodes_[static_cast<std::size_t>(i)]; };
    for (const int operand : {n.a, n.b, n.c}) {
        if (operand < 0) continue;
        n.uniform = n.uniform && at(operand).uniform;
        n.active = n.active || at(operand).active;
    }
    if (n.op == Op::kUniform) {
        n.value = n.constant;
    } else if (n.uniform && n.op == Op::kIfBelow) {
        n.value = at(at(n.a).value < n.constant ? n.b : n.c).value;
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

}  // namespace sysid
