// The filter of one run, one sample after the other, with the kernels of this processor.
#pragma once

#include <array>
#include <cmath>

#include "sysid/estimate/frozen.hpp"
#include "sysid/identify/run_system.hpp"
#include "sysid/math/lanes.hpp"

namespace sysid {

/// Gives what `filter_run` gives, to rounding, in less time and without its care: it ends where
/// rounding may count.
template <int NX>
class RowFilter {
  public:
    explicit RowFilter(const RunSystem<NX>& system)
        : system_(system),
          n_(static_cast<std::size_t>(system.taking_part())),
          stride_((n_ + 7) / 8 * 8),
          mean_(system.initial_mean()),
          by_state_{transition_, stride_, 1},
          by_reading_{observation_, 1, kMost} {
        const Mat<NX, NX> known = system.initial_covariance();
        for (std::size_t i = 0; i < n_; ++i) {
            for (std::size_t j = 0; j < n_; ++j)
                covariance_[i * stride_ + j] = known(static_cast<int>(i), static_cast<int>(j));
            process_[i] = system.process_noise(static_cast<int>(i));
        }
    }

    /// Calls `keep(k, *this)` after each sample; false, and not all are kept, where it ends early.
    template <class Keep>
    bool run(Keep&& keep) {
        for (std::size_t k = 0; k < system_.size(); ++k) {
            poll_interrupt(k);
            if (k > 0) {
                mean_ = system_.moved(k, mean_, by_state_);
                lane_kernels().propagate_rows(transition_, process_, n_, stride_, covariance_);
            }
            if (!use(k)) return false;
            keep(k, *this);
        }
        return true;
    }

    double log_likelihood() const { return density_.value(); }
    double mean(int i) const { return mean_[i]; }
    double covariance(int i, int j) const { return covariance_[at(i) * stride_ + at(j)]; }
    double gain(int i, int channel) const { return gain_[at(channel) * stride_ + at(i)]; }
    /// Of all readings of the sample; zero where there is none.
    double innovation(int channel) const { return innovation_[at(channel)]; }
    double whitener(int i, int j) const { return whitener_[at(i) * (at(i) + 1) / 2 + at(j)]; }

  private:
    static constexpr std::size_t kMost = (static_cast<std::size_t>(NX) + 7) / 8 * 8;
    static constexpr std::size_t at(int i) { return static_cast<std::size_t>(i); }

    /// A matrix whose elements stand so far apart, with room for NX columns.
    struct Strided {
        double* of;
        std::size_t column, row;
        double& operator()(int i, int j) { return of[at(i) * row + at(j) * column]; }
    };

    bool use(std::size_t k) {
        const Vec<kChannels>& y = system_.measurement(k);
        const Vec<kChannels> expected = system_.seen(k, mean_, by_reading_);
        std::array<bool, kChannels> present;
        std::array<double, kChannels> noise, one_after{}, variance;
        for (int c = 0; c < kChannels; ++c) {
            present[at(c)] = !std::isnan(y[c]);
            noise[at(c)] = system_.measurement_noise(k)(c, c);
            innovation_[at(c)] = present[at(c)] ? y[c] - expected[c] : 0.0;
            one_after[at(c)] = innovation_[at(c)];
        }
        RowUpdate u;
        u.states = n_;
        u.readings = kChannels;
        u.stride = stride_;
        u.observation = observation_;
        u.observation_stride = kMost;
        u.noise = noise.data();
        u.present = present.data();
        u.innovation = one_after.data();
        u.variance = variance.data();
        u.gain = gain_;
        u.whitener = whitener_;
        lane_kernels().correct_rows(u, mean_.data(), covariance_);
        struct Seen {
            double squares = 0.0, determinant = 1.0;
            int observed = 0;
        } seen;
        for (std::size_t c = 0; c < kChannels; ++c) {
            if (!present[c]) continue;
            const double e = one_after[c];
            if (!std::isfinite(variance[c]) || !std::isfinite(e) || !(variance[c] > 0.0) ||
                noise[c] < kSurest * variance[c])
                return false;
            ++seen.observed;
            seen.squares += e * e / variance[c];
            seen.determinant *= variance[c];
        }
        density_.add(seen);
        return density_.finite();
    }

    const RunSystem<NX>& system_;
    std::size_t n_, stride_;
    Vec<NX> mean_;
    Strided by_state_, by_reading_;
    LogDensity density_;
    std::array<double, kChannels> innovation_{};
    double process_[kMost]{}, whitener_[kChannels * (kChannels + 1) / 2]{};
    alignas(64) double transition_[kMost * kMost]{};
    alignas(64) double covariance_[kMost * kMost]{};
    alignas(64) double observation_[kChannels * kMost]{};
    alignas(64) double gain_[kChannels * kMost]{};
};

/// A sample of `filter_run`, read as one of a `RowFilter`.
template <int NX>
struct CarefulStep {
    const FilterStep<NX, kChannels>& step;
    const Mat<kChannels, kChannels> whitening;

    double mean(int i) const { return step.mean[i]; }
    double covariance(int i, int j) const { return step.covariance(i, j); }
    double gain(int i, int channel) const { return step.update.gain(i, channel); }
    double innovation(int channel) const { return step.update.innovation[channel]; }
    double whitener(int i, int j) const { return whitening(i, j); }
};

/// The filter over a run from its usual start: `keep(k, sample)` receives every sample, some twice
/// where care is needed. Returns the log-likelihood.
template <int NX, class Keep>
double filter_rows_of(const RunSystem<NX>& system, Keep&& keep) {
    if (RowFilter<NX> rows(system); rows.run(keep)) return rows.log_likelihood();
    return filter_run<NX>(system, [&](std::size_t k, const FilterStep<NX, kChannels>& s) {
        keep(k, CarefulStep<NX>{s, whitener_of<kChannels>(s.update, system.measurement(k))});
    });
}

}  // namespace sysid
