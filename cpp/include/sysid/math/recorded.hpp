// A scalar that writes down what is done to it: a model that is written for any scalar becomes a
// `Program`.
//
// Constants are worked out at once, unless the recorder spells; steps that were taken before are
// not repeated, and what does not depend on the sample keeps its value. A condition may be asked
// only of such numbers; on others the model uses `if_below`.
#pragma once

#include <type_traits>

#include "sysid/math/given.hpp"

namespace sysid {

class Recorder;

class Recorded {
  public:
    Recorded() = default;
    Recorded(double value) : v_(value) {}  // NOLINT(google-explicit-constructor): constants mix

    Recorded& operator+=(const Recorded& o) { return *this = *this + o; }
    Recorded& operator-=(const Recorded& o) { return *this = *this - o; }
    Recorded& operator*=(const Recorded& o) { return *this = *this * o; }
    Recorded& operator/=(const Recorded& o) { return *this = *this / o; }

    friend Recorded operator-(const Recorded& a);
    friend Recorded operator+(const Recorded& a, const Recorded& b);
    friend Recorded operator-(const Recorded& a, const Recorded& b);
    friend Recorded operator*(const Recorded& a, const Recorded& b);
    friend Recorded operator/(const Recorded& a, const Recorded& b);
    friend Recorded sin(const Recorded& a);
    friend Recorded cos(const Recorded& a);
    friend Recorded atan(const Recorded& a);
    friend Recorded direction(const Recorded& y, const Recorded& x);
    friend Recorded atan2(const Recorded& y, const Recorded& x) { return direction(y, x); }
    friend Recorded sqrt(const Recorded& a);
    friend Recorded exp(const Recorded& a);
    friend Recorded log(const Recorded& a);
    friend Recorded tanh(const Recorded& a);
    friend Recorded abs(const Recorded& a);
    friend Recorded if_below(const Recorded& x, double limit, const Recorded& below,
                             const Recorded& otherwise);
    /// J_n of a lag, n = 0, 1, 2.
    friend Recorded lag_integral(const Recorded& z, int n);
    /// phi_n(-z) of `PhiWeights`, n = 1, 2, 3.
    friend Recorded phi_weight(const Recorded& z, int n);

    /// The value where it is the same for all samples. Throws `std::logic_error` where it is not.
    friend double value_of(const Recorded& x);

    /// Whether names and parts are kept, for a text.
    friend bool spells(const Recorded& x);
    /// The name of a step in a text of the calculation; see `named`.
    friend void name_step(const char* name, const Recorded& x);
    /// From here on the steps, of whose calculation `x` is, belong to the part of this title.
    friend void begin_part(const char* title, const Recorded& x);

  private:
    friend class Recorder;
    friend struct RecordedAccess;
    Recorded(double value, int node, Recorder* to) : v_(value), node_(node), to_(to) {}

    double v_ = 0.0;
    int node_ = -1;  // a constant has none
    Recorder* to_ = nullptr;
};

/// Gives a number the name that it has where the calculation is written as text. A name may be
/// given again to what takes its place. Costs nothing with any other scalar.
template <class S>
S named(const char* name, const S& x) {
    if constexpr (std::is_same_v<S, Recorded>) name_step(name, x);
    return x;
}

}  // namespace sysid
