// Failures a caller can act on.
#pragma once

#include <array>
#include <cstddef>
#include <cstdio>
#include <stdexcept>
#include <string>

namespace sysid {

/// A computation left the range in which its result means anything; names the sample.
struct NumericalFailure : std::runtime_error {
    NumericalFailure(const std::string& reason_, std::size_t sample_)
        : std::runtime_error(reason_ + " at sample " + std::to_string(sample_)),
          reason(reason_),
          sample(sample_) {}

    /// The same failure where the log and the time are known; `sample` then counts in that log.
    NumericalFailure(const NumericalFailure& failure, const std::string& log, double time_s,
                     std::size_t sample_)
        : std::runtime_error(log + ": " + failure.reason + " at " + seconds(time_s) +
                             " s (sample " + std::to_string(sample_) + ")"),
          reason(failure.reason),
          sample(sample_) {}

    std::string reason;
    std::size_t sample;

  private:
    static std::string seconds(double time_s) {
        std::array<char, 32> text{};
        std::snprintf(text.data(), text.size(), "%.6g", time_s);
        return text.data();
    }
};

}  // namespace sysid
