// The flat parameter vector: eight tyre coefficients, the yaw inertia, then every effect's own,
// those of users' effects last.
#pragma once

#include <array>
#include <cstddef>

#include "sysid/effects/user_effect.hpp"

namespace sysid {

enum BaseParameter : std::size_t {
    kBFront,
    kCFront,
    kDFront,
    kEFront,
    kBRear,
    kCRear,
    kDRear,
    kERear,
    kYawInertia,
    kBaseParameterCount,
};

constexpr std::size_t kParameterCount = kBaseParameterCount + user_offset(kUserEffects);

/// Of the base parameters; `typical` is where a search may start.
constexpr std::array<ParameterInfo, kBaseParameterCount> kBaseParameterInfos{
    {
        {"B_front", "1/rad", 0.0, 10.0, 0.5, {1.0, 40.0}, {6.0, 18.0}},
        {"C_front", "1", 0.0, 1.4, 0.1, {0.5, 3.0}, {1.1, 1.7}},
        {"D_front", "1", 0.0, 1.0, 0.05, {0.1, 4.0}, {0.8, 1.6}},
        {"E_front", "1", 0.0, 0.0, 0.2, {-6.0, 1.0}, {-2.0, 0.8}},
        {"B_rear", "1/rad", 0.0, 10.0, 0.5, {1.0, 40.0}, {6.0, 18.0}},
        {"C_rear", "1", 0.0, 1.4, 0.1, {0.5, 3.0}, {1.1, 1.7}},
        {"D_rear", "1", 0.0, 1.0, 0.05, {0.1, 4.0}, {0.8, 1.6}},
        {"E_rear", "1", 0.0, 0.0, 0.2, {-6.0, 1.0}, {-2.0, 0.8}},
        {"yaw_inertia_kgm2", "kg m2", 0.0, 1500.0, 50.0, {0.001, 1.0e6}, {800.0, 4000.0}},
    },
};

}  // namespace sysid
