// How every sideslip observer looks after its sensors: what no car does is refused, gaps of the
// inputs are filled, sensors that stand still are noticed.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "sysid/math/errors.hpp"
#include "sysid/math/whole.hpp"
#include "sysid/online/observer.hpp"

namespace sysid {

/// What no road car exceeds, in the order of `SensorSample`: the reading itself, and how fast it
/// changes. A rate is that of a car at the limit of its grip, several times over, so that filters
/// and held values of slow sensors pass.
struct SensorRange {
    const char* channel;
    double most;       // of the absolute value
    double most_rate;  // per second
};
constexpr std::array<SensorRange, 5> kSensorRanges = {
    SensorRange{"steer_rad", 1.2, 15.0},       SensorRange{"vx_mps", 150.0, 30.0},
    SensorRange{"yaw_rate_radps", 10.0, 20.0}, SensorRange{"ax_mps2", 80.0, 200.0},
    SensorRange{"ay_mps2", 80.0, 200.0},
};
constexpr double kMostSideslipRad = 1.2;  // beyond it a car spins, and no tyre model holds
constexpr double kSlowestMps = 1.0;       // keeps what divides by speed finite
// Longer ones are divided: tyres of a small or slow car answer within 0.05 s, which Heun's rule
// does not follow. The settings were chosen on logs of this step.
constexpr double kLongestStepS = 0.01;
constexpr double kForgottenAfterS = 1.0;  // after a longer one the motion is unknown

inline double squared(double v) { return v * v; }

inline std::array<double, 5> readings_of(const SensorSample& s) {
    return {s.steer_rad, s.vx_mps, s.yaw_rate_radps, s.ax_mps2, s.ay_mps2};
}

/// Throws for what is no number of a sensor at all.
inline void check_sample(double dt, const SensorSample& s, std::size_t sample) {
    if (!(dt > 0.0) || !std::isfinite(dt))
        throw NumericalFailure("the time step is not positive", sample);
    const auto values = readings_of(s);
    for (std::size_t i = 0; i < values.size(); ++i)
        if (std::isinf(values[i]))
            throw NumericalFailure(
                std::string(kSensorRanges[i].channel) + " is infinite (NaN marks a missing value)",
                sample);
}

class SensorWatch {
  public:
    explicit SensorWatch(const ObserverSettings& settings) : settings_(settings) {
        last_.fill(std::nan(""));
        still_s_.fill(0.0);
        taken_.fill(std::nan(""));
        since_s_.fill(0.0);
    }

    /// The sample without what cannot be and without frozen channels, and with the steering angle
    /// held over gaps.
    SensorSample look(double dt, SensorSample s, std::size_t sample) {
        check_sample(dt, s, sample);
        refused_ = false;
        const ObserverSettings& noise = settings_;
        drop_if_impossible(0, s.steer_rad, dt, 0.0);
        drop_if_impossible(1, s.vx_mps, dt, noise.vx_mps);
        drop_if_impossible(2, s.yaw_rate_radps, dt, noise.yaw_rate_radps);
        drop_if_impossible(3, s.ax_mps2, dt, noise.ax_mps2);
        drop_if_impossible(4, s.ay_mps2, dt, noise.ay_mps2);
        steer_gap_s_ = std::isnan(s.steer_rad) ? steer_gap_s_ + dt : 0.0;
        if (steer_gap_s_ == 0.0) steer_ = s.steer_rad;
        s.steer_rad = steer_;
        drop_if_frozen(0, s.yaw_rate_radps, dt);
        drop_if_frozen(1, s.ax_mps2, dt);
        drop_if_frozen(2, s.ay_mps2, dt);
        return s;
    }

    double steer_gap_s() const { return steer_gap_s_; }
    /// Whether the angle that is held is older than that of a sensor that is merely slow.
    bool steer_lost() const { return steer_gap_s_ > kSlowestS; }
    /// Whether a reading of the last sample was refused.
    bool refused() const { return refused_; }

    /// Hysteresis keeps the mode from flickering.
    bool fast_enough(double speed) {
        if (!std::isnan(speed))
            running_ = speed > (running_ ? settings_.stop_below_mps : settings_.go_above_mps);
        return running_;
    }

    template <class Row>
    void remember(Row& row) {
        row(last_, still_s_, taken_, since_s_, steer_, steer_gap_s_, running_, refused_);
    }

  private:
    // A reading that jumped is believed when it has stayed for so long: the one before was wrong.
    static constexpr double kPatienceS = 0.5;
    static constexpr double kHeldS = 0.05;     // some sensors give a new value only so often
    static constexpr double kSlowestS = 0.15;  // between two readings of such a sensor
    static constexpr double kNoise = 8.0;      // standard deviations between two readings

    void drop_if_impossible(std::size_t i, double& value, double dt, double noise) {
        since_s_[i] += dt;
        if (std::isnan(value)) return;
        const SensorRange& range = kSensorRanges[i];
        bool possible = std::abs(value) <= range.most;
        if (possible && since_s_[i] <= kPatienceS)
            possible = std::isnan(taken_[i]) ||
                       std::abs(value - taken_[i]) <=
                           kNoise * noise + range.most_rate * std::max(since_s_[i], kHeldS);
        if (possible) {
            taken_[i] = value;
            since_s_[i] = 0.0;
        } else {
            value = std::nan("");
            refused_ = true;
        }
    }

    void drop_if_frozen(std::size_t i, double& value, double dt) {
        if (std::isnan(value)) return;
        still_s_[i] = value == last_[i] ? still_s_[i] + dt : 0.0;
        last_[i] = value;
        // A true zero is what a noise-free simulation gives on a straight.
        if (value != 0.0 && still_s_[i] > settings_.frozen_after_s) value = std::nan("");
    }

    ObserverSettings settings_;
    std::array<double, 3> last_{};
    std::array<double, 3> still_s_{};
    std::array<double, 5> taken_{};    // the last reading that was taken
    std::array<double, 5> since_s_{};  // and how long ago
    double steer_ = 0.0, steer_gap_s_ = 0.0;
    bool running_ = false, refused_ = false;
};

constexpr int kMostPieces = 1'000'000;

/// Runs `part(dt, share)` over the pieces of a long step; `share` is how much of it has passed at
/// the end of the piece.
template <class Part>
void in_short_steps(double dt, Part&& part) {
    const int pieces = whole_within(std::ceil(dt / kLongestStepS - 1e-9), 1, kMostPieces);
    for (int i = 1; i <= pieces; ++i) part(dt / pieces, static_cast<double>(i) / pieces);
}

}  // namespace sysid
