#include "sysid/identify/prediction_error.hpp"

#include <algorithm>

#include "sysid/estimate/frozen.hpp"
#include "sysid/identify/local_model.hpp"
#include "sysid/identify/run_system.hpp"
#include "sysid/math/interrupt.hpp"
#include "sysid/math/lanes.hpp"

namespace sysid {

namespace {

constexpr double kTurn = 1.6;  // of the fastest rate in a part of an interval, see `substeps_for`

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

/// What a path gives for one sample besides the errors.
struct Moment {
    int substeps = 0;                 // of the step to it, none for the first of a run
    ModelState<double> before, here;  // corrected states of the sample before; predicted ones
    std::array<double, kExternals> pushed, pushed_here;  // what disturbs step and reading
};

/// The mean of the filter with frozen gains; `keep(k, errors, moment)` gets whitened errors.
template <class Keep>
void run_frozen(const SingleTrack& model, const Run& run, const double* p,
                const std::vector<FrozenStep>& steps, const Noise& noise, Keep&& keep) {
    const ActiveStates own = active_states(model.effects);
    const std::size_t disturbances = noise.sloping() ? kDisturbances : kMotionStates;
    std::array<double, kDisturbances> forget;
    for (std::size_t i = 0; i < kDisturbances; ++i) forget[i] = noise.forget(i, run.dt);
    static_assert(kDisturbances == kExternals);
    ModelState<double> x = initial_state(model, run, p);
    std::array<double, kExternals> disturbance{};
    Moment moment;
    for (std::size_t k = 0; k < run.size(); ++k) {
        poll_interrupt(k);
        if (k > 0) {
            moment.before = x;
            moment.pushed = disturbance;
            // More of them only far from where the filter was frozen, where fewer were unstable.
            moment.substeps =
                std::max(steps[k].substeps, substeps_for(model, p, x[0], run.dt, kTurn));
            advance(model, x, disturbance.data(), run.inputs[k - 1], run.inputs[k], p, run.dt,
                    moment.substeps);
            for (std::size_t i = 0; i < disturbances; ++i)
                disturbance[i] = forget[i] * disturbance[i];
        }
        moment.here = x;
        moment.pushed_here = disturbance;
        const auto y = sense(model, x, disturbance.data(), run.inputs[k], p);
        const FrozenStep& step = steps[k];
        const std::array<double, kChannels> error = errors_of(run.measurements[k], y);
        keep(k, whitened(step.whitener, error), moment);
        const auto mend = [&](int row, double& state) { correct(step.gain, row, error, state); };
        for (int i = 0; i < kMotionStates; ++i) {
            mend(i, x[static_cast<std::size_t>(i)]);
            mend(kMotionStates + i, disturbance[static_cast<std::size_t>(i)]);
        }
        for (std::size_t i = kMotionStates; i < disturbances; ++i)
            mend(road_row(i), disturbance[i]);
        for (std::size_t i : own) mend(kStatesPlain + static_cast<int>(i), x[kMotionStates + i]);
    }
}

/// Signals that act as forces or shift readings, a column each.
struct Signals {
    const double* values;  // samples x targets, row-major
    const std::vector<int>* targets;
};

/// Derivatives of the whitened errors with frozen gains, by parameters or signals.
///
/// Those of the single steps stand in `LocalModel`; from sample to sample they are handed on by the
/// same linear recursion as the mean.
class Derivatives {
  public:
    Derivatives(const Problem& problem, const double* p, const FrozenFilter& filter,
                const std::vector<int>& columns, const Signals* signals = nullptr)
        : problem_(problem),
          p_(p),
          filter_(filter),
          signals_(signals),
          own_(active_states(problem.model.effects)),
          width_(padded(signals != nullptr ? signals->targets->size() : columns.size())),
          local_(problem.model, p, columns, width_, signals != nullptr || filter.noise.sloping()),
          states_(local_.states()),
          externals_(local_.externals()),
          samples_(kTogether),
          packed_(kTogether * 2 * (states_ + kExternals)),
          derivatives_(kTogether * local_.size()),
          G_(kTogether * kChannels * width_),
          e_(kTogether * kChannels) {
        for (int i = 0; i < kMotionStates; ++i) gain_rows_.push_back(i);
        for (const std::size_t i : own_) gain_rows_.push_back(kStatesPlain + static_cast<int>(i));
        for (int i = 0; i < kMotionStates; ++i) gain_rows_.push_back(kMotionStates + i);
        for (std::size_t i = kMotionStates; i < externals_; ++i) gain_rows_.push_back(road_row(i));
        gain_.resize(gain_rows_.size() * kChannels);
    }

    /// Columns as they are kept, zero beyond those that were asked for.
    std::size_t width() const { return width_; }

    /// Calls `keep(G, e, samples)` with minus the derivatives of the errors e: rows of `width()`.
    template <class Keep>
    void walk(Keep&& keep) {
        std::size_t offset = 0;
        for (std::size_t i = 0; i < problem_.runs.size(); ++i) {
            const Run& run = problem_.runs[i];
            moved_.assign((states_ + externals_) * width_, 0.0);
            if (signals_ == nullptr) {
                const std::vector<double> start = local_.start(run);
                std::copy(start.begin(), start.end(), moved_.begin());
            }
            for (std::size_t n = 0; n < externals_; ++n)
                forget_[n] = filter_.noise.forget(n, run.dt);
            taken_ = 0;
            run_frozen(problem_.model, run, p_, filter_.runs[i], filter_.noise,
                       [&](std::size_t k, const auto& white, const Moment& moment) {
                           take(run, k, white, moment);
                           if (taken_ == kTogether || k + 1 == run.size()) {
                               hand_on(run, filter_.runs[i], k + 1 - taken_, offset);
                               keep(G_.data(), e_.data(), taken_);
                               taken_ = 0;
                           }
                       });
            offset += run.size();
        }
    }

  private:
    static constexpr std::size_t kTogether =
        std::size_t{8} * kLanes;  // samples, so that they stay in the cache
    static std::size_t padded(std::size_t columns) { return (columns + 7) / 8 * 8; }

    void take(const Run& run, std::size_t k, const std::array<double, kChannels>& white,
              const Moment& moment) {
        double* to = packed_.data() + taken_ * 2 * (states_ + kExternals);
        const auto packed = [&](const ModelState<double>& x) {
            double* first = to;
            to = std::copy_n(x.begin(), kMotionStates, to);
            for (const std::size_t i : own_) *to++ = x[kMotionStates + i];
            return first;
        };
        const auto kept = [&](const std::array<double, kExternals>& external) {
            double* first = to;
            to = std::copy(external.begin(), external.end(), to);
            return first;
        };
        PathSample& s = samples_[taken_];
        s.run = &run;
        s.at = k;
        s.substeps = k > 0 ? moment.substeps : 0;
        s.before = packed(moment.before);
        s.pushed = kept(moment.pushed);
        s.here = packed(moment.here);
        s.pushed_here = kept(moment.pushed_here);
        std::copy(white.begin(), white.end(), e_.begin() + static_cast<long>(taken_ * kChannels));
        ++taken_;
    }

    /// The recursion over the samples that were taken, the first of them number `first`.
    void hand_on(const Run& run, const std::vector<FrozenStep>& steps, std::size_t first,
                 std::size_t offset) {
        const LaneKernels& kernels = lane_kernels();
        const auto columns = static_cast<std::ptrdiff_t>(states_ + externals_);
        local_.differentiate(samples_.data(), taken_, derivatives_.data());
        std::fill_n(G_.begin(), taken_ * kChannels * width_, 0.0);
        for (std::size_t n = 0; n < taken_; ++n) {
            double* local = derivatives_.data() + n * local_.size();
            const std::size_t k = first + n;
            if (k > 0) {
                double* next = local + local_.step_parameters();
                for (std::size_t i = 0; signals_ != nullptr && i < states_; ++i)
                    force(local + i * gain_rows_.size() + states_, offset + k, next + i * width_);
                kernels.add_product(next, local, columns, 1, moved_.data(), states_,
                                    gain_rows_.size(), width_);
                std::copy_n(next, states_ * width_, moved_.begin());
                for (std::size_t i = 0; i < externals_; ++i)
                    for (std::size_t j = 0; j < width_; ++j)
                        moved_[(states_ + i) * width_ + j] *= forget_[i];
            }
            const double* read = local + local_.read();
            double* reading = local + local_.read_parameters();
            for (std::size_t c = 0; signals_ != nullptr && c < kChannels; ++c) {
                force(read + c * gain_rows_.size() + states_, offset + k, reading + c * width_);
                shift(c, offset + k, reading + c * width_);
            }
            kernels.add_product(reading, read, columns, 1, moved_.data(), kChannels,
                                gain_rows_.size(), width_);
            for (int c = 0; c < kChannels; ++c)
                if (std::isnan(run.measurements[k][c]))
                    std::fill_n(reading + static_cast<std::size_t>(c) * width_, width_, 0.0);
            kernels.add_product(G_.data() + n * kChannels * width_, steps[k].whitener.data(), 1,
                                kChannels, reading, kChannels, kChannels, width_);
            for (std::size_t i = 0; i < gain_rows_.size(); ++i)
                for (int c = 0; c < kChannels; ++c)
                    gain_[i * kChannels + static_cast<std::size_t>(c)] =
                        -steps[k].gain(gain_rows_[i], c);
            kernels.add_product(moved_.data(), gain_.data(), kChannels, 1, reading,
                                gain_rows_.size(), kChannels, width_);
        }
    }

    /// Adds what the signals of sample `k` do as forces; `by_external`: derivatives by those.
    void force(const double* by_external, std::size_t k, double* row) const {
        const std::vector<int>& targets = *signals_->targets;
        const double* values = signals_->values + k * targets.size();
        for (std::size_t j = 0; j < targets.size(); ++j)
            if (targets[j] < kExternals) row[j] += by_external[targets[j]] * values[j];
    }

    void shift(std::size_t channel, std::size_t k, double* row) const {
        const std::vector<int>& targets = *signals_->targets;
        for (std::size_t j = 0; j < targets.size(); ++j)
            if (targets[j] == kExternals + static_cast<int>(channel))
                row[j] += signals_->values[k * targets.size() + j];
    }

    const Problem& problem_;
    const double* p_;
    const FrozenFilter& filter_;
    const Signals* signals_;
    ActiveStates own_;
    std::size_t width_;
    LocalModel local_;
    std::size_t states_, externals_, taken_ = 0;
    std::vector<int> gain_rows_;
    std::vector<PathSample> samples_;
    std::vector<double> packed_, derivatives_, G_, e_, moved_, gain_;
    std::array<double, kExternals> forget_{};
};

/// The derivatives without their padding.
void write(Derivatives& derivatives, std::size_t columns, double* out) {
    if (columns == 0) return;
    derivatives.walk([&](const double* G, const double* /*e*/, std::size_t samples) {
        for (std::size_t row = 0; row < samples * kChannels; ++row)
            out = std::copy_n(G + row * derivatives.width(), columns, out);
    });
}

template <class Keep>
void each_error(const Problem& problem, const double* p, const FrozenFilter& filter, Keep&& keep) {
    for (std::size_t i = 0; i < problem.runs.size(); ++i)
        run_frozen(problem.model, problem.runs[i], p, filter.runs[i], filter.noise,
                   [&](std::size_t, const auto& white, const Moment&) { keep(white); });
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
    each_error(problem, p, filter,
               [&](const auto& white) { out = std::copy(white.begin(), white.end(), out); });
}

double half_sum_of_squares(const Problem& problem, const double* p, const FrozenFilter& filter) {
    double sum = 0.0;
    each_error(problem, p, filter, [&](const auto& white) {
        for (const double e : white) sum += e * e;
    });
    return 0.5 * sum;
}

void sensitivities(const Problem& problem, const double* p, const FrozenFilter& filter,
                   const std::vector<int>& columns, double* out) {
    Derivatives derivatives(problem, p, filter, columns);
    write(derivatives, columns.size(), out);
}

double normal_equations(const Problem& problem, const double* p, const FrozenFilter& filter,
                        const std::vector<int>& columns, double* gradient, double* information) {
    const std::size_t n = columns.size();
    if (n == 0) return half_sum_of_squares(problem, p, filter);
    Derivatives derivatives(problem, p, filter, columns);
    const std::size_t width = derivatives.width();
    std::vector<double> slope(width, 0.0), squares(width * width, 0.0);
    double sum = 0.0;
    derivatives.walk([&](const double* G, const double* e, std::size_t samples) {
        lane_kernels().add_squares(G, e, samples * kChannels, width, slope.data(), squares.data());
        for (std::size_t i = 0; i < samples * kChannels; ++i) sum += e[i] * e[i];
    });
    std::copy_n(slope.begin(), n, gradient);
    for (std::size_t i = 0; i < n; ++i)
        for (std::size_t j = 0; j <= i; ++j)
            information[i * n + j] = information[j * n + i] = squares[i * width + j];
    return 0.5 * sum;
}

void signal_sensitivities(const Problem& problem, const double* p, const FrozenFilter& filter,
                          const double* signals, const std::vector<int>& targets, double* out) {
    const Signals all{signals, &targets};
    Derivatives derivatives(problem, p, filter, {}, &all);
    write(derivatives, targets.size(), out);
}

}  // namespace sysid
