// Whole numbers: from what was computed, where a cast of what no integer holds is undefined, and as
// places in a vector.
#pragma once

#include <cstddef>

namespace sysid {

/// `value` without its fraction, from `least` to `most`; the least where it is no number.
inline int whole_within(double value, int least, int most) {
    if (!(value > least)) return least;
    return value < most ? static_cast<int>(value) : most;
}

/// A number that is not negative, as the place of an element.
inline std::size_t index(int i) { return static_cast<std::size_t>(i); }

}  // namespace sysid
