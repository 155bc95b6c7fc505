// Whole numbers from what was computed: a cast of what no integer holds is undefined.
#pragma once

namespace sysid {

/// `value` without its fraction, from `least` to `most`; the least where it is no number.
inline int whole_within(double value, int least, int most) {
    if (!(value > least)) return least;
    return value < most ? static_cast<int>(value) : most;
}

}  // namespace sysid
