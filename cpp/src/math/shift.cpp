#include "sysid/math/shift.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>

namespace sysid {

namespace {

constexpr int kTaps = 2 * kShiftReach;
constexpr std::array<double, 4> kWindow{0.355768, 0.487396, 0.144232, 0.012604};

struct Taps {
    std::array<double, kTaps> value{}, slope{};
};

/// Weights of the samples number 1 - kShiftReach to kShiftReach for the place `part` after number
/// 0, and their derivatives. The window and its derivative end at zero: values and slopes are
/// continuous in the shift (A. H. Nuttall, IEEE Trans. ASSP 29, 1981).
Taps taps_at(double part) {
    constexpr double pi = std::numbers::pi;
    Taps taps;
    double sum = 0.0, sum_slope = 0.0;
    for (std::size_t i = 0; i < taps.value.size(); ++i) {
        const double t = part - (static_cast<double>(i) + 1.0 - kShiftReach);
        const double turn = pi * t / kShiftReach;
        double window = kWindow[0], window_slope = 0.0;
        for (std::size_t m = 1; m < kWindow.size(); ++m) {
            const auto often = static_cast<double>(m);
            window += kWindow[m] * std::cos(often * turn);
            window_slope -= kWindow[m] * often * pi / kShiftReach * std::sin(often * turn);
        }
        double wave = 1.0, wave_slope = 0.0;
        if (std::abs(t) > 1e-9) {
            wave = std::sin(pi * t) / (pi * t);
            wave_slope = (std::cos(pi * t) - wave) / t;
        }
        taps.value[i] = wave * window;
        taps.slope[i] = wave_slope * window + wave * window_slope;
        sum += taps.value[i];
        sum_slope += taps.slope[i];
    }
    for (std::size_t i = 0; i < taps.value.size(); ++i) {
        taps.value[i] /= sum;
        taps.slope[i] = (taps.slope[i] - taps.value[i] * sum_slope) / sum;
    }
    return taps;
}

}  // namespace

void shift_in_time(const double* signal, std::size_t count, double late, double* value,
                   double* slope) {
    const auto n = static_cast<std::int64_t>(count);
    const double whole = std::floor(-late);
    const Taps taps = taps_at(-late - whole);
    const bool between = -late != whole;
    const std::int64_t first = static_cast<std::int64_t>(whole) + 1 - kShiftReach;
    const auto sample = [&](std::int64_t i) {
        if (i < 0) return 2.0 * signal[0] - signal[std::min(-i, n - 1)];
        if (i < n) return signal[i];
        return 2.0 * signal[n - 1] - signal[std::max(2 * (n - 1) - i, std::int64_t{0})];
    };
    for (std::int64_t k = 0; k < n; ++k) {
        double v = 0.0, s = 0.0;
        for (std::int64_t j = 0; j < kTaps; ++j) {
            const double u = sample(k + first + j);
            v += taps.value[static_cast<std::size_t>(j)] * u;
            s += taps.slope[static_cast<std::size_t>(j)] * u;
        }
        value[k] = between ? v : sample(k + static_cast<std::int64_t>(whole));
        slope[k] = s;
    }
}

}  // namespace sysid
