// Score and expected information of the noise parameters along a linearised filter. Shumway &
// Stoffer, Time Series Analysis and Its Applications (4th ed.), sec. 6.3; the information is its
// eq. (6.70).
#include <algorithm>

#include "sysid/identify/prediction_error.hpp"
#include "sysid/identify/run_system.hpp"

namespace sysid {

namespace {

/// Of the states that take part: square, one column for each channel, one row for each.
using Square = Eigen::MatrixXd;
using Block = Eigen::Ref<const Square>;
using Gain = Eigen::Matrix<double, Eigen::Dynamic, kChannels>;
using Row = Eigen::Matrix<double, kChannels, Eigen::Dynamic>;

constexpr int motion_lane(int i) { return kChannels + i; }
constexpr int deviation_lane(std::size_t i) {
    const int before = i < kMotionStates ? kMotionStates : 2 * kMotionStates;
    return kChannels + before + static_cast<int>(i);
}
constexpr int time_lane(std::size_t i) {
    return i < kMotionStates ? kChannels + 2 * kMotionStates + static_cast<int>(i)
                             : kNoiseParameters - 1;
}

/// Derivatives of the filter's mean and covariance by the logarithms of the noise parameters, along
/// a run. Only the first `n` states take part; the others stand still and are certain. `L` noise
/// parameters do: those of the road only where there is one.
template <int L>
class Answer {
  public:
    /// One number for each noise parameter, the sensors first: what follows is done for all of them
    /// at once.
    using Lanes = Eigen::Array<double, L, 1>;
    using Table = Mat<L, L>;

    template <int NX>
    Answer(const RunSystem<NX>& system, const Run& run, const Noise& noise)
        : n_(system.taking_part()),
          mean_(place(n_), Lanes::Zero()),
          moved_(mean_.size()),
          covariance_(place(n_ * n_), Lanes::Zero()),
          half_(covariance_.size()),
          cross_(place(n_ * kChannels)),
          process_(place(n_), Lanes::Zero()),
          disturbances_(system.disturbances()) {
        for (int i = 0; i < kMotionStates; ++i) {
            const auto m = static_cast<std::size_t>(i);
            process_[m][motion_lane(i)] = 2.0 * noise.motion[m] * noise.motion[m] * run.dt;
        }
        for (std::size_t i = 0; i < disturbances_; ++i) {
            const int w = where_[i] = system.disturbing(i);
            const double forget = system.forget(i);
            const double variance = noise.deviation_of(i) * noise.deviation_of(i);
            // d exp(-dt/tau) / d log(tau)
            slope_[i] = forget * run.dt / noise.time_of(i);
            process_[place(w)][deviation_lane(i)] = 2.0 * variance * (1.0 - forget * forget);
            process_[place(w)][time_lane(i)] = -2.0 * variance * forget * slope_[i];
            at(w, w)[deviation_lane(i)] = 2.0 * variance;  // of the stationary start
        }
        for (int i = 0; i < kChannels; ++i) {
            const double s = noise.sensor[static_cast<std::size_t>(i)];
            sensor_[i] = 2.0 * s * s;
        }
    }

    /// From the update at one sample to the prediction for the next one.
    void predict(const Block& transition) {
        const Square through = transition.lazyProduct(keep_);
        const Gain gain = transition.lazyProduct(gain_);
        turn(through);
        for (int i = 0; i < n_; ++i)
            for (int j = 0; j <= i; ++j) {
                Lanes& d = at(i, j);
                for (int c = 0; c < kChannels; ++c) d[c] += seen_[c] * gain(i, c) * gain(j, c);
            }
        // The transition's own diagonal for the disturbance states depends on their times.
        for (std::size_t i = 0; i < disturbances_; ++i) {
            const int w = where_[i];
            const Eigen::VectorXd cross =
                slope_[i] * transition.lazyProduct(covariance_after_.col(w));
            for (int j = 0; j < n_; ++j)
                at(std::max(w, j), std::min(w, j))[time_lane(i)] += (j == w ? 2.0 : 1.0) * cross[j];
        }
        for (int i = 0; i < n_; ++i) at(i, i) += process_[place(i)];
        for (int i = 0; i < n_; ++i)
            for (int j = 0; j < i; ++j) at(j, i) = at(i, j);
        for (int i = 0; i < n_; ++i) {
            Lanes sum = Lanes::Zero();
            for (int j = 0; j < n_; ++j) sum += transition(i, j) * mean_[place(j)];
            moved_[place(i)] = sum;
        }
        for (std::size_t i = 0; i < disturbances_; ++i)
            moved_[place(where_[i])][time_lane(i)] += slope_[i] * mean_after_[where_[i]];
        mean_.swap(moved_);
    }

    /// What one sample adds to the score and to the information, and the update there.
    template <int NX>
    void update(const FilterStep<NX, kChannels>& s, const Vec<kChannels>& measured) {
        const auto& u = s.update;
        update({u.innovation, u.information, u.lower}, u.observation.leftCols(n_),
               u.gain.topRows(n_), measured);
        mean_after_ = s.mean.head(n_);
        covariance_after_ = s.covariance.topLeftCorner(n_, n_);
    }

    const Lanes& score() const { return score_; }
    const Table& information() const { return information_; }

  private:
    static constexpr int kPairs = kChannels * (kChannels + 1) / 2;

    /// Of the innovation: its value, the inverse of its covariance, and the factor of that.
    struct Seen {
        const Vec<kChannels>& innovation;
        const Mat<kChannels, kChannels>& information;
        const Mat<kChannels, kChannels>& lower;
    };

    void update(const Seen& s, const Row& H, const Gain& gain, const Vec<kChannels>& measured) {
        const Vec<kChannels> weighed = s.information * s.innovation;
        for (int i = 0; i < kChannels; ++i) seen_[i] = std::isnan(measured[i]) ? 0.0 : sensor_[i];

        const auto crossed = [&](int i, int c) -> Lanes& {  // dP H^T
            return cross_[place(i * kChannels + c)];
        };
        for (int i = 0; i < n_; ++i)
            for (int c = 0; c < kChannels; ++c) {
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
            for (int c = 0; c < kChannels; ++c) pushed[place(i)] += weighed[c] * crossed(i, c);
        }
        for (int i = 0; i < n_; ++i) {
            Lanes sum = Lanes::Zero();
            for (int j = 0; j < n_; ++j) sum += keep_(i, j) * pushed[place(j)];
            for (int c = 0; c < kChannels; ++c) sum[c] -= gain_(i, c) * seen_[c] * weighed[c];
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
        const Mat<kChannels, kChannels> inverse =
            u.lower.template triangularView<Eigen::Lower>().solve(
                Mat<kChannels, kChannels>::Identity());
        const Vec<kChannels> white = inverse * u.innovation;
        std::array<std::array<Lanes, kChannels>, kChannels> change;  // H dP H^T + dR
        std::array<Lanes, kChannels> shift;                          // -H dx
        for (int a = 0; a < kChannels; ++a) {
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
        Eigen::Matrix<double, L, kPairs + kChannels> rows;
        Lanes score = Lanes::Zero();
        std::array<std::array<Lanes, kChannels>, kChannels> left;
        int row = 0;
        for (int a = 0; a < kChannels; ++a) {
            for (int b = 0; b < kChannels; ++b) {
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
    std::size_t disturbances_;
    std::array<int, kDisturbances> where_{};
    std::array<double, kDisturbances> slope_{};
    Vec<kChannels> sensor_, seen_;
    Square keep_, covariance_after_;
    Gain gain_;
    Eigen::VectorXd mean_after_;
};

template <int L>
double score_all(const Problem& problem, const double* p, const Noise& noise, double* gradient,
                 double* information) {
    typename Answer<L>::Lanes score = Answer<L>::Lanes::Zero();
    typename Answer<L>::Table info = Answer<L>::Table::Zero();
    double log_likelihood = 0.0;
    with_state_size(problem.model.effects, noise, [&](auto nx) {
        constexpr int NX = decltype(nx)::value;
        for (const Run& run : problem.runs) {
            const RunSystem<NX> system(problem.model, run, p, noise);
            const int n = system.taking_part();
            Answer<L> answer(system, run, noise);
            log_likelihood +=
                filter_run<NX>(system, [&](std::size_t k, const FilterStep<NX, kChannels>& s) {
                    if (k > 0) answer.predict(s.transition.topLeftCorner(n, n));
                    answer.update(s, run.measurements[k]);
                });
            score += answer.score();
            info += answer.information();
        }
    });
    symmetrise(info);
    using All = Mat<kNoiseParameters, kNoiseParameters>;
    Eigen::Map<Vec<kNoiseParameters>> to{gradient};
    Eigen::Map<All> table{information};
    to.setZero();
    table.setZero();
    to.template head<L>() = score.matrix();
    table.template topLeftCorner<L, L>() = info;
    return log_likelihood;
}

}  // namespace

double noise_score(const Problem& problem, const double* p, const Noise& noise, double* gradient,
                   double* information) {
    return noise.sloping()
               ? score_all<kNoiseParameters>(problem, p, noise, gradient, information)
               : score_all<kPlainNoiseParameters>(problem, p, noise, gradient, information);
}

}  // namespace sysid
