// The free motion of a damped oscillator, exact over any time, on any scalar.
#pragma once

#include <cmath>

#include "sysid/math/dual.hpp"
#include "sysid/math/recorded.hpp"

namespace sysid {

/// Angle and rate of an oscillator, or their changes.
template <class S>
struct Swing {
    S angle, rate;

    friend Swing operator+(const Swing& a, const Swing& b) {
        return {a.angle + b.angle, a.rate + b.rate};
    }
    friend Swing operator-(const Swing& a, const Swing& b) {
        return {a.angle - b.angle, a.rate - b.rate};
    }
    friend Swing operator*(double a, const Swing& b) { return {a * b.angle, a * b.rate}; }
};

/// Where s'' + 2 D w s' + w^2 s = 0 leads in the time t, for 0 <= D < 1 and w > 0:
///   s(t) = e^(-D w t) (s_0 cos(w_d t) + (s'_0 + D w s_0) sin(w_d t) / w_d), w_d = w sqrt(1 - D^2).
/// Meirovitch, Fundamentals of Vibrations (2001), sec. 2.2.
template <class S>
class SwingFree {
  public:
    SwingFree(const S& w, double D, double t) {
        using std::cos;
        using std::exp;
        using std::sin;
        const double slower = std::sqrt(1.0 - D * D);
        const S fade = exp((-D * t) * w);
        const S sine = fade * sin((slower * t) * w) / slower;
        const S cosine = fade * cos((slower * t) * w);
        angle_of_angle_ = cosine + D * sine;
        angle_of_rate_ = sine / w;
        rate_of_angle_ = -(sine * w);
        rate_of_rate_ = cosine - D * sine;
    }

    Swing<S> operator()(const Swing<S>& x) const {
        return {angle_of_angle_ * x.angle + angle_of_rate_ * x.rate,
                rate_of_angle_ * x.angle + rate_of_rate_ * x.rate};
    }

  private:
    S angle_of_angle_, angle_of_rate_, rate_of_angle_, rate_of_rate_;
};

}  // namespace sysid
