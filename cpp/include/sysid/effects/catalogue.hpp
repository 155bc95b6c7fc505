// Every effect the software knows. A new one is written in the file of its station of the car and
// entered in the list here, and nowhere else.
#pragma once

#include <array>
#include <cstdint>
#include <tuple>
#include <type_traits>
#include <utility>

#include "sysid/effects/aero.hpp"
#include "sysid/effects/driveline.hpp"
#include "sysid/effects/mass.hpp"
#include "sysid/effects/road.hpp"
#include "sysid/effects/sensors.hpp"
#include "sysid/effects/steering.hpp"
#include "sysid/effects/suspension.hpp"
#include "sysid/effects/tyre.hpp"

namespace sysid {

/// The order matters within a stage: what the grip is comes before what the friction ellipse leaves
/// of it, errors of the logged angle before its lag, where sensors are before how they
/// are turned, the lean of an accelerometer before its own errors.
using Catalogue = std::tuple<
    AeroDownforce, AeroDrag, RollingResistance, HeadWind, TyreLoadSensitivity, LateralLoadTransfer,
    LongitudinalLoadTransfer, FrictionChange, TyreTemperature, ForceGain, ForceLag, WheelInertia,
    ForceSplit, CombinedSlip, AligningMoment, RearToe, TyreRelaxation, FrontTyreRelaxation,
    RearTyreRelaxation, SteerDelay, SteerOffset, SteerRatio, SteerNonlinearity, SteerLag,
    SteerCompliance, RoadBank, RoadGrade, SideWind, Mass, YawInertia, LockedDifferential,
    LimitedSlipDifferential, DriveYawMoment, SensorDelay, CgPosition, SpeedSensorLeverArm,
    SpeedSensorMisalignment, ImuLeverArm, InsLeverArm, BodyAttitude, BodyRoll, FrontRollSteer,
    RearRollSteer, AccelerometerBias, GyroScale, GyroBias, AccelerometerScale>;

constexpr std::size_t kEffectCount = std::tuple_size_v<Catalogue>;

/// Which effects act: bit i stands for the i-th of the catalogue.
using EffectMask = std::uint64_t;
static_assert(kEffectCount + kUserStates <= 64);

/// Bit of a mask that says that a state of users' effects takes part.
constexpr EffectMask user_state_bit(std::size_t i) { return EffectMask{1} << (kEffectCount + i); }

namespace detail {

template <std::size_t... I>
constexpr std::array<EffectInfo, kEffectCount> collect_infos(std::index_sequence<I...> /*unused*/) {
    return {std::tuple_element_t<I, Catalogue>::info...};
}

}  // namespace detail

constexpr std::array<EffectInfo, kEffectCount> kEffectInfos =
    detail::collect_infos(std::make_index_sequence<kEffectCount>{});

namespace detail {

template <class E, std::size_t... I>
constexpr std::size_t place_of(std::index_sequence<I...> /*unused*/) {
    return ((std::is_same_v<E, std::tuple_element_t<I, Catalogue>> ? I : 0) + ...);
}

}  // namespace detail

/// Where an effect stands in the catalogue.
template <class E>
constexpr std::size_t effect_place() {
    return detail::place_of<E>(std::make_index_sequence<kEffectCount>{});
}

/// Where the parameters of effect `index` begin in the concatenation of all effects' parameters.
constexpr std::size_t effect_offset(std::size_t index) {
    std::size_t offset = 0;
    for (std::size_t i = 0; i < index; ++i) offset += kEffectInfos[i].parameter_count();
    return offset;
}
constexpr std::size_t kEffectParameterCount = effect_offset(kEffectCount);

namespace detail {

template <std::size_t... I>
constexpr std::array<std::size_t, kEffectCount> collect_state_counts(
    std::index_sequence<I...> /*unused*/) {
    return {std::tuple_element_t<I, Catalogue>::info.state_count()...};
}
constexpr auto kEffectStateCounts = collect_state_counts(std::make_index_sequence<kEffectCount>{});

template <std::size_t... I>
constexpr std::array<double, kEffectCount> collect_state_spreads(
    std::index_sequence<I...> /*unused*/) {
    return {std::tuple_element_t<I, Catalogue>::state_spread...};
}
constexpr auto kEffectStateSpreads =
    collect_state_spreads(std::make_index_sequence<kEffectCount>{});

template <std::size_t... I>
constexpr EffectMask mask_reading_yaw_acceleration(std::index_sequence<I...> /*unused*/) {
    return ((std::tuple_element_t<I, Catalogue>::reads_yaw_acceleration ? EffectMask{1} << I : 0) |
            ...);
}

template <class E>
constexpr bool changes_axle_forces() {
    using Parameters = const double*;
    using Car = Workings<double>&;
    using Loads = decltype(E::loads(std::declval<Parameters>(), std::declval<Car>()));
    using Grip = decltype(E::grip(std::declval<Parameters>(), std::declval<Car>(),
                                  std::declval<const double*>()));
    return !std::is_same_v<Loads, Inactive> || !std::is_same_v<Grip, Inactive>;
}

template <std::size_t... I>
constexpr EffectMask mask_changing_axle_forces(std::index_sequence<I...> /*unused*/) {
    return ((changes_axle_forces<std::tuple_element_t<I, Catalogue>>() ? EffectMask{1} << I : 0) |
            ...);
}

}  // namespace detail

/// Where the states of effect `index` begin among those of the whole catalogue.
constexpr std::size_t effect_state_offset(std::size_t index) {
    std::size_t offset = 0;
    for (std::size_t i = 0; i < index; ++i) offset += detail::kEffectStateCounts[i];
    return offset;
}
constexpr std::size_t kCatalogueStates = effect_state_offset(kEffectCount);
/// Those of users' effects stand behind.
constexpr int kAuxiliaryStates = static_cast<int>(kCatalogueStates + kUserStates);

/// Standard deviations of all those states when a run begins; users' begin where they say.
constexpr std::array<double, kAuxiliaryStates> effect_state_spreads() {
    std::array<double, kAuxiliaryStates> spreads{};
    std::size_t at = 0;
    for (std::size_t i = 0; i < kEffectCount; ++i)
        for (std::size_t n = 0; n < detail::kEffectStateCounts[i]; ++n)
            spreads[at++] = detail::kEffectStateSpreads[i];
    return spreads;
}
constexpr EffectMask kReadYawAcceleration =
    detail::mask_reading_yaw_acceleration(std::make_index_sequence<kEffectCount>{});
/// Those at whose stage `loads` or `grip` the lateral forces of the axles change.
constexpr EffectMask kChangeAxleForces =
    detail::mask_changing_axle_forces(std::make_index_sequence<kEffectCount>{});

namespace detail {

// An effect for which `visit` returns `Inactive` does not act there, and leaves no code behind.
template <std::size_t I, class T, class Visit>
void visit_one(EffectMask mask, const T* p, Visit& visit) {
    using E = std::tuple_element_t<I, Catalogue>;
    if constexpr (!std::is_same_v<decltype(visit(E{}, p, I)), Inactive>) {
        constexpr std::size_t at = effect_offset(I);
        constexpr std::size_t state = effect_state_offset(I);
        if ((mask >> I) & 1U) visit(E{}, p + at, state);
    }
}

template <class T, class Visit, std::size_t... I>
void visit_active(EffectMask mask, const T* p, Visit& visit, std::index_sequence<I...> /*unused*/) {
    (visit_one<I>(mask, p, visit), ...);
}

template <class T, class Visit, std::size_t... I>
void visit_backwards(EffectMask mask, const T* p, Visit& visit,
                     std::index_sequence<I...> /*unused*/) {
    (visit_one<kEffectCount - 1 - I>(mask, p, visit), ...);
}

}  // namespace detail

/// Calls `visit(effect, its parameters, index of its first state)` for every effect of `mask`, in
/// catalogue order. Effects for which that returns `Inactive` cost nothing.
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

/// The states of a model's effects, by their place among those of the whole catalogue.
struct ActiveStates {
    std::array<std::size_t, kAuxiliaryStates> place{};
    std::size_t count = 0;
    const std::size_t* begin() const { return place.data(); }
    const std::size_t* end() const { return place.data() + count; }
};

inline ActiveStates active_states(EffectMask mask) {
    ActiveStates found;
    std::size_t at = 0;
    for (std::size_t i = 0; i < kEffectCount; ++i) {
        const std::size_t own = detail::kEffectStateCounts[i];
        for (std::size_t n = 0; n < own && ((mask >> i) & 1U); ++n)
            found.place[found.count++] = at + n;
        at += own;
    }
    for (std::size_t i = 0; i < kUserStates; ++i)
        if (mask & user_state_bit(i)) found.place[found.count++] = kCatalogueStates + i;
    return found;
}

}  // namespace sysid
