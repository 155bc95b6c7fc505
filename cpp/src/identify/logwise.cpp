#include "sysid/identify/logwise.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace sysid {

namespace {

/// Parameters of a part.
class Own {
  public:
    Own(const LogwiseProblem::Part& part, const double* p) : values_(p) {
        if (part.shift.empty()) return;
        moved_ = part.shift;
        for (double& value : moved_) value += *p++;
        values_ = moved_.data();
    }
    operator const double*() const { return values_; }  // NOLINT(*-explicit-*)

  private:
    std::vector<double> moved_;
    const double* values_;
};

/// Calls `work(part, its parameters, its number, samples before it)` for all parts.
template <class Work>
void each(const LogwiseProblem& problem, const double* p, Work&& work) {
    std::size_t before = 0, number = 0;
    for (const LogwiseProblem::Part& part : problem.parts) {
        const Own own(part, p);
        work(part.problem, own, number++, before);
        before += part.problem.samples();
    }
}

/// The sum of what `work` returns and of the derivatives it writes, of `n` and of n by n numbers.
template <class Work>
double added(const LogwiseProblem& problem, const double* p, std::size_t n, double* gradient,
             double* information, Work&& work) {
    double sum = 0.0;
    std::vector<double> g(n), h(n * n);
    each(problem, p, [&](const Problem& part, const double* own, std::size_t number, std::size_t) {
        sum += work(part, own, number, g.data(), h.data());
        for (std::size_t i = 0; i < g.size(); ++i)
            gradient[i] = (number > 0 ? gradient[i] : 0.0) + g[i];
        for (std::size_t i = 0; i < h.size(); ++i)
            information[i] = (number > 0 ? information[i] : 0.0) + h[i];
    });
    return sum;
}

/// One after the other what `work(part, its parameters, its number)` says of the samples.
template <class Work>
Trace joined(const LogwiseProblem& problem, const double* p, Work&& work) {
    Trace all;
    each(problem, p, [&](const Problem& part, const double* own, std::size_t number, std::size_t) {
        Trace some = work(part, own, number);
        if (number == 0) {
            all = std::move(some);
            return;
        }
        for (auto member : {&Trace::innovation, &Trace::spread, &Trace::whitened,
                            &Trace::log_density, &Trace::state, &Trace::state_std})
            (all.*member).insert((all.*member).end(), (some.*member).begin(), (some.*member).end());
        all.log_likelihood += some.log_likelihood;
    });
    return all;
}

}  // namespace

Problem& LogwiseProblem::shifted(std::vector<double> shift) {
    if (parts.back().shift != shift) {
        if (parts.back().problem.runs.empty())
            parts.back().shift = std::move(shift);
        else
            parts.push_back({Problem{parts.back().problem.model, {}}, std::move(shift)});
    }
    return parts.back().problem;
}

void LogwiseProblem::add(std::vector<double> shift, Run run) {
    constexpr double kClocks = 1e-5;  // of a second, how well quartz tells it
    std::vector<Run>& runs = shifted(std::move(shift)).runs;
    const auto alike = std::find_if(runs.begin(), runs.end(), [&](const Run& other) {
        return std::abs(other.dt - run.dt) < kClocks * run.dt;
    });
    if (alike != runs.end()) run.dt = alike->dt;
    runs.push_back(std::move(run));
}

LogwiseProblem LogwiseProblem::with_model(const SingleTrack& model) const {
    LogwiseProblem other = *this;
    for (Part& part : other.parts) {
        const auto most_n = part.problem.model.most_n;
        part.problem.model = model;
        part.problem.model.most_n = most_n;
    }
    return other;
}

std::size_t LogwiseProblem::samples() const {
    std::size_t n = 0;
    for (const Part& part : parts) n += part.problem.samples();
    return n;
}

bool fits(const LogwiseProblem& problem, const LogwiseFilter& filter) {
    bool same = problem.parts.size() == filter.parts.size();
    for (std::size_t n = 0; same && n < filter.parts.size(); ++n) {
        const std::vector<Run>& runs = problem.parts[n].problem.runs;
        const std::vector<FrozenRun>& of = filter.parts[n].runs;
        same = runs.size() == of.size();
        for (std::size_t i = 0; same && i < of.size(); ++i) same = runs[i].size() == of[i].size();
    }
    return same;
}

LogwiseFilter freeze(const LogwiseProblem& logged, const double* p, const Noise& noise) {
    LogwiseFilter filter;
    each(logged, p, [&](const Problem& part, const double* own, std::size_t, std::size_t) {
        filter.parts.push_back(freeze(part, own, noise));
        filter.log_likelihood += filter.parts.back().log_likelihood;
        filter.observed += filter.parts.back().observed;
    });
    return filter;
}

void log_likelihoods(const LogwiseProblem& problem, const std::vector<const double*>& sets,
                     const Noise& noise, double* out) {
    std::vector<double> some(sets.size());
    for (std::size_t i = 0; i < sets.size(); ++i) out[i] = 0.0;
    for (const LogwiseProblem::Part& part : problem.parts) {
        std::vector<Own> shifted;
        shifted.reserve(sets.size());
        for (const double* p : sets) shifted.emplace_back(part, p);
        const std::vector<const double*> own(shifted.begin(), shifted.end());
        log_likelihoods(part.problem, own, noise, some.data());
        for (std::size_t i = 0; i < sets.size(); ++i) out[i] += some[i];
    }
}

void residuals(const LogwiseProblem& problem, const double* p, const LogwiseFilter& filter,
               double* out) {
    each(problem, p,
         [&](const Problem& part, const double* own, std::size_t number, std::size_t before) {
             residuals(part, own, filter.parts[number], out + before * kChannels);
         });
}

void sensitivities(const LogwiseProblem& problem, const double* p, const LogwiseFilter& filter,
                   const std::vector<int>& columns, double* out) {
    each(problem, p,
         [&](const Problem& part, const double* own, std::size_t number, std::size_t before) {
             sensitivities(part, own, filter.parts[number], columns,
                           out + before * kChannels * columns.size());
         });
}

double normal_equations(const LogwiseProblem& problem, const double* p, const LogwiseFilter& filter,
                        const std::vector<int>& columns, double* gradient, double* information) {
    return added(
        problem, p, columns.size(), gradient, information,
        [&](const Problem& part, const double* own, std::size_t number, double* g, double* h) {
            return normal_equations(part, own, filter.parts[number], columns, g, h);
        });
}

double half_sum_of_squares(const LogwiseProblem& problem, const double* p,
                           const LogwiseFilter& filter) {
    double sum = 0.0;
    each(problem, p, [&](const Problem& part, const double* own, std::size_t number, std::size_t) {
        sum += half_sum_of_squares(part, own, filter.parts[number]);
    });
    return sum;
}

void signal_sensitivities(const LogwiseProblem& problem, const double* p,
                          const LogwiseFilter& filter, const double* signals,
                          const std::vector<int>& targets, double* out) {
    each(problem, p,
         [&](const Problem& part, const double* own, std::size_t number, std::size_t before) {
             const std::size_t first = before * targets.size();
             signal_sensitivities(part, own, filter.parts[number], signals + first, targets,
                                  out + first * kChannels);
         });
}

double noise_score(const LogwiseProblem& logged, const double* p, const Noise& noise,
                   double* gradient, double* information) {
    return added(logged, p, kNoiseParameters, gradient, information,
                 [&](const Problem& part, const double* own, std::size_t /*number*/, double* g,
                     double* h) { return noise_score(part, own, noise, g, h); });
}

double noise_score(const LogwiseProblem& logged, const double* p, const LogwiseFilter& filter,
                   double* gradient, double* information) {
    return added(logged, p, kNoiseParameters, gradient, information,
                 [&](const Problem& part, const double* own, std::size_t number, double* g,
                     double* h) { return noise_score(part, own, filter.parts[number], g, h); });
}

Trace trace(const LogwiseProblem& logged, const double* p, const Noise& noise, bool smoothed) {
    return joined(logged, p, [&](const Problem& part, const double* own, std::size_t /*number*/) {
        return trace(part, own, noise, smoothed);
    });
}

Trace trace(const LogwiseProblem& logged, const double* p, const LogwiseFilter& filter) {
    return joined(logged, p, [&](const Problem& part, const double* own, std::size_t number) {
        return trace(part, own, filter.parts[number]);
    });
}

void smoothed_means(const LogwiseProblem& logged, const double* p, const Noise& noise,
                    double* out) {
    each(logged, p, [&](const Problem& part, const double* own, std::size_t, std::size_t before) {
        smoothed_means(part, own, noise, out + before * kStatesTold);
    });
}

void smoothed_means(const LogwiseProblem& logged, const double* p, const LogwiseFilter& filter,
                    double* out) {
    each(logged, p,
         [&](const Problem& part, const double* own, std::size_t number, std::size_t before) {
             smoothed_means(part, own, filter.parts[number], out + before * kStatesTold);
         });
}

void look_ahead(const LogwiseProblem& logged, const double* p, const Noise& noise,
                const std::vector<Horizon>& horizons, double* errors, bool readings,
                const double* road) {
    const std::size_t samples = logged.samples();
    std::vector<double> some;
    each(logged, p, [&](const Problem& part, const double* own, std::size_t, std::size_t before) {
        const std::size_t n = part.samples() * kChannels;
        some.resize(horizons.size() * n);
        look_ahead(part, own, noise, horizons, some.data(), readings,
                   road ? road + 2 * before : nullptr);
        for (std::size_t h = 0; h < horizons.size(); ++h)
            std::copy_n(some.data() + h * n, n, errors + (h * samples + before) * kChannels);
    });
}

void free_run(const LogwiseProblem& logged, const double* p, double* readings) {
    each(logged, p, [&](const Problem& part, const double* own, std::size_t, std::size_t before) {
        free_run(part, own, readings + before * kChannels);
    });
}

}  // namespace sysid
