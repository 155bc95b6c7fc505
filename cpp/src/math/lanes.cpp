#include "sysid/math/lanes.hpp"

#include <atomic>

namespace sysid {

extern const LaneKernels kPlainLanes;
extern const LaneKernels kAvx2Lanes;
extern const LaneKernels kAvx512Lanes;

std::vector<const LaneKernels*> all_lane_kernels() {
    std::vector<const LaneKernels*> found{&kPlainLanes};
#ifdef SYSID_AVX2
    if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma"))
        found.push_back(&kAvx2Lanes);
#endif
#ifdef SYSID_AVX512
    if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq"))
        found.push_back(&kAvx512Lanes);
#endif
    return found;
}

namespace {

std::atomic<const LaneKernels*>& chosen() {
    static std::atomic<const LaneKernels*> kernels{all_lane_kernels().back()};
    return kernels;
}

}  // namespace

const LaneKernels& lane_kernels() { return *chosen().load(std::memory_order_relaxed); }

void use_lane_kernels(const LaneKernels& kernels) { chosen().store(&kernels); }

}  // namespace sysid
