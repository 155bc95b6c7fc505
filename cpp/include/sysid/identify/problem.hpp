// Driving of one car, ready for estimation: what was done, what was measured, how noisy it is.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "sysid/dynamics/step.hpp"
#include "sysid/math/linear.hpp"

namespace sysid {

/// One uninterrupted stretch of a log at a constant sampling interval.
struct Run {
    double dt = 0.01;
    std::vector<Input> inputs;
    std::vector<Vec<kChannels>> measurements;       // NaN where missing
    std::string name;                               // of the log, for messages
    std::vector<double> steer_before, steer_after;  // logged steering around it, as far as known
    std::size_t size() const { return inputs.size(); }
};

/// Gravity along and across, where the slope of the road varies.
constexpr int kRoadStates = 2;
/// What readings of yaw rate, a_x and a_y have beside white noise, where they have it.
constexpr int kColourStates = 3;

/// The noise model that fitting, comparing, diagnosing and validating share.
///
/// Sensors are white; those of yaw rate and acceleration may have noise with a correlation time
/// beside it. The motion is disturbed by white accelerations, and by forces and a moment
/// with correlation times of their own (Ornstein-Uhlenbeck): they take up what the model cannot
/// explain, so that the innovations stay white and the uncertainty honest. A road that is not
/// level pulls along and across, slowly, with a force that no accelerometer feels.
struct Noise {
    std::array<double, kChannels> sensor{};           // standard deviations, in the channels' units
    std::array<double, kMotionStates> motion{};       // per square root of a second
    std::array<double, kMotionStates> disturbance{};  // F_x, F_y [N], M_z [N m]
    std::array<double, kMotionStates> correlation_time_s{0.5, 0.5, 0.5};
    std::array<double, kRoadStates> road{};  // gravity along and across [m/s2]
    double road_time_s = 5.0;
    std::array<double, kColourStates> colour{};  // of yaw rate, a_x, a_y, in the channels' units
    std::array<double, kColourStates> colour_time_s{0.05, 0.05, 0.05};

    /// Whether the slope of the road varies; without, its states do not exist.
    bool sloping() const { return road[0] > 0.0 || road[1] > 0.0; }
    /// Whether noise of sensors is correlated in time; without, its states do not exist.
    bool coloured() const {
        return std::any_of(colour.begin(), colour.end(), [](double s) { return s > 0.0; });
    }
    /// Whether all noise is white.
    bool white() const {
        return !sloping() && !coloured() &&
               std::all_of(disturbance.begin(), disturbance.end(),
                           [](double s) { return s == 0.0; });
    }

    /// How many externals are states of a filter, in their order.
    std::size_t disturbances() const {
        if (coloured()) return kExternals;
        if (white()) return 0;
        return std::size_t{kMotionStates} + (sloping() ? kRoadStates : 0);
    }

    /// Correlation time and standard deviation of an external.
    double time_of(std::size_t i) const {
        if (i >= kPushes) return colour_time_s[i - kPushes];
        return i < kMotionStates ? correlation_time_s[i] : road_time_s;
    }
    double deviation_of(std::size_t i) const {
        if (i >= kPushes) return colour[i - kPushes];
        return i < kMotionStates ? disturbance[i] : road[i - kMotionStates];
    }
    double forget(std::size_t i, double dt) const { return std::exp(-dt / time_of(i)); }
};
constexpr int kPlainNoiseParameters = kChannels + 3 * kMotionStates;
constexpr int kRoadNoiseParameters = kPlainNoiseParameters + kRoadStates + 1;
constexpr int kNoiseParameters = kRoadNoiseParameters + 2 * kColourStates;
static_assert(kMotionStates + kRoadStates == kPushes && kPushes + kColourStates == kExternals);

/// Motion and disturbance; with the auxiliary states where an effect has states of its
/// own.
constexpr int kStatesPlain = 2 * kMotionStates;
constexpr int kStatesFull = kStatesPlain + kAuxiliaryStates;
/// What is told of a sample: these, then gravity along and across.
constexpr int kStatesTold = kStatesFull + kRoadStates;

struct Problem {
    SingleTrack model;
    std::vector<Run> runs;

    std::size_t samples() const {
        std::size_t n = 0;
        for (const Run& run : runs) n += run.size();
        return n;
    }
};

/// Variances of the motion where a run starts. Wide enough that the first measurements, not the
/// guess, decide.
constexpr std::array<double, kMotionStates> kFirstVariances{1.0, 1.0, 0.04};

/// Slip angle of the rear axle at the start of a run, at most [rad].
constexpr double kMostSlip = 0.15;

/// Where a run starts: the measured motion where there is one, settled auxiliary states. The same
/// from sample `begin` on is a guess of the state there.
template <class S = double, class T>
ModelState<S> initial_state(const SingleTrack& model, const Run& run, const T* p,
                            std::size_t begin = 0) {
    const auto first = [&](int channel, double otherwise) {
        for (std::size_t k = begin; k < run.size() && k < begin + 50; ++k)
            if (!std::isnan(run.measurements[k][channel])) return run.measurements[k][channel];
        return otherwise;
    };
    ModelState<S> x{};
    x[0] = S(first(kVx, 10.0));
    const double r = first(kYawRate, 0.0);
    // The rear axle slips as its share of a steady turn asks: F_y = F_z v_x r / g = B C D F_z
    // alpha. The filter is linear in slip, and does not come back from the wrong side of the tyres'
    // peak.
    const double speed = std::max(value_of(x[0]), kLowestSpeed);
    S slip = S(speed * r / model.car.gravity_mps2) / S(p[kBRear] * p[kCRear] * p[kDRear]);
    if (!(std::abs(value_of(slip)) < kMostSlip)) slip = S(std::copysign(kMostSlip, r));
    const double side = first(kVy, std::nan(""));
    x[1] = std::isnan(side) ? S(model.car.lr_m * r) - S(speed) * slip : S(side);
    x[2] = S(r);
    const std::array<S, kExternals> calm{};
    const Input& u = run.inputs[begin];
    InputFor<S> input{u.steer_rad, u.longitudinal, u.time_s, u.steer_rate_radps};
    std::copy(u.channels.begin(), u.channels.end(), input.channels.begin());
    input.gravity_x_mps2 = u.gravity_x_mps2;
    input.gravity_y_mps2 = u.gravity_y_mps2;
    settle_auxiliary(model, x, calm.data(), input, p);
    return x;
}

}  // namespace sysid
