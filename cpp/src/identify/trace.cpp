#include <algorithm>

#include "sysid/estimate/smoother.hpp"
#include "sysid/identify/in_time.hpp"
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
