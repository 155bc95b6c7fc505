// What an effect is made of.
//
// An effect is a struct that derives from `Effect`, states its `info`, and shadows the stages at
// which it acts. Stages run in the order they are declared here, and within a stage in the order of
// the catalogue, `input` in the reverse order. `p` points at the effect's own parameters, `lags`
// and `state` at its own states; at the null values of the parameters nothing must change.
#pragma once

#include <cmath>
#include <cstddef>

#include "sysid/math/dual.hpp"
#include "sysid/model/lags.hpp"
#include "sysid/model/workings.hpp"

namespace sysid {

/// A parameter that means nothing while the effect is null, and how its value is looked for then:
/// over the time of the log, or over its typical range.
enum class Scan { kNone, kTime, kRange };

/// A law of motion that readings seem to break where the effect acts, through no fault of theirs:
/// all channels come late, the car answers its steering late, gravity acts along the car.
enum class Breaks { kNothing, kReadingsLate, kReadingsElsewhere, kAnswersLate, kOnASlope };

struct Range {
    double low = 0.0, high = 0.0;
};

struct ParameterInfo {
    const char* name = nullptr;
    const char* unit = nullptr;
    double null_value = 0.0;  // exactly the model without the effect
    double typical = 0.0;     // a size one meets in practice
    double matters = 0.0;     // smallest size worth acting on
    Range bounds{};           // of any search
    Range usual{};            // where most cars lie that have the effect
    bool mirrored = false;    // changes its sign in a mirror that swaps left and right
    Scan scan = Scan::kNone;
};

/// A state of an effect's own, by the name that exported models give it.
struct StateInfo {
    const char* name = nullptr;
    const char* unit = nullptr;
};

constexpr std::size_t kMaxEffectParameters = 2;
constexpr std::size_t kMaxEffectStates = 5;

struct EffectInfo {
    const char* id = nullptr;
    const char* title = nullptr;
    const char* equation = nullptr;
    const char* source = nullptr;
    const char* excited_by = nullptr;       // which driving shows it
    const char* moves = nullptr;            // which measured channels it moves first
    const char* needs = nullptr;            // channels a log must have for it to be told at all
    const char* confounded_with = nullptr;  // effects alike in most driving; said by both
    ParameterInfo parameters[kMaxEffectParameters] = {};
    StateInfo states[kMaxEffectStates] = {};  // lags, or an oscillator of two
    // Derivative at the null value does not exist (a lag of zero): scored at a finite size instead.
    bool scored_at_typical = false;
    // Visible only through a known longitudinal force.
    bool needs_force = false;
    // Effect through which it chiefly acts; weak in a model without that.
    const char* through = "";
    Breaks breaks = Breaks::kNothing;
    // As a nuisance it is the same in all logs of a car, where others differ from log to log.
    bool same_in_all_logs = false;
    // Effects that it refines: a candidate only beside one of them, or where a user names it. Where
    // both are in a model neither takes a share of the errors that is its own.
    const char* refines = "";
    // A candidate only where a user names it.
    bool on_request = false;

    constexpr std::size_t parameter_count() const {
        std::size_t n = 0;
        while (n < kMaxEffectParameters && parameters[n].name != nullptr) ++n;
        return n;
    }
    constexpr std::size_t state_count() const {
        std::size_t n = 0;
        while (n < kMaxEffectStates && states[n].name != nullptr) ++n;
        return n;
    }
};

/// What a stage returns at which an effect does not act: it is left out when compiling.
struct Inactive {};

struct Effect {
    /// Standard deviation of the states when a run begins, in their own unit.
    static constexpr double state_spread = 0.02;
    /// Whether the stage `input` reads the yaw acceleration, which the forces settle only later.
    static constexpr bool reads_yaw_acceleration = false;

    template <class T, class S>
    static Inactive vehicle(const T* /*p*/, Workings<S>& /*w*/) {
        return {};
    }
    template <class T, class S>
    static Inactive input(const T* /*p*/, Workings<S>& /*w*/) {
        return {};
    }
    /// The wheel force that acts; nothing where it is not known.
    template <class T, class S>
    static Inactive drive(const T* /*p*/, Workings<S>& /*w*/, Lags<S> /*lags*/) {
        return {};
    }
    template <class T, class S>
    static Inactive steering(const T* /*p*/, Workings<S>& /*w*/, Lags<S> /*lags*/) {
        return {};
    }
    template <class T, class S>
    static Inactive body(const T* /*p*/, Workings<S>& /*w*/) {
        return {};
    }
    template <class T, class S>
    static Inactive slip(const T* /*p*/, Workings<S>& /*w*/, Lags<S> /*lags*/) {
        return {};
    }
    template <class T, class S>
    static Inactive loads(const T* /*p*/, Workings<S>& /*w*/) {
        return {};
    }
    template <class T, class S>
    static Inactive grip(const T* /*p*/, Workings<S>& /*w*/, const S* /*state*/) {
        return {};
    }
    /// The lateral axle forces are known, their sums are not yet formed.
    template <class T, class S>
    static Inactive forces(const T* /*p*/, Workings<S>& /*w*/) {
        return {};
    }
    /// Everything is known: for states that follow results.
    template <class T, class S>
    static Inactive follow(const T* /*p*/, const Workings<S>& /*w*/, Lags<S> /*lags*/) {
        return {};
    }
    template <class T, class S>
    static Inactive sensors(const T* /*p*/, const Workings<S>& /*w*/, const S* /*state*/,
                            S* /*y*/) {
        return {};
    }
};

}  // namespace sysid
