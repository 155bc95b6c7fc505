#include "sysid/twin/observer.hpp"

#include <cmath>
#include <stdexcept>
#include <string>

#include "sysid/math/errors.hpp"
#include "sysid/math/interrupt.hpp"

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

void check(const TwinObserverSettings& settings, double dt) {
    const auto within = [](std::size_t place, std::size_t size, const char* what) {
        if (place >= size)
            throw std::invalid_argument(std::string(what) + " " + std::to_string(place) +
                                        " is not one of " + std::to_string(size));
    };
    if (settings.stride == 0) throw std::invalid_argument("stride = 0: give one or more");
    const bool usable = dt > 0.0 && std::isfinite(dt);
    if (!usable) throw std::invalid_argument("the step must be positive and finite");
    for (const StateGain& g : settings.gains) {
        within(g.channel, kReadings, "gains: reading");
        within(g.state, kTwinStatesWithTyres, "gains: state");
    }
    if (settings.laws) within(settings.laws->readings() - 1, kReadings, "laws: reading");
    if (settings.batch) within(settings.batch->readings(), kReadings + 1, "batch: reading");
    const std::size_t twins = settings.batch ? settings.batch->twins() : 1;
    for (const StartStep& s : settings.starts) {
        within(s.twin, twins, "starts: twin");
        within(s.state, kTwinStatesWithTyres, "starts: state");
    }
    for (const std::size_t place : settings.scaled) {
        within(place, kTwinInputs, "scaled: input");
        if (place < 2) throw std::invalid_argument("scaled: the steering has no scale");
    }
}

void check(const Input14* inputs, std::size_t n) {
    const auto* row = reinterpret_cast<const double*>(inputs);
    for (std::size_t i = 0; i < n * kTwinInputs; ++i)
        if (!std::isfinite(row[i]))
            throw std::invalid_argument("inputs: column " + std::to_string(i % kTwinInputs) +
                                        " is no number at sample " +
                                        std::to_string(i / kTwinInputs));
}

void take(Vehicle14& twin, const Estimates& estimate, std::size_t sample) {
    try {
        twin.set_load(to_load(estimate));
    } catch (const std::invalid_argument& error) {
        throw NumericalFailure(error.what(), sample);
    }
}

/// The inputs as a twin with this scale gets them.
Input14 scaled(const Input14& u, const std::vector<std::size_t>& places, double scale) {
    Input14 out = u;
    auto* row = reinterpret_cast<double*>(&out);
    for (const std::size_t place : places) row[place] *= scale;
    return out;
}

}  // namespace

Observation observe14(const Vehicle14& twin, const State14& start, const Input14* inputs,
                      const double* measured, std::size_t n, double dt,
                      TwinObserverSettings settings) {
    check(settings, dt);
    check(inputs, n);
    const std::size_t count = settings.batch ? settings.batch->twins() : 1;
    std::vector<Vehicle14> twins(count, twin);
    std::vector<State14> states(count, start);
    std::vector<Output14> readings(count);
    std::vector<Input14> told(count);
    Estimates estimate = to_estimates(twin.load());
    std::vector<double> scales(count, 1.0);
    const auto put = [&](std::size_t t, std::size_t sample) {
        const Estimates own = settings.batch ? settings.batch->of_twin(t, estimate) : estimate;
        take(twins[t], own, sample);
        scales[t] = own[kInputScale];
    };
    if (settings.batch)
        for (std::size_t t = 0; t < count; ++t) put(t, 0);
    for (const StartStep& s : settings.starts) states[s.twin][s.state] += s.step;
    Observation seen;
    for (std::size_t k = 0; k < n; ++k) {
        poll_interrupt(k);
        const double* car = measured + k * kReadings;
        const Steered steered(inputs[k]);
        for (std::size_t t = 0; t < count; ++t) {
            if (!settings.scaled.empty()) told[t] = scaled(inputs[k], settings.scaled, scales[t]);
            const Input14& u = settings.scaled.empty() ? inputs[k] : told[t];
            readings[t] = twins[t].output(states[t], u, steered);
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
            if (settings.laws || settings.batch) put(t, k);
            twins[t].step(states[t], settings.scaled.empty() ? inputs[k] : told[t], steered, dt);
        }
    }
    if (settings.batch) {
        const Eigen::VectorXd spread = settings.batch->spread();
        seen.spread.assign(spread.data(), spread.data() + spread.size());
    }
    return seen;
}

}  // namespace sysid
