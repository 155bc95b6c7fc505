// Score and expected information of noise parameters along a linearised filter. Shumway & Stoffer,
// Time Series Analysis and Its Applications (4th ed.), sec. 6.3; the information is its eq. (6.70).
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "sysid/estimate/kalman.hpp"
#include "sysid/math/lanes.hpp"

namespace sysid {

/// Derivatives of a filter's mean and covariance by the logarithms of `L` noise parameters, the
/// `NY` sensors' first, along a run. Only the first `n` states take part; the others stand still
/// and are certain.
template <int NY, int L>
class NoiseScore {
  public:
    /// Of the states that take part: square, one column for each channel, one row for each.
    using Square = Eigen::MatrixXd;
    using Block = Eigen::Ref<const Square>;
    using Gain = Eigen::Matrix<double, Eigen::Dynamic, NY>;
    using Row = Eigen::Matrix<double, NY, Eigen::Dynamic>;
    /// One number for each noise parameter, the sensors first: what follows is done for all of them
    /// at once.
    using Lanes = Eigen::Array<double, L, 1>;
    using Table = Mat<L, L>;

    /// `n` states; `sensor`: derivatives of the variances of the readings, by lane after lane.
    NoiseScore(int n, const Vec<NY>& sensor)
        : n_(n),
          mean_(place(n) * kWide, 0.0),
          moved_(mean_.size()),
          covariance_(place(n * n) * kWide, 0.0),
          half_(covariance_.size()),
          cross_(place(n * NY) * kWide),
          process_(place(n), Lanes::Zero()),
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
        at(state, state)[deviation_lane] = 2.0 * variance;  // of the stationary start
        correlated_.push_back({state, time_lane, slope});
    }

    /// From the update at one sample to the prediction for the next one.
    void predict(const Block& transition) {
        through_ = transition.lazyProduct(keep_);
        carried_ = transition.lazyProduct(gain_);
        turn();
        for (int i = 0; i < n_; ++i)
            for (int j = 0; j <= i; ++j)
                for (int c = 0; c < NY; ++c)
                    at(i, j)[c] += seen_[c] * carried_(i, c) * carried_(j, c);
        // The transition's own diagonal for the disturbance states depends on their times.
        for (const Correlated& d : correlated_) {
            const int w = d.state;
            cross_after_ = d.slope * transition.lazyProduct(covariance_after_.col(w));
            for (int j = 0; j < n_; ++j)
                at(std::max(w, j), std::min(w, j))[d.lane] +=
                    (j == w ? 2.0 : 1.0) * cross_after_[j];
        }
        for (int i = 0; i < n_; ++i)
            for (int l = 0; l < L; ++l) at(i, i)[l] += process_[place(i)][l];
        for (int i = 0; i < n_; ++i)
            for (int j = 0; j < i; ++j) std::copy_n(at(i, j), kWide, at(j, i));
        std::fill(moved_.begin(), moved_.end(), 0.0);
        add_product(moved_.data(), transition.data(), transition.outerStride(), mean_.data(), n_,
                    n_);
        for (const Correlated& d : correlated_)
            moved_[place(d.state) * kWide + place(d.lane)] += d.slope * mean_after_[d.state];
        mean_.swap(moved_);
    }

    /// What one sample adds to the score and to the information, and the update there.
    template <int NX>
    void update(const FilterStep<NX, NY>& s, const Vec<NY>& measured) {
        const auto& u = s.update;
        observation_ = u.observation.leftCols(n_);
        gain_ = u.gain.topRows(n_);
        update({u.innovation, u.information, u.lower}, measured);
        mean_after_ = s.mean.head(n_);
        covariance_after_ = s.covariance.topLeftCorner(n_, n_);
    }

    Lanes score() const { return Eigen::Map<const Lanes>(score_.data()); }
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
    static constexpr int kPairs = NY * (NY + 1) / 2;

    struct Correlated {
        int state, lane;
        double slope;
    };

    /// Of the innovation: its value, the inverse of its covariance, and the factor of that.
    struct Seen {
        const Vec<NY>& innovation;
        const Mat<NY, NY>& information;
        const Mat<NY, NY>& lower;
    };

    void update(const Seen& s, const Vec<NY>& measured) {
        const Vec<NY> weighed = s.information * s.innovation;
        for (int i = 0; i < NY; ++i) seen_[i] = std::isnan(measured[i]) ? 0.0 : sensor_[i];
        // H dP, and with dP symmetric the columns of dP H^T.
        std::fill(cross_.begin(), cross_.end(), 0.0);
        add_product(cross_.data(), observation_.data(), NY, covariance_.data(), NY, n_,
                    place(n_) * kWide);
        innovate(s);

        keep_ = -gain_.lazyProduct(observation_);
        keep_.diagonal().array() += 1.0;
        // x+ = x- + K e:  dx+ = (I - K H) (dx- + dP- H^T S^-1 e) - K dR S^-1 e
        moved_ = mean_;
        add_product(moved_.data(), weighed.data(), 1, cross_.data(), 1, NY, place(n_) * kWide);
        std::fill(mean_.begin(), mean_.end(), 0.0);
        add_product(mean_.data(), keep_.data(), n_, moved_.data(), n_, n_);
        for (int i = 0; i < n_; ++i)
            for (int c = 0; c < NY; ++c)
                mean_[place(i) * kWide + place(c)] -= gain_(i, c) * seen_[c] * weighed[c];
    }

    static std::size_t place(int i) { return static_cast<std::size_t>(i); }
    double* at(int i, int j) { return covariance_.data() + place(i * n_ + j) * kWide; }

    /// Y += A X for rows of lanes; the columns of A stand `stride` apart.
    void add_product(double* Y, const double* A, Eigen::Index stride, const double* X, int rows,
                     int inner, std::size_t width = kWide) const {
        kernels_.add_product(Y, A, 1, stride, X, place(rows), place(inner), width);
    }

    /// A dP A^T, its lower triangle.
    void turn() {
        std::fill(half_.begin(), half_.end(), 0.0);
        add_product(half_.data(), through_.data(), n_, covariance_.data(), n_, n_,
                    place(n_) * kWide);
        std::fill(covariance_.begin(), covariance_.end(), 0.0);
        for (int i = 0; i < n_; ++i)
            add_product(at(i, 0), through_.data(), n_, half_.data() + place(i * n_) * kWide, i + 1,
                        n_);
    }

    /// The derivatives of the innovation and of its covariance S, whitened by L L^T = S.
    void innovate(const Seen& u) {
        const Mat<NY, NY> inverse =
            u.lower.template triangularView<Eigen::Lower>().solve(Mat<NY, NY>::Identity());
        const Vec<NY> white = inverse * u.innovation;
        // H dP H^T + dR, then L^-1 dS, then L^-1 dS L^-T; dP H^T and dx have the sign of -S, -e.
        std::array<double, std::size_t{NY} * NY * kWide> change{}, left{}, both{};
        std::array<double, NY * kWide> shift{}, moved{};
        const auto row = [](auto& of, int a, int b = 0) {
            return of.data() + (a * NY + b) * kWide;
        };
        for (int b = 0; b < NY; ++b) {
            add_product(row(change, b), observation_.data(), NY,
                        cross_.data() + place(b * n_) * kWide, NY, n_);
            row(change, b, b)[b] += seen_[b];
        }
        add_product(left.data(), inverse.data(), NY, change.data(), NY, NY, NY * kWide);
        for (int a = 0; a < NY; ++a)
            add_product(row(both, a), inverse.data(), NY, row(left, a), NY, NY);
        add_product(shift.data(), observation_.data(), NY, mean_.data(), NY, n_);
        add_product(moved.data(), inverse.data(), NY, shift.data(), NY, NY);
        // Rows that make the information as a sum of squares: one for each element of L^-1 dS L^-T,
        // and one for each of L^-1 d(innovation). `by` makes the score of them.
        std::array<double, (kPairs + NY) * kWide> rows;
        std::array<double, kPairs + NY> by;
        double* to = rows.data();
        std::size_t n = 0;
        const auto add = [&](const double* from, double factor, double slope) {
            for (std::size_t l = 0; l < kWide; ++l) *to++ = factor * from[l];
            by[n++] = slope;
        };
        const double root = std::sqrt(0.5);
        for (int a = 0; a < NY; ++a) {
            for (int b = 0; b < a; ++b) add(row(both, a, b), 1.0, white[a] * white[b]);
            add(row(both, a, a), root, root * (white[a] * white[a] - 1.0));
            add(moved.data() + place(a) * kWide, 1.0, white[a]);
        }
        kernels_.add_squares(rows.data(), by.data(), n, kWide, score_.data(), information_.data());
    }

    const LaneKernels& kernels_ = lane_kernels();
    std::array<double, kWide> score_{};
    std::array<double, kWide * kWide> information_{};
    int n_;
    std::vector<double> mean_, moved_, covariance_, half_, cross_;  // rows of `kWide`
    std::vector<Lanes> process_;
    std::vector<Correlated> correlated_;
    Vec<NY> sensor_, seen_;
    Square keep_, covariance_after_, through_;
    Row observation_;
    Gain gain_, carried_;
    Eigen::VectorXd mean_after_, cross_after_;
};

}  // namespace sysid
