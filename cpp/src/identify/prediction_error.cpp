#include "sysid/identify/prediction_error.hpp"

#include <algorithm>

#include "sysid/identify/frozen_path.hpp"
#include "sysid/identify/in_time.hpp"
#include "sysid/identify/local_model.hpp"
#include "sysid/math/interrupt.hpp"
#include "sysid/math/lanes.hpp"

namespace sysid {

namespace {

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
          width_(padded(signals != nullptr ? signals->targets->size() : columns.size())),
          local_(problem.model, p, columns, width_,
                 std::max(filter.noise.disturbances(),
                          signals != nullptr ? std::size_t{kPushes} : std::size_t{0})),
          states_(local_.states()),
          externals_(local_.externals()),
          samples_(kTogether),
          derivatives_(kTogether * local_.size()),
          G_(kTogether * kChannels * width_),
          places_(filter.places(filter_rows(problem.model.effects, externals_))),
          gain_(places_.size() * kChannels),
          whitener_(std::size_t{kChannels} * kChannels, 0.0) {}

    /// Columns as they are kept, zero beyond those that were asked for.
    std::size_t width() const { return width_; }

    /// Calls `keep(G, e, samples)` with minus the derivatives of the errors e: rows of `width()`.
    template <class Keep>
    void walk(Keep&& keep) {
        const FrozenPath path = frozen_path(problem_, p_, filter_, true);
        std::size_t offset = 0;
        for (std::size_t i = 0; i < problem_.runs.size(); ++i) {
            const Run& run = problem_.runs[i];
            moved_.assign(places_.size() * width_, 0.0);
            if (signals_ == nullptr) {
                const std::vector<double> start = local_.start(run);
                std::copy(start.begin(), start.end(), moved_.begin());
            }
            for (std::size_t n = 0; n < externals_; ++n)
                forget_[n] = filter_.noise.forget(n, run.dt);
            for (std::size_t first = 0; first < run.size(); first += kTogether) {
                poll_interrupt();
                const std::size_t count = std::min(kTogether, run.size() - first);
                for (std::size_t n = 0; n < count; ++n)
                    samples_[n] = sample(path, run, first + n, offset);
                hand_on(i, first, count, offset);
                keep(G_.data(), path.whitened.data() + (offset + first) * kChannels, count);
            }
            offset += run.size();
        }
    }

  private:
    static constexpr std::size_t kTogether =
        std::size_t{8} * kLanes;  // samples, so that they stay in the cache
    static std::size_t padded(std::size_t columns) { return (columns + 7) / 8 * 8; }

    PathSample sample(const FrozenPath& path, const Run& run, std::size_t k,
                      std::size_t offset) const {
        PathSample s;
        s.run = &run;
        s.at = k;
        s.here = path.here(offset + k);
        s.pushed_here = s.here + states_;
        if (k > 0) {
            s.substeps = path.parts[offset + k];
            s.before = path.before(offset + k);
            s.pushed = s.before + states_;
        }
        return s;
    }

    /// The recursion over `count` samples of a run from its sample `first` on.
    void hand_on(std::size_t number, std::size_t first, std::size_t count, std::size_t offset) {
        const Run& run = problem_.runs[number];
        const LaneKernels& kernels = lane_kernels();
        const auto columns = static_cast<std::ptrdiff_t>(states_ + externals_);
        local_.differentiate(samples_.data(), count, derivatives_.data());
        std::fill_n(G_.begin(), count * kChannels * width_, 0.0);
        for (std::size_t n = 0; n < count; ++n) {
            double* local = derivatives_.data() + n * local_.size();
            const std::size_t k = first + n;
            if (k > 0) {
                double* next = local + local_.step_parameters();
                for (std::size_t i = 0; signals_ != nullptr && i < states_; ++i)
                    force(local + i * places_.size() + states_, offset + k, next + i * width_);
                kernels.add_product(next, local, columns, 1, moved_.data(), states_, places_.size(),
                                    width_);
                std::copy_n(next, states_ * width_, moved_.begin());
                for (std::size_t i = 0; i < externals_; ++i)
                    for (std::size_t j = 0; j < width_; ++j)
                        moved_[(states_ + i) * width_ + j] *= forget_[i];
            }
            const double* read = local + local_.read();
            double* reading = local + local_.read_parameters();
            for (std::size_t c = 0; signals_ != nullptr && c < kChannels; ++c) {
                force(read + c * places_.size() + states_, offset + k, reading + c * width_);
                shift(c, offset + k, reading + c * width_);
            }
            kernels.add_product(reading, read, columns, 1, moved_.data(), kChannels, places_.size(),
                                width_);
            for (int c = 0; c < kChannels; ++c)
                if (std::isnan(run.measurements[k][c]))
                    std::fill_n(reading + static_cast<std::size_t>(c) * width_, width_, 0.0);
            const double* whitener = filter_.whitener(number, k);
            for (std::size_t c = 0; c < kChannels; ++c, whitener += c)
                std::copy_n(whitener, c + 1, whitener_.begin() + static_cast<long>(c * kChannels));
            kernels.add_product(G_.data() + n * kChannels * width_, whitener_.data(), kChannels, 1,
                                reading, kChannels, kChannels, width_);
            const double* gains = filter_.gain(number, k);
            for (std::size_t i = 0; i < places_.size(); ++i)
                for (std::size_t c = 0; c < kChannels && places_[i] >= 0; ++c)
                    gain_[i * kChannels + c] =
                        -gains[static_cast<std::size_t>(places_[i]) * kChannels + c];
            kernels.add_product(moved_.data(), gain_.data(), kChannels, 1, reading, places_.size(),
                                kChannels, width_);
        }
    }

    /// Adds what the signals of sample `k` do as forces; `by_external`: derivatives by those.
    void force(const double* by_external, std::size_t k, double* row) const {
        const std::vector<int>& targets = *signals_->targets;
        const double* values = signals_->values + k * targets.size();
        for (std::size_t j = 0; j < targets.size(); ++j)
            if (targets[j] < kPushes) row[j] += by_external[targets[j]] * values[j];
    }

    void shift(std::size_t channel, std::size_t k, double* row) const {
        const std::vector<int>& targets = *signals_->targets;
        for (std::size_t j = 0; j < targets.size(); ++j)
            if (targets[j] == kPushes + static_cast<int>(channel))
                row[j] += signals_->values[k * targets.size() + j];
    }

    const Problem& problem_;
    const double* p_;
    const FrozenFilter& filter_;
    const Signals* signals_;
    std::size_t width_;
    LocalModel local_;
    std::size_t states_, externals_;
    std::vector<PathSample> samples_;
    std::vector<double> derivatives_, G_, moved_;
    std::vector<int> places_;  // of the gains
    std::vector<double> gain_, whitener_;
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

}  // namespace

void residuals(const Problem& problem, const double* p, const FrozenFilter& filter, double* out) {
    const InTime in_time(problem, p);
    const FrozenPath path = frozen_path(*in_time, p, filter, false);
    std::copy(path.whitened.begin(), path.whitened.end(), out);
}

double half_sum_of_squares(const Problem& problem, const double* p, const FrozenFilter& filter) {
    const InTime in_time(problem, p);
    double sum = 0.0;
    for (const double e : frozen_path(*in_time, p, filter, false).whitened) sum += e * e;
    return 0.5 * sum;
}

void sensitivities(const Problem& problem, const double* p, const FrozenFilter& filter,
                   const std::vector<int>& columns, double* out) {
    const InTime in_time(problem, p);
    Derivatives derivatives(*in_time, p, filter, columns);
    write(derivatives, columns.size(), out);
}

double normal_equations(const Problem& problem, const double* p, const FrozenFilter& filter,
                        const std::vector<int>& columns, double* gradient, double* information) {
    const std::size_t n = columns.size();
    if (n == 0) return half_sum_of_squares(problem, p, filter);
    const InTime in_time(problem, p);
    Derivatives derivatives(*in_time, p, filter, columns);
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
    const InTime in_time(problem, p);
    Derivatives derivatives(*in_time, p, filter, {}, &all);
    write(derivatives, targets.size(), out);
}

}  // namespace sysid
