// What the sensors make of the truth: noise, bias, delay, and a rate of their own.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

namespace sysid::lab {

/// Every sensor of the laboratory, in the order of its records.
enum Sensor : std::size_t {
    kSenseVx,
    kSenseVy,
    kSenseYawRate,
    kSenseAx,
    kSenseAy,
    kSenseHeading,
    kSensePlaceX,
    kSensePlaceY,
    kSenseLoadFront,
    kSenseLoadRear,
    kSenseForce,
    kSenseSteer,
    kSensorCount,
};

struct SensorData {
    double noise_std = 0.0;  // white, of each reading
    double bias = 0.0;
    double delay_s = 0.0;
    double rate_hz = 0.0;  // 0: a reading at every sample
};

using Readings = std::array<double, kSensorCount>;

class Sensors {
  public:
    Sensors(const std::array<SensorData, kSensorCount>& data, double dt) : data_(data), dt_(dt) {}

    /// Readings at the last sample of `perfect`, which holds all samples up to now; `normal` are
    /// this sample's standard normal numbers. NaN: no fresh reading.
    Readings read(const std::vector<Readings>& perfect, const double* normal) const {
        const std::size_t k = perfect.size() - 1;
        Readings out;
        for (std::size_t i = 0; i < kSensorCount; ++i) {
            const SensorData& s = data_[i];
            out[i] = fresh(s, k)
                         ? delayed(perfect, k, i, s.delay_s) + s.bias + s.noise_std * normal[i]
                         : std::numeric_limits<double>::quiet_NaN();
        }
        return out;
    }

  private:
    // Readings fall on the first sample at or after each multiple of the sensor's own interval.
    bool fresh(const SensorData& s, std::size_t k) const {
        if (s.rate_hz <= 0.0 || k == 0) return true;
        const auto count = [&](std::size_t sample) {
            return std::floor(static_cast<double>(sample) * dt_ * s.rate_hz + 1e-9);
        };
        return count(k) > count(k - 1);
    }

    double delayed(const std::vector<Readings>& perfect, std::size_t k, std::size_t i,
                   double delay_s) const {
        const double back = delay_s / dt_;
        const double at = static_cast<double>(k) - back;
        if (at <= 0.0) return perfect[0][i];
        const auto before = static_cast<std::size_t>(at);
        const double part = at - static_cast<double>(before);
        if (part == 0.0) return perfect[before][i];
        return (1.0 - part) * perfect[before][i] + part * perfect[before + 1][i];
    }

    std::array<SensorData, kSensorCount> data_;
    double dt_;
};

}  // namespace sysid::lab
