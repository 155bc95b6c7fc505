// The Kalman measurement update, and the extended Kalman filter built on it, for any fixed-size
// model.
//
// A `System` provides, for sample k:
//   std::size_t size() const;
//   Vec<NX> predict(k, x, A, Q) const    x(k) from x(k-1); fills the Jacobian A and the noise Q
//   Vec<NY> observe(k, x, H) const       expected measurement; fills its Jacobian H
//   Vec<NY> measurement(k) const         NaN marks a missing element
//   Mat<NY, NY> measurement_noise(k) const
//
// For speed it may promise, as static constexpr int:
//   kMovingStates    only so many first states change by themselves: A's other rows are the unit's,
//                    and `predict` finds and leaves them so
//   kDirectReadings  so many first readings are the states of the same number
//   kSteadyNoise     true: Q is the same for all samples; `process_noise()` gives it, `predict`
//   does
//                    not fill it
#pragma once

#include <cmath>
#include <type_traits>

#include "sysid/math/errors.hpp"
#include "sysid/math/interrupt.hpp"
#include "sysid/math/linear.hpp"
#include "sysid/math/products.hpp"

namespace sysid {

constexpr double kLogTwoPi = 1.8378770664093454836;

template <class System, int NX, class = void>
struct MovingStates : std::integral_constant<int, NX> {};
template <class System, int NX>
struct MovingStates<System, NX, std::void_t<decltype(System::kMovingStates)>>
    : std::integral_constant<int, System::kMovingStates> {};

template <class System, class = void>
struct DirectReadings : std::integral_constant<int, 0> {};
template <class System>
struct DirectReadings<System, std::void_t<decltype(System::kDirectReadings)>>
    : std::integral_constant<int, System::kDirectReadings> {};

template <class System, class = void>
struct SteadyNoise : std::false_type {};
template <class System>
struct SteadyNoise<System, std::void_t<decltype(System::kSteadyNoise)>>
    : std::bool_constant<System::kSteadyNoise> {};

/// Turns a symmetric P into A P A', where only the first M rows of A differ from the unit matrix.
template <int M, int NX>
void propagate(const Mat<NX, NX>& A, Mat<NX, NX>& P) {
    if constexpr (M == NX) {
        P = times_transposed<NX, NX, NX>(times<NX, NX, NX>(A, P), A);
        symmetrise(P);
    } else {
        const Mat<M, NX> moving = A.template topRows<M>();
        const Mat<NX, M> halfway = times_transposed<NX, NX, M>(P, moving);
        for (int j = 0; j < M; ++j)
            for (int i = 0; i <= j; ++i) {
                double sum = 0.0;
                for (int k = 0; k < NX; ++k) sum += moving(i, k) * halfway(k, j);
                P(i, j) = P(j, i) = sum;
            }
        for (int j = 0; j < M; ++j)
            for (int i = M; i < NX; ++i) P(i, j) = P(j, i) = halfway(i, j);
    }
}

/// X H', where the first D rows of H are those of the unit matrix.
template <int D, int R, int NX, int NY>
Mat<R, NY> seen_by(const Mat<R, NX>& X, const Mat<NY, NX>& H) {
    Mat<R, NY> out = Mat<R, NY>::Zero();
    for (int j = 0; j < D; ++j)
        for (int i = 0; i < R; ++i) out(i, j) = X(i, j);
    for (int j = D; j < NY; ++j)
        for (int k = 0; k < NX; ++k) {
            const double h = H(j, k);
            for (int i = 0; i < R; ++i) out(i, j) += X(i, k) * h;
        }
    return out;
}

/// X H of the same H.
template <int D, int R, int NX, int NY>
Mat<R, NX> carried_back(const Mat<R, NY>& X, const Mat<NY, NX>& H) {
    Mat<R, NX> out = Mat<R, NX>::Zero();
    for (int j = 0; j < D; ++j)
        for (int i = 0; i < R; ++i) out(i, j) = X(i, j);
    for (int j = 0; j < NX; ++j)
        for (int k = D; k < NY; ++k) {
            const double h = H(k, j);
            for (int i = 0; i < R; ++i) out(i, j) += X(i, k) * h;
        }
    return out;
}

template <int NX, int NY>
struct Update {
    Vec<NY> innovation;     // zero where the measurement is missing
    Mat<NY, NY> lower;      // Cholesky factor of the innovation covariance; 1 on missing diagonals
    Mat<NY, NY> whitening;  // its inverse
    Mat<NY, NY> information;  // inverse covariance of the innovation
    Mat<NX, NY> gain;         // zero columns for missing measurements
    Mat<NY, NX> observation;  // zero rows for missing measurements
    int observed = 0;
    double squares = 0.0;      // innovations against their covariance
    double determinant = 1.0;  // of that covariance
};

/// The log-density of innovations, gathered from updates. A logarithm for each would take longer
/// than much of the update itself.
class LogDensity {
  public:
    template <class U>
    void add(const U& update) {
        sum_ -= 0.5 * (update.squares + update.observed * kLogTwoPi);
        // What leaves this range on its own is a matter of the logarithm too.
        if (!ordinary(update.determinant)) {
            sum_ -= 0.5 * std::log(update.determinant);
            return;
        }
        product_ *= update.determinant;
        if (!ordinary(product_)) {
            sum_ -= 0.5 * std::log(product_);
            product_ = 1.0;
        }
    }
    double value() const { return sum_ - 0.5 * std::log(product_); }
    bool finite() const { return std::isfinite(sum_); }

    /// Of one update alone.
    template <class U>
    static double of(const U& update) {
        LogDensity one;
        one.add(update);
        return one.value();
    }

  private:
    /// Whether two such numbers can be multiplied; false for what is not a number.
    static bool ordinary(double x) { return x > 1e-140 && x < 1e140; }

    double sum_ = 0.0;
    double product_ = 1.0;
};

/// After an update with a reading surer than `kSurest`: where a variance fell by that much, all get
/// a share of what they were, larger than the rounding of the update.
template <int NX>
void keep_positive(const Mat<NX, NX>& before, Mat<NX, NX>& P) {
    bool fell = false;
    for (int i = 0; i < NX; ++i) fell |= P(i, i) < kSurest * before(i, i);
    if (!fell) return;
    for (int i = 0; i < NX; ++i) P(i, i) += 0.1 * kSurest * before(i, i);
}

/// For a covariance that lost its positive definiteness where a reading needs it.
template <int NX>
void restore_positive(Mat<NX, NX>& P, std::size_t sample) {
    if (std::isnan(lift_correlations<NX>(P, 0.1 * kSurest)))
        throw NumericalFailure("the covariance is not finite", sample);
}

/// The algebra of an update, for an innovation and an observation that are in `u`. False, and
/// nothing changed, where the covariance of the innovation is not positive definite.
template <int NX, int NY, int D>
bool joseph_update(Vec<NX>& x, Mat<NX, NX>& P, const Mat<NY, NY>& noise, Update<NX, NY>& u) {
    const bool whole = u.observed == NY;
    const auto seen = [&](const auto& X) {
        return whole ? seen_by<D>(X, u.observation) : seen_by<0>(X, u.observation);
    };
    const Mat<NX, NY> cross = seen(P);
    const Mat<NY, NX> crossed = transposed<NX, NY>(cross);
    Mat<NY, NY> S = seen(crossed);
    S += noise;
    if (!cholesky<NY>(S, u.lower, u.whitening)) return false;
    u.information = transposed_times<NY, NY, NY>(u.whitening, u.whitening);
    u.gain = times<NX, NY, NY>(cross, u.information);
    u.squares = 0.0;
    u.determinant = 1.0;
    for (int i = 0; i < NY; ++i) {
        double whitened = 0.0;
        for (int j = 0; j <= i; ++j) whitened += u.whitening(i, j) * u.innovation[j];
        u.squares += whitened * whitened;
        u.determinant *= u.lower(i, i);
    }
    u.determinant *= u.determinant;
    add_product<NX, NY, 1>(u.gain.data(), u.innovation.data(), 1.0, x.data());
    // (I - K H) P (I - K H)' + K R K', multiplied from the left, then from the right.
    const Mat<NX, NX> left = less_times_transposed<NX, NY, NX>(P, u.gain, cross);
    Mat<NX, NY> rest = seen(left);
    add_product<NX, NY, NY>(u.gain.data(), noise.data(), -1.0, rest.data());
    const auto finish = [&] {
        P = less_times_transposed<NX, NY, NX>(left, rest, u.gain);
        symmetrise(P);
    };
    bool sure = false;
    for (int i = 0; i < NY; ++i) sure |= noise(i, i) < kSurest * S(i, i);
    if (sure) {
        const Mat<NX, NX> before = P;
        finish();
        keep_positive<NX>(before, P);
    } else {
        finish();
    }
    return true;
}

/// Updates mean and covariance with the elements of `y` that are there (Joseph form). The first `D`
/// readings are states.
template <int NX, int NY, int D = 0>
void measurement_update(Vec<NX>& x, Mat<NX, NX>& P, const Vec<NY>& y, const Vec<NY>& expected,
                        const Mat<NY, NX>& H, const Mat<NY, NY>& R, std::size_t sample,
                        Update<NX, NY>& u) {
    u.observed = 0;
    if (&u.observation != &H) u.observation = H;
    Mat<NY, NY> noise = R;
    for (int i = 0; i < NY; ++i) {
        if (std::isnan(y[i])) {
            u.innovation[i] = 0.0;
            for (int j = 0; j < NX; ++j) u.observation(i, j) = 0.0;
            for (int j = 0; j < NY; ++j) noise(i, j) = noise(j, i) = 0.0;
            noise(i, i) = 1.0;
        } else {
            u.innovation[i] = y[i] - expected[i];
            if (!std::isfinite(u.innovation[i]))
                throw NumericalFailure("the expected reading is not finite", sample);
            ++u.observed;
        }
    }
    if (joseph_update<NX, NY, D>(x, P, noise, u)) return;
    restore_positive(P, sample);
    if (!joseph_update<NX, NY, D>(x, P, noise, u))
        throw NumericalFailure("the innovation covariance is not positive definite", sample);
}

/// Lowers P by one reading whose innovation has a variance, and gives its gain. `cross`, P h, is
/// used up. The Joseph form (I - k h') P (I - k h')' + R k k' is P - k c' - c k' + s k k', with c =
/// P h and the variance s; written so it stays symmetric. Sizes may be fixed or not.
template <class Covariance, class Vector>
void use_one_reading(Covariance& P, Vector& cross, double variance, Vector& gain) {
    const double information = 1.0 / variance;
    for (Eigen::Index i = 0; i < P.rows(); ++i) {
        gain[i] = cross[i] * information;
        cross[i] -= (0.5 * variance) * gain[i];
    }
    for (Eigen::Index k = 0; k < P.rows(); ++k)
        for (Eigen::Index i = 0; i < P.rows(); ++i)
            P(i, k) -= gain[i] * cross[k] + cross[i] * gain[k];
}

/// An update with one reading after the other, which gives the same where their noise is not
/// correlated (Durbin & Koopman, Time Series Analysis by State Space Methods, 2012, sec. 6.4).
/// Column j and element j are those of the state that has seen the readings before j.
template <int NX, int NY>
struct SequentialUpdate {
    Vec<NY> innovation;       // zero where the measurement is missing
    Vec<NY> information;      // inverse variance of the innovation; zero where missing
    Mat<NX, NY> gain;         // zero columns for missing measurements
    Mat<NY, NX> observation;  // zero rows for missing measurements
    int observed = 0;
    double squares = 0.0;      // innovations against their covariance
    double determinant = 1.0;  // of that covariance
};

/// Updates as above, for a diagonal `R`; several times faster, for nothing is factorised.
template <int NX, int NY, int D = 0>
void measurement_update(Vec<NX>& x, Mat<NX, NX>& P, const Vec<NY>& y, const Vec<NY>& expected,
                        const Mat<NY, NX>& H, const Mat<NY, NY>& R, std::size_t sample,
                        SequentialUpdate<NX, NY>& u) {
    const Vec<NX> before = x;
    u.observed = 0;
    if (&u.observation != &H) u.observation = H;
    u.squares = 0.0;
    u.determinant = 1.0;
    for (int j = 0; j < NY; ++j) {
        if (std::isnan(y[j])) {
            u.innovation[j] = u.information[j] = 0.0;
            u.gain.col(j).setZero();
            u.observation.row(j).setZero();
            continue;
        }
        ++u.observed;
        Vec<NX> cross;
        double variance, innovation = y[j] - expected[j];
        const auto look = [&] {
            variance = R(j, j);
            if (j < D) {
                cross = P.col(j);
                variance += cross[j];
            } else {
                cross.setZero();
                for (int k = 0; k < NX; ++k) {
                    const double h = H(j, k);
                    for (int i = 0; i < NX; ++i) cross[i] += P(i, k) * h;
                }
                for (int i = 0; i < NX; ++i) variance += H(j, i) * cross[i];
            }
        };
        look();
        if (j < D)
            innovation -= x[j] - before[j];
        else
            for (int i = 0; i < NX; ++i) innovation -= H(j, i) * (x[i] - before[i]);
        if (!std::isfinite(innovation))
            throw NumericalFailure("the expected reading is not finite", sample);
        if (!(variance > 0.0)) {
            restore_positive(P, sample);
            look();
            if (!(variance > 0.0))
                throw NumericalFailure("the innovation covariance is not positive definite",
                                       sample);
        }
        const double information = 1.0 / variance;
        Vec<NX> gain;
        if (R(j, j) < kSurest * variance) {
            const Mat<NX, NX> before_it = P;
            use_one_reading(P, cross, variance, gain);
            keep_positive<NX>(before_it, P);
        } else {
            use_one_reading(P, cross, variance, gain);
        }
        for (int i = 0; i < NX; ++i) x[i] += gain[i] * innovation;
        u.squares += innovation * innovation * information;
        u.determinant *= variance;
        u.innovation[j] = innovation;
        u.information[j] = information;
        u.gain.col(j) = gain;
    }
}

/// What is known before and after a sample has been used; `transition` led to it from the sample
/// before.
template <int NX>
struct StateStep {
    Vec<NX> predicted_mean, mean;
    Mat<NX, NX> predicted_covariance, covariance, transition;
};

template <int NX, int NY, class Form = Update<NX, NY>>
struct FilterStep : StateStep<NX> {
    Form update;
};

/// Extended Kalman filter over a whole record; `keep(k, step)` receives every sample. Returns the
/// log-likelihood. The first sample is updated from (mean, covariance) without a
/// prediction, unless `predict_first` says that these belong one sample earlier. `Form` is
/// `Update`, or `SequentialUpdate` where the measurement noise is diagonal.
template <int NX, int NY, class Form = Update<NX, NY>, class System, class Keep>
double extended_kalman_filter(const System& system, const Vec<NX>& mean,
                              const Mat<NX, NX>& covariance, Keep&& keep,
                              bool predict_first = false) {
    LogDensity log_density;
    FilterStep<NX, NY, Form> step;
    Vec<NX>& x = step.mean;
    Mat<NX, NX>& P = step.covariance;
    Mat<NX, NX> Q;
    Mat<NY, NX>& H = step.update.observation;
    if constexpr (SteadyNoise<System>::value) Q = system.process_noise();
    step.transition.setIdentity();
    step.predicted_mean = x = mean;
    step.predicted_covariance = P = covariance;
    for (std::size_t k = 0; k < system.size(); ++k) {
        poll_interrupt(k);
        if (k > 0 || predict_first) {
            step.predicted_mean = system.predict(k, x, step.transition, Q);
            propagate<MovingStates<System, NX>::value>(step.transition, P);
            P += Q;
            step.predicted_covariance = P;
        }
        x = step.predicted_mean;
        const Vec<NY> expected = system.observe(k, x, H);
        measurement_update<NX, NY, DirectReadings<System>::value>(
            x, P, system.measurement(k), expected, H, system.measurement_noise(k), k, step.update);
        log_density.add(step.update);
        if (!log_density.finite()) throw NumericalFailure("the log-likelihood is not finite", k);
        keep(k, step);
    }
    return log_density.value();
}

}  // namespace sysid
