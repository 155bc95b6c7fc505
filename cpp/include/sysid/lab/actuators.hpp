// Steering and drive as they are: they stop at their ends, and take their time.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

namespace sysid::lab {

/// What was at a limit at a sample, one bit each.
enum Limit : std::uint32_t {
    kForceAtMost = 1U,
    kForceAtLeast = 2U,
    kForceRateLimited = 4U,
    kSteerAtMost = 8U,
    kSteerAtLeast = 16U,
    kSteerRateLimited = 32U,
    kYawRateLimited = 64U,           // the heading loop asks for more than it may
    kYawAccelerationLimited = 128U,  // and so does its change
    kSlipLimited = 256U,             // steering held back to keep the front tyre on its curve
    kBrakesIdle = 512U,              // a little too fast, and left to roll
    kRearSlipLimited = 1024U,        // yaw rate given up to keep the rear tyre on its curve
};

struct Actuator {
    double least = -std::numeric_limits<double>::infinity();
    double most = std::numeric_limits<double>::infinity();
    double rate_limit = std::numeric_limits<double>::infinity();  // per second
    double lag_s = 0.0;                                           // first order
};

/// Which bits an actuator sets.
struct ActuatorLimits {
    Limit at_most, at_least, rate;
};
constexpr ActuatorLimits kForceLimits{kForceAtMost, kForceAtLeast, kForceRateLimited};
constexpr ActuatorLimits kSteerLimits{kSteerAtMost, kSteerAtLeast, kSteerRateLimited};

/// Where the actuator is a sample later, if it is told `command` now.
inline double follow(const Actuator& actuator, double now, double command, double dt,
                     const ActuatorLimits& bits, std::uint32_t& limits) {
    const double wanted = std::clamp(command, actuator.least, actuator.most);
    if (command > actuator.most) limits |= bits.at_most;
    if (command < actuator.least) limits |= bits.at_least;
    const double share = actuator.lag_s > 0.0 ? -std::expm1(-dt / actuator.lag_s) : 1.0;
    const double step = actuator.rate_limit * dt;
    const double move = share == 1.0 ? wanted - now : share * (wanted - now);
    if (std::abs(move) > step) {
        limits |= bits.rate;
        return now + std::copysign(step, move);
    }
    return share == 1.0 ? wanted : now + move;
}

}  // namespace sysid::lab
