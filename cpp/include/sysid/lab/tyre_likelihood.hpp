// Likelihood of tyre coefficients: one-step-ahead prediction errors of v_x, v_y, r and a_y.
//
// States that come out of a smoother are not exact regressors, and a regression on them is biased
// and too sure of itself. Here the motion stays unknown, and the residuals are those of the main
// job: the whitened innovations of the same extended Kalman filter (`estimate/kalman.hpp`), its
// gains frozen (`estimate/frozen.hpp`). The noise is that of four sensors and of white
// disturbances of the motion.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "sysid/lab/grey_box.hpp"
#include "sysid/math/linear.hpp"

namespace sysid::lab {

constexpr int kGreyChannels = 4;                          // v_x, v_y, r, a_y
constexpr int kGreyNoises = kGreyChannels + kGreyStates;  // sensors, then disturbed motion

/// One uninterrupted drive. Readings are NaN where missing.
struct TyreRun {
    double dt = 0.01;
    std::vector<GreyBoxInput> inputs;  // of the interval that begins at each sample
    std::vector<Vec<kGreyChannels>> measurements;
    std::size_t size() const { return inputs.size(); }
};

/// As `FrozenStep`.
struct FrozenGain {
    Mat<kGreyStates, kGreyChannels> gain;
    Mat<kGreyChannels, kGreyChannels> whitener;
};

struct FrozenGains {
    std::vector<std::vector<FrozenGain>> runs;
    double log_likelihood = 0.0;
    std::size_t observed = 0;
};

struct TyreProblem {
    GreyBoxCar car;
    std::vector<TyreRun> runs;

    std::size_t samples() const {
        std::size_t n = 0;
        for (const TyreRun& run : runs) n += run.size();
        return n;
    }
};

/// Runs the filter. `noise`: standard deviations of the four sensors, and of the white disturbance
/// of v_x, v_y, r per root second.
FrozenGains freeze(const TyreProblem& problem, const double* p, const double* noise);

/// Whitened errors, kGreyChannels per sample, runs one after the other; what follows is as in
/// `identify/prediction_error.hpp`.
void residuals(const TyreProblem& problem, const double* p, const FrozenGains& gains, double* out);

double half_sum_of_squares(const TyreProblem& problem, const double* p, const FrozenGains& gains);

void sensitivities(const TyreProblem& problem, const double* p, const FrozenGains& gains,
                   const std::vector<int>& columns, double* out);

double normal_equations(const TyreProblem& problem, const double* p, const FrozenGains& gains,
                        const std::vector<int>& columns, double* gradient, double* information);

double noise_score(const TyreProblem& problem, const double* p, const double* noise,
                   double* gradient, double* information);

/// Filtered v_x, v_y, r of every sample.
void states(const TyreProblem& problem, const double* p, const FrozenGains& gains, double* out);

/// Readings predicted `ahead` samples ahead from the filtered state, kGreyChannels per sample; NaN
/// where that would begin before a run does. `ahead` of 0 simulates each run freely from its first
/// state.
void look_ahead(const TyreProblem& problem, const double* p, const FrozenGains& gains,
                std::size_t ahead, double* out);

}  // namespace sysid::lab
