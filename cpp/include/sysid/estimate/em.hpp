// Expectation-maximisation for the covariances Q and R of any fixed-size `System` (kalman.hpp):
// Shumway & Stoffer, J. Time Series Analysis 1982.
//
// The expectations come either from the disturbance smoother, which repeats the filter's
// linearisation and needs no inverse of a covariance (Koopman, Biometrika 1993; Durbin & Koopman,
// Time Series Analysis by State Space Methods, 2012, ch. 4), or from the Rauch-Tung-Striebel
// smoother, with the model linearised again where the smoothed states are.
#pragma once

#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "sysid/estimate/noise_structure.hpp"
#include "sysid/estimate/smoother.hpp"

namespace sysid {

/// A' N A of a symmetric N, where only the first M rows of A differ from the unit matrix.
template <int M, int NX>
Mat<NX, NX> pulled_back(const Mat<NX, NX>& A, const Mat<NX, NX>& N) {
    if constexpr (M == NX) {
        return A.transpose() * N * A;
    } else {
        Mat<M, NX> change = A.template topRows<M>();
        change.diagonal().array() -= 1.0;
        const Mat<NX, NX> halfway = N + N.template leftCols<M>() * change;
        return halfway + change.transpose() * halfway.template topRows<M>();
    }
}

template <int NX, int NY>
struct NoisePair {
    Mat<NX, NX> process = Mat<NX, NX>::Identity();
    Mat<NY, NY> sensors = Mat<NY, NY>::Identity();
};

/// A `System` whose own noise is replaced by one that can be changed.
template <class System, int NX, int NY>
struct WithNoise {
    const System& system;
    const NoisePair<NX, NY>& noise;

    static constexpr int kMovingStates = MovingStates<System, NX>::value;
    static constexpr int kDirectReadings = DirectReadings<System>::value;
    static constexpr bool kSteadyNoise = true;

    std::size_t size() const { return system.size(); }
    const Mat<NX, NX>& process_noise() const { return noise.process; }
    Vec<NX> predict(std::size_t k, const Vec<NX>& x, Mat<NX, NX>& A, Mat<NX, NX>& Q) const {
        if constexpr (SteadyNoise<System>::value) return system.predict(k, x, A, Q);
        Mat<NX, NX> ignored;
        return system.predict(k, x, A, ignored);
    }
    Vec<NY> observe(std::size_t k, const Vec<NX>& x, Mat<NY, NX>& H) const {
        return system.observe(k, x, H);
    }
    Vec<NY> measurement(std::size_t k) const { return system.measurement(k); }
    const Mat<NY, NY>& measurement_noise(std::size_t) const { return noise.sensors; }
};

/// One log: its system and what is known before its first sample (`predict_first` as in
/// `extended_kalman_filter`). The system must outlive it.
template <class System, int NX>
struct EmRecord {
    const System* system;
    Vec<NX> mean;
    Mat<NX, NX> covariance;
    bool predict_first = false;
};

/// Expected squares of the disturbances, given all measurements.
template <int NX, int NY>
struct NoiseMoments {
    SquareSum<NX> process;
    SquareSum<NY> sensors;
};

/// What a sample's readings do to `r` and `N`, gradient and negative curvature by the state of the
/// log-density of all that follows; adds the brackets of `FilteredExpectation`. The first `D`
/// readings are states.
template <int D, int NX, int NY>
void step_back(const Update<NX, NY>& now, const Vec<NY>& y, Vec<NX>& r, Mat<NX, NX>& N,
               SquareSum<NY>& sensors) {
    Mat<NY, NY> information = now.information;
    for (int j = 0; j < NY; ++j)
        if (std::isnan(y[j])) information(j, j) = 0.0;
    const Mat<NX, NY> NK = N * now.gain;
    const Vec<NY> u = now.information * now.innovation - now.gain.transpose() * r;
    const Mat<NY, NY> bracket = information + now.gain.transpose() * NK;
    sensors.sum += u * u.transpose() - bracket;
    r += now.observation.transpose() * u;
    const auto back = [&](const auto& X) {
        return now.observed == NY ? carried_back<D>(X, now.observation)
                                  : carried_back<0>(X, now.observation);
    };
    const Mat<NX, NX> mixed = back(NK);
    const Mat<NX, NY> halfway = back(bracket).transpose();
    N += back(halfway) - mixed - mixed.transpose();
}

/// The same, one reading after the other, the last one first; only the diagonal of the sum.
template <int D, int NX, int NY>
void step_back(const SequentialUpdate<NX, NY>& now, const Vec<NY>& y, Vec<NX>& r, Mat<NX, NX>& N,
               SquareSum<NY>& sensors) {
    for (int j = NY; j-- > 0;) {
        if (std::isnan(y[j])) continue;
        const Vec<NX> gain = now.gain.col(j);
        Vec<NX> mixed = N * gain;
        const double u = now.information[j] * now.innovation[j] - gain.dot(r);
        const double bracket = now.information[j] + gain.dot(mixed);
        sensors.sum(j, j) += u * u - bracket;
        if (j < D) {
            r[j] += u;
            mixed[j] -= 0.5 * bracket;
            N.col(j) -= mixed;
            N.row(j) -= mixed.transpose();
        } else {
            const Vec<NX> h = now.observation.row(j).transpose();
            r += u * h;
            mixed -= 0.5 * bracket * h;
            N -= mixed * h.transpose() + h * mixed.transpose();
        }
    }
}

/// Expectations at the filter's own linearisation: exact where the model is linear. `Form` as in
/// `extended_kalman_filter`; what is learnt with `SequentialUpdate` has uncorrelated sensors.
template <int NX, int NY, class System, class Form = Update<NX, NY>>
class FilteredExpectation {
  public:
    explicit FilteredExpectation(std::vector<EmRecord<System, NX>> records)
        : records_(std::move(records)), steps_(records_.size()) {}

    double log_likelihood(const NoisePair<NX, NY>& noise) {
        noise_ = noise;
        double sum = 0.0;
        for (std::size_t i = 0; i < records_.size(); ++i) {
            const auto& record = records_[i];
            const WithNoise<System, NX, NY> system{*record.system, noise_};
            auto& steps = steps_[i];
            steps.resize(system.size());
            sum += extended_kalman_filter<NX, NY, Form>(
                system, record.mean, record.covariance,
                [&](std::size_t k, const FilterStep<NX, NY, Form>& step) {
                    steps[k].transition = step.transition;
                    steps[k].update = step.update;
                },
                record.predict_first);
        }
        return sum;
    }

    NoiseMoments<NX, NY> moments() const {
        NoiseMoments<NX, NY> out;
        for (std::size_t i = 0; i < records_.size(); ++i) add_record(i, out);
        const auto& Q = noise_.process;
        const auto& R = noise_.sensors;
        out.process.sum = (out.process.samples * Q + Q * out.process.sum * Q).eval();
        out.sensors.sum = (out.sensors.samples * R + R * out.sensors.sum * R).eval();
        return out;
    }

  private:
    struct Kept {
        Mat<NX, NX> transition;
        Form update;
    };

    // Adjoint recursion. The expected square of a disturbance is Q + Q (r r' - N) Q; only the
    // brackets are summed here.
    void add_record(std::size_t i, NoiseMoments<NX, NY>& out) const {
        const auto& record = records_[i];
        const auto& steps = steps_[i];
        Vec<NX> r = Vec<NX>::Zero();
        Mat<NX, NX> N = Mat<NX, NX>::Zero();
        for (std::size_t k = steps.size(); k-- > 0;) {
            const Vec<NY>& y = record.system->measurement(k);
            for (int j = 0; j < NY; ++j)
                if (!std::isnan(y[j])) out.sensors.count[j] += 1.0;
            out.sensors.samples += 1.0;
            if (k + 1 < steps.size()) {
                const auto& A = steps[k + 1].transition;
                r = (A.transpose() * r).eval();
                N = pulled_back<MovingStates<System, NX>::value>(A, N);
            }
            step_back<DirectReadings<System>::value>(steps[k].update, y, r, N, out.sensors);
            symmetrise(N);
            if (k > 0 || record.predict_first) {
                out.process.sum.noalias() += r * r.transpose() - N;
                out.process.add_count();
            }
        }
    }

    std::vector<EmRecord<System, NX>> records_;
    std::vector<std::vector<Kept>> steps_;
    NoisePair<NX, NY> noise_;
};

/// Adds the expected squares of a smoothed record, with `system` linearised at the smoothed states.
/// Where only some of a sample's readings are missing, R must be diagonal.
template <int NX, int NY, class System>
void add_smoothed_moments(const System& system, const std::vector<SmoothedStep<NX>>& states,
                          NoiseMoments<NX, NY>& out) {
    Mat<NX, NX> A = Mat<NX, NX>::Identity(), ignored;
    Mat<NY, NX> H;
    for (std::size_t k = 0; k < states.size(); ++k) {
        const auto& now = states[k];
        if (k > 0) {
            const auto& before = states[k - 1];
            const Vec<NX> e = now.mean - system.predict(k, before.mean, A, ignored);
            const Mat<NX, NX> mixed = now.lag_one * A.transpose();
            out.process.sum += e * e.transpose() + now.covariance +
                               A * before.covariance * A.transpose() - mixed - mixed.transpose();
            out.process.add_count();
        }
        const Vec<NY>& y = system.measurement(k);
        Vec<NY> e = y - system.observe(k, now.mean, H);
        for (int j = 0; j < NY; ++j) {
            if (std::isnan(y[j])) {
                e[j] = 0.0;
                H.row(j).setZero();
                out.sensors.sum(j, j) += system.measurement_noise(k)(j, j);
            } else {
                out.sensors.count[j] += 1.0;
            }
        }
        out.sensors.samples += 1.0;
        out.sensors.sum += e * e.transpose() + H * now.covariance * H.transpose();
    }
}

struct EmOptions {
    int most_iterations = 100;
    // Stops when no more than this gain of log-likelihood is to come; with `accelerate`, when two
    // steps and a leap gained no more.
    double tolerance = 0.1;
    bool never_fall = true;  // shortens a step that lowers the log-likelihood, else only reports it
    bool accelerate = false;
};

template <int NX, int NY>
struct EmOutcome {
    NoisePair<NX, NY> noise;
    std::vector<double> log_likelihood;  // of the start, then after each iteration
    bool converged = false;
    int shortened = 0;  // steps that had to be
    int fell = 0;       // iterations that ended lower than they began
    int leaps = 0;      // iterations that were leaps, see `NoiseLeap`
};

/// Leap along the path of two steps of expectation-maximisation: squared extrapolation (Varadhan &
/// Roland, Scand. J. Statistics 2008) of the logarithms of the covariances, which keeps them
/// positive and lets those that tend to zero get there.
template <int NX, int NY>
class NoiseLeap {
  public:
    using Pair = NoisePair<NX, NY>;
    NoiseLeap(const Pair& a, const Pair& b, const Pair& c)
        : process_(a.process, b.process, c.process), sensors_(a.sensors, b.sensors, c.sensors) {}

    /// Length of the leap in steps; not above one where a leap makes no sense.
    double length() const {
        const double bend = process_.bend.squaredNorm() + sensors_.bend.squaredNorm();
        const double step = process_.step.squaredNorm() + sensors_.step.squaredNorm();
        return bend > 0.0 ? std::min(std::sqrt(step / bend), 100.0) : 1.0;
    }
    Pair landing(const NoiseStructure<NX>& process, const NoiseStructure<NY>& sensors,
                 const Pair& now) const {
        const double n = length();
        return {
            process.admitted(process_.at(n), now.process),
            sensors.admitted(sensors_.at(n), now.sensors),
        };
    }

  private:
    template <int N>
    struct Path {
        Vec<N> unit;
        Mat<N, N> start, step, bend;  // logarithms, and their first and second differences

        Path(const Mat<N, N>& a, const Mat<N, N>& b, const Mat<N, N>& c)
            : unit(a.diagonal().cwiseMax(kNothing).cwiseSqrt()), start(logarithm(a)) {
            const Mat<N, N> middle = logarithm(b);
            step = middle - start;
            bend = logarithm(c) - middle - step;
        }
        Mat<N, N> at(double n) const {
            const Eigen::SelfAdjointEigenSolver<Mat<N, N>> e(start + 2.0 * n * step + n * n * bend);
            const Mat<N, N> root =
                e.eigenvectors() * (0.5 * e.eigenvalues()).array().exp().matrix().asDiagonal();
            const Mat<N, N> half = unit.asDiagonal() * root;
            return half * half.transpose();
        }

      private:
        static constexpr double kNothing = 1e-200;  // stands for a variance of zero
        Mat<N, N> logarithm(const Mat<N, N>& C) const {
            const Vec<N> per_unit = unit.cwiseInverse();
            const Eigen::SelfAdjointEigenSolver<Mat<N, N>> e(per_unit.asDiagonal() * C *
                                                             per_unit.asDiagonal());
            const Vec<N> logs = e.eigenvalues().cwiseMax(kNothing).array().log();
            return e.eigenvectors() * logs.asDiagonal() * e.eigenvectors().transpose();
        }
    };

    Path<NX> process_;
    Path<NY> sensors_;
};

/// Alternates expectation and maximisation. `Expectation` provides log_likelihood(noise), then
/// moments() for that noise.
template <int NX, int NY, class Expectation>
EmOutcome<NX, NY> learn_noise(Expectation& expectation, const NoisePair<NX, NY>& start,
                              const NoiseStructure<NX>& process, const NoiseStructure<NY>& sensors,
                              const EmOptions& options) {
    using Pair = NoisePair<NX, NY>;
    EmOutcome<NX, NY> out;
    out.noise = {
        process.admitted(start.process, start.process),
        sensors.admitted(start.sensors, start.sensors),
    };
    double value = expectation.log_likelihood(out.noise);
    double gain_before = 0.0, value_at_leap = value;
    std::vector<Pair> path{out.noise};  // since the last leap
    out.log_likelihood.push_back(value);
    const auto iterations = [&] { return static_cast<int>(out.log_likelihood.size()) - 1; };
    const auto value_or_nan = [&](const Pair& noise) {
        try {
            return expectation.log_likelihood(noise);
        } catch (const NumericalFailure&) {  // a leap into the blue
            return std::nan("");
        }
    };
    while (iterations() < options.most_iterations) {
        const NoiseMoments<NX, NY> moments = expectation.moments();
        Pair next;
        next.process = process.best(moments.process, out.noise.process);
        next.sensors = sensors.best(moments.sensors, out.noise.sensors);
        double reached = expectation.log_likelihood(next);
        // The filter linearises anew, so that near the optimum a step may be too long.
        for (int halving = 0; options.never_fall && reached < value && halving < 6; ++halving) {
            if (halving == 0) ++out.shortened;
            next.process = 0.5 * (next.process + out.noise.process);
            next.sensors = 0.5 * (next.sensors + out.noise.sensors);
            reached = expectation.log_likelihood(next);
        }
        const double gain = reached - value;
        if (gain < 0.0 && options.never_fall) {
            out.converged = true;  // no step of either length gains anything
            break;
        }
        if (gain < 0.0) ++out.fell;
        out.noise = next;
        value = reached;
        out.log_likelihood.push_back(value);
        // Gains shrink geometrically: what is to come is the rest of the series (Aitken).
        const double ratio = gain_before > 0.0 ? gain / gain_before : 1.0;
        if (!options.accelerate && gain >= 0.0 && ratio < 1.0 &&
            gain * ratio / (1.0 - ratio) < options.tolerance) {
            out.converged = true;
            break;
        }
        gain_before = gain;
        path.push_back(next);
        if (!options.accelerate || path.size() < 3 || iterations() >= options.most_iterations)
            continue;
        const NoiseLeap<NX, NY> leap(path[0], path[1], path[2]);
        path.assign(1, out.noise);
        if (leap.length() > 1.0) {
            const Pair landing = leap.landing(process, sensors, out.noise);
            const double there = value_or_nan(landing);
            if (there > value) {
                ++out.leaps;
                out.noise = path[0] = landing;
                value = there;
                out.log_likelihood.push_back(value);
            } else {
                expectation.log_likelihood(out.noise);  // its moments come next
            }
        }
        // Steps after a leap first undo its side effects: their gains are no geometric series.
        if (value - value_at_leap < options.tolerance) {
            out.converged = true;
            break;
        }
        value_at_leap = value;
    }
    return out;
}

}  // namespace sysid
