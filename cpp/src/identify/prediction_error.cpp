#include "sysid/identify/prediction_error.hpp"

#include <algorithm>

#include "sysid/estimate/frozen.hpp"
#include "sysid/identify/least_squares.hpp"
#include "sysid/identify/run_system.hpp"
#include "sysid/math/interrupt.hpp"

namespace sysid {

namespace {

constexpr double kTurn = 1.6;  // of the fastest rate in a part of an interval, see `substeps_for`
using Wide = Dual<kParameterPass>;

/// Where the gains of disturbance `i`, one of the road, stand.
constexpr int road_row(std::size_t i) { return kStatesFull + static_cast<int>(i) - kMotionStates; }

template <int NX>
void freeze_run(const Problem& problem, const Run& run, const double* p, const Noise& noise,
                std::vector<FrozenStep>& steps, FrozenFilter& filter) {
    const RunSystem<NX> system(problem.model, run, p, noise);
    steps.resize(run.size());
    filter.log_likelihood +=
        filter_run<NX>(system, [&](std::size_t k, const FilterStep<NX, kChannels>& s) {
            steps[k].gain.setZero();
            steps[k].gain.template topRows<kStatesPlain>() =
                s.update.gain.template topRows<kStatesPlain>();
            for (std::size_t i = 0; i < system.own().count; ++i)
                steps[k].gain.row(kMotionStates + static_cast<int>(system.place(i))) =
                    s.update.gain.row(system.packed(i));
            for (std::size_t i = kMotionStates; i < system.disturbances(); ++i)
                steps[k].gain.row(road_row(i)) = s.update.gain.row(system.disturbing(i));
            steps[k].whitener = whitener_of<kChannels>(s.update, run.measurements[k]);
            filter.observed += static_cast<std::size_t>(s.update.observed);
            if (k + 1 < run.size())
                steps[k + 1].substeps = substeps_for(problem.model, p, s.mean[0], run.dt);
        });
}

/// The mean of the filter with frozen gains. `disturb(k, external)` may add to the disturbance
/// acting from sample k-1 to k and `shift(k, y)` to the expected reading; `keep(k, e)` gets
/// whitened errors.
template <class S, class T, class Disturb, class Shift, class Keep>
void run_frozen(const SingleTrack& model, const Run& run, const double* p_values, const T* p,
                const std::vector<FrozenStep>& steps, const Noise& noise, Disturb&& disturb,
                Shift&& shift, Keep&& keep) {
    const ActiveStates own = active_states(model.effects);
    ModelState<S> x = initial_state<S>(model, run, p);
    const std::size_t disturbances = noise.sloping() ? kDisturbances : kMotionStates;
    std::array<S, kDisturbances> disturbance;
    disturbance.fill(S(0.0));
    std::array<double, kDisturbances> forget;
    for (std::size_t i = 0; i < kDisturbances; ++i) forget[i] = noise.forget(i, run.dt);
    std::array<S, kExternals> external;
    const auto fill_push = [&](std::size_t k) {
        external.fill(S(0.0));
        for (std::size_t i = 0; i < disturbances; ++i) external[i] = disturbance[i];
        disturb(k, external);
    };
    for (std::size_t k = 0; k < run.size(); ++k) {
        poll_interrupt(k);
        fill_push(k);
        if (k > 0) {
            // More of them only far from where the filter was frozen, where fewer were unstable.
            const int substeps = std::max(
                steps[k].substeps, substeps_for(model, p_values, value_of(x[0]), run.dt, kTurn));
            advance(model, x, external.data(), run.inputs[k - 1], run.inputs[k], p, run.dt,
                    substeps);
            for (std::size_t i = 0; i < disturbances; ++i)
                disturbance[i] = forget[i] * disturbance[i];
            fill_push(k);
        }
        auto y = sense(model, x, external.data(), run.inputs[k], p);
        shift(k, y);
        const FrozenStep& step = steps[k];
        const std::array<S, kChannels> error = errors_of(run.measurements[k], y);
        keep(k, whitened(step.whitener, error));
        const auto mend = [&](int row, S& state) { correct(step.gain, row, error, state); };
        for (int i = 0; i < kMotionStates; ++i) {
            mend(i, x[static_cast<std::size_t>(i)]);
            mend(kMotionStates + i, disturbance[static_cast<std::size_t>(i)]);
        }
        for (std::size_t i = kMotionStates; i < disturbances; ++i)
            mend(road_row(i), disturbance[i]);
        for (std::size_t i : own) mend(kStatesPlain + static_cast<int>(i), x[kMotionStates + i]);
    }
}

const auto kNothing = [](std::size_t, auto&) {};

constexpr Passes<kShortParameterPass, kParameterPass> kPasses{kParameterCount};

/// As `least_squares.hpp` takes it.
auto walk_of(const Problem& problem, const double* values, const FrozenFilter& filter) {
    return [&problem, values, &filter](const auto* p, auto&& keep) {
        using S = std::decay_t<decltype(*p)>;
        for (std::size_t i = 0; i < problem.runs.size(); ++i)
            run_frozen<S>(problem.model, problem.runs[i], values, p, filter.runs[i], filter.noise,
                          kNothing, kNothing, [&](std::size_t, const auto& white) { keep(white); });
    };
}

}  // namespace

FrozenFilter freeze(const Problem& problem, const double* p, const Noise& noise) {
    FrozenFilter filter;
    filter.noise = noise;
    filter.runs.resize(problem.runs.size());
    with_state_size(problem.model.effects, noise, [&](auto nx) {
        for (std::size_t i = 0; i < problem.runs.size(); ++i)
            freeze_run<decltype(nx)::value>(problem, problem.runs[i], p, noise, filter.runs[i],
                                            filter);
    });
    return filter;
}

void residuals(const Problem& problem, const double* p, const FrozenFilter& filter, double* out) {
    residuals_of(walk_of(problem, p, filter), p, out);
}

double half_sum_of_squares(const Problem& problem, const double* p, const FrozenFilter& filter) {
    return half_sum_of(walk_of(problem, p, filter), p);
}

void sensitivities(const Problem& problem, const double* p, const FrozenFilter& filter,
                   const std::vector<int>& columns, double* out) {
    kPasses.sensitivities(walk_of(problem, p, filter), p, columns, out);
}

double normal_equations(const Problem& problem, const double* p, const FrozenFilter& filter,
                        const std::vector<int>& columns, double* gradient, double* information) {
    return kPasses.normal_equations(walk_of(problem, p, filter), p, problem.samples() * kChannels,
                                    columns, gradient, information);
}

void signal_sensitivities(const Problem& problem, const double* p, const FrozenFilter& filter,
                          const double* signals, const std::vector<int>& targets, double* out) {
    const std::size_t width = targets.size();
    for (std::size_t first = 0; first < width; first += kParameterPass) {
        const std::size_t count = std::min<std::size_t>(kParameterPass, width - first);
        double* row = out + first;
        std::size_t offset = 0;
        for (std::size_t i = 0; i < problem.runs.size(); ++i) {
            const auto add = [&](std::size_t k, auto& onto, int base) {
                for (std::size_t j = 0; j < count; ++j) {
                    const int target = targets[first + j] - base;
                    if (target < 0 || target >= static_cast<int>(onto.size())) continue;
                    onto[static_cast<std::size_t>(target)].d[j] +=
                        signals[(offset + k) * width + first + j];
                }
            };
            run_frozen<Wide>(
                problem.model, problem.runs[i], p, p, filter.runs[i], filter.noise,
                [&](std::size_t k, auto& external) { add(k, external, 0); },
                [&](std::size_t k, auto& y) { add(k, y, kExternals); },
                [&](std::size_t, const auto& white) {
                    for (const Wide& e : white) {
                        for (std::size_t j = 0; j < count; ++j) row[j] = -e.d[j];
                        row += width;
                    }
                });
            offset += problem.runs[i].size();
        }
    }
}

}  // namespace sysid
