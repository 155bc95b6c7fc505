// The score of the noise that fitting, comparing, diagnosing and validating share; its recursion
// stands in `estimate/noise_score.hpp`.
#include "sysid/estimate/noise_score.hpp"

#include "sysid/identify/prediction_error.hpp"
#include "sysid/identify/run_system.hpp"

namespace sysid {

namespace {

constexpr int deviation_lane(std::size_t i) {
    const int before = i < kMotionStates ? kMotionStates : 2 * kMotionStates;
    return kChannels + before + static_cast<int>(i);
}
constexpr int time_lane(std::size_t i) {
    return i < kMotionStates ? kChannels + 2 * kMotionStates + static_cast<int>(i)
                             : kNoiseParameters - 1;
}

/// Of `L` noise parameters: those of the road only where there is one.
template <int L, int NX>
NoiseScore<kChannels, L> score_of(const RunSystem<NX>& system, const Run& run, const Noise& noise) {
    Vec<kChannels> sensor;
    for (int i = 0; i < kChannels; ++i) {
        const double s = noise.sensor[static_cast<std::size_t>(i)];
        sensor[i] = 2.0 * s * s;
    }
    NoiseScore<kChannels, L> score(system.taking_part(), sensor);
    for (int i = 0; i < kMotionStates; ++i) {
        const double s = noise.motion[static_cast<std::size_t>(i)];
        score.white(i, kChannels + i, 2.0 * s * s * run.dt);
    }
    for (std::size_t i = 0; i < system.disturbances(); ++i) {
        const double s = noise.deviation_of(i);
        score.correlated(system.disturbing(i), deviation_lane(i), time_lane(i), s * s,
                         system.forget(i), run.dt / noise.time_of(i));
    }
    return score;
}

template <int L>
double score_all(const Problem& problem, const double* p, const Noise& noise, double* gradient,
                 double* information) {
    Eigen::Array<double, L, 1> score = Eigen::Array<double, L, 1>::Zero();
    Mat<L, L> info = Mat<L, L>::Zero();
    double log_likelihood = 0.0;
    with_state_size(problem.model.effects, noise, [&](auto nx) {
        constexpr int NX = decltype(nx)::value;
        for (const Run& run : problem.runs) {
            const RunSystem<NX> system(problem.model, run, p, noise);
            const int n = system.taking_part();
            auto answer = score_of<L>(system, run, noise);
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
