#include <algorithm>

#include "sysid/estimate/smoother.hpp"
#include "sysid/identify/in_time.hpp"
#include "sysid/identify/lane_filter.hpp"
#include "sysid/identify/prediction_error.hpp"
#include "sysid/identify/run_system.hpp"
#include "sysid/math/interrupt.hpp"

namespace sysid {

namespace {

template <int NX>
void store_state(const RunSystem<NX>& system, Trace& out, const Vec<NX>& mean,
                 const Mat<NX, NX>& covariance) {
    const std::size_t begin = out.state.size();
    out.state.resize(begin + kStatesFull, std::nan(""));
    out.state_std.resize(begin + kStatesFull, std::nan(""));
    const auto store = [&](std::size_t to, int from) {
        out.state[begin + to] = mean[from];
        out.state_std[begin + to] = std::sqrt(std::max(covariance(from, from), 0.0));
    };
    std::fill_n(out.state.begin() + static_cast<long>(begin), kStatesPlain, 0.0);
    std::fill_n(out.state_std.begin() + static_cast<long>(begin), kStatesPlain, 0.0);
    for (int i = 0; i < std::min(system.packed(0), NX); ++i) store(static_cast<std::size_t>(i), i);
    for (std::size_t i = 0; i < system.own().count; ++i)
        store(kMotionStates + system.place(i), system.packed(i));
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

/// States as they are told, samples x kStatesFull: those that a car always has, others unknown.
void clear_states(std::size_t samples, double* out) {
    std::fill_n(out, samples * kStatesFull, std::nan(""));
    for (std::size_t k = 0; k < samples; ++k) std::fill_n(out + k * kStatesFull, kStatesPlain, 0.0);
}

/// The backward pass over a run that the filter has gone through: of each sample what
/// `LaneFilter::write_sample` wrote, `wide` numbers.
///
/// Smoothed means alone need no covariance but the filter's: they are what is known at a sample and
/// that times a sum of later innovations (Bryson & Frazier 1963; de Jong, Biometrika 1988).
bool means_of_run(const Run& run, const std::vector<double>& forget, std::size_t moving,
                  const std::vector<int>& rows, const double* numbers, std::size_t wide,
                  double* out) {
    const std::size_t n = rows.size();
    std::vector<double> later(n, 0.0), before(n);
    for (std::size_t k = run.size(); k-- > 0;) {
        poll_interrupt(k);
        const double* transition = numbers + k * wide;
        const double* observation = transition + moving * n;
        const double* gain = observation + kChannels * n;
        const double* whitener = gain + n * kChannels;
        const double* innovation = whitener + kWhitener;
        const double* mean = innovation + kChannels;
        const double* covariance = mean + n;
        for (std::size_t i = 0; i < n; ++i) {
            double sum = mean[i];
            for (std::size_t j = 0; j < n; ++j)
                sum += covariance[LaneFilter::packed(std::max(i, j), std::min(i, j))] * later[j];
            if (!std::isfinite(sum)) return false;
            if (rows[i] < static_cast<int>(kStatesFull))
                out[k * kStatesFull + static_cast<std::size_t>(rows[i])] = sum;
        }
        std::array<double, kChannels> told{};  // inverse covariance times innovation
        for (std::size_t i = 0, entry = 0; i < kChannels; entry += ++i) {
            double white = 0.0;
            for (std::size_t j = 0; j <= i; ++j) white += whitener[entry + j] * innovation[j];
            for (std::size_t j = 0; j <= i; ++j) told[j] += whitener[entry + j] * white;
        }
        before = later;
        for (std::size_t c = 0; c < kChannels; ++c) {
            if (std::isnan(run.measurements[k][static_cast<int>(c)])) continue;
            double sum = told[c];
            for (std::size_t i = 0; i < n; ++i) sum -= gain[i * kChannels + c] * later[i];
            for (std::size_t i = 0; i < n; ++i) before[i] += observation[c * n + i] * sum;
        }
        if (k == 0) break;
        for (std::size_t i = 0; i < n; ++i) {
            double sum = i < moving ? 0.0 : forget[i - moving] * before[i];
            for (std::size_t r = 0; r < moving; ++r) sum += transition[r * n + i] * before[r];
            later[i] = sum;
        }
    }
    return true;
}

bool means_in_pieces(const Problem& problem, const double* p, const Noise& noise, double* out) {
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
    clear_states(problem.samples(), out);
    for (std::size_t i = 0; i < problem.runs.size(); ++i) {
        const Run& run = problem.runs[i];
        std::vector<double> forget;
        forget.reserve(noise.disturbances());
        for (std::size_t d = 0; d < noise.disturbances(); ++d)
            forget.push_back(noise.forget(d, run.dt));
        if (!means_of_run(run, forget, moving, rows, numbers.data() + first[i] * wide, wide,
                          out + first[i] * kStatesFull))
            return false;
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

void smoothed_means(const Problem& logged, const double* p, const Noise& noise, double* out) {
    const InTime in_time(logged, p);
    if (means_in_pieces(*in_time, p, noise, out)) return;
    const Trace told = trace(logged, p, noise, true);
    std::copy(told.state.begin(), told.state.end(), out);
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
