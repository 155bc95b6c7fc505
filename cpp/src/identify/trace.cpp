#include <algorithm>

#include "sysid/estimate/smoother.hpp"
#include "sysid/identify/in_time.hpp"
#include "sysid/identify/lane_filter.hpp"
#include "sysid/identify/prediction_error.hpp"
#include "sysid/identify/run_system.hpp"
#include "sysid/identify/told_path.hpp"
#include "sysid/math/interrupt.hpp"

namespace sysid {

namespace {

template <int NX>
void store_state(const RunSystem<NX>& system, Trace& out, const Vec<NX>& mean,
                 const Mat<NX, NX>& covariance) {
    const std::size_t begin = out.state.size();
    out.state.resize(begin + kStatesTold, std::nan(""));
    out.state_std.resize(begin + kStatesTold, std::nan(""));
    const auto store = [&](std::size_t to, int from) {
        out.state[begin + to] = mean[from];
        out.state_std[begin + to] = std::sqrt(std::max(covariance(from, from), 0.0));
    };
    std::fill_n(out.state.begin() + static_cast<long>(begin), kStatesPlain, 0.0);
    std::fill_n(out.state_std.begin() + static_cast<long>(begin), kStatesPlain, 0.0);
    for (int i = 0; i < std::min(system.packed(0), NX); ++i) store(static_cast<std::size_t>(i), i);
    for (std::size_t i = 0; i < system.own().count; ++i)
        store(kMotionStates + system.place(i), system.packed(i));
    const auto pushes = std::min<std::size_t>(system.disturbances(), kPushes);
    for (std::size_t i = kMotionStates; i < pushes; ++i)
        store(kStatesFull + i - kMotionStates, system.disturbing(i));
}

template <int NX>
void trace_run(const Problem& problem, const Run& run, const double* p, const Noise& noise,
               bool smoothed, Trace& out) {
    const RunSystem<NX> system(problem.model, run, p, noise);
    std::vector<FilterStep<NX, kChannels>> steps;
    if (smoothed) steps.reserve(run.size());
    out.log_likelihood +=
        filter_run<NX>(system, [&](std::size_t k, const FilterStep<NX, kChannels>& s) {
            const Mat<kChannels, kChannels> S = s.update.lower * s.update.lower.transpose();
            const Vec<kChannels> white =
                s.update.lower.template triangularView<Eigen::Lower>().solve(s.update.innovation);
            for (int i = 0; i < kChannels; ++i) {
                const bool missing = std::isnan(run.measurements[k][i]);
                out.innovation.push_back(missing ? std::nan("") : s.update.innovation[i]);
                out.spread.push_back(missing ? std::nan("") : std::sqrt(S(i, i)));
                out.whitened.push_back(missing ? 0.0 : white[i]);
            }
            out.log_density.push_back(-s.update.lower.diagonal().array().log().sum());
            if (smoothed)
                steps.push_back(s);
            else
                store_state<NX>(system, out, s.mean, s.covariance);
        });
    if (!smoothed) return;
    for (const auto& s : smooth(steps)) store_state<NX>(system, out, s.mean, s.covariance);
}

/// What the filter says of a sample, from its gains and what it told.
void add_told(const FrozenFilter& filter, std::size_t run, std::size_t k, Trace& out) {
    const std::size_t n = filter.rows.size();
    const double *error = filter.told(run, k), *mean = error + kChannels, *known = mean + n;
    Mat<kChannels, kChannels> whitener = Mat<kChannels, kChannels>::Zero();
    const double* from = filter.whitener(run, k);
    for (int i = 0; i < kChannels; ++i)
        for (int j = 0; j <= i; ++j) whitener(i, j) = *from++;
    Vec<kChannels> white;
    filter.whiten(run, k, error, white.data());
    std::array<bool, kChannels> missing{};
    for (int i = 0; i < kChannels; ++i) {
        missing[static_cast<std::size_t>(i)] = whitener(i, i) == 0.0;
        if (whitener(i, i) == 0.0) whitener(i, i) = 1.0;
    }
    const Mat<kChannels, kChannels> lower =
        whitener.triangularView<Eigen::Lower>().solve(Mat<kChannels, kChannels>::Identity().eval());
    for (int i = 0; i < kChannels; ++i) {
        const bool none = missing[static_cast<std::size_t>(i)];
        out.innovation.push_back(none ? std::nan("") : error[i]);
        out.spread.push_back(none ? std::nan("") : lower.row(i).norm());
        out.whitened.push_back(none ? 0.0 : white[i]);
    }
    out.log_density.push_back(whitener.diagonal().array().log().sum());
    const std::size_t begin = out.state.size();
    for (std::vector<double>* all : {&out.state, &out.state_std}) {
        all->resize(begin + kStatesTold, std::nan(""));
        std::fill_n(all->begin() + static_cast<long>(begin), kStatesPlain, 0.0);
    }
    for (std::size_t i = 0; i < n; ++i) {
        const auto row = static_cast<std::size_t>(filter.rows[i]);
        if (row >= kStatesTold) continue;
        out.state[begin + row] = mean[i];
        out.state_std[begin + row] = std::sqrt(std::max(known[LaneFilter::packed(i, i)], 0.0));
    }
}

/// The first sample of each run among all.
std::vector<std::size_t> first_samples(const Problem& problem) {
    std::vector<std::size_t> first;
    std::size_t samples = 0;
    for (const Run& run : problem.runs) {
        first.push_back(samples);
        samples += run.size();
    }
    return first;
}

/// Where smoothed means go: kStatesTold per sample, by the names of `filter_rows`.
struct Means {
    double* out;

    double* at(std::size_t sample) const { return out + sample * kStatesTold; }
    /// States that a car always has are zero, others unknown.
    void clear(std::size_t samples) const {
        std::fill_n(out, samples * kStatesTold, std::nan(""));
        for (std::size_t k = 0; k < samples; ++k) std::fill_n(at(k), kStatesPlain, 0.0);
    }
};

/// The backward pass over a run that the filter has gone through, from its last sample on.
///
/// Smoothed means alone need no covariance but the filter's: they are what is known at a sample and
/// that times a sum of later innovations (Bryson & Frazier 1963; de Jong, Biometrika 1988).
class MeansBackwards {
  public:
    MeansBackwards(const Run& run, const Noise& noise, std::size_t moving,
                   const std::vector<int>& rows)
        : run_(run), moving_(moving), rows_(rows), later_(rows.size(), 0.0), before_(rows.size()) {
        for (std::size_t d = 0; d < noise.disturbances(); ++d)
            forget_.push_back(noise.forget(d, run.dt));
    }

    /// Writes the means of sample `k`; false where one is no number.
    bool add(std::size_t k, const ScoreSample& s, double* out) {
        const std::size_t n = rows_.size();
        for (std::size_t i = 0; i < n; ++i) {
            double sum = s.mean[i];
            for (std::size_t j = 0; j < n; ++j)
                sum += s.covariance[LaneFilter::packed(std::max(i, j), std::min(i, j))] * later_[j];
            if (!std::isfinite(sum)) return false;
            const auto row = static_cast<std::size_t>(rows_[i]);
            if (row < kStatesTold) out[row] = sum;
        }
        std::array<double, kChannels> told{};  // inverse covariance times innovation
        for (std::size_t i = 0, entry = 0; i < kChannels; entry += ++i) {
            double white = 0.0;
            for (std::size_t j = 0; j <= i; ++j) white += s.whitener[entry + j] * s.innovation[j];
            for (std::size_t j = 0; j <= i; ++j) told[j] += s.whitener[entry + j] * white;
        }
        before_ = later_;
        for (std::size_t c = 0; c < kChannels; ++c) {
            if (std::isnan(run_.measurements[k][static_cast<int>(c)])) continue;
            double sum = told[c];
            for (std::size_t i = 0; i < n; ++i) sum -= s.gain[i * kChannels + c] * later_[i];
            for (std::size_t i = 0; i < n; ++i) before_[i] += s.observation[c * n + i] * sum;
        }
        for (std::size_t i = 0; i < n && k > 0; ++i) {
            double sum = i < moving_ ? 0.0 : forget_[i - moving_] * before_[i];
            for (std::size_t r = 0; r < moving_; ++r) sum += s.transition[r * n + i] * before_[r];
            later_[i] = sum;
        }
        return true;
    }

  private:
    const Run& run_;
    std::size_t moving_;
    const std::vector<int>& rows_;
    std::vector<double> forget_, later_, before_;
};

bool means_in_pieces(const Problem& problem, const double* p, const Noise& noise, const Means& to) {
    const std::vector<Piece> pieces =
        pieces_of(problem.runs, forgets_s(problem, noise), filter_samples(problem.model));
    if (pieces.empty()) return false;
    LaneFilter filter(problem, {p}, noise, pieces);
    filter.with_transition = true;
    const std::vector<std::size_t> first = first_samples(problem);
    const std::vector<int> rows = filter_rows(problem.model.effects, noise.disturbances());
    const std::size_t moving = filter.moving();
    const std::size_t wide = filter.sample_size();
    std::vector<double> numbers(problem.samples() * wide);
    filter.keep = [&](const LaneSample& s, std::size_t lane, int /*parts*/) {
        filter.write_sample(lane, numbers.data() + (first[pieces[s.piece].run] + s.at) * wide);
    };
    if (!side_by_side(problem.runs, pieces, filter)) return false;
    to.clear(problem.samples());
    for (std::size_t i = 0; i < problem.runs.size(); ++i) {
        const Run& run = problem.runs[i];
        MeansBackwards means(run, noise, moving, rows);
        for (std::size_t k = run.size(); k-- > 0;) {
            poll_interrupt(k);
            const double* from = numbers.data() + (first[i] + k) * wide;
            if (!means.add(k, score_sample(from, rows.size(), moving, k), to.at(first[i] + k)))
                return false;
        }
    }
    return true;
}

/// The same along a path that a filter has told; how single samples answer to states is worked out
/// for many of them side by side.
bool means_along(const Problem& problem, const double* p, const FrozenFilter& filter,
                 const Means& to) {
    ToldPath path(problem, p, filter);
    to.clear(problem.samples());
    const std::vector<std::size_t> first = first_samples(problem);
    for (std::size_t i = 0; i < problem.runs.size(); ++i) {
        const Run& run = problem.runs[i];
        MeansBackwards means(run, filter.noise, path.moving(), filter.rows);
        for (std::size_t end = run.size(); end > 0;) {
            poll_interrupt();
            const std::size_t count = std::min(ToldPath::kTogether, end);
            end -= count;
            path.linearise(i, end, count);
            for (std::size_t j = count; j-- > 0;)
                if (!means.add(end + j, path.sample(i, end + j), to.at(first[i] + end + j)))
                    return false;
        }
    }
    return true;
}

}  // namespace

Trace trace(const Problem& logged, const double* p, const Noise& noise, bool smoothed) {
    const InTime in_time(logged, p);
    const Problem& problem = *in_time;
    Trace out;
    with_state_size(problem.model.effects, noise, [&](auto nx) {
        for (const Run& run : problem.runs)
            trace_run<decltype(nx)::value>(problem, run, p, noise, smoothed, out);
    });
    return out;
}

Trace trace(const Problem& logged, const double* p, const FrozenFilter& filter) {
    if (!filter.tells_of(logged)) return trace(logged, p, filter.noise, false);
    Trace out;
    out.log_likelihood = filter.log_likelihood;
    for (std::size_t i = 0; i < logged.runs.size(); ++i)
        for (std::size_t k = 0; k < logged.runs[i].size(); ++k) {
            poll_interrupt(k);
            add_told(filter, i, k, out);
        }
    return out;
}

void smoothed_means(const Problem& logged, const double* p, const Noise& noise, double* out) {
    const InTime in_time(logged, p);
    if (means_in_pieces(*in_time, p, noise, {out})) return;
    if (logged.samples() <= kToldSamples &&
        means_along(*in_time, p, freeze(logged, p, noise), {out}))
        return;
    const Trace told = trace(logged, p, noise, true);
    std::copy(told.state.begin(), told.state.end(), out);
}

void smoothed_means(const Problem& logged, const double* p, const FrozenFilter& filter,
                    double* out) {
    const InTime in_time(logged, p);
    if (!filter.tells_of(logged) || !means_along(*in_time, p, filter, {out}))
        smoothed_means(logged, p, filter.noise, out);
}

void free_run(const Problem& logged, const double* p, double* readings) {
    const InTime in_time(logged, p);
    const Problem& problem = *in_time;
    const std::array<double, kExternals> calm{};
    for (const Run& run : problem.runs) {
        ModelState<double> x = initial_state(problem.model, run, p);
        for (std::size_t k = 0; k < run.size(); ++k) {
            poll_interrupt(k);
            if (k > 0)
                advance(problem.model, x, calm.data(), run.inputs[k - 1], run.inputs[k], p, run.dt,
                        substeps_for(problem.model, p, x[0], run.dt));
            const auto y = sense(problem.model, x, calm.data(), run.inputs[k], p);
            readings = std::copy(y.begin(), y.end(), readings);
        }
    }
}

}  // namespace sysid
