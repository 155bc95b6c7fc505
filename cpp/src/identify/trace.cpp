#include <algorithm>
#include <stdexcept>

#include "sysid/estimate/smoother.hpp"
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
    for (int i = 0; i < kStatesPlain; ++i) store(static_cast<std::size_t>(i), i);
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

template <int NX>
void look_ahead_run(const Problem& problem, const Run& run, const double* p, const Noise& noise,
                    std::size_t ahead, std::size_t every, double* errors) {
    const RunSystem<NX> system(problem.model, run, p, noise);
    std::vector<Vec<NX>> means(run.size());
    filter_run<NX>(system,
                   [&](std::size_t k, const FilterStep<NX, kChannels>& s) { means[k] = s.mean; });
    std::fill(errors, errors + run.size() * kChannels, std::nan(""));
    if (ahead >= run.size()) return;
    const std::size_t step = std::min(every, run.size());
    // Forces are not foreseen; the slope of the road fades from where it is known.
    std::array<double, kExternals> external{};
    static_assert(kGravityX == kMotionStates && kExternals == kDisturbances);
    for (std::size_t k = 0; k < run.size() - ahead; k += step) {
        poll_interrupt();
        ModelState<double> x = system.start();
        for (int i = 0; i < kMotionStates; ++i) x[static_cast<std::size_t>(i)] = means[k][i];
        for (std::size_t i = 0; i < system.own().count; ++i)
            x[system.place(i)] = means[k][system.packed(i)];
        for (std::size_t i = kMotionStates; i < system.disturbances(); ++i)
            external[i] = means[k][system.disturbing(i)];
        for (std::size_t n = k + 1; n <= k + ahead; ++n) {
            const int substeps = substeps_for(problem.model, p, x[0], run.dt);
            advance(problem.model, x, external.data(), run.inputs[n - 1], run.inputs[n], p, run.dt,
                    substeps);
            for (std::size_t i = kMotionStates; i < system.disturbances(); ++i)
                external[i] *= system.forget(i);
        }
        const std::size_t at = k + ahead;
        const auto y = sense(problem.model, x, external.data(), run.inputs[at], p);
        for (int i = 0; i < kChannels; ++i)
            errors[at * kChannels + static_cast<std::size_t>(i)] =
                run.measurements[at][i] - y[static_cast<std::size_t>(i)];
    }
}

}  // namespace

Trace trace(const Problem& problem, const double* p, const Noise& noise, bool smoothed) {
    Trace out;
    with_state_size(problem.model.effects, noise, [&](auto nx) {
        for (const Run& run : problem.runs)
            trace_run<decltype(nx)::value>(problem, run, p, noise, smoothed, out);
    });
    return out;
}

void look_ahead(const Problem& problem, const double* p, const Noise& noise, std::size_t ahead,
                std::size_t every, double* errors) {
    if (every == 0) throw std::invalid_argument("every = 0: give one or more");
    with_state_size(problem.model.effects, noise, [&](auto nx) {
        for (const Run& run : problem.runs) {
            look_ahead_run<decltype(nx)::value>(problem, run, p, noise, ahead, every, errors);
            errors += run.size() * kChannels;
        }
    });
}

}  // namespace sysid
