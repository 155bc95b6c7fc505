#include "sysid/identify/run_system.hpp"

namespace sysid {

template <int NX>
double filter_run(const RunSystem<NX>& system, const KeepStep<NX>& keep) {
    return extended_kalman_filter<NX, kChannels>(system, system.initial_mean(),
                                                 system.initial_covariance(), keep);
}

template double filter_run(const RunSystem<kStatesPlain>&, const KeepStep<kStatesPlain>&);
template double filter_run(const RunSystem<kStatesFew>&, const KeepStep<kStatesFew>&);
template double filter_run(const RunSystem<kStatesSome>&, const KeepStep<kStatesSome>&);
template double filter_run(const RunSystem<kStatesMost>&, const KeepStep<kStatesMost>&);

}  // namespace sysid
