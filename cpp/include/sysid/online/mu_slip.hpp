// Friction over slip: curves of a few parameters, and estimators of those parameters.
//
// Rudd, "Estimating the Mu Slip Curve via Extended Kalman Filtering", The Mathematica Journal 11:1
// (2008), doi:10.3888/tmj.11.1-5, is the filter with pseudo-noise; the others are held against it.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "sysid/estimate/kalman.hpp"
#include "sysid/math/dual2.hpp"
#include "sysid/model/tyre.hpp"

namespace sysid {

/// mu = 2 mu_p s / (s_p (1 + (s/s_p)^2)); parameters: peak mu_p, slip of the peak s_p.
struct TwoParameterCurve {
    static constexpr int kParameters = 2;
    static constexpr std::array<double, 2> kLower{0.0, 1e-3};
    static constexpr std::array<double, 2> kUpper{10.0, 10.0};

    template <class S>
    static S mu(double slip, const S* p) {
        const S ratio = S(slip) / p[1];
        return S(2.0) * p[0] * ratio / (S(1.0) + ratio * ratio);
    }
};

/// The Magic Formula by what can be read off its curve. Parameters: peak mu_p, slip of the peak
/// s_p, shape C, and the slope at the origin as a multiple of mu_p / s_p. From these follow
/// D = mu_p, B = slope / (C s_p), and E from Pacejka, Tire and Vehicle Dynamics (3rd ed.),
/// eq. (4.11), which puts the peak at s_p.
struct MagicFormulaCurve {
    static constexpr int kParameters = 4;
    static constexpr std::array<double, 4> kLower{0.0, 1e-3, 1.05, 1.1};
    static constexpr std::array<double, 4> kUpper{10.0, 10.0, 2.4, 20.0};

    template <class S>
    static TyreCoefficients<S> coefficients(const S* p) {
        using std::atan;
        using std::tan;
        constexpr double kHalfPi = 1.5707963267948966;
        const S at_peak = p[3] / p[2];  // B s_p
        const S curvature = (at_peak - tan(S(kHalfPi) / p[2])) / (at_peak - atan(at_peak));
        return {at_peak / p[1], p[2], p[0], curvature};
    }
    template <class S>
    static S mu(double slip, const S* p) {
        return magic_formula(S(slip), coefficients(p));
    }
};

template <int NP>
struct CurvePoint {
    double mu = 0.0;
    Vec<NP> gradient;
    Mat<NP, NP> hessian;
};

template <class Curve>
using CurveVec = Vec<Curve::kParameters>;
template <class Curve>
using CurveMat = Mat<Curve::kParameters, Curve::kParameters>;

template <class Curve>
CurvePoint<Curve::kParameters> curve_point(double slip, const CurveVec<Curve>& parameters) {
    constexpr int n = Curve::kParameters;
    std::array<Dual2<n>, n> seeded;
    for (int i = 0; i < n; ++i)
        seeded[static_cast<std::size_t>(i)] = Dual2<n>::seeded(parameters[i], i);
    const Dual2<n> result = Curve::mu(slip, seeded.data());
    return {result.v, result.d, result.dd};
}

/// Keeps parameters where the curve means something.
template <class Curve>
void keep_inside(CurveVec<Curve>& x) {
    for (int i = 0; i < Curve::kParameters; ++i) {
        const auto at = static_cast<std::size_t>(i);
        x[i] = std::min(std::max(x[i], Curve::kLower[at]), Curve::kUpper[at]);
    }
}

/// Variance of the terms of second order of an expansion at the mean, taken as noise. Correlations
/// count as 1, because a negative one would lower it (Rudd, Out[19], for two parameters).
template <int NP>
double pseudo_noise(const Mat<NP, NP>& hessian, const Mat<NP, NP>& P) {
    double sum = 0.0;
    for (int i = 0; i < NP; ++i) {
        const double own = 0.5 * hessian(i, i) * P(i, i);
        sum += own * own;
        for (int j = i + 1; j < NP; ++j) sum += hessian(i, j) * hessian(i, j) * P(i, i) * P(j, j);
    }
    return sum;
}

template <class Curve>
struct CurvePrior {
    CurveVec<Curve> mean;
    CurveMat<Curve> covariance;
};

template <class Curve>
struct CurveFilterSettings {
    double noise_std = 0.0;    // that the filter assumes of a friction reading
    bool pseudo_noise = true;  // add the variance of the terms left out of the linearisation
    int iterations = 1;        // linearisations per reading; 1 is the extended Kalman filter
    CurveVec<Curve> drift_std = CurveVec<Curve>::Zero();  // random walk per sample
};

/// One reading as the filter saw it.
template <class Curve>
struct CurveStep {
    FilterStep<Curve::kParameters, 1> filter;
    double pseudo_variance = 0.0;
    double signal_before = 0.0;  // H P H' before the reading and after it, each at its estimate
    double signal_after = 0.0;
};

/// Takes one reading at a time; the first one without a drift before it.
template <class Curve>
class CurveFilter {
  public:
    CurveFilter(const CurvePrior<Curve>& prior, const CurveFilterSettings<Curve>& settings)
        : mean_(prior.mean), covariance_(prior.covariance), settings_(settings) {}

    const CurveVec<Curve>& mean() const { return mean_; }
    const CurveMat<Curve>& covariance() const { return covariance_; }
    std::size_t readings() const { return readings_; }

    template <class Row>
    void remember(Row& row) {
        auto& s = settings_;
        row(mean_, covariance_, s.noise_std, s.pseudo_noise, s.iterations, s.drift_std, readings_);
    }

    CurveStep<Curve> update(double slip, double mu) {
        constexpr int n = Curve::kParameters;
        CurveStep<Curve> out;
        auto& step = out.filter;
        CurveMat<Curve> P = covariance_;
        if (readings_ > 0) P += CurveMat<Curve>(settings_.drift_std.cwiseAbs2().asDiagonal());
        step.transition.setIdentity();
        step.predicted_mean = mean_;
        step.predicted_covariance = P;

        CurvePoint<n> at = curve_point<Curve>(slip, mean_);
        if (settings_.pseudo_noise) out.pseudo_variance = pseudo_noise<n>(at.hessian, P);
        const double before = out.pseudo_variance;
        out.signal_before = at.gradient.dot(P * at.gradient);
        const double sensor = settings_.noise_std * settings_.noise_std;

        CurveVec<Curve> x = mean_;
        for (int i = 0; i < settings_.iterations; ++i) {
            if (i > 0) {
                at = curve_point<Curve>(slip, x);
                // What is left out there, about the new estimate. An odd reading may lead to where
                // the curve is steep and bent: taken for straight there, it would leave a certainty
                // that no later reading undoes.
                if (settings_.pseudo_noise)
                    out.pseudo_variance =
                        std::max(before, pseudo_noise<n>(at.hessian, step.covariance));
            }
            const Mat<1, 1> R(sensor + out.pseudo_variance);
            CurveVec<Curve> next = mean_;
            CurveMat<Curve> covariance = P;
            const Vec<1> expected(at.mu + at.gradient.dot(mean_ - x));
            measurement_update<n, 1>(next, covariance, Vec<1>(mu), expected,
                                     at.gradient.transpose(), R, readings_, step.update);
            step.covariance = covariance;
            keep_inside<Curve>(next);
            if (i > 0) next = shortened(x, next, P, slip, mu, R(0, 0));
            const double moved = (next - x).cwiseAbs().maxCoeff();
            x = next;
            if (moved < 1e-12) break;
        }
        step.mean = x;
        const CurveVec<Curve> slope = curve_point<Curve>(slip, x).gradient;
        out.signal_after = slope.dot(step.covariance * slope);
        mean_ = x;
        covariance_ = step.covariance;
        ++readings_;
        return out;
    }

  private:
    // A full Gauss-Newton step can overshoot; halve it until it does not make matters worse.
    CurveVec<Curve> shortened(const CurveVec<Curve>& x, const CurveVec<Curve>& next,
                              const CurveMat<Curve>& P, double slip, double mu, double R) const {
        if (std::isnan(mu)) return x;
        const auto cost = [&](const CurveVec<Curve>& at) {
            const double error = mu - Curve::mu(slip, at.data());
            const CurveVec<Curve> away = at - mean_;
            return error * error / R + away.dot(solved_by<Curve::kParameters, 1>(P, away));
        };
        const double now = cost(x);
        CurveVec<Curve> trial = next;
        for (int halving = 0; halving < 20; ++halving) {
            if (cost(trial) <= now) return trial;
            trial = x + 0.5 * (trial - x);
        }
        return x;
    }

    CurveVec<Curve> mean_;
    CurveMat<Curve> covariance_;
    CurveFilterSettings<Curve> settings_;
    std::size_t readings_ = 0;
};

/// Readings of friction; a missing one is NaN.
struct CurveReadings {
    std::vector<double> slip, mu;
    std::size_t size() const { return slip.size(); }
};

template <class Curve>
std::vector<CurveStep<Curve>> filter_curve(const CurveReadings& readings,
                                           const CurvePrior<Curve>& prior,
                                           const CurveFilterSettings<Curve>& settings);

/// Mean and covariance at every sample given all readings.
template <class Curve>
struct CurveSmoothed {
    std::vector<CurveVec<Curve>> mean;
    std::vector<CurveMat<Curve>> covariance;
    int rounds = 0;
    bool converged = false;
};

/// Iterated smoother: filters, smooths, linearises again along the smoothed estimate, until that
/// rests at the maximum of the posterior (Bell, SIAM J. Optim. 4, 1994). Only the first round has
/// pseudo-noise.
template <class Curve>
CurveSmoothed<Curve> smooth_curve(const CurveReadings& readings, const CurvePrior<Curve>& prior,
                                  const CurveFilterSettings<Curve>& settings, int max_rounds);

/// Nonlinear least squares, with what follows from its derivatives for noise of variance 1.
template <class Curve>
struct CurveFit {
    CurveVec<Curve> mean;
    CurveMat<Curve> covariance = CurveMat<Curve>::Zero();  // inverse of J'J
    CurveVec<Curve> bias = CurveVec<Curve>::Zero();  // Box, J. R. Statist. Soc. B 33 (1971), p. 171
    double sum_of_squares = 0.0;
    int used = 0;             // readings that were there
    bool determined = false;  // covariance and bias exist
    int iterations = 0;
    bool converged = false;
};

/// Gauss-Newton inside a box; a step that does not lower the sum is damped (Levenberg, Marquardt).
template <class Curve>
CurveFit<Curve> fit_curve(const CurveReadings& readings, const CurveVec<Curve>& start,
                          const CurveVec<Curve>& lower, const CurveVec<Curve>& upper,
                          int max_iterations);

}  // namespace sysid
