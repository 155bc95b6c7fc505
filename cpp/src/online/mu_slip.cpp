#include "sysid/online/mu_slip.hpp"

#include <algorithm>

#include "sysid/estimate/smoother.hpp"
#include "sysid/math/interrupt.hpp"

namespace sysid {

namespace {

/// The readings linearised along a path: a linear system, so that one pass of filter and smoother
/// is one Gauss-Newton step on the whole record.
template <class Curve>
struct LinearisedReadings {
    static constexpr int n = Curve::kParameters;
    const CurveReadings& readings;
    const std::vector<CurveVec<Curve>>& path;
    const CurveFilterSettings<Curve>& settings;

    std::size_t size() const { return readings.size(); }
    Vec<n> predict(std::size_t /*k*/, const Vec<n>& x, Mat<n, n>& A, Mat<n, n>& Q) const {
        A.setIdentity();
        Q = settings.drift_std.cwiseAbs2().asDiagonal();
        return x;
    }
    Vec<1> observe(std::size_t k, const Vec<n>& x, Mat<1, n>& H) const {
        const auto at = curve_point<Curve>(readings.slip[k], path[k]);
        H = at.gradient.transpose();
        return Vec<1>(at.mu + at.gradient.dot(x - path[k]));
    }
    Vec<1> measurement(std::size_t k) const { return Vec<1>(readings.mu[k]); }
    Mat<1, 1> measurement_noise(std::size_t /*k*/) const {
        return Mat<1, 1>(settings.noise_std * settings.noise_std);
    }
};

/// Minus twice the logarithm of the posterior density of a path, up to a constant.
template <class Curve>
double cost_of(const std::vector<CurveVec<Curve>>& path, const CurveReadings& readings,
               const CurvePrior<Curve>& prior, const CurveFilterSettings<Curve>& settings) {
    const CurveVec<Curve> away = path.front() - prior.mean;
    double cost = away.dot(solved_by<Curve::kParameters, 1>(prior.covariance, away));
    for (std::size_t k = 0; k < path.size(); ++k) {
        if (!std::isnan(readings.mu[k])) {
            const double error = readings.mu[k] - Curve::mu(readings.slip[k], path[k].data());
            cost += error * error / (settings.noise_std * settings.noise_std);
        }
        if (k == 0) continue;
        for (int i = 0; i < Curve::kParameters; ++i) {
            if (settings.drift_std[i] == 0.0) continue;
            const double moved = (path[k][i] - path[k - 1][i]) / settings.drift_std[i];
            cost += moved * moved;
        }
    }
    return cost;
}

template <class Curve>
void take(const std::vector<SmoothedStep<Curve::kParameters>>& steps,
          std::vector<CurveVec<Curve>>& mean, std::vector<CurveMat<Curve>>& covariance) {
    mean.clear();
    covariance.clear();
    for (const auto& step : steps) {
        mean.push_back(step.mean);
        covariance.push_back(step.covariance);
        keep_inside<Curve>(mean.back());
    }
}

template <class Curve>
double sum_of_squares(const CurveReadings& readings, const CurveVec<Curve>& x) {
    double sum = 0.0;
    for (std::size_t k = 0; k < readings.size(); ++k) {
        if (std::isnan(readings.mu[k])) continue;
        const double error = readings.mu[k] - Curve::mu(readings.slip[k], x.data());
        sum += error * error;
    }
    return sum;
}

template <class Curve>
CurveMat<Curve> inverse_of(const CurveMat<Curve>& information) {
    constexpr int n = Curve::kParameters;
    return solved_by<n, n>(information, CurveMat<Curve>::Identity());
}

template <class Curve>
struct NormalEquations {
    CurveMat<Curve> information = CurveMat<Curve>::Zero();
    CurveVec<Curve> gradient = CurveVec<Curve>::Zero();  // J' times the residuals
    CurveVec<Curve> curvature = CurveVec<Curve>::Zero();
    int used = 0;

    NormalEquations(const CurveReadings& readings, const CurveVec<Curve>& x) {
        std::vector<CurvePoint<Curve::kParameters>> points;
        for (std::size_t k = 0; k < readings.size(); ++k) {
            if (std::isnan(readings.mu[k])) continue;
            points.push_back(curve_point<Curve>(readings.slip[k], x));
            const auto& at = points.back();
            information += at.gradient * at.gradient.transpose();
            gradient += at.gradient * (readings.mu[k] - at.mu);
            ++used;
        }
        const CurveMat<Curve> inverse = inverse_of<Curve>(information);
        for (const auto& at : points) curvature += at.gradient * (inverse * at.hessian).trace();
    }
};

}  // namespace

template <class Curve>
std::vector<CurveStep<Curve>> filter_curve(const CurveReadings& readings,
                                           const CurvePrior<Curve>& prior,
                                           const CurveFilterSettings<Curve>& settings) {
    CurveFilter<Curve> filter(prior, settings);
    std::vector<CurveStep<Curve>> steps;
    steps.reserve(readings.size());
    for (std::size_t k = 0; k < readings.size(); ++k) {
        poll_interrupt(k);
        steps.push_back(filter.update(readings.slip[k], readings.mu[k]));
    }
    return steps;
}

template <class Curve>
CurveSmoothed<Curve> smooth_curve(const CurveReadings& readings, const CurvePrior<Curve>& prior,
                                  const CurveFilterSettings<Curve>& settings, int max_rounds) {
    constexpr int n = Curve::kParameters;
    using Steps = std::vector<FilterStep<n, 1>>;
    Steps steps;
    for (auto& step : filter_curve<Curve>(readings, prior, settings)) steps.push_back(step.filter);
    CurveSmoothed<Curve> out;
    out.rounds = 1;
    take<Curve>(smooth(steps), out.mean, out.covariance);
    double cost = cost_of<Curve>(out.mean, readings, prior, settings);
    std::vector<CurveVec<Curve>> next;
    for (; out.rounds < max_rounds && !out.converged; ++out.rounds) {
        steps.clear();
        extended_kalman_filter<n, 1>(
            LinearisedReadings<Curve>{readings, out.mean, settings}, prior.mean, prior.covariance,
            [&](std::size_t, const FilterStep<n, 1>& step) { steps.push_back(step); });
        take<Curve>(smooth(steps), next, out.covariance);
        double lower = cost_of<Curve>(next, readings, prior, settings);
        for (int halving = 0; lower > cost && halving < 20; ++halving) {
            for (std::size_t k = 0; k < next.size(); ++k)
                next[k] = out.mean[k] + 0.5 * (next[k] - out.mean[k]);
            lower = cost_of<Curve>(next, readings, prior, settings);
        }
        out.converged = cost - lower < 1e-10 * (1.0 + cost);
        if (lower > cost) break;
        cost = lower;
        out.mean = next;
    }
    return out;
}

template <class Curve>
CurveFit<Curve> fit_curve(const CurveReadings& readings, const CurveVec<Curve>& start,
                          const CurveVec<Curve>& lower, const CurveVec<Curve>& upper,
                          int max_iterations) {
    CurveFit<Curve> fit;
    CurveVec<Curve> x = start.cwiseMax(lower).cwiseMin(upper);
    double cost = sum_of_squares<Curve>(readings, x);
    double damping = 0.0;
    for (; fit.iterations < max_iterations && !fit.converged; ++fit.iterations) {
        const NormalEquations<Curve> at(readings, x);
        // At a bound, only steps back inside count.
        CurveVec<Curve> free;
        for (int i = 0; i < Curve::kParameters; ++i)
            free[i] = (x[i] <= lower[i] && at.gradient[i] < 0.0) ||
                              (x[i] >= upper[i] && at.gradient[i] > 0.0)
                          ? 0.0
                          : 1.0;
        const CurveVec<Curve> gradient = at.gradient.cwiseProduct(free);
        const CurveVec<Curve> scale = at.information.diagonal().array() + 1e-12;
        bool lowered = false;
        for (int trial = 0; trial < 30 && !lowered; ++trial) {
            CurveMat<Curve> system = free.asDiagonal() * at.information * free.asDiagonal();
            system +=
                CurveMat<Curve>((damping * scale + CurveVec<Curve>::Ones() - free).asDiagonal());
            const CurveVec<Curve> next = (x + solved_by<Curve::kParameters, 1>(system, gradient))
                                             .cwiseMax(lower)
                                             .cwiseMin(upper);
            const double trial_cost = next.allFinite() ? sum_of_squares<Curve>(readings, next)
                                                       : std::numeric_limits<double>::infinity();
            if (trial_cost <= cost) {
                lowered = true;
                fit.converged = (next - x).cwiseAbs().maxCoeff() < 1e-10;
                x = next;
                cost = trial_cost;
                damping = damping < 1e-6 ? 0.0 : damping / 10.0;
            } else {
                damping = std::max(10.0 * damping, 1e-4);
            }
        }
        if (!lowered) fit.converged = true;  // no step, however short, leads lower
    }
    const NormalEquations<Curve> at(readings, x);
    CurveMat<Curve> factor, inverse;
    fit.mean = x;
    fit.sum_of_squares = cost;
    fit.used = at.used;
    fit.determined =
        cholesky<Curve::kParameters>(at.information, factor, inverse) && std::isfinite(cost);
    if (!fit.determined) return fit;
    fit.covariance = inverse.transpose() * inverse;
    symmetrise(fit.covariance);
    fit.bias = -0.5 * fit.covariance * at.curvature;
    return fit;
}

template std::vector<CurveStep<TwoParameterCurve>> filter_curve(
    const CurveReadings&, const CurvePrior<TwoParameterCurve>&,
    const CurveFilterSettings<TwoParameterCurve>&);
template CurveSmoothed<TwoParameterCurve> smooth_curve(
    const CurveReadings&, const CurvePrior<TwoParameterCurve>&,
    const CurveFilterSettings<TwoParameterCurve>&, int);
template CurveFit<TwoParameterCurve> fit_curve<TwoParameterCurve>(
    const CurveReadings&, const CurveVec<TwoParameterCurve>&, const CurveVec<TwoParameterCurve>&,
    const CurveVec<TwoParameterCurve>&, int);

template std::vector<CurveStep<MagicFormulaCurve>> filter_curve(
    const CurveReadings&, const CurvePrior<MagicFormulaCurve>&,
    const CurveFilterSettings<MagicFormulaCurve>&);
template CurveSmoothed<MagicFormulaCurve> smooth_curve(
    const CurveReadings&, const CurvePrior<MagicFormulaCurve>&,
    const CurveFilterSettings<MagicFormulaCurve>&, int);
template CurveFit<MagicFormulaCurve> fit_curve<MagicFormulaCurve>(
    const CurveReadings&, const CurveVec<MagicFormulaCurve>&, const CurveVec<MagicFormulaCurve>&,
    const CurveVec<MagicFormulaCurve>&, int);

}  // namespace sysid
