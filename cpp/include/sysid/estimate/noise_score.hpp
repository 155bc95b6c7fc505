// Score and expected information of noise parameters along a linearised filter. Shumway & Stoffer,
// Time Series Analysis and Its Applications (4th ed.), sec. 6.3; the information is its eq. (6.70).
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "sysid/estimate/kalman.hpp"

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
          mean_(place(n), Lanes::Zero()),
          moved_(mean_.size()),
          covariance_(place(n * n), Lanes::Zero()),
          half_(covariance_.size()),
          cross_(place(n * NY)),
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
        const Square through = transition.lazyProduct(keep_);
        const Gain gain = transition.lazyProduct(gain_);
        turn(through);
        for (int i = 0; i < n_; ++i)
            for (int j = 0; j <= i; ++j) {
                Lanes& d = at(i, j);
                for (int c = 0; c < NY; ++c) d[c] += seen_[c] * gain(i, c) * gain(j, c);
            }
        // The transition's own diagonal for the disturbance states depends on their times.
        for (const Correlated& d : correlated_) {
            const int w = d.state;
            const Eigen::VectorXd cross =
                d.slope * transition.lazyProduct(covariance_after_.col(w));
            for (int j = 0; j < n_; ++j)
                at(std::max(w, j), std::min(w, j))[d.lane] += (j == w ? 2.0 : 1.0) * cross[j];
        }
        for (int i = 0; i < n_; ++i) at(i, i) += process_[place(i)];
        for (int i = 0; i < n_; ++i)
            for (int j = 0; j < i; ++j) at(j, i) = at(i, j);
        for (int i = 0; i < n_; ++i) {
            Lanes sum = Lanes::Zero();
            for (int j = 0; j < n_; ++j) sum += transition(i, j) * mean_[place(j)];
            moved_[place(i)] = sum;
        }
        for (const Correlated& d : correlated_)
            moved_[place(d.state)][d.lane] += d.slope * mean_after_[d.state];
        mean_.swap(moved_);
    }

    /// What one sample adds to the score and to the information, and the update there.
    template <int NX>
    void update(const FilterStep<NX, NY>& s, const Vec<NY>& measured) {
        const auto& u = s.update;
        update({u.innovation, u.information, u.lower}, u.observation.leftCols(n_),
               u.gain.topRows(n_), measured);
        mean_after_ = s.mean.head(n_);
        covariance_after_ = s.covariance.topLeftCorner(n_, n_);
    }

    const Lanes& score() const { return score_; }
    const Table& information() const { return information_; }

  private:
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

    void update(const Seen& s, const Row& H, const Gain& gain, const Vec<NY>& measured) {
        const Vec<NY> weighed = s.information * s.innovation;
        for (int i = 0; i < NY; ++i) seen_[i] = std::isnan(measured[i]) ? 0.0 : sensor_[i];

        const auto crossed = [&](int i, int c) -> Lanes& {  // dP H^T
            return cross_[place(i * NY + c)];
        };
        for (int i = 0; i < n_; ++i)
            for (int c = 0; c < NY; ++c) {
                Lanes sum = Lanes::Zero();
                for (int j = 0; j < n_; ++j) sum += H(c, j) * at(i, j);
                crossed(i, c) = sum;
            }
        innovate(s, H, crossed);

        gain_ = gain;
        keep_ = -gain.lazyProduct(H);
        keep_.diagonal().array() += 1.0;
        // x+ = x- + K e:  dx+ = (I - K H) (dx- + dP- H^T S^-1 e) - K dR S^-1 e
        std::vector<Lanes>& pushed = moved_;
        for (int i = 0; i < n_; ++i) {
            pushed[place(i)] = mean_[place(i)];
            for (int c = 0; c < NY; ++c) pushed[place(i)] += weighed[c] * crossed(i, c);
        }
        for (int i = 0; i < n_; ++i) {
            Lanes sum = Lanes::Zero();
            for (int j = 0; j < n_; ++j) sum += keep_(i, j) * pushed[place(j)];
            for (int c = 0; c < NY; ++c) sum[c] -= gain_(i, c) * seen_[c] * weighed[c];
            mean_[place(i)] = sum;
        }
    }

    static std::size_t place(int i) { return static_cast<std::size_t>(i); }
    Lanes& at(int i, int j) { return covariance_[place(i * n_ + j)]; }

    /// A dP A^T, its lower triangle.
    void turn(const Square& A) {
        for (int i = 0; i < n_; ++i)
            for (int j = 0; j < n_; ++j) {
                Lanes sum = Lanes::Zero();
                for (int m = 0; m < n_; ++m) sum += A(i, m) * at(m, j);
                half_[place(i * n_ + j)] = sum;
            }
        for (int i = 0; i < n_; ++i)
            for (int j = 0; j <= i; ++j) {
                Lanes sum = Lanes::Zero();
                for (int m = 0; m < n_; ++m) sum += A(j, m) * half_[place(i * n_ + m)];
                at(i, j) = sum;
            }
    }

    /// The derivatives of the innovation and of its covariance S, whitened by L L^T = S.
    template <class Crossed>
    void innovate(const Seen& u, const Row& H, const Crossed& crossed) {
        const Mat<NY, NY> inverse =
            u.lower.template triangularView<Eigen::Lower>().solve(Mat<NY, NY>::Identity());
        const Vec<NY> white = inverse * u.innovation;
        std::array<std::array<Lanes, NY>, NY> change;  // H dP H^T + dR
        std::array<Lanes, NY> shift;                   // -H dx
        for (int a = 0; a < NY; ++a) {
            Lanes sum = Lanes::Zero();
            for (int i = 0; i < n_; ++i) sum -= H(a, i) * mean_[place(i)];
            shift[place(a)] = sum;
            for (int b = 0; b <= a; ++b) {
                Lanes both = Lanes::Zero();
                for (int i = 0; i < n_; ++i) both += H(a, i) * crossed(i, b);
                if (a == b) both[a] += seen_[a];
                change[place(a)][place(b)] = change[place(b)][place(a)] = both;
            }
        }
        // Rows that make the information as a sum of squares: one for each element of L^-1 dS L^-T,
        // and one for each of L^-1 d(innovation).
        Eigen::Matrix<double, L, kPairs + NY> rows;
        Lanes score = Lanes::Zero();
        std::array<std::array<Lanes, NY>, NY> left;
        int row = 0;
        for (int a = 0; a < NY; ++a) {
            for (int b = 0; b < NY; ++b) {
                Lanes sum = Lanes::Zero();
                for (int c = 0; c <= a; ++c) sum += inverse(a, c) * change[place(c)][place(b)];
                left[place(a)][place(b)] = sum;
            }
            for (int b = 0; b <= a; ++b) {
                Lanes sum = Lanes::Zero();
                for (int c = 0; c <= b; ++c) sum += inverse(b, c) * left[place(a)][place(c)];
                const double twice = a == b ? 1.0 : 2.0;
                score += 0.5 * twice * white[a] * white[b] * sum;
                if (a == b) score -= 0.5 * sum;
                rows.col(row++) = std::sqrt(0.5 * twice) * sum;
            }
            Lanes moved = Lanes::Zero();
            for (int c = 0; c <= a; ++c) moved += inverse(a, c) * shift[place(c)];
            score -= white[a] * moved;
            rows.col(row++) = moved;
        }
        score_ += score;
        information_ += rows.lazyProduct(rows.transpose());
    }

    Lanes score_ = Lanes::Zero();
    Table information_ = Table::Zero();
    int n_;
    std::vector<Lanes> mean_, moved_, covariance_, half_, cross_, process_;
    std::vector<Correlated> correlated_;
    Vec<NY> sensor_, seen_;
    Square keep_, covariance_after_;
    Gain gain_;
    Eigen::VectorXd mean_after_;
};

}  // namespace sysid
