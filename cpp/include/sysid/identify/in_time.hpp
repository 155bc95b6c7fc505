// Logged steering at the time at which the road wheels of a model have it.
#pragma once

#include <optional>

#include "sysid/identify/problem.hpp"

namespace sysid {

/// A problem whose steering angles, with their rates, are those that act on a car with these
/// parameters (`SteerDelay`). One whose model has no such effect is handed on as it is.
class InTime {
  public:
    InTime(const Problem& logged, const double* p);
    const Problem& operator*() const { return acting_ ? *acting_ : logged_; }

  private:
    const Problem& logged_;
    std::optional<Problem> acting_;
};

}  // namespace sysid
