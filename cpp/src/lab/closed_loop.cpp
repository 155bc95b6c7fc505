#include "sysid/lab/closed_loop.hpp"

namespace sysid::lab {

LoopRecord run_closed_loop(const LoopData& data, const Plant& plant,
                           const LoopObserverData& observer, const std::vector<Wanted>& wanted,
                           const double* normal, const double* external) {
    ClosedLoop<LoopObserver> loop(data, plant, LoopObserver(observer, data.car, data.dt));
    return loop.run(wanted, normal, external);
}

}  // namespace sysid::lab
