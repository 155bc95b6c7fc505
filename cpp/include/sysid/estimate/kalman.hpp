// The Kalman measurement update, and the extended Kalman filter built on it, for any fixed-size
// model.
//
// A `System` provides, for sample k:
//   std::size_t size() const;
//   Vec<NX> predict(k, x, A, Q) const    x(k) from x(k-1); fills the Jacobian A and the noise Q
//   Vec<NY> observe(k, x, H) const       expected measurement; fills its Jacobian H
//   Vec<NY> measurement(k) const         NaN marks a missing element
//   Mat<NY, NY> measurement_noise(k) const
#pragma once

#include <cmath>

#include "sysid/math/errors.hpp"
#include "sysid/math/linear.hpp"

namespace sysid {

constexpr double kLogTwoPi = 1.8378770664093454836;

template <int NX, int NY>
struct Update {
    Vec<NY> innovation;  // zero where the measurement is missing
    Mat<NY, NY> lower;   // Cholesky factor of the innovation covariance; 1 on missing diagonals
    Mat<NX, NY> gain;    // zero columns for missing measurements
    Mat<NY, NX> observation;  // zero rows for missing measurements
    int observed = 0;
    double log_likelihood = 0.0;
};

/// Updates mean and covariance with the elements of `y` that are there (Joseph form).
template <int NX, int NY>
Update<NX, NY> measurement_update(Vec<NX>& x, Mat<NX, NX>& P, const Vec<NY>& y,
                                  const Vec<NY>& expected, const Mat<NY, NX>& H,
                                  const Mat<NY, NY>& R, std::size_t sample) {
    Update<NX, NY> u;
    u.innovation = y - expected;
    u.observation = H;
    Mat<NY, NY> noise = R;
    for (int i = 0; i < NY; ++i) {
        if (std::isnan(y[i])) {
            u.innovation[i] = 0.0;
            u.observation.row(i).setZero();
            noise.row(i).setZero();
            noise.col(i).setZero();
            noise(i, i) = 1.0;
        } else {
            ++u.observed;
        }
    }
    const Mat<NX, NY> cross = P * u.observation.transpose();
    const Mat<NY, NY> S = u.observation * cross + noise;
    const Eigen::LLT<Mat<NY, NY>> factor(S);
    if (factor.info() != Eigen::Success || !u.innovation.allFinite())
        throw NumericalFailure("the innovation covariance is not positive definite", sample);
    u.lower = factor.matrixL();
    u.gain = factor.solve(cross.transpose()).transpose();
    const Vec<NY> whitened = u.lower.template triangularView<Eigen::Lower>().solve(u.innovation);
    u.log_likelihood = -0.5 * (whitened.squaredNorm() + u.observed * kLogTwoPi) -
                       u.lower.diagonal().array().log().sum();
    x += u.gain * u.innovation;
    Mat<NX, NX> keep = Mat<NX, NX>::Identity();
    keep.noalias() -= u.gain * u.observation;
    P = (keep * P * keep.transpose() + u.gain * noise * u.gain.transpose()).eval();
    symmetrise(P);
    return u;
}

/// What is known after a sample has been used; `A` led to it from the sample before.
template <int NX, int NY>
struct FilterStep {
    Vec<NX> predicted_mean, mean;
    Mat<NX, NX> predicted_covariance, covariance, transition;
    Update<NX, NY> update;
};

/// Extended Kalman filter over a whole record; `keep(k, step)` receives every sample. Returns the
/// log-likelihood. The first sample is updated from (x, P) without a prediction, unless
/// `predict_first` says that (x, P) belongs one sample earlier.
template <int NX, int NY, class System, class Keep>
double extended_kalman_filter(const System& system, Vec<NX> x, Mat<NX, NX> P, Keep&& keep,
                              bool predict_first = false) {
    double log_likelihood = 0.0;
    FilterStep<NX, NY> step;
    Mat<NX, NX> Q;
    Mat<NY, NX> H;
    step.transition.setIdentity();
    for (std::size_t k = 0; k < system.size(); ++k) {
        if (k > 0 || predict_first) {
            x = system.predict(k, x, step.transition, Q);
            P = (step.transition * P * step.transition.transpose() + Q).eval();
            symmetrise(P);
        }
        step.predicted_mean = x;
        step.predicted_covariance = P;
        const Vec<NY> expected = system.observe(k, x, H);
        step.update = measurement_update<NX, NY>(x, P, system.measurement(k), expected, H,
                                                 system.measurement_noise(k), k);
        step.mean = x;
        step.covariance = P;
        log_likelihood += step.update.log_likelihood;
        if (!std::isfinite(log_likelihood))
            throw NumericalFailure("the log-likelihood is not finite", k);
        keep(k, step);
    }
    return log_likelihood;
}

}  // namespace sysid
