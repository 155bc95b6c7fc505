// What is known of a sample: plain numbers, except where the calculation itself is written down.
#pragma once

#include <type_traits>

namespace sysid {

class Recorded;

/// Scalar of inputs and times of a model whose states have the scalar `S`.
template <class S>
using Given = std::conditional_t<std::is_same_v<S, Recorded>, Recorded, double>;

}  // namespace sysid
