// Effects that users define: formulas for forces, a moment, and what sensors read too much.
#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "sysid/effects/catalogue.hpp"
#include "sysid/model/formula.hpp"

namespace sysid {

/// Places for such effects behind those of the catalogue, and parameters kept for each.
constexpr std::size_t kUserEffects = 8;
constexpr std::size_t kUserParameters = 4;

/// What a formula adds to.
enum class Target : std::uint8_t {
    kForceX,  // at the stage `body`: the axle loads follow from it
    kForceY,  // these four at the stage `forces`
    kMomentZ,
    kForceYFront,
    kForceYRear,
    kReadVx,  // these at the stage `sensors`, in the order of the channels
    kReadVy,
    kReadYawRate,
    kReadAx,
    kReadAy,
    kTargets,
};
constexpr std::array<const char*, static_cast<std::size_t>(Target::kTargets)> kTargetNames{
    "force_x", "force_y", "moment_z",       "force_y_front", "force_y_rear",
    "vx_mps",  "vy_mps",  "yaw_rate_radps", "ax_mps2",       "ay_mps2",
};

/// Whether a signal is known where a target is added to.
constexpr bool known(Signal which, Target target) {
    if (target == Target::kForceX) return known(which) == Known::kAtOnce;
    return target >= Target::kReadVx || known(which) != Known::kMotion;
}

/// A state of a user's effect, ds/dt = f. `decay` is -df/ds: by it the integration stays stable
/// however quick the state is. Without `initial` a run begins where the state would rest.
struct UserState {
    Formula rate, decay;
    std::optional<Formula> initial;
};

struct UserEffect {
    std::size_t slot = 0;
    std::vector<std::pair<Target, Formula>> acts;
    std::size_t first_state = 0;  // among those of all users' effects of a model
    std::vector<UserState> states;
};

/// Shared by all copies of a model, and never changed.
using UserEffects = std::shared_ptr<const std::vector<UserEffect>>;

/// Where the effect's parameters begin behind those of the catalogue.
constexpr std::size_t user_offset(std::size_t slot) {
    return kEffectParameterCount + slot * kUserParameters;
}

namespace detail {

template <class S, class T, class Add>
void each_user_formula(const UserEffects& effects, const Workings<S>& w, const T* effect_parameters,
                       Target from, Target until, const Add& add) {
    if (!effects) return;
    for (const UserEffect& effect : *effects)
        for (const auto& [target, formula] : effect.acts)
            if (target >= from && target < until)
                add(target, formula(w, effect_parameters + user_offset(effect.slot)));
}

}  // namespace detail

template <class S, class T>
void user_body(const UserEffects& effects, const T* effect_parameters, Workings<S>& w) {
    detail::each_user_formula(effects, w, effect_parameters, Target::kForceX, Target::kForceY,
                              [&](Target /*only one*/, const S& more) { w.force_x += more; });
}

template <class S, class T>
void user_forces(const UserEffects& effects, const T* effect_parameters, Workings<S>& w) {
    detail::each_user_formula(effects, w, effect_parameters, Target::kForceY, Target::kReadVx,
                              [&](Target target, const S& more) {
                                  if (target == Target::kForceY) w.force_y += more;
                                  if (target == Target::kMomentZ) w.moment_z += more;
                                  if (target == Target::kForceYFront) w.fy_f += more;
                                  if (target == Target::kForceYRear) w.fy_r += more;
                              });
}

/// When everything is known: how the states move.
///
/// They are states of the filter like those of the catalogue, without noise of their own, and
/// certain when a run begins: what is known of the motion is known of them.
template <class S, class T>
void user_states(const UserEffects& effects, const T* effect_parameters, const Workings<S>& w,
                 Lags<S> lags) {
    if (!effects) return;
    for (const UserEffect& effect : *effects) {
        const T* p = effect_parameters + user_offset(effect.slot);
        for (std::size_t i = 0; i < effect.states.size(); ++i) {
            const UserState& state = effect.states[i];
            const std::size_t n = effect.first_state + i;
            if (lags.settling() && state.initial)
                lags.put(n, (*state.initial)(w, p));
            else
                lags.move(n, state.rate(w, p), state.decay(w, p));
        }
    }
}

template <class S, class T>
void user_sensors(const UserEffects& effects, const T* effect_parameters, const Workings<S>& w,
                  S* y) {
    detail::each_user_formula(effects, w, effect_parameters, Target::kReadVx, Target::kTargets,
                              [&](Target target, const S& more) {
                                  y[static_cast<int>(target) - static_cast<int>(Target::kReadVx)] +=
                                      more;
                              });
}

}  // namespace sysid
