// One sampling interval of the model: classical Runge-Kutta with the inputs linear in between, and
// lags by their exact solution.
//
// A cruder rule would be read as a missing lag: 60 s of driving resolve about a millisecond.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include "sysid/dynamics/single_track.hpp"
#include "sysid/math/integrate.hpp"
#include "sysid/math/whole.hpp"

namespace sysid {

constexpr int kMotionStates = 3;
constexpr int kModelStates = kMotionStates + kAuxiliaryStates;

/// v_x, v_y, r, then the auxiliary states.
template <class S>
using ModelState = std::array<S, kModelStates>;

template <class V>
InputOf<V> between(const InputOf<V>& a, const InputOf<V>& b, double part) {
    const auto mix = [&](const V& from, const V& to) { return from + part * (to - from); };
    InputOf<V> mixed{
        mix(a.steer_rad, b.steer_rad),
        mix(a.longitudinal, b.longitudinal),
        mix(a.time_s, b.time_s),
        mix(a.steer_rate_radps, b.steer_rate_radps),
    };
    for (std::size_t i = 0; i < kUserChannels; ++i)
        mixed.channels[i] = mix(a.channels[i], b.channels[i]);
    mixed.loads_n = {mix(a.loads_n.front, b.loads_n.front), mix(a.loads_n.rear, b.loads_n.rear)};
    mixed.gravity_x_mps2 = mix(a.gravity_x_mps2, b.gravity_x_mps2);
    mixed.gravity_y_mps2 = mix(a.gravity_y_mps2, b.gravity_y_mps2);
    return mixed;
}

/// Speeds below this are treated as this in the slip angles' denominator [m/s].
constexpr double kLowestSpeed = 1.0;

/// However stiff or long the interval, it is cut into no more parts than this.
constexpr int kMostSubsteps = 250;

/// Parts so short that in each the fastest rate turns through `turn`: 0.8 for accuracy; the rule is
/// stable up to 2.7.
inline int substeps_for(const SingleTrack& model, const double* p, double v_x, double dt,
                        double turn = 0.8) {
    const double rate = model.fastest_rate(p, std::max(v_x, kLowestSpeed));
    return whole_within(std::ceil(dt * rate / turn), 1, kMostSubsteps);
}
/// The same from the fastest rate at 1 m/s: it falls with speed.
inline int substeps_for(double rate_at_1_mps, double v_x, double dt, double turn = 0.8) {
    const double rate = rate_at_1_mps / std::max(v_x, kLowestSpeed);
    return whole_within(std::ceil(dt * rate / turn), 1, kMostSubsteps);
}

/// What the lags of one model need to remember within a step.
template <class S>
class LagMemory {
  public:
    LagStep<S> begin(const ModelState<S>& x, double h) {
        exact_.fill(false);
        LagStep<S> step;
        step.before = x.data() + kMotionStates;
        step.after = after_.data();
        step.target_start = target_start_.data();
        step.target_middle = target_middle_.data();
        step.target_again = target_again_.data();
        step.rate_start = rate_start_.data();
        step.rate_middle = rate_middle_.data();
        step.exact = exact_.data();
        step.h = h;
        return step;
    }
    bool exact(std::size_t i) const { return exact_[i]; }
    const S& after(std::size_t i) const { return after_[i]; }

  private:
    using States = std::array<S, kAuxiliaryStates>;
    States after_, target_start_, target_middle_, target_again_, rate_start_, rate_middle_;
    std::array<bool, kAuxiliaryStates> exact_{};
};

/// Stands in for it where a model has no states of its own.
template <class S>
struct NoLags {
    LagStep<S> begin(const ModelState<S>& /*x*/, double /*h*/) { return {}; }
    bool exact(std::size_t /*i*/) const { return false; }
    S after(std::size_t /*i*/) const { return S(0.0); }
};

/// One Runge-Kutta step of the motion. Lags move by their exact solution between the targets of its
/// stages, slow states with the motion. The first step of a sample fills in `since`.
template <class S, class T, class Memory>
void model_step(const SingleTrack& model, ModelState<S>& x, const S* external,
                const InputFor<S>& from, const InputFor<S>& to, const T* p, double h,
                const ActiveStates& own, Memory& memory, LoadsSince<S>& since) {
    const LagStep<S> lags = memory.begin(x, h);
    const std::array<InputFor<S>, 3> input{from, between(from, to, 0.5), to};
    const auto rate = [&](std::size_t stage, const ModelState<S>& at, ModelState<S>& k) {
        S* own_rate = k.data() + kMotionStates;
        const auto w =
            model.evaluate(at.data(), external,
                           Lags<S>(kLagStages[stage], at.data() + kMotionStates, own_rate, lags),
                           input[(stage + 1) / 2], p, k.data(), since);
        if (model.loads_move() && !since.on) since = {true, w.m * w.a_x, w.v_x * w.v_x};
    };
    runge_kutta_step(x, h, rate, [&](auto&& use) {
        for (std::size_t i = 0; i < kMotionStates; ++i) use(i);
        for (std::size_t i : own)
            if (!memory.exact(i)) use(kMotionStates + i);
    });
    if (own.count == 0) return;
    // What stiff lags end at is their target at the end, of which the last stage has a guess.
    ModelState<S> ignored;
    rate(3, x, ignored);
    for (std::size_t i : own)
        if (memory.exact(i)) x[kMotionStates + i] = memory.after(i);
}

/// Moves `x` over `dt` seconds in `substeps` equal parts; `external` is held.
template <class S, class T>
void advance(const SingleTrack& model, ModelState<S>& x, const S* external, const InputFor<S>& from,
             const InputFor<S>& to, const T* p, double dt, int substeps) {
    const ActiveStates own = active_states(model.effects);
    const InputFor<S>& until = model.inputs_held ? from : to;
    LoadsSince<S> since;
    const auto steps = [&](auto&& memory) {
        for (int n = 0; n < substeps; ++n)
            model_step(model, x, external, between(from, until, static_cast<double>(n) / substeps),
                       between(from, until, (n + 1.0) / substeps), p, dt / substeps, own, memory,
                       since);
    };
    if (own.count == 0)
        steps(NoLags<S>{});
    else
        steps(LagMemory<S>{});
}

/// The sensors' readings in state `x`.
template <class S, class T>
std::array<S, kChannels> sense(const SingleTrack& model, const ModelState<S>& x, const S* external,
                               const InputFor<S>& u, const T* p) {
    ModelState<S> rate;
    const auto w = model.evaluate(x.data(), external, x.data() + kMotionStates, u, p, rate.data(),
                                  rate.data() + kMotionStates);
    std::array<S, kChannels> y;
    model.sense(w, p, x.data() + kMotionStates, y.data());
    y[kYawRate] += external[kReadYawRate];
    y[kAx] += external[kReadAx];
    y[kAy] += external[kReadAy];
    return y;
}

/// Auxiliary states that have settled: they equal what they follow.
template <class S, class T>
void settle_auxiliary(const SingleTrack& model, ModelState<S>& x, const S* external,
                      const InputFor<S>& u, const T* p) {
    const ActiveStates own = active_states(model.effects);
    if (own.count == 0) return;
    // One round settles any chain of lags. Only slow states act before their target is known.
    constexpr int kRounds = 12;
    std::array<S, kMotionStates> rate;
    LagStep<S> step;
    step.after = x.data() + kMotionStates;
    const Lags<S> lags(LagStage::kSettle, step.after, nullptr, step);
    for (int round = 0; round < kRounds; ++round)
        model.evaluate(x.data(), external, lags, u, p, rate.data());
}

/// Directions that one pass through the model differentiates by: states in a filter, in one with
/// states of many effects, and in one whose states fill one such pass and not two.
constexpr int kStatePass = 6, kWideStatePass = 9, kWidestStatePass = 12;

// The model takes seconds to compile for each scalar. These are what kernels use; each is compiled
// once, by the files of this name in `src/dynamics/`.
// NOLINTBEGIN(bugprone-macro-parentheses): types take none
#define SYSID_COMPILED_MODEL(PREFIX, S, T)                                                         \
    PREFIX template Workings<S> SingleTrack::evaluate(const S*, const S*, const Lags<S>&,          \
                                                      const InputFor<S>&, const T*, S*,            \
                                                      const LoadsSince<S>&) const;                 \
    PREFIX template void SingleTrack::sense(const Workings<S>&, const T*, const S*, S*) const;     \
    PREFIX template void advance(const SingleTrack&, ModelState<S>&, const S*, const InputFor<S>&, \
                                 const InputFor<S>&, const T*, double, int);                       \
    PREFIX template std::array<S, kChannels> sense(const SingleTrack&, const ModelState<S>&,       \
                                                   const S*, const InputFor<S>&, const T*);        \
    PREFIX template void settle_auxiliary(const SingleTrack&, ModelState<S>&, const S*,            \
                                          const InputFor<S>&, const T*);
// NOLINTEND(bugprone-macro-parentheses)

SYSID_COMPILED_MODEL(extern, double, double)
SYSID_COMPILED_MODEL(extern, Dual<kMotionStates>, double)
SYSID_COMPILED_MODEL(extern, Dual<kStatePass>, double)
SYSID_COMPILED_MODEL(extern, Dual<kWideStatePass>, double)
SYSID_COMPILED_MODEL(extern, Dual<kWidestStatePass>, double)
SYSID_COMPILED_MODEL(extern, Recorded, Recorded)

}  // namespace sysid
