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
        return transposed_times<NX, NX, NX>(A, times<NX, NX, NX>(N, A));
    } else {
        Mat<M, NX> change = A.template topRows<M>();
        for (int i = 0; i < M; ++i) change(i, i) -= 1.0;
        Mat<NX, NX> halfway = N;  // its first M columns are those that `change` meets
        add_product<NX, M, NX>(N.data(), change.data(), 1.0, halfway.data());
        const Mat<NX, M> turned = transposed<M, NX>(change);
        const Mat<M, NX> top = halfway.template topRows<M>();
        add_product<NX, M, NX>(turned.data(), top.data(), 1.0, halfway.data());
        return halfway;
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
    const Mat<NX, NY> NK = times<NX, NX, NY>(N, now.gain);
    const Mat<NY, NX> turned = transposed<NX, NY>(now.gain);
    Vec<NY> u = times<NY, NY, 1>(now.information, now.innovation);
    add_product<NY, NX, 1>(turned.data(), r.data(), -1.0, u.data());
    Mat<NY, NY> bracket = information;
    add_product<NY, NX, NY>(turned.data(), NK.data(), 1.0, bracket.data());
    for (int j = 0; j < NY; ++j)
        for (int i = 0; i < NY; ++i) sensors.sum(i, j) += u[i] * u[j] - bracket(i, j);
    for (int j = 0; j < NX; ++j)
        for (int i = 0; i < NY; ++i) r[j] += now.observation(i, j) * u[i];
    const auto back = [&](const auto& X) {
        return now.observed == NY ? carried_back<D>(X, now.observation)
                                  : carried_back<0>(X, now.observation);
    };
    const Mat<NX, NX> mixed = back(NK);
    const Mat<NY, NX> carried = back(bracket);
    const Mat<NX, NY> halfway = transposed<NY, NX>(carried);
    N += back(halfway);
    for (int j = 0; j < NX; ++j)
        for (int i = 0; i < NX; ++i) N(i, j) -= mixed(i, j) + mixed(j, i);
}

/// The same, one reading after the other, the last one first; only the diagonal of the sum.
template <int D, int NX, int NY>
void step_back(const SequentialUpdate<NX, NY>& now, const Vec<NY>& y, Vec<NX>& r, Mat<NX, NX>& N,
               SquareSum<NY>& sensors) {
    for (int j = NY; j-- > 0;) {
        if (std::isnan(y[j])) continue;
        const double* gain = now.gain.data() + static_cast<std::ptrdiff_t>(NX) * j;
        Vec<NX> mixed = Vec<NX>::Zero();
        add_product<NX, NX, 1>(N.data(), gain, 1.0, mixed.data());
        double u = now.information[j] * now.innovation[j];
        double bracket = now.information[j];
        for (int i = 0; i < NX; ++i) {
            u -= gain[i] * r[i];
            bracket += gain[i] * mixed[i];
        }
        sensors.sum(j, j) += u * u - bracket;
        if (j < D) {
            r[j] += u;
            mixed[j] -= 0.5 * bracket;
            for (int i = 0; i < NX; ++i) N(i, j) -= mixed[i];
            for (int i = 0; i < NX; ++i) N(j, i) -= mixed[i];
        } else {
            Vec<NX> h;
            for (int i = 0; i < NX; ++i) {
                h[i] = now.observation(j, i);
                r[i] += u * h[i];
                mixed[i] -= 0.5 * bracket * h[i];
            }
            for (int k = 0; k < NX; ++k)
                for (int i = 0; i < NX; ++i) N(i, k) -= mixed[i] * h[k] + h[i] * mixed[k];
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
        out.process.sum = times<NX, NX, NX>(Q, times<NX, NX, NX>(out.process.sum, Q));
        out.process.sum += out.process.samples * Q;
        out.sensors.sum = times<NY, NY, NY>(R, times<NY, NY, NY>(out.sensors.sum, R));
        out.sensors.sum += out.sensors.samples * R;
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
                r = transposed_times<NX, NX, 1>(A, r);
                N = pulled_back<MovingStates<System, NX>::value>(A, N);
            }
            step_back<DirectReadings<System>::value>(steps[k].update, y, r, N, out.sensors);
            symmetrise(N);
            if (k > 0 || record.predict_first) {
                for (int n = 0; n < NX; ++n)
                    for (int m = 0; m < NX; ++m) out.process.sum(m, n) += r[m] * r[n] - N(m, n);
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
            const Mat<NX, NX> mixed = times_transposed<NX, NX, NX>(now.lag_one, A);
            Mat<NX, NX> spread = before.covariance;
            propagate<NX>(A, spread);
            for (int j = 0; j < NX; ++j)
                for (int i = 0; i < NX; ++i)
                    out.process.sum(i, j) += e[i] * e[j] + now.covariance(i, j) + spread(i, j) -
                                             mixed(i, j) - mixed(j, i);
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
        const Mat<NY, NY> known =
            times_transposed<NY, NX, NY>(times<NY, NX, NX>(H, now.covariance), H);
        for (int j = 0; j < NY; ++j)
            for (int i = 0; i < NY; ++i) out.sensors.sum(i, j) += e[i] * e[j] + known(i, j);
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

/// How an iteration went, whatever the size of the model.
struct EmProgress {
    std::vector<double> log_likelihood;  // of the start, then after each iteration
    bool converged = false;
    int shortened = 0;  // steps that had to be
    int fell = 0;       // iterations that ended lower than they began
    int leaps = 0;      // iterations that were leaps, see `NoiseLeap` in `em.cpp`
};

template <int NX, int NY>
struct EmOutcome : EmProgress {
    NoisePair<NX, NY> noise;
};

/// Covariances of a model of any size.
struct AnyNoise {
    Eigen::MatrixXd process, sensors;
};

/// What the iteration asks of a model of any size.
class AnyExpectation {
  public:
    AnyExpectation() = default;
    virtual ~AnyExpectation() = default;
    AnyExpectation(const AnyExpectation&) = delete;
    AnyExpectation& operator=(const AnyExpectation&) = delete;
    virtual double log_likelihood(const AnyNoise& noise) = 0;
    /// For the noise of the last call; of the process, then of the sensors.
    virtual std::pair<AnySquareSum, AnySquareSum> moments() = 0;
};

/// Alternates expectation and maximisation from `noise` on, which receives the outcome.
EmProgress learn_noise(AnyExpectation& expectation, AnyNoise& noise, const NoiseForm& process,
                       const NoiseForm& sensors, const EmOptions& options);

/// The same for `Expectation`, which provides log_likelihood(noise), then moments() for that noise.
template <int NX, int NY, class Expectation>
EmOutcome<NX, NY> learn_noise(Expectation& expectation, const NoisePair<NX, NY>& start,
                              const NoiseStructure<NX>& process, const NoiseStructure<NY>& sensors,
                              const EmOptions& options) {
    class Sized final : public AnyExpectation {
      public:
        explicit Sized(Expectation& its) : its_(its) {}
        double log_likelihood(const AnyNoise& noise) override {
            return its_.log_likelihood({noise.process, noise.sensors});
        }
        std::pair<AnySquareSum, AnySquareSum> moments() override {
            const NoiseMoments<NX, NY> found = its_.moments();
            return {found.process.any(), found.sensors.any()};
        }

      private:
        Expectation& its_;
    };
    Sized sized(expectation);
    AnyNoise noise{start.process, start.sensors};
    EmOutcome<NX, NY> out;
    static_cast<EmProgress&>(out) =
        learn_noise(sized, noise, process.form(), sensors.form(), options);
    out.noise = {noise.process, noise.sensors};
    return out;
}

}  // namespace sysid
