// The single place where NumPy arrays cross into C++. What is not float64 and contiguous is copied
// on the way in; shapes are never changed.
#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <Eigen/Dense>
#include <atomic>
#include <cmath>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "sysid/math/interrupt.hpp"

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

/// A time from one sample to the next.
inline double step_of(double dt) {
    const bool usable = dt > 0.0 && std::isfinite(dt);
    if (!usable) throw std::invalid_argument("dt: the step must be positive and finite");
    return dt;
}

inline Array empty(std::size_t rows, std::size_t columns) {
    return Array({static_cast<py::ssize_t>(rows), static_cast<py::ssize_t>(columns)});
}

inline Array copy_of(const std::vector<double>& values, std::size_t columns) {
    Array out = empty(values.size() / columns, columns);
    std::copy(values.begin(), values.end(), out.mutable_data());
    return out;
}

template <int R, int C>
Array to_array(const Eigen::Matrix<double, R, C>& m) {
    Array out = C == 1 ? Array(R) : empty(R, C);
    Eigen::Map<Eigen::Matrix<double, C, R>>(out.mutable_data()) = m.transpose();
    return out;
}

/// The elements of a vector or an array.
template <class Values>
Array row_of(const Values& values) {
    Array out(static_cast<py::ssize_t>(values.size()));
    std::copy(values.data(), values.data() + values.size(), out.mutable_data());
    return out;
}

/// Ends the work of the threads that follow it, in the middle of a kernel. Where the thread that
/// makes it follows another one, it is set together with that.
class Stop {
  public:
    Stop();
    void set() { flag_->asked = true; }
    bool is_set() const { return flag_->is_set(); }
    /// From now on kernels of this thread end when it is set.
    void follow() const;

  private:
    friend void answer_interrupts();
    struct Flag {
        std::atomic<bool> asked{false};
        std::shared_ptr<const Flag> outer;
        bool is_set() const { return asked || (outer != nullptr && outer->is_set()); }
    };
    static std::shared_ptr<const Flag>& followed();
    std::shared_ptr<Flag> flag_ = std::make_shared<Flag>();
};

/// What kernels ask about every 50 ms: handlers of signals, which Python runs in the main thread
/// only, and the `Stop` that this thread follows.
void answer_interrupts();

/// Runs a kernel without the interpreter lock. No Python object may be touched inside.
template <class Kernel>
auto unlocked(Kernel&& kernel) {
    const py::gil_scoped_release released;
    const InterruptGuard guard(&answer_interrupts);
    poll_interrupt();  // for rows of kernels that are too short to ask
    return kernel();
}

/// What a kernel writes.
template <class Kernel>
Array filled(std::size_t rows, std::size_t columns, Kernel&& kernel) {
    Array out = empty(rows, columns);
    double* to = out.mutable_data();
    unlocked([&] { kernel(to); });
    return out;
}

/// The value a kernel returns, with the gradient and the matrix of `n` parameters that it writes.
template <class Kernel>
py::tuple with_derivatives(std::size_t n, Kernel&& kernel) {
    Array gradient(static_cast<py::ssize_t>(n));
    Array information = empty(n, n);
    double* g = gradient.mutable_data();
    double* h = information.mutable_data();
    const double value = unlocked([&] { return kernel(g, h); });
    return py::make_tuple(value, gradient, information);
}

}  // namespace sysid::bindings
