#include "sysid/estimate/em.hpp"

#include <algorithm>

namespace sysid {

namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

/// A covariance along two steps, by its logarithm.
struct Path {
    VectorXd unit;
    MatrixXd start, step, bend;  // logarithms, and their first and second differences

    Path(const MatrixXd& a, const MatrixXd& b, const MatrixXd& c)
        : unit(a.diagonal().cwiseMax(kNothing).cwiseSqrt()), start(logarithm(a)) {
        const MatrixXd middle = logarithm(b);
        step = middle - start;
        bend = logarithm(c) - middle - step;
    }
    MatrixXd at(double n) const {
        const auto [values, vectors] = spectrum(MatrixXd(start + 2.0 * n * step + n * n * bend));
        const MatrixXd root = vectors * (0.5 * values).array().exp().matrix().asDiagonal();
        const MatrixXd half = unit.asDiagonal() * root;
        return half * half.transpose();
    }

  private:
    static constexpr double kNothing = 1e-200;  // stands for a variance of zero
    MatrixXd logarithm(const MatrixXd& C) const {
        const VectorXd per_unit = unit.cwiseInverse();
        const auto [values, vectors] =
            spectrum(MatrixXd(per_unit.asDiagonal() * C * per_unit.asDiagonal()));
        const VectorXd logs = values.cwiseMax(kNothing).array().log();
        return vectors * logs.asDiagonal() * vectors.transpose();
    }
};

/// Leap along the path of two steps of expectation-maximisation: squared extrapolation (Varadhan &
/// Roland, Scand. J. Statistics 2008) of the logarithms of the covariances, which keeps them
/// positive and lets those that tend to zero get there.
class NoiseLeap {
  public:
    NoiseLeap(const AnyNoise& a, const AnyNoise& b, const AnyNoise& c)
        : process_(a.process, b.process, c.process), sensors_(a.sensors, b.sensors, c.sensors) {}

    /// Length of the leap in steps; not above one where a leap makes no sense.
    double length() const {
        const double bend = process_.bend.squaredNorm() + sensors_.bend.squaredNorm();
        const double step = process_.step.squaredNorm() + sensors_.step.squaredNorm();
        return bend > 0.0 ? std::min(std::sqrt(step / bend), 100.0) : 1.0;
    }
    AnyNoise landing(const NoiseForm& process, const NoiseForm& sensors,
                     const AnyNoise& now) const {
        const double n = length();
        return {
            process.admitted(process_.at(n), now.process),
            sensors.admitted(sensors_.at(n), now.sensors),
        };
    }

  private:
    Path process_;
    Path sensors_;
};

}  // namespace

EmProgress learn_noise(AnyExpectation& expectation, AnyNoise& noise, const NoiseForm& process,
                       const NoiseForm& sensors, const EmOptions& options) {
    EmProgress out;
    noise = {
        process.admitted(noise.process, noise.process),
        sensors.admitted(noise.sensors, noise.sensors),
    };
    double value = expectation.log_likelihood(noise);
    double gain_before = 0.0, value_at_leap = value;
    std::vector<AnyNoise> path{noise};  // since the last leap
    out.log_likelihood.push_back(value);
    const auto iterations = [&] { return static_cast<int>(out.log_likelihood.size()) - 1; };
    const auto value_or_nan = [&](const AnyNoise& there) {
        try {
            return expectation.log_likelihood(there);
        } catch (const NumericalFailure&) {  // a leap into the blue
            return std::nan("");
        }
    };
    while (iterations() < options.most_iterations) {
        const auto [process_squares, sensor_squares] = expectation.moments();
        AnyNoise next{
            process.best(process_squares, noise.process),
            sensors.best(sensor_squares, noise.sensors),
        };
        double reached = expectation.log_likelihood(next);
        // The filter linearises anew, so that near the optimum a step may be too long.
        for (int halving = 0; options.never_fall && reached < value && halving < 6; ++halving) {
            if (halving == 0) ++out.shortened;
            next.process = 0.5 * (next.process + noise.process);
            next.sensors = 0.5 * (next.sensors + noise.sensors);
            reached = expectation.log_likelihood(next);
        }
        const double gain = reached - value;
        if (gain < 0.0 && options.never_fall) {
            out.converged = true;  // no step of either length gains anything
            break;
        }
        if (gain < 0.0) ++out.fell;
        noise = next;
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
        const NoiseLeap leap(path[0], path[1], path[2]);
        path.assign(1, noise);
        if (leap.length() > 1.0) {
            const AnyNoise landing = leap.landing(process, sensors, noise);
            const double there = value_or_nan(landing);
            if (there > value) {
                ++out.leaps;
                noise = path[0] = landing;
                value = there;
                out.log_likelihood.push_back(value);
            } else {
                expectation.log_likelihood(noise);  // its moments come next
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
