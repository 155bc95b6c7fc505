// States that follow a quantity with a first-order lag,  ds/dt = lambda (target - s).
//
// Over a step such a state has its exact solution for a target that is interpolated between the
// stages of the Runge-Kutta rule. With z the integral of lambda over the step,
//   s(z) = e^-z s_0 + int_0^z e^-(z-u) target(u) du,
// which holds for any lambda: neither a short lag nor a stiff one needs shorter steps.
// Hochbruck & Ostermann, "Exponential integrators", Acta Numerica 19 (2010), sec. 2.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "sysid/math/lag_weights.hpp"
#include "sysid/math/swing.hpp"

namespace sysid {

/// Rates beyond this are taken as this where a lag is integrated explicitly [1/s].
constexpr double kFastestExplicitLag = 4000.0;

/// Lags shorter than this act as this [s]: no log resolves them, and their derivative stays finite.
constexpr double kShortestLag = 1e-6;

/// Rate of a lag with this time constant [1/s].
template <class T>
T lag_rate(const T& time_constant) {
    return value_of(time_constant) > kShortestLag ? 1.0 / time_constant : T(1.0 / kShortestLag);
}

/// The stages at which a model is evaluated while its lags move.
enum class LagStage {
    kRates,   // rates of the states, for explicit integration, and readings at one instant
    kSettle,  // the states become what they follow
    kStart,   // the four of a Runge-Kutta step
    kMiddle,
    kMiddleAgain,
    kEnd,
};
constexpr std::array<LagStage, 4> kLagStages{LagStage::kStart, LagStage::kMiddle,
                                             LagStage::kMiddleAgain, LagStage::kEnd};

/// What the lags of a model have seen of a step; arrays with an element for each state.
template <class S>
struct LagStep {
    const S* before = nullptr;  // the states at the start of the step
    S* after = nullptr;         // as far as they are known at this stage
    S* target_start = nullptr;
    S* target_middle = nullptr;
    S* target_again = nullptr;
    S* rate_start = nullptr;
    S* rate_middle = nullptr;
    bool* exact = nullptr;      // moved by their exact solution, not by their rates
    double h = 0.0;             // length of the step [s]
    double* fastest = nullptr;  // where asked for: the fastest rate in explicit integration [1/s]
};

/// How an effect moves its states. `follow` may be called anew with a better target at any stage.
template <class S>
class Lags {
  public:
    /// `state` as it is at this stage, `state_rate` receives what explicit integration needs.
    Lags(LagStage stage, const S* state, S* state_rate, const LagStep<S>& step = {})
        : stage_(stage), state_(state), state_rate_(state_rate), step_(step) {}

    /// The same, counted from the effect's first state.
    Lags from(std::size_t first) const {
        Lags own = *this;
        own.first_ = first;
        return own;
    }

    const S* states() const { return state_ + first_; }

    /// Lets the state number `i` follow `target` at `rate` [1/s]; returns where it is at this
    /// stage.
    S follow(std::size_t i, const S& target, const S& rate) {
        const std::size_t n = first_ + i;
        switch (stage_) {
            case LagStage::kRates: {
                const S limited = named("lag_rate", explicit_rate(rate));
                if (step_.fastest != nullptr)
                    *step_.fastest = std::max(*step_.fastest, value_of(limited));
                state_rate_[n] = limited * (target - state_[n]);
                return state_[n];
            }
            case LagStage::kSettle:
                step_.after[n] = target;
                return target;
            case LagStage::kStart:
                step_.exact[n] = true;
                step_.target_start[n] = target;
                step_.rate_start[n] = rate;
                return state_[n];
            case LagStage::kMiddle:
            case LagStage::kMiddleAgain: {
                (stage_ == LagStage::kMiddle ? step_.target_middle : step_.target_again)[n] =
                    target;
                step_.rate_middle[n] = rate;
                const S z = (0.25 * step_.h) * (step_.rate_start[n] + rate);
                const LagWeights<S> w(z);
                step_.after[n] = w.kept * step_.before[n] + (w.J0 - w.J1) * step_.target_start[n] +
                                 w.J1 * target;
                return step_.after[n];
            }
            case LagStage::kEnd: {
                const S z =
                    (step_.h / 6.0) * (step_.rate_start[n] + 4.0 * step_.rate_middle[n] + rate);
                const LagWeights<S> w(z);
                const S middle = w.J1 - w.J2;
                step_.after[n] = w.kept * step_.before[n] +
                                 (w.J0 - w.J1 - 2.0 * middle) * step_.target_start[n] +
                                 // The two middle stages are off by h^2/8 x'' on either side.
                                 2.0 * middle * (step_.target_middle[n] + step_.target_again[n]) +
                                 (w.J2 - middle) * target;
                return step_.after[n];
            }
        }
        return target;
    }

    /// The same for a state that acts before its target is known, and is slow against any step: it
    /// is moved by its rate, as the motion is.
    void follow_slowly(std::size_t i, const S& target, const S& rate) {
        const std::size_t n = first_ + i;
        if (stage_ == LagStage::kSettle)
            step_.after[n] = target;
        else
            state_rate_[n] = rate * (target - state_[n]);
    }

    /// Moves the states `i` and `i + 1` as angle and rate of a damped oscillator that is driven
    /// towards `target`: s'' + 2 D w s' + w^2 s = w^2 target, with w > 0 [rad/s] and 0 <= D < 1.
    /// Its free motion is exact for any step, what drives it enters as in the Runge-Kutta rule:
    /// the fourth order, and Simpson's rule where the target does not depend on the oscillator.
    /// Lawson, SIAM J. Numer. Anal. 4 (1967), 372-380, eq. (2.4) and the rule of order four.
    void swing(std::size_t i, const S& target, const S& w, double D) {
        const std::size_t n = first_ + i;
        const Swing<S> now{state_[n], state_[n + 1]};
        if (stage_ == LagStage::kSettle) {
            step_.after[n] = target;
            step_.after[n + 1] = S(0.0);
            return;
        }
        if (stage_ == LagStage::kRates) {
            if (step_.fastest != nullptr) *step_.fastest = std::max(*step_.fastest, value_of(w));
            state_rate_[n] = now.rate;
            state_rate_[n + 1] = w * (w * (target - now.angle) - (2.0 * D) * now.rate);
            return;
        }
        const double h = step_.h;
        const auto rates = [&](const Swing<S>& k) {
            state_rate_[n] = k.angle;
            state_rate_[n + 1] = k.rate;
        };
        const SwingFree<S> half(w, D, 0.5 * h);
        const Swing<S> before{step_.before[n], step_.before[n + 1]};
        const S push = w * w * target;
        // The rule of the motion makes the next stage, and the end, from these.
        if (stage_ == LagStage::kStart) step_.target_start[n] = push;
        const Swing<S> pushed = half({S(0.0), step_.target_start[n]});
        const Swing<S> kept = half(before);
        const Swing<S> first = (2.0 / h) * (kept - before) + pushed;
        if (stage_ == LagStage::kStart) return rates(first);
        if (stage_ == LagStage::kMiddle) {
            step_.target_middle[n] = push;
            return rates((2.0 / h) * (kept - before) + Swing<S>{S(0.0), push});
        }
        const Swing<S> lost = (1.0 / h) * (half(kept) - before);
        if (stage_ == LagStage::kMiddleAgain) {
            step_.target_again[n] = push;
            return rates(lost + half({S(0.0), push}));
        }
        const S& middle = step_.target_middle[n];
        const S& again = step_.target_again[n];
        const Swing<S> second = (2.0 / h) * (kept - before) + Swing<S>{S(0.0), middle};
        const Swing<S> third = lost + half({S(0.0), again});
        const Swing<S> whole = 6.0 * lost + half(pushed) + 2.0 * half({S(0.0), middle + again}) +
                               Swing<S>{S(0.0), push};
        rates(whole - first - 2.0 * (second + third));
    }

    bool settling() const { return stage_ == LagStage::kSettle; }

    /// Where a state begins.
    void put(std::size_t i, const S& value) { step_.after[first_ + i] = value; }

    /// Moves a state by ds/dt = rate, which may depend on the state itself; `decay` is minus that
    /// derivative. The linear part is solved exactly, the rest as Runge-Kutta does: the rule is
    /// that one where `decay` is zero, exact where `rate` is linear in the state and quadratic in
    /// time, and stable for any decay.
    /// Cox & Matthews, J. Comp. Phys. 176 (2002), 430-455, eq. (26) to (29).
    void move(std::size_t i, const S& rate, const S& decay) {
        const std::size_t n = first_ + i;
        const S& now = state_[n];
        if (stage_ == LagStage::kSettle) {
            if (value_of(decay) > 0.0) step_.after[n] = now + rate / decay;
            return;
        }
        if (stage_ == LagStage::kRates) {
            if (step_.fastest != nullptr)
                *step_.fastest = std::max(*step_.fastest, value_of(decay));
            state_rate_[n] = rate;
            return;
        }
        if (stage_ == LagStage::kStart) step_.rate_start[n] = decay;
        const S& c = step_.rate_start[n];
        const S rest = rate + c * now;  // what is not the linear part
        const S z = (0.5 * step_.h) * c;
        const S phi = phi_weights(z)[1];
        // The rule of the motion makes the next stage, and the end, from these.
        if (stage_ == LagStage::kStart) {
            step_.target_start[n] = rest;
            state_rate_[n] = phi * rate;
            return;
        }
        const S& before = step_.before[n];
        if (stage_ == LagStage::kMiddle) {
            step_.target_middle[n] = rest;
            state_rate_[n] = phi * (rest - c * before);
            return;
        }
        const S first = phi * (step_.target_start[n] - c * before);
        if (stage_ == LagStage::kMiddleAgain) {
            step_.target_again[n] = rest;
            state_rate_[n] = phi * (rest - c * (before + (0.25 * step_.h) * first));
            return;
        }
        const S& again = step_.target_again[n];
        const S second = phi * (step_.target_middle[n] - c * before);
        const S third = phi * (again - c * (before + (0.25 * step_.h) * first));
        const auto whole = phi_weights(S(2.0 * z));
        const S middle = 2.0 * whole[2] - 4.0 * whole[3];
        const S mean = (whole[1] - whole[2] - middle) * step_.target_start[n] +
                       middle * (step_.target_middle[n] + again) + (whole[2] - middle) * rest -
                       whole[1] * (c * before);
        state_rate_[n] = 6.0 * mean - first - 2.0 * (second + third);
    }

  private:
    static S explicit_rate(const S& rate) {
        return if_below(rate, kFastestExplicitLag, rate, S(kFastestExplicitLag));
    }

    LagStage stage_;
    const S* state_;
    S* state_rate_;
    LagStep<S> step_;
    std::size_t first_ = 0;
};

}  // namespace sysid
