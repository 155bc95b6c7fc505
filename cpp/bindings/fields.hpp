// Fields of a class that Python reads and sets under the names that they have here.
#pragma once

#include <pybind11/pybind11.h>

#include <utility>

// NOLINTNEXTLINE(bugprone-macro-parentheses): names take none
#define SYSID_FIELD(Class, name) \
    std::pair { #name, &Class::name }

namespace sysid::bindings {

template <class Bound, class... Fields>
void fields(Bound&& bound, Fields... all) {
    (bound.def_readwrite(all.first, all.second), ...);
}

}  // namespace sysid::bindings
