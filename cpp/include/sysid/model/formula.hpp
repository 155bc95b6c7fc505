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
#include "sysid/model/kinematics.hpp"
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
    kChannel,  // of the log; these two are read by number, as signals and parameters are
    kState,    // of a user's effect
    kOperations,
};
constexpr std::array<const char*, static_cast<std::size_t>(Operation::kOperations)> kOperationNames{
    "constant", "signal", "parameter", "add",     "subtract", "multiply", "divide",  "negative",
    "absolute", "sign",   "sin",       "cos",     "arctan",   "arctan2",  "sqrt",    "exp",
    "log",      "tanh",   "minimum",   "maximum", "greater",  "where",    "channel", "state",
};

/// What a formula may read. Files hold these numbers: what is new comes last.
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
    kLoadFrontLeft,  // of the wheels: load, slip angle, speed of the contact along the car
    kLoadFrontRight,
    kLoadRearLeft,
    kLoadRearRight,
    kSlipFrontLeft,
    kSlipFrontRight,
    kSlipRearLeft,
    kSlipRearRight,
    kSpeedFrontLeft,
    kSpeedFrontRight,
    kSpeedRearLeft,
    kSpeedRearRight,
    kSignals,
};
constexpr std::array<const char*, static_cast<std::size_t>(Signal::kSignals)> kSignalNames{
    "time",     "v_x",   "v_y",   "r",     "steer", "F_x",      "alpha_f",  "alpha_r",
    "F_xf",     "F_xr",  "F_zf",  "F_zr",  "F_yf",  "F_yr",     "a_x",      "a_y",
    "r_dot",    "F_zfl", "F_zfr", "F_zrl", "F_zrr", "alpha_fl", "alpha_fr", "alpha_rl",
    "alpha_rr", "v_xfl", "v_xfr", "v_xrl", "v_xrr",
};

/// When the model comes to know something: before the tyres act, with the forces of the tyres, with
/// the motion they bring about.
enum class Known : std::uint8_t { kAtOnce, kForces, kMotion };
constexpr Known known(Signal which) {
    if (which < Signal::kForceX || which >= Signal::kSpeedFrontLeft) return Known::kAtOnce;
    const bool motion = which >= Signal::kAx && which <= Signal::kYawAcceleration;
    return motion ? Known::kMotion : Known::kForces;
}

/// What stands at a wheel; `left` is 1 on the left, -1 on the right.
///
/// Each axle's own lateral force, at the height of the centre of gravity, is carried by the
/// difference of the loads of its wheels: F_z,left = F_z / 2 - h F_y / t. How the body's roll
/// shares it between the axles is not known.
template <class S>
S wheel_load(const S& load, const S& force, const Workings<S>& w, const Given<S>& track,
             double left) {
    return 0.5 * load - (left / track) * (w.h * force);
}
template <class S>
S wheel_speed(const Workings<S>& w, const Given<S>& track, double left) {
    return w.v_x - (0.5 * left * track) * w.r;
}
template <class S>
S front_slip(const Workings<S>& w, double left) {
    return slip_angle(wheel_speed(w, w.track_f, left), S(w.v_road + w.l_f * w.r), w.delta);
}
template <class S>
S rear_slip(const Workings<S>& w, double left) {
    return slip_angle(wheel_speed(w, w.track_r, left), S(w.v_road - w.l_r * w.r), 0.0);
}

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
        case Signal::kLoadFrontLeft:
            return wheel_load(w.fz_f, w.fy_f, w, w.track_f, 1.0);
        case Signal::kLoadFrontRight:
            return wheel_load(w.fz_f, w.fy_f, w, w.track_f, -1.0);
        case Signal::kLoadRearLeft:
            return wheel_load(w.fz_r, w.fy_r, w, w.track_r, 1.0);
        case Signal::kLoadRearRight:
            return wheel_load(w.fz_r, w.fy_r, w, w.track_r, -1.0);
        case Signal::kSlipFrontLeft:
            return front_slip(w, 1.0);
        case Signal::kSlipFrontRight:
            return front_slip(w, -1.0);
        case Signal::kSlipRearLeft:
            return rear_slip(w, 1.0);
        case Signal::kSlipRearRight:
            return rear_slip(w, -1.0);
        case Signal::kSpeedFrontLeft:
            return wheel_speed(w, w.track_f, 1.0);
        case Signal::kSpeedFrontRight:
            return wheel_speed(w, w.track_f, -1.0);
        case Signal::kSpeedRearLeft:
            return wheel_speed(w, w.track_r, 1.0);
        case Signal::kSpeedRearRight:
            return wheel_speed(w, w.track_r, -1.0);
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
    static constexpr std::size_t kLongest = 256;

    /// Throws `std::invalid_argument` where a step reads what does not exist.
    Formula(std::vector<Instruction> steps, std::size_t parameters) : steps_(std::move(steps)) {
        if (steps_.empty() || steps_.size() > kLongest)
            throw std::invalid_argument("formula: it must have 1 to 256 steps");
        for (std::size_t i = 0; i < steps_.size(); ++i) {
            const Instruction& step = steps_[i];
            if (step.operation >= Operation::kOperations)
                throw std::invalid_argument("formula: there is no such operation");
            // Places that an operation does not read are looked up all the same.
            if (!leaf(step.operation))
                for (const std::size_t place : step.from)
                    if (place >= i)
                        throw std::invalid_argument("formula: a step reads a later one");
            const std::size_t first = step.from[0];
            if ((step.operation == Operation::kSignal &&
                 first >= static_cast<std::size_t>(Signal::kSignals)) ||
                (step.operation == Operation::kParameter && first >= parameters) ||
                (step.operation == Operation::kChannel && first >= kUserChannels) ||
                (step.operation == Operation::kState && first >= kUserStates))
                throw std::invalid_argument("formula: it reads what there is none of");
        }
    }

    template <class S, class T>
    S operator()(const Workings<S>& w, const T* p) const {
        // Most are short: places for results are set to zero each time.
        return steps_.size() <= kShort ? result<kShort>(w, p) : result<kLongest>(w, p);
    }

  private:
    static constexpr std::size_t kShort = 24;

    template <std::size_t N, class S, class T>
    S result(const Workings<S>& w, const T* p) const {
        std::array<S, N> value;
        for (std::size_t i = 0; i < steps_.size(); ++i) {
            const Instruction& step = steps_[i];
            const std::size_t first = step.from[0];
            switch (step.operation) {
                case Operation::kConstant:
                    value[i] = S(step.constant);
                    break;
                case Operation::kSignal:
                    value[i] = signal_of(w, static_cast<Signal>(first));
                    break;
                case Operation::kParameter:
                    value[i] = S(p[first]);
                    break;
                case Operation::kChannel:
                    value[i] = S(w.channels[first]);
                    break;
                case Operation::kState:
                    value[i] = w.user_states[first];
                    break;
                default:
                    value[i] = apply(step.operation, value[first], value[step.from[1]],
                                     value[step.from[2]]);
            }
        }
        return value[steps_.size() - 1];
    }

    static bool leaf(Operation operation) {
        return operation <= Operation::kParameter || operation == Operation::kChannel ||
               operation == Operation::kState;
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
                return if_below(a, 0.0, S(-1.0), if_below(S(-a), 0.0, S(1.0), S(0.0)));
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
                return if_below(S(a - b), 0.0, a, b);
            case Operation::kMaximum:
                return if_below(S(a - b), 0.0, b, a);
            case Operation::kGreater:
                return if_below(S(b - a), 0.0, S(1.0), S(0.0));
            case Operation::kSelect:
                return if_below(S(-abs(a)), 0.0, b, c);
            default:
                return S(0.0);
        }
    }

    std::vector<Instruction> steps_;
};

}  // namespace sysid
