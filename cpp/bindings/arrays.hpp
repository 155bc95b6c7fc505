// The single place where NumPy arrays cross into C++. What is not float64 and contiguous is copied
// on the way in; shapes are never changed.
#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <stdexcept>
#include <string>
#include <vector>

namespace sysid::bindings {

namespace py = pybind11;

using Array = py::array_t<double, py::array::c_style>;

inline const double* matrix(const Array& a, py::ssize_t rows, py::ssize_t columns,
                            const char* name) {
    if (a.ndim() != 2 || a.shape(0) != rows || a.shape(1) != columns) {
        throw std::invalid_argument(std::string(name) + ": expected shape (" +
                                    std::to_string(rows) + ", " + std::to_string(columns) + ")");
    }
    return a.data();
}

inline const double* vector(const Array& a, std::size_t size, const char* name) {
    if (a.ndim() != 1 || a.size() != static_cast<py::ssize_t>(size)) {
        throw std::invalid_argument(std::string(name) + ": expected " + std::to_string(size) +
                                    " values, got " + std::to_string(a.size()));
    }
    return a.data();
}

inline Array empty(std::size_t rows, std::size_t columns) {
    return Array({static_cast<py::ssize_t>(rows), static_cast<py::ssize_t>(columns)});
}

inline Array copy_of(const std::vector<double>& values, std::size_t columns) {
    Array out = empty(values.size() / columns, columns);
    std::copy(values.begin(), values.end(), out.mutable_data());
    return out;
}

/// Runs a kernel without the interpreter lock. No Python object may be touched inside.
template <class Kernel>
auto unlocked(Kernel&& kernel) {
    const py::gil_scoped_release released;
    return kernel();
}

}  // namespace sysid::bindings
