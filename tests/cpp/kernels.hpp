// Tests that run with the kernels of each set of instructions.
#pragma once

#include <gtest/gtest.h>

#include <string>

#include "sysid/math/lanes.hpp"

namespace sysid::test {

/// Puts the kernels back that a test has exchanged.
class OfEachProcessor : public testing::TestWithParam<const LaneKernels*> {
  protected:
    void SetUp() override { use_lane_kernels(*GetParam()); }
    void TearDown() override { use_lane_kernels(*all_lane_kernels().back()); }
};

inline std::string kernels_name(const testing::TestParamInfo<const LaneKernels*>& of) {
    std::string name = of.param->name;
    std::erase(name, '-');
    return name;
}

}  // namespace sysid::test
