// Ctrl-C in the middle of a kernel, and the end of threads whose results nobody wants any more.
#include "arrays.hpp"
#include "register.hpp"

namespace sysid::bindings {

namespace {

/// Ends a kernel; Python sees it as KeyboardInterrupt.
struct Stopped : std::exception {
    const char* what() const noexcept override { return "stopped"; }
};

}  // namespace

std::shared_ptr<const Stop::Flag>& Stop::followed() {
    thread_local std::shared_ptr<const Flag> flag;
    return flag;
}

Stop::Stop() { flag_->outer = followed(); }

void Stop::follow() const { followed() = flag_; }

void answer_interrupts() {
    if (const auto& flag = Stop::followed()) {  // in a pool: Python handles no signals there
        if (flag->is_set()) throw Stopped();
        return;
    }
    const py::gil_scoped_acquire lock;
    if (PyErr_CheckSignals() != 0) throw py::error_already_set();
}

void register_interrupts(py::module_& m) {
    // NOLINTNEXTLINE(performance-unnecessary-value-param): pybind11 fixes the signature
    py::register_local_exception_translator([](std::exception_ptr thrown) {
        try {
            if (thrown) std::rethrow_exception(thrown);
        } catch (const Stopped& stopped) {
            PyErr_SetString(PyExc_KeyboardInterrupt, stopped.what());
        }
    });
    py::class_<Stop>(m, "Stop")
        .def(py::init<>())
        .def("set", &Stop::set)
        .def("follow", &Stop::follow)
        .def_property_readonly("is_set", &Stop::is_set);
}

}  // namespace sysid::bindings
