// Score and expected information of the noise parameters along a linearised filter. Shumway &
// Stoffer, Time Series Analysis and Its Applications (4th ed.), sec. 6.3; the information is its
// eq. (6.70).
#include "sysid/identify/prediction_error.hpp"
#include "sysid/identify/run_system.hpp"

namespace sysid {

namespace {

/// Derivative of the filter's mean and covariance in the direction of one log noise parameter.
template <int NX>
struct Direction {
    Vec<NX> mean = Vec<NX>::Zero();
    Mat<NX, NX> covariance = Mat<NX, NX>::Zero();
    Mat<NX, NX> process = Mat<NX, NX>::Zero();
    Mat<kChannels, kChannels> sensor = Mat<kChannels, kChannels>::Zero();
    double forget = 0.0;  // derivative of exp(-dt/tau)
};

/// d/d(log parameter) of the noise covariances.
template <int NX>
std::array<Direction<NX>, kNoiseParameters> directions(const Run& run, const Noise& noise) {
    std::array<Direction<NX>, kNoiseParameters> all;
    for (int i = 0; i < kChannels; ++i) {
        const auto n = static_cast<std::size_t>(i);
        all[n].sensor(i, i) = 2.0 * noise.sensor[n] * noise.sensor[n];
    }
    const double forget = std::exp(-run.dt / noise.correlation_time_s);
    // d exp(-dt/tau) / d log(tau)
    const double slope = forget * run.dt / noise.correlation_time_s;
    auto& time = all[kNoiseParameters - 1];
    time.forget = slope;
    for (int i = 0; i < kMotionStates; ++i) {
        const auto n = static_cast<std::size_t>(i);
        const int w = kMotionStates + i;
        const double variance = noise.wander[n] * noise.wander[n];
        all[kChannels + n].process(i, i) = 2.0 * noise.motion[n] * noise.motion[n] * run.dt;
        auto& wander = all[kChannels + kMotionStates + n];
        wander.process(w, w) = 2.0 * variance * (1.0 - forget * forget);
        wander.covariance(w, w) = 2.0 * variance;  // of the stationary start
        time.process(w, w) = -2.0 * variance * forget * slope;
    }
    return all;
}

template <int NX>
double score_run(const Problem& problem, const Run& run, const double* p, const Noise& noise,
                 Eigen::Ref<Eigen::VectorXd> gradient, Eigen::Ref<Eigen::MatrixXd> information) {
    const RunSystem<NX> system(problem.model, run, p, noise);
    auto all = directions<NX>(run, noise);
    Vec<NX> mean = system.initial_mean();
    Mat<NX, NX> covariance = system.initial_covariance();
    using Square = Mat<kChannels, kChannels>;
    std::array<Square, kNoiseParameters> dS;
    std::array<Vec<kChannels>, kNoiseParameters> de;
    return filter_run<NX>(system, [&](std::size_t k, const FilterStep<NX, kChannels>& s) {
        const auto lower = s.update.lower.template triangularView<Eigen::Lower>();
        const Mat<kChannels, NX>& H = s.update.observation;
        const Mat<NX, NX> keep = Mat<NX, NX>::Identity() - s.update.gain * H;
        const Vec<kChannels> white = lower.solve(s.update.innovation);
        const Vec<kChannels> weighed = lower.transpose().solve(white);
        Square inverse = lower.solve(Square::Identity());  // L^-1
        Square present = Square::Identity();
        for (int i = 0; i < kChannels; ++i)
            if (std::isnan(run.measurements[k][i])) present(i, i) = 0.0;
        for (int j = 0; j < kNoiseParameters; ++j) {
            const auto n = static_cast<std::size_t>(j);
            Direction<NX>& d = all[n];
            if (k > 0) {
                Vec<NX> moved = s.transition * d.mean;
                Mat<NX, NX> spread = s.transition * d.covariance * s.transition.transpose();
                if (d.forget != 0.0) {
                    // The transition's own diagonal for the wandering states depends on tau.
                    Mat<NX, NX> turn = Mat<NX, NX>::Zero();
                    for (int i = kMotionStates; i < kStatesPlain; ++i) turn(i, i) = d.forget;
                    moved += turn * mean;
                    const Mat<NX, NX> half = turn * covariance * s.transition.transpose();
                    spread += half + half.transpose();
                }
                d.mean = moved;
                d.covariance = spread + d.process;
            }
            const Mat<NX, kChannels> cross = d.covariance * H.transpose();
            const Square change = H * cross + present * d.sensor * present;
            const Vec<kChannels> shift = -H * d.mean;
            dS[n] = inverse * change * inverse.transpose();
            de[n] = lower.solve(shift);
            gradient[j] += 0.5 * (white.dot(dS[n] * white) - dS[n].trace()) - white.dot(de[n]);
            // P+ = (I - K H) P-:  dP+ = (I-KH) dP- (I-KH)^T + K dR K^T
            const Mat<NX, kChannels> gain_change =
                keep * cross - s.update.gain * present * d.sensor;
            d.mean = keep * d.mean + gain_change * weighed;
            d.covariance = keep * d.covariance * keep.transpose() +
                           s.update.gain * present * d.sensor * s.update.gain.transpose();
        }
        for (int i = 0; i < kNoiseParameters; ++i) {
            for (int j = 0; j <= i; ++j) {
                const auto a = static_cast<std::size_t>(i);
                const auto b = static_cast<std::size_t>(j);
                const double info =
                    0.5 * dS[a].cwiseProduct(dS[b].transpose()).sum() + de[a].dot(de[b]);
                information(i, j) += info;
                if (i != j) information(j, i) += info;
            }
        }
        mean = s.mean;
        covariance = s.covariance;
    });
}

}  // namespace

double noise_score(const Problem& problem, const double* p, const Noise& noise, double* gradient,
                   double* information) {
    Eigen::VectorXd g = Eigen::VectorXd::Zero(kNoiseParameters);
    Eigen::MatrixXd info = Eigen::MatrixXd::Zero(kNoiseParameters, kNoiseParameters);
    double log_likelihood = 0.0;
    with_state_size(problem.model.effects, [&](auto nx) {
        for (const Run& run : problem.runs)
            log_likelihood += score_run<decltype(nx)::value>(problem, run, p, noise, g, info);
    });
    Eigen::Map<Eigen::VectorXd>(gradient, kNoiseParameters) = g;
    Eigen::Map<Eigen::MatrixXd>(information, kNoiseParameters, kNoiseParameters) = info;
    return log_likelihood;
}

}  // namespace sysid
