#include <cmath>
#include <stdexcept>

#include "sysid/math/errors.hpp"
#include "sysid/math/interrupt.hpp"
#include "sysid/twin/observer.hpp"

namespace sysid {

namespace {

/// Takes all twins to where they would be, had the parameters always been the new ones.
void follow(const Eigen::VectorXd& moved, std::vector<State14>& states) {
    State14 change{};
    for (std::size_t j = 1; j < states.size(); ++j) {
        const double part = moved[static_cast<Eigen::Index>(j - 1)];
        if (part == 0.0) continue;
        for (std::size_t i = 0; i < change.size(); ++i)
            change[i] += part * (states[j][i] - states[0][i]);
    }
    for (State14& x : states)
        for (std::size_t i = 0; i < change.size(); ++i) x[i] += change[i];
}

}  // namespace

Observation observe14(const Vehicle14& twin, const State14& start, const Input14* inputs,
                      const double* measured, std::size_t n, double dt, ObserverSettings settings) {
    if (settings.stride == 0) throw std::invalid_argument("stride = 0: give one or more");
    const std::size_t count = settings.batch ? settings.batch->twins() : 1;
    std::vector<Vehicle14> twins(count, twin);
    std::vector<State14> states(count, start);
    std::vector<Output14> readings(count);
    LoadVector estimate = to_vector(twin.load());
    Observation seen;
    for (std::size_t k = 0; k < n; ++k) {
        poll_interrupt(k);
        const double* car = measured + k * kReadings;
        const Steered steered(inputs[k]);
        for (std::size_t t = 0; t < count; ++t) {
            readings[t] = twins[t].output(states[t], inputs[k], steered);
            for (const StateGain& g : settings.gains) {
                const double innovation = car[g.channel] - readings[t][g.channel];
                if (!std::isnan(innovation))
                    states[t][g.state] += g.gain * (g.per_sample ? 1.0 : dt) * innovation;
            }
        }
        // Written so that a state that is not a number counts as lost.
        if (!(std::abs(states[0][state14::Roll]) < 1.5))
            throw NumericalFailure("the twin overturned or left the range of numbers", k);
        if (k % settings.stride == 0) {
            seen.loads.insert(seen.loads.end(), estimate.begin(), estimate.end());
            seen.readings.insert(seen.readings.end(), readings[0].begin(), readings[0].end());
            seen.stages.push_back(settings.laws ? settings.laws->stage() : 0);
        }
        if (settings.laws) settings.laws->update(car, readings[0].data(), estimate);
        if (settings.batch)
            follow(settings.batch->update(car, readings[0].data(), kTwinOutputs, estimate), states);
        for (std::size_t t = 0; t < count; ++t) {
            if (settings.laws || settings.batch)
                twins[t].set_load(
                    to_load(settings.batch ? settings.batch->of_twin(t, estimate) : estimate));
            twins[t].step(states[t], inputs[k], steered, dt);
        }
    }
    if (settings.batch) {
        const auto& P = settings.batch->covariance();
        for (Eigen::Index i = 0; i < P.rows(); ++i) seen.spread.push_back(std::sqrt(P(i, i)));
    }
    return seen;
}

}  // namespace sysid
