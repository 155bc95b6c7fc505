// Score and expected information of noise parameters along a linearised filter. Shumway & Stoffer,
// Time Series Analysis and Its Applications (4th ed.), sec. 6.3; the information is its eq. (6.70).
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "sysid/estimate/frozen.hpp"
#include "sysid/estimate/kalman.hpp"
#include "sysid/math/lanes.hpp"

namespace sysid {

/// One sample of a linearised filter; matrices are row-major, of symmetric and lower ones the lower
/// triangle is kept.
struct ScoreSample {
    const double* transition = nullptr;   // to the sample: a row for each state that has one
    const double* observation = nullptr;  // readings x states
    const double* gain = nullptr;         // states x readings, zero where there is no reading
    const double* whitener = nullptr;     // the same
    const double* innovation = nullptr;
    const double* mean = nullptr;  // after the readings
    const double* covariance = nullptr;
};

/// Derivatives of a filter's mean and covariance by the logarithms of `L` noise parameters, the
/// `NY` sensors' first, along a run.
template <int NY, int L>
class NoiseScore {
    static_assert(NY == kScoredReadings);

  public:
    /// One number for each noise parameter, the sensors first: what follows is done for all of them
    /// at once.
    using Lanes = Eigen::Array<double, L, 1>;
    using Table = Mat<L, L>;

    /// `n` states, of which the first `moving` have a transition; each other is scaled by its part
    /// of `forget`. `sensor`: derivatives of the variances of the readings, by lane after lane.
    NoiseScore(int n, int moving, std::vector<double> forget, const Vec<NY>& sensor)
        : n_(place(n)),
          moving_(place(moving)),
          forget_(std::move(forget)),
          mean_(n_ * kWide, 0.0),
          covariance_(packed(n_, 0) * kWide, 0.0),
          after_(n_ + packed(n_, 0)),
          process_(n_, Lanes::Zero()),
          sensor_(sensor) {}

    /// A state is disturbed anew at each sample, with a variance that has this derivative.
    void white(int state, int lane, double slope) { process_[place(state)][lane] = slope; }

    /// A state is a disturbance with a correlation time, of which `forget` is left after a sample
    /// of so many of these times.
    void correlated(int state, int deviation_lane, int time_lane, double variance, double forget,
                    double times) {
        const double slope = forget * times;  // d exp(-dt/tau) / d log(tau)
        white(state, deviation_lane, 2.0 * variance * (1.0 - forget * forget));
        white(state, time_lane, -2.0 * variance * forget * slope);
        at(place(state), place(state))[deviation_lane] = 2.0 * variance;  // of the stationary start
        correlated_.push_back({place(state), place(time_lane), slope});
    }

    /// What one sample adds to the score and to the information; the first of a run has no
    /// transition.
    void add(const ScoreSample& s, const Vec<NY>& measured) {
        if (s.transition != nullptr) predict(s.transition);
        std::array<double, NY> seen, innovation;
        for (int i = 0; i < NY; ++i) {
            const bool there = !std::isnan(measured[i]);
            seen[place(i)] = there ? sensor_[i] : 0.0;
            innovation[place(i)] = there ? s.innovation[i] : 0.0;
        }
        LaneScore all = score();
        all.observation = s.observation;
        all.gain = s.gain;
        all.whitener = s.whitener;
        all.innovation = innovation.data();
        all.sensor = seen.data();
        kernels_.score_update(all);
        // The rows' parts of the score, in the order of the rows.
        std::array<double, NY> white{};
        std::array<double, kRows> by;
        std::size_t n = 0;
        for (std::size_t a = 0; a < NY; ++a) {
            for (std::size_t b = 0; b <= a; ++b)
                white[a] += s.whitener[packed(a, b)] * innovation[b];
            for (std::size_t b = 0; b < a; ++b) by[n++] = white[a] * white[b];
            by[n++] = std::sqrt(0.5) * (white[a] * white[a] - 1.0);
            by[n++] = white[a];
        }
        kernels_.add_squares(rows_.data(), by.data(), kRows, kWide, score_.data(),
                             information_.data());
        std::copy_n(s.mean, n_, after_.begin());
        std::copy_n(s.covariance, packed(n_, 0), after_.begin() + static_cast<long>(n_));
    }

    /// The same of a step of a filter whose first states these are, with a transition of their own
    /// each; `first` of a run.
    template <int NX>
    void add(const FilterStep<NX, NY>& s, const Vec<NY>& measured, bool first) {
        numbers_.clear();
        const auto rows = [&](const auto& of, std::size_t height, std::size_t width, bool lower) {
            for (std::size_t i = 0; i < height; ++i)
                for (std::size_t j = 0; j < (lower ? i + 1 : width); ++j)
                    numbers_.push_back(of(static_cast<int>(i), static_cast<int>(j)));
        };
        rows(s.transition, n_, n_, false);
        rows(s.update.observation, NY, n_, false);
        rows(s.update.gain, n_, NY, false);
        rows(whitener_of<NY>(s.update, measured), NY, NY, true);
        rows(s.covariance, n_, n_, true);
        ScoreSample to;
        const double* from = numbers_.data();
        to.transition = first ? nullptr : from;
        to.observation = from += n_ * n_;
        to.gain = from += NY * n_;
        to.whitener = from += n_ * NY;
        to.covariance = from + packed(NY, 0);
        to.innovation = s.update.innovation.data();
        to.mean = s.mean.data();
        add(to, measured);
    }

    Lanes score_sum() const { return Eigen::Map<const Lanes>(score_.data()); }
    Table information() const {
        Table out;
        for (int i = 0; i < L; ++i)
            for (int j = 0; j <= i; ++j)
                out(i, j) = out(j, i) = information_[place(i) * kWide + place(j)];
        return out;
    }

  private:
    // Numbers kept for `L` lanes.
    static constexpr std::size_t kWide = (static_cast<std::size_t>(L) + 7) / 8 * 8;
    static constexpr std::size_t kRows = NY * (NY + 1) / 2 + NY;

    struct Correlated {
        std::size_t state, lane;
        double slope;
    };

    static std::size_t place(int i) { return static_cast<std::size_t>(i); }
    static std::size_t packed(std::size_t i, std::size_t j) {
        return i >= j ? i * (i + 1) / 2 + j : j * (j + 1) / 2 + i;
    }
    double* at(std::size_t i, std::size_t j) { return covariance_.data() + packed(i, j) * kWide; }

    LaneScore score() {
        LaneScore all;
        all.states = n_;
        all.width = kWide;
        all.mean = mean_.data();
        all.covariance = covariance_.data();
        all.rows = rows_.data();
        return all;
    }

    /// From the update at one sample to the prediction for the next one.
    void predict(const double* transition) {
        kernels_.score_predict(transition, moving_, forget_.data(), score());
        // The transition's own diagonal for the disturbance states depends on their times.
        for (const Correlated& d : correlated_) {
            mean_[d.state * kWide + d.lane] += d.slope * after_[d.state];
            for (std::size_t j = 0; j < n_; ++j) {
                double moved = 0.0;  // of A P
                for (std::size_t k = 0; k < n_ && j < moving_; ++k)
                    moved += transition[j * n_ + k] * after_[n_ + packed(k, d.state)];
                if (j >= moving_) moved = forget_[j - moving_] * after_[n_ + packed(j, d.state)];
                at(d.state, j)[d.lane] += (j == d.state ? 2.0 : 1.0) * d.slope * moved;
            }
        }
        for (std::size_t i = 0; i < n_; ++i)
            for (std::size_t l = 0; l < place(L); ++l)
                at(i, i)[l] += process_[i][static_cast<int>(l)];
    }

    const LaneKernels& kernels_ = lane_kernels();
    std::array<double, kWide> score_{};
    std::array<double, kWide * kWide> information_{};
    std::array<double, kRows * kWide> rows_{};
    std::size_t n_, moving_;
    std::vector<double> forget_, mean_, covariance_;  // rows of `kWide`
    std::vector<double> after_;                       // mean and covariance of the filter
    std::vector<Lanes> process_;
    std::vector<Correlated> correlated_;
    Vec<NY> sensor_;
    std::vector<double> numbers_;
};

}  // namespace sysid
