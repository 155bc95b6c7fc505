// What an effect is made of.
//
// An effect is a struct that derives from `Effect`, states its `info`, and shadows the stages at
// which it acts. Stages run in the order they are declared here, and within a stage in the order of
// the catalogue, `input` in the reverse order. `p` points at the effect's own parameters; at their
// null values nothing must change.
#pragma once

#include <cmath>
#include <cstddef>

#include "sysid/model/workings.hpp"

namespace sysid {

struct ParameterInfo {
    const char* name;
    const char* unit;
    double null_value;  // exactly the model without the effect
    double typical;     // a size one meets in practice
    double matters;     // smallest size worth acting on
    double lower, upper;
};

constexpr std::size_t kMaxEffectParameters = 2;

struct EffectInfo {
    const char* id;
    const char* title;
    const char* equation;
    const char* source;
    const char* excited_by;  // which driving shows it
    const char* moves;       // which measured channels it moves first
    std::size_t parameter_count;
    ParameterInfo parameters[kMaxEffectParameters];
    // Derivative at the null value does not exist (a lag of zero): scored at a finite size instead.
    bool scored_at_typical = false;
    // Visible only through a known longitudinal force.
    bool needs_force = false;
};

/// Lags act no faster than this [1/s]: minutes of driving hardly resolve a quarter of a
/// millisecond, and integration would need ever shorter steps.
constexpr double kFastestLag = 4000.0;

struct Effect {
    template <class T, class S>
    static void vehicle(const T* /*p*/, Workings<S>& /*w*/) {}
    template <class T, class S>
    static void input(const T* /*p*/, Workings<S>& /*w*/) {}
    template <class T, class S>
    static void steering(const T* /*p*/, Workings<S>& /*w*/, const S* /*aux*/, S* /*aux_rate*/) {}
    template <class T, class S>
    static void body(const T* /*p*/, Workings<S>& /*w*/) {}
    template <class T, class S>
    static void slip(const T* /*p*/, Workings<S>& /*w*/, const S* /*aux*/, S* /*aux_rate*/) {}
    template <class T, class S>
    static void loads(const T* /*p*/, Workings<S>& /*w*/) {}
    template <class T, class S>
    static void grip(const T* /*p*/, Workings<S>& /*w*/) {}
    template <class T, class S>
    static void sensors(const T* /*p*/, const Workings<S>& /*w*/, S* /*y*/) {}
    /// Fastest rate [1/s] the effect adds, so that the integrator can take short enough steps.
    static double rate(const double* /*p*/, double /*v_x*/) { return 0.0; }
};

}  // namespace sysid
