// Likelihood of tyre coefficients: one-step-ahead prediction errors of v_x, v_y, r and a_y.
//
// States that come out of a smoother are not exact regressors, and a regression on them is biased
// and too sure of itself. Here the motion stays unknown: an extended Kalman filter predicts every
// reading from the readings before it, and the errors of the predictions, each divided by its
// expected size, are the residuals (Ljung, System Identification, 2nd ed., sec. 7.2). Sensor noise
// is taken as independent from channel to channel, so that readings enter one at a time.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "sysid/lab/grey_box.hpp"

namespace sysid::lab {

constexpr int kGreyChannels = 4;                          // v_x, v_y, r, a_y
constexpr int kGreyNoises = kGreyChannels + kGreyStates;  // sensors, then disturbed motion

/// One uninterrupted drive. Readings are NaN where missing.
struct TyreRun {
    double dt = 0.01;
    std::vector<GreyBoxInput> inputs;  // of the interval that begins at each sample
    std::vector<std::array<double, kGreyChannels>> measurements;
    std::size_t size() const { return inputs.size(); }
};

/// Gains of every sample, channel after channel, and one over the expected size of each error;
/// both zero where there is no reading.
struct FrozenGain {
    std::array<std::array<double, kGreyStates>, kGreyChannels> gain;
    std::array<double, kGreyChannels> per_std;
};

struct FrozenGains {
    std::vector<std::vector<FrozenGain>> runs;
    double log_likelihood = 0.0;
    std::size_t observed = 0;
};

class TyreProblem {
  public:
    explicit TyreProblem(const GreyBoxCar& car) : car_(car) {}

    void add_run(TyreRun run) { runs_.push_back(std::move(run)); }
    std::size_t samples() const;
    const std::vector<TyreRun>& runs() const { return runs_; }

    /// Runs the filter. `noise`: standard deviations of the four sensors, and of the white
    /// disturbance of v_x, v_y, r per root second.
    FrozenGains freeze(const double* p, const double* noise) const;

    /// Errors over their expected size, kGreyChannels per sample, runs one after the other.
    void residuals(const double* p, const FrozenGains& gains, double* out) const;

    /// Minus the derivatives of the residuals by the parameters `columns`, row-major.
    void sensitivities(const double* p, const FrozenGains& gains, const std::vector<int>& columns,
                       double* out) const;

    /// Half the sum of squared residuals, with G^T e and G^T G (row-major) of the sensitivities G.
    double normal_equations(const double* p, const FrozenGains& gains,
                            const std::vector<int>& columns, double* gradient,
                            double* information) const;

    double half_sum_of_squares(const double* p, const FrozenGains& gains) const;

    /// Log-likelihood, its derivatives by the logarithms of the noise parameters, and their
    /// expected information (row-major). Where the filter linearises is taken as given.
    double noise_score(const double* p, const double* noise, double* gradient,
                       double* information) const;

    /// Filtered v_x, v_y, r of every sample.
    void states(const double* p, const FrozenGains& gains, double* out) const;

    /// Readings predicted `ahead` samples ahead from the filtered state, kGreyChannels per sample;
    /// NaN where that would begin before a run does. `ahead` of 0 simulates each run freely from
    /// its first state.
    void look_ahead(const double* p, const FrozenGains& gains, std::size_t ahead,
                    double* out) const;

  private:
    GreyBoxCar car_;
    std::vector<TyreRun> runs_;
};

}  // namespace sysid::lab
