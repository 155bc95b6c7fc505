// Formulas that join the model while the program runs: effects that users write in Python.
//
// Python follows a user's function once and hands over the steps it took. They are evaluated here
// on any scalar, so that such an effect simulates, filters and has derivatives like a built-in one,
// and no kernel calls back.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <stdexcept>
#include <utility>
#include <vector>

#include "sysid/math/dual.hpp"
#include "sysid/model/workings.hpp"

namespace sysid {

enum class Operation : std::uint8_t {
    kConstant,
    kSignal,
    kParameter,
    kAdd,
    kSubtract,
    kMultiply,
    kDivide,
    kNegate,
    kAbs,
    kSign,
    kSin,
    kCos,
    kAtan,
    kAtan2,
    kSqrt,
    kExp,
    kLog,
    kTanh,
    kMinimum,
    kMaximum,
    kGreater,  // 1 where the first exceeds the second, otherwise 0
    kSelect,   // the second where the first is not 0, otherwise the third
    kOperations,
};
constexpr std::array<const char*, static_cast<std::size_t>(Operation::kOperations)> kOperationNames{
    "constant", "signal", "parameter", "add",     "subtract", "multiply", "divide", "negative",
    "absolute", "sign",   "sin",       "cos",     "arctan",   "arctan2",  "sqrt",   "exp",
    "log",      "tanh",   "minimum",   "maximum", "greater",  "where",
};

/// What a formula may read, in the order in which the model comes to know it.
enum class Signal : std::uint8_t {
    kTime,
    kVx,
    kVy,
    kYawRate,
    kSteer,
    kForceX,  // total wheel force
    kSlipFront,
    kSlipRear,
    kForceXFront,
    kForceXRear,
    kLoadFront,
    kLoadRear,
    kForceYFront,
    kForceYRear,
    kAx,
    kAy,
    kYawAcceleration,
    kSignals,
};
constexpr std::array<const char*, static_cast<std::size_t>(Signal::kSignals)> kSignalNames{
    "time", "v_x",  "v_y",  "r",    "steer", "F_x", "alpha_f", "alpha_r", "F_xf",
    "F_xr", "F_zf", "F_zr", "F_yf", "F_yr",  "a_x", "a_y",     "r_dot",
};

template <class S>
S signal_of(const Workings<S>& w, Signal which) {
    switch (which) {
        case Signal::kTime:
            return S(w.time_s);
        case Signal::kVx:
            return w.v_x;
        case Signal::kVy:
            return w.v_y;
        case Signal::kYawRate:
            return w.r;
        case Signal::kSteer:
            return w.delta;
        case Signal::kForceX:
            return w.fx;
        case Signal::kSlipFront:
            return w.alpha_f;
        case Signal::kSlipRear:
            return w.alpha_r;
        case Signal::kForceXFront:
            return w.fx_f;
        case Signal::kForceXRear:
            return w.fx_r;
        case Signal::kLoadFront:
            return w.fz_f;
        case Signal::kLoadRear:
            return w.fz_r;
        case Signal::kForceYFront:
            return w.fy_f;
        case Signal::kForceYRear:
            return w.fy_r;
        case Signal::kAx:
            return w.a_x;
        case Signal::kAy:
            return w.a_y;
        case Signal::kYawAcceleration:
            return w.r_dot;
        case Signal::kSignals:
            break;
    }
    return S(0.0);
}

/// One step: what it does, to the results of which earlier steps; signals and parameters go by
/// their number.
struct Instruction {
    Operation operation = Operation::kConstant;
    std::array<std::size_t, 3> from{};
    double constant = 0.0;
};

class Formula {
  public:
    static constexpr std::size_t kLongest = 96;

    /// Throws `std::invalid_argument` where a step reads what does not exist.
    Formula(std::vector<Instruction> steps, std::size_t parameters) : steps_(std::move(steps)) {
        if (steps_.empty() || steps_.size() > kLongest)
            throw std::invalid_argument("formula: it must have 1 to 96 steps");
        for (std::size_t i = 0; i < steps_.size(); ++i) {
            const Instruction& step = steps_[i];
            if (step.operation >= Operation::kOperations)
                throw std::invalid_argument("formula: there is no such operation");
            const std::size_t operands = arity(step.operation);
            for (std::size_t n = 0; n < operands; ++n)
                if (step.from.at(n) >= i)
                    throw std::invalid_argument("formula: a step reads a later one");
            const std::size_t first = step.from[0];
            if ((step.operation == Operation::kSignal &&
                 first >= static_cast<std::size_t>(Signal::kSignals)) ||
                (step.operation == Operation::kParameter && first >= parameters))
                throw std::invalid_argument("formula: it reads what there is none of");
        }
    }

    template <class S, class T>
    S operator()(const Workings<S>& w, const T* p) const {
        std::array<S, kLongest> value;
        for (std::size_t i = 0; i < steps_.size(); ++i) {
            const Instruction& step = steps_[i];
            if (step.operation == Operation::kConstant) {
                value[i] = S(step.constant);
            } else if (step.operation == Operation::kSignal) {
                value[i] = signal_of(w, static_cast<Signal>(step.from[0]));
            } else if (step.operation == Operation::kParameter) {
                value[i] = S(p[step.from[0]]);
            } else {
                value[i] = apply(step.operation, value[step.from[0]], value[step.from[1]],
                                 value[step.from[2]]);
            }
        }
        return value[steps_.size() - 1];
    }

  private:
    static std::size_t arity(Operation operation) {
        switch (operation) {
            case Operation::kConstant:
            case Operation::kSignal:
            case Operation::kParameter:
                return 0;
            case Operation::kAdd:
            case Operation::kSubtract:
            case Operation::kMultiply:
            case Operation::kDivide:
            case Operation::kAtan2:
            case Operation::kMinimum:
            case Operation::kMaximum:
            case Operation::kGreater:
                return 2;
            case Operation::kSelect:
                return 3;
            default:
                return 1;
        }
    }

    template <class S>
    static S apply(Operation operation, const S& a, const S& b, const S& c) {
        using std::abs;
        using std::atan;
        using std::atan2;
        using std::cos;
        using std::exp;
        using std::log;
        using std::sin;
        using std::sqrt;
        using std::tanh;
        switch (operation) {
            case Operation::kAdd:
                return a + b;
            case Operation::kSubtract:
                return a - b;
            case Operation::kMultiply:
                return a * b;
            case Operation::kDivide:
                return a / b;
            case Operation::kNegate:
                return -a;
            case Operation::kAbs:
                return abs(a);
            case Operation::kSign:
                return S((value_of(a) > 0.0 ? 1.0 : 0.0) - (value_of(a) < 0.0 ? 1.0 : 0.0));
            case Operation::kSin:
                return sin(a);
            case Operation::kCos:
                return cos(a);
            case Operation::kAtan:
                return atan(a);
            case Operation::kAtan2:
                return atan2(a, b);
            case Operation::kSqrt:
                return sqrt(a);
            case Operation::kExp:
                return exp(a);
            case Operation::kLog:
                return log(a);
            case Operation::kTanh:
                return tanh(a);
            case Operation::kMinimum:
                return value_of(a) < value_of(b) ? a : b;
            case Operation::kMaximum:
                return value_of(a) < value_of(b) ? b : a;
            case Operation::kGreater:
                return S(value_of(a) > value_of(b) ? 1.0 : 0.0);
            case Operation::kSelect:
                return value_of(a) != 0.0 ? b : c;
            default:
                return S(0.0);
        }
    }

    std::vector<Instruction> steps_;
};

}  // namespace sysid
