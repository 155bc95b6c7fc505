// Driving whose logs have parameters of their own: offsets of sensors and road that differ from log
// to log by known amounts. Everything that `prediction_error.hpp` offers, log after log.
#pragma once

#include <vector>

#include "sysid/identify/prediction_error.hpp"

namespace sysid {

/// Runs, consecutive ones of the same shift together; without a shift all are one part.
struct LogwiseProblem {
    struct Part {
        Problem problem;
        std::vector<double> shift;  // of all parameters; empty: none
    };
    std::vector<Part> parts;

    explicit LogwiseProblem(const SingleTrack& model) : parts{{Problem{model, {}}, {}}} {}

    /// The problem that takes further runs whose parameters are shifted so.
    Problem& shifted(std::vector<double> shift);
    /// Takes a run whose parameters are shifted so. Its sampling interval is that of runs that are
    /// there, where the two differ by less than clocks are known to: lanes take steps alike.
    void add(std::vector<double> shift, Run run);
    LogwiseProblem with_model(const SingleTrack& model) const;
    std::size_t samples() const;
};

struct LogwiseFilter {
    std::vector<FrozenFilter> parts;
    double log_likelihood = 0.0;
    std::size_t observed = 0;
};

/// Whether the filter was made from runs like those of the problem.
bool fits(const LogwiseProblem& problem, const LogwiseFilter& filter);

LogwiseFilter freeze(const LogwiseProblem& logged, const double* p, const Noise& noise);
void log_likelihoods(const LogwiseProblem& problem, const std::vector<const double*>& sets,
                     const Noise& noise, double* out);
void residuals(const LogwiseProblem& problem, const double* p, const LogwiseFilter& filter,
               double* out);
void sensitivities(const LogwiseProblem& problem, const double* p, const LogwiseFilter& filter,
                   const std::vector<int>& columns, double* out);
double normal_equations(const LogwiseProblem& problem, const double* p, const LogwiseFilter& filter,
                        const std::vector<int>& columns, double* gradient, double* information);
double half_sum_of_squares(const LogwiseProblem& problem, const double* p,
                           const LogwiseFilter& filter);
void signal_sensitivities(const LogwiseProblem& problem, const double* p,
                          const LogwiseFilter& filter, const double* signals,
                          const std::vector<int>& targets, double* out);
double noise_score(const LogwiseProblem& logged, const double* p, const Noise& noise,
                   double* gradient, double* information);
double noise_score(const LogwiseProblem& logged, const double* p, const LogwiseFilter& filter,
                   double* gradient, double* information);
Trace trace(const LogwiseProblem& logged, const double* p, const Noise& noise, bool smoothed);
Trace trace(const LogwiseProblem& logged, const double* p, const LogwiseFilter& filter);
void smoothed_means(const LogwiseProblem& logged, const double* p, const Noise& noise, double* out);
void smoothed_means(const LogwiseProblem& logged, const double* p, const LogwiseFilter& filter,
                    double* out);
void look_ahead(const LogwiseProblem& logged, const double* p, const Noise& noise,
                const std::vector<Horizon>& horizons, double* errors, bool readings = false,
                const double* road = nullptr);
void free_run(const LogwiseProblem& logged, const double* p, double* readings);

}  // namespace sysid
