// One-step-ahead prediction errors, whitened, and their derivatives: the residuals of everything.
//
// The extended Kalman filter runs once and its gains are kept. With the gains frozen, the
// prediction errors are a smooth function of the parameters, and the mean of the filter, written
// once on the scalar type, gives their exact derivatives. Ljung, System Identification (2nd ed.),
// sec. 7.2.
#pragma once

#include <vector>

#include "sysid/identify/made_of.hpp"

namespace sysid {

/// Filter gains of every sample of a run: the correction of each state by the innovations, state
/// after state, then the lower triangle of the inverse Cholesky factor that whitens these. Zero
/// where a measurement is missing. The parts into which the interval before the sample is cut are
/// kept as well: were they counted anew, residuals would jump where a parameter makes it one more.
struct FrozenRun {
    std::vector<double> numbers;
    std::vector<double> told;  // see `FrozenFilter::told`
    std::vector<int> substeps;
    std::size_t size() const { return substeps.size(); }
};
constexpr std::size_t kWhitener = kChannels * (kChannels + 1) / 2;

/// Samples of a problem up to which a filter keeps what it told of the states.
constexpr std::size_t kToldSamples = 32768;

/// Belongs to problems with the runs it was made from, whatever their model.
struct FrozenFilter {
    std::vector<FrozenRun> runs;
    Noise noise;
    double log_likelihood = 0.0;
    std::size_t observed = 0;        // measured elements that count
    std::vector<int> rows;           // what has gains, see `filter_rows`
    std::vector<double> deviations;  // of these, the largest at the ends of runs
    MadeOf made_of;                  // nothing where it does not tell

    /// Numbers of one sample.
    std::size_t size() const { return rows.size() * kChannels + kWhitener; }
    const double* gain(std::size_t run, std::size_t k) const {
        return runs[run].numbers.data() + k * size();
    }
    double* gain(std::size_t run, std::size_t k) { return runs[run].numbers.data() + k * size(); }
    const double* whitener(std::size_t run, std::size_t k) const {
        return gain(run, k) + rows.size() * kChannels;
    }
    double* whitener(std::size_t run, std::size_t k) {
        return gain(run, k) + rows.size() * kChannels;
    }
    /// Errors of a sample, whitened; zero where a measurement is missing.
    void whiten(std::size_t run, std::size_t k, const double* error, double* to) const {
        const double* row = whitener(run, k);
        for (std::size_t i = 0; i < kChannels; ++i) {
            double sum = 0.0;
            for (std::size_t j = 0; j <= i; ++j) sum += *row++ * error[j];
            to[i] = sum;
        }
    }
    /// Numbers that tell how a sample was filtered: innovations, zero where a measurement is
    /// missing, means of the states after them, the lower triangle of their covariance. Of a
    /// problem with more than `kToldSamples` they are not kept.
    std::size_t told_size() const {
        return kChannels + rows.size() + rows.size() * (rows.size() + 1) / 2;
    }
    const double* told(std::size_t run, std::size_t k) const {
        return runs[run].told.data() + k * told_size();
    }
    double* told(std::size_t run, std::size_t k) { return runs[run].told.data() + k * told_size(); }
    /// Means of the states before a sample, which those after it and its innovations tell.
    void predicted(std::size_t run, std::size_t k, double* to) const {
        const double *gains = gain(run, k), *error = told(run, k), *mean = error + kChannels;
        for (std::size_t i = 0; i < rows.size(); ++i) {
            to[i] = mean[i];
            for (std::size_t c = 0; c < kChannels; ++c) to[i] -= *gains++ * error[c];
        }
    }
    bool tells() const { return !runs.empty() && !runs[0].told.empty(); }
    /// Whether what was told is of the states of this problem's model.
    bool tells_of(const Problem& problem) const;
    /// Where among the gains of a sample those of such rows stand; -1 for those that have none.
    std::vector<int> places(const std::vector<int>& of) const;
};

/// Names of the states that a filter corrects: v_x, v_y, r, the states of effects, disturbances.
/// They are places among `kStatesFull`; gravity and coloured sensors stand behind these. Of so many
/// disturbances, see `Noise::disturbances`.
std::vector<int> filter_rows(EffectMask effects, std::size_t disturbances);

FrozenFilter freeze(const Problem& logged, const double* p, const Noise& noise);

/// Log-likelihoods of sets of parameters, whose filters run side by side; minus infinity where one
/// fails.
void log_likelihoods(const Problem& problem, const std::vector<const double*>& sets,
                     const Noise& noise, double* out);

/// Whitened prediction errors, kChannels per sample, runs one after the other.
void residuals(const Problem& problem, const double* p, const FrozenFilter& filter, double* out);

/// Minus the derivatives of the residuals with respect to the parameters `columns`;
/// row-major, (kChannels * samples) x columns.size().
void sensitivities(const Problem& problem, const double* p, const FrozenFilter& filter,
                   const std::vector<int>& columns, double* out);

/// Gauss-Newton normal equations over the parameters `columns`: half the sum of squared residuals,
/// G^T e and G^T G (row-major) with G the sensitivities.
double normal_equations(const Problem& problem, const double* p, const FrozenFilter& filter,
                        const std::vector<int>& columns, double* gradient, double* information);

/// Half the sum of squared residuals alone.
double half_sum_of_squares(const Problem& problem, const double* p, const FrozenFilter& filter);

/// Sensitivities to signals that act as forces or shift readings: column b answers to `signals`
/// (samples x count, row-major) added to target b: an `External` that pushes, or kPushes + a
/// `Channel` for a sensor reading.
void signal_sensitivities(const Problem& problem, const double* p, const FrozenFilter& filter,
                          const double* signals, const std::vector<int>& targets, double* out);

/// Derivatives of the log-likelihood with respect to the logarithms of the noise parameters
/// (sensor, motion, disturbance, correlation times, road and its time, colour and its times; of
/// what there is not they are zero), and their expected information (row-major).
double noise_score(const Problem& logged, const double* p, const Noise& noise, double* gradient,
                   double* information);

/// The same where the filter has run with these parameters, under its noise.
double noise_score(const Problem& logged, const double* p, const FrozenFilter& filter,
                   double* gradient, double* information);

/// Everything the filter, or the smoother, says of each sample.
struct Trace {
    std::vector<double> innovation;   // samples x kChannels; NaN where missing
    std::vector<double> spread;       // its expected standard deviation
    std::vector<double> whitened;     // zero where missing
    std::vector<double> log_density;  // -1/2 log det S, per sample
    std::vector<double> state;        // samples x kStatesTold, filtered or smoothed
    std::vector<double> state_std;
    double log_likelihood = 0.0;
};

Trace trace(const Problem& logged, const double* p, const Noise& noise, bool smoothed);

/// What the filter says, where it has run with these parameters, under its noise.
Trace trace(const Problem& logged, const double* p, const FrozenFilter& filter);

/// The states that the smoother tells, samples x kStatesTold, without how sure they are: a third of
/// the work.
void smoothed_means(const Problem& logged, const double* p, const Noise& noise, double* out);

/// The same where the filter has run with these parameters, under its noise.
void smoothed_means(const Problem& logged, const double* p, const FrozenFilter& filter,
                    double* out);

/// Predictions so many samples ahead, of which one sample in `every` starts one.
struct Horizon {
    std::size_t ahead = 1;
    std::size_t every = 1;
};

/// Prediction errors from the filtered state, for each horizon samples x kChannels; NaN where no
/// prediction ends. The filter runs once, and predictions that start at one sample are one
/// prediction, read at each horizon. Where the slope of the road varies it is known: whoever drives
/// answers the slopes to come, and of a prediction that does not know them a car that answers less
/// errs less. `road`: gravity along and across at each sample. Without it the grade is that of the
/// smoother, and the crossfall fades: a smoother takes what a model errs sideways for one, by which
/// that model would be predicted. `readings`: what is predicted itself, from what was known before;
/// both slopes fade.
void look_ahead(const Problem& logged, const double* p, const Noise& noise,
                const std::vector<Horizon>& horizons, double* errors, bool readings = false,
                const double* road = nullptr);

/// Readings of each run, kChannels per sample, simulated from where it starts with no filter.
void free_run(const Problem& logged, const double* p, double* readings);

}  // namespace sysid
