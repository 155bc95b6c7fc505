// Every effect the software knows. A new one is added here, and nowhere else.
#pragma once

#include <array>
#include <cstdint>
#include <tuple>
#include <utility>

#include "sysid/effects/accelerometer_bias.hpp"
#include "sysid/effects/accelerometer_scale.hpp"
#include "sysid/effects/aero_downforce.hpp"
#include "sysid/effects/aero_drag.hpp"
#include "sysid/effects/cg_position.hpp"
#include "sysid/effects/combined_slip.hpp"
#include "sysid/effects/drive_yaw_moment.hpp"
#include "sysid/effects/gyro_bias.hpp"
#include "sysid/effects/imu_lever_arm.hpp"
#include "sysid/effects/lateral_load_transfer.hpp"
#include "sysid/effects/mass.hpp"
#include "sysid/effects/road_bank.hpp"
#include "sysid/effects/road_grade.hpp"
#include "sysid/effects/rolling_resistance.hpp"
#include "sysid/effects/side_wind.hpp"
#include "sysid/effects/steer_compliance.hpp"
#include "sysid/effects/steer_lag.hpp"
#include "sysid/effects/steer_offset.hpp"
#include "sysid/effects/steer_ratio.hpp"
#include "sysid/effects/tyre_load_sensitivity.hpp"
#include "sysid/effects/tyre_relaxation.hpp"
#include "sysid/effects/yaw_inertia.hpp"

namespace sysid {

/// The order matters within a stage: the offset and ratio of the logged angle come before its lag.
using Catalogue =
    std::tuple<AeroDownforce, AeroDrag, RollingResistance, TyreLoadSensitivity, LateralLoadTransfer,
               CombinedSlip, TyreRelaxation, SteerOffset, SteerRatio, SteerLag, SteerCompliance,
               RoadBank, RoadGrade, SideWind, Mass, YawInertia, CgPosition, DriveYawMoment,
               ImuLeverArm, AccelerometerBias, GyroBias, AccelerometerScale>;

constexpr std::size_t kEffectCount = std::tuple_size_v<Catalogue>;

/// Which effects act: bit i stands for the i-th of the catalogue.
using EffectMask = std::uint64_t;
static_assert(kEffectCount <= 64);

namespace detail {

template <std::size_t... I>
constexpr std::array<EffectInfo, kEffectCount> collect_infos(std::index_sequence<I...> /*unused*/) {
    return {std::tuple_element_t<I, Catalogue>::info...};
}

}  // namespace detail

constexpr std::array<EffectInfo, kEffectCount> kEffectInfos =
    detail::collect_infos(std::make_index_sequence<kEffectCount>{});

/// Where the parameters of effect `index` begin in the concatenation of all effects' parameters.
constexpr std::size_t effect_offset(std::size_t index) {
    std::size_t offset = 0;
    for (std::size_t i = 0; i < index; ++i) offset += kEffectInfos[i].parameter_count;
    return offset;
}
constexpr std::size_t kEffectParameterCount = effect_offset(kEffectCount);

namespace detail {

template <class T, class Visit, std::size_t... I>
void visit_active(EffectMask mask, const T* p, Visit&& visit,
                  std::index_sequence<I...> /*unused*/) {
    (((mask >> I) & 1U ? visit(std::tuple_element_t<I, Catalogue>{}, p + effect_offset(I))
                       : void()),
     ...);
}

template <class T, class Visit, std::size_t... I>
void visit_backwards(EffectMask mask, const T* p, Visit&& visit,
                     std::index_sequence<I...> /*unused*/) {
    (visit_active(mask, p, visit, std::index_sequence<kEffectCount - 1 - I>{}), ...);
}

}  // namespace detail

/// Calls `visit(effect, its parameters)` for every effect of `mask`, in catalogue order.
template <class T, class Visit>
void for_each_active(EffectMask mask, const T* effect_parameters, Visit&& visit) {
    if (mask == 0) return;
    detail::visit_active(mask, effect_parameters, visit, std::make_index_sequence<kEffectCount>{});
}

/// The same, last of the catalogue first.
template <class T, class Visit>
void for_each_active_backwards(EffectMask mask, const T* effect_parameters, Visit&& visit) {
    if (mask == 0) return;
    detail::visit_backwards(mask, effect_parameters, visit,
                            std::make_index_sequence<kEffectCount>{});
}

}  // namespace sysid
