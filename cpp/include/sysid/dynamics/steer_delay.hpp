// The time by which the road wheels act after what the log says of the steering.
#pragma once

#include <cmath>
#include <cstddef>
#include <vector>

#include "sysid/dynamics/single_track.hpp"

namespace sysid {

/// That time [s]: the parameter of `SteerDelay`, zero in a model without.
inline double steer_delay(const SingleTrack& model, const double* p) {
    constexpr std::size_t place = effect_place<SteerDelay>();
    if (((model.effects >> place) & 1U) == 0) return 0.0;
    return p[kBaseParameterCount + effect_offset(place)];
}

/// A signal as it was `late` samples before its last one, straight between samples; before the
/// first it was that.
inline double earlier(const std::vector<double>& signal, double late) {
    const double at = static_cast<double>(signal.size() - 1) - late;
    if (!(at > 0.0)) return signal.front();
    const auto i = static_cast<std::size_t>(std::floor(at));
    if (i + 1 >= signal.size()) return signal.back();
    return signal[i] + (at - static_cast<double>(i)) * (signal[i + 1] - signal[i]);
}

}  // namespace sysid
