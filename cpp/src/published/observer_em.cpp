#include "sysid/published/observer_em.hpp"

#include <type_traits>

namespace sysid::lab {

namespace {

class PublishedExpectation {
  public:
    explicit PublishedExpectation(const std::vector<ObserverLog>& logs)
        : logs_(logs), steps_(logs.size()) {}

    double log_likelihood(const ObserverNoisePair& noise) {
        noise_ = {noise.process, noise.sensors};
        double sum = 0.0;
        for (std::size_t i = 0; i < logs_.size(); ++i) {
            const ObserverLog& log = logs_[i];
            auto& steps = steps_[i];
            steps.resize(log.size());
            const ObserverSystem system(log.model, log.inputs, log.readings, noise_);
            ObserverMat before;
            const auto pass = [&](const auto& form) {
                return extended_kalman_filter<kObserverStates, kObserverMeasurements,
                                              std::decay_t<decltype(form)>>(
                    system, log.start.mean, log.start.covariance,
                    [&](std::size_t k, const auto& step) {
                        steps[k] = step;
                        if (k > 0) steps[k].transition = before;
                        before = step.transition;
                    },
                    log.start.one_before);
            };
            sum += noise.sensors.isDiagonal(0.0)
                       ? pass(SequentialUpdate<kObserverStates, kObserverMeasurements>())
                       : pass(Update<kObserverStates, kObserverMeasurements>());
        }
        return sum;
    }

    NoiseMoments<kObserverStates, kObserverMeasurements> moments() const {
        constexpr double kRidge = 1e-9;
        NoiseMoments<kObserverStates, kObserverMeasurements> out;
        for (std::size_t i = 0; i < logs_.size(); ++i) {
            const ObserverLog& log = logs_[i];
            ObserverForm form = log.model.form();
            form.input_before = form.speed_predicted = true;
            const ObserverModel model = log.model.with_form(form);
            add_smoothed_moments<kObserverStates, kObserverMeasurements>(
                ObserverSystem(model, log.inputs, log.readings, noise_),
                smooth<SmoothedSum::kDifference>(steps_[i], kRidge), out);
        }
        return out;
    }

  private:
    const std::vector<ObserverLog>& logs_;
    std::vector<std::vector<StateStep<kObserverStates>>>
        steps_;  // with the transition of the step before
    ObserverNoise noise_;
};

}  // namespace

ObserverEm learn_as_published(const std::vector<ObserverLog>& logs, const ObserverNoise& start,
                              const NoiseStructure<kObserverStates>& process,
                              const NoiseStructure<kObserverMeasurements>& sensors,
                              const EmOptions& options) {
    PublishedExpectation expectation(logs);
    return learn_noise<kObserverStates, kObserverMeasurements>(
        expectation, {start.process, start.sensors}, process, sensors, options);
}

}  // namespace sysid::lab
