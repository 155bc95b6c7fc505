#include "sysid/lab/lab_em.hpp"

#include <cmath>
#include <type_traits>

namespace sysid::lab {

namespace {

constexpr int NX = kObserverStates;
constexpr int NY = kObserverMeasurements;
using Step = FilterStep<NX, NY>;

template <class Derived>
void append(std::vector<double>& to, const Eigen::MatrixBase<Derived>& values) {
    for (const double v : values.reshaped()) to.push_back(v);
}

void add_sample(const ObserverLog& log, std::size_t k, const ObserverVec& mean,
                const ObserverMat& covariance, ObserverTrace& out) {
    append(out.state, mean);
    append(out.covariance, covariance);
    ObserverRow H;
    append(out.reading, log.model.observe(mean[0], mean, log.inputs[k], H));
    append(out.reading_std, (H * covariance * H.transpose()).diagonal().cwiseMax(0.0).cwiseSqrt());
}

void add_innovation(const ObserverReading& y, const Step& step, ObserverTrace& out) {
    ObserverReading innovation = step.update.innovation;
    ObserverReading spread = step.update.lower.rowwise().norm();
    for (int i = 0; i < NY; ++i)
        if (std::isnan(y[i])) innovation[i] = spread[i] = y[i];
    append(out.innovation, innovation);
    append(out.innovation_std, spread);
}

}  // namespace

double log_likelihood(const ObserverLog& log, const ObserverNoise& noise) {
    const ObserverSystem system(log.model, log.inputs, log.readings, noise);
    const auto pass = [&](const auto& form) {
        return extended_kalman_filter<NX, NY, std::decay_t<decltype(form)>>(
            system, log.start.mean, log.start.covariance, [](std::size_t, const auto&) {},
            log.start.one_before);
    };
    return noise.sensors.isDiagonal(0.0) ? pass(SequentialUpdate<NX, NY>())
                                         : pass(Update<NX, NY>());
}

ObserverTrace trace(const ObserverLog& log, const ObserverNoise& noise, bool smoothed) {
    const ObserverSystem system(log.model, log.inputs, log.readings, noise);
    ObserverTrace out;
    std::vector<Step> steps;
    if (smoothed) steps.reserve(log.size());
    out.log_likelihood = extended_kalman_filter<NX, NY>(
        system, log.start.mean, log.start.covariance,
        [&](std::size_t k, const Step& step) {
            add_innovation(log.readings[k], step, out);
            if (smoothed)
                steps.push_back(step);
            else
                add_sample(log, k, step.mean, step.covariance, out);
        },
        log.start.one_before);
    const auto states = smooth(steps);
    for (std::size_t k = 0; k < states.size(); ++k)
        add_sample(log, k, states[k].mean, states[k].covariance, out);
    return out;
}

ObserverEm learn(const std::vector<ObserverLog>& logs, const ObserverNoise& start,
                 const NoiseStructure<NX>& process, const NoiseStructure<NY>& sensors,
                 const EmOptions& options) {
    const ObserverNoisePair noise{start.process, start.sensors};
    std::vector<ObserverSystem> systems;
    std::vector<EmRecord<ObserverSystem, NX>> records;
    systems.reserve(logs.size());
    for (const ObserverLog& log : logs) {
        systems.emplace_back(log.model, log.inputs, log.readings, start);
        records.push_back(
            {&systems.back(), log.start.mean, log.start.covariance, log.start.one_before});
    }
    const auto learn_by = [&](const auto& form) {
        FilteredExpectation<NX, NY, ObserverSystem, std::decay_t<decltype(form)>> expectation(
            records);
        return learn_noise<NX, NY>(expectation, noise, process, sensors, options);
    };
    return sensors.uncorrelated() ? learn_by(SequentialUpdate<NX, NY>())
                                  : learn_by(Update<NX, NY>());
}

}  // namespace sysid::lab
