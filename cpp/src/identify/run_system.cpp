#include "sysid/identify/run_system.hpp"

namespace sysid {

template <int NX>
double filter_run(const RunSystem<NX>& system, const KeepStep<NX>& keep) {
    try {
        return extended_kalman_filter<NX, kChannels>(system, system.initial_mean(),
                                                     system.initial_covariance(), keep);
    } catch (const NumericalFailure& failure) {
        const Run& run = system.run();
        if (run.name.empty()) throw;
        const double time_s = run.inputs[failure.sample].time_s;
        throw NumericalFailure(failure, run.name, time_s,
                               static_cast<std::size_t>(std::llround(time_s / run.dt)));
    }
}

template double filter_run(const RunSystem<kMotionStates>&, const KeepStep<kMotionStates>&);
template double filter_run(const RunSystem<kStatesPlain>&, const KeepStep<kStatesPlain>&);
template double filter_run(const RunSystem<kStatesFew>&, const KeepStep<kStatesFew>&);
template double filter_run(const RunSystem<kStatesSome>&, const KeepStep<kStatesSome>&);
template double filter_run(const RunSystem<kStatesSeveral>&, const KeepStep<kStatesSeveral>&);
template double filter_run(const RunSystem<kStatesMost>&, const KeepStep<kStatesMost>&);

}  // namespace sysid
