// What a filter ran on: whoever asks for a path knows whether it is the one that was told.
#pragma once

#include <cstdint>
#include <vector>

#include "sysid/identify/problem.hpp"

namespace sysid {

class MadeOf {
  public:
    /// Of nothing.
    MadeOf() = default;
    MadeOf(const Problem& problem, const double* p);

    /// Whether it was this model, these data and these parameters. Models with formulas of users
    /// are never known again.
    bool is(const Problem& problem, const double* p) const;

  private:
    std::vector<double> parameters_;
    std::uint64_t data_ = 0;  // a digest of the model and the runs
};

}  // namespace sysid
