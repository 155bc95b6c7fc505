// Failures a caller can act on.
#pragma once

#include <stdexcept>
#include <string>

namespace sysid {

/// A computation left the range in which its result means anything; names the sample.
struct NumericalFailure : std::runtime_error {
    NumericalFailure(const std::string& what, std::size_t sample)
        : std::runtime_error(what + " at sample " + std::to_string(sample)) {}
};

}  // namespace sysid
