// Parameter laws: from what the car and its twin read to a better parameter. They know nothing of
// the twin's equations and serve any simulator.
//
// Dettu et al. (2023), eqs. (14), (15), (18), (24), with these corrections:
//   - Sign. Under equal forces the heavier body accelerates less, so sgn(s)(s - s~) is negative
//     where the parameter must grow: d(delta)/dt = K sgn(s) (s~ - s) with K > 0. The published sign
//     diverges; it is kept behind `published_sign`.
//   - Source of the sign. E[n sgn(s + n)] > 0: the sign of a noisy measurement makes the noise
//     push the parameter. The twin's own reading has no noise and is the default.
//   - Time. Gains are per second, whatever the step; eq. (15) lacks the dot on omega~.
#pragma once

#include <cstddef>
#include <limits>
#include <vector>

#include "sysid/twin/load.hpp"

namespace sysid {

enum class LawKind : int { kSign, kGradient };
enum class SignSource : int { kTwin, kMeasured };

// Of any simulator's row of readings; the arrays are checked again where rows come in.
constexpr std::size_t kMostReadings = 1'000'000;

struct ParameterLaw {
    int parameter = kMass;
    std::size_t channel = 0;     // of the readings
    bool differentiate = false;  // the reading is a rate, the law wants its derivative
    /// kSign: d(delta)/dt = K sgn(s) (s~ - s). kGradient: K s~ (s~ - s) / (floor^2 + mean of s~^2).
    LawKind kind = LawKind::kSign;
    SignSource sign = SignSource::kTwin;
    bool published_sign = false;
    double gain = 0.0;        // K(t) = max(gain, first_gain / (1 + t/first_gain_s))
    double first_gain = 0.0;  // t counts while the law acts
    double first_gain_s = 1.0;
    double deadband = 0.0;  // of |s|
    double floor = 0.1;
    double averaging_s = 5.0;
    double lower = 0.0, upper = std::numeric_limits<double>::infinity();
    double yaw_rate_below_radps = std::numeric_limits<double>::infinity();  // gate of eq. (24)
    double yaw_rate_above_radps = 0.0;
    int stage = 0;
};

/// When figure 12 of the paper goes on: after a time of excitation and with the estimate at rest.
struct Schedule {
    double excited_s = 60.0;
    double window_s = 10.0;
    double relative_rate_ps = 1e-3;  // of the parameter's first value
};

/// The derivative of a first-order low-pass, exact on ramps; car and twin go through the same one.
class Derivative {
  public:
    Derivative(double corner_hz, double dt);
    double operator()(double value);

  private:
    double share_, dt_;
    double smooth_ = 0.0;
    bool started_ = false;
};

class ParameterLaws {
  public:
    /// Throws std::invalid_argument if a law's parameter, channel or a time is out of range.
    ParameterLaws(std::vector<ParameterLaw> laws, double dt, std::size_t yaw_rate_channel,
                  double derivative_hz = 20.0, Schedule schedule = {});

    /// One step: `car` and `twin` hold the readings, NaN where there is none.
    void update(const double* car, const double* twin, Estimates& parameters);

    /// How many readings a row must have.
    std::size_t readings() const;

    /// The stage whose laws act; laws of earlier stages have done their work.
    int stage() const { return stage_; }

  private:
    struct Working {
        Derivative car, twin;
        double power = 0.0, acting_s = 0.0, since_mark_s = 0.0;
        double first = 0.0, mark = 0.0;
        bool settled = false;
    };
    void watch(std::size_t i, double value);

    std::vector<ParameterLaw> laws_;
    std::vector<Working> working_;
    Schedule schedule_;
    double dt_;
    std::size_t yaw_rate_channel_;
    int stage_ = 0, last_stage_ = 0;
    bool started_ = false;
};

}  // namespace sysid
