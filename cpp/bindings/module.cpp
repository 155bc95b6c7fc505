// Table of contents of the private extension; the Python package wraps all of it.
#include "arrays.hpp"
#include "register.hpp"
#include "sysid/math/errors.hpp"

namespace {

namespace py = pybind11;

/// An error of the package's own. Looked up when something fails: this module is imported while the
/// package is, and every interpreter has classes of its own.
py::object public_error(const char* name, const std::exception& error) {
    return py::module_::import("sysid_vehicle.errors").attr(name)(error.what());
}

void raise(const py::object& error) {
    PyErr_SetObject(reinterpret_cast<PyObject*>(Py_TYPE(error.ptr())), error.ptr());
}

/// The one border: what the kernels throw leaves as what the package documents. Called with the
/// interpreter lock held; errors that are Python's own pass.
void raise_public(std::exception_ptr thrown) {  // NOLINT(performance-unnecessary-value-param)
    try {
        if (thrown) std::rethrow_exception(thrown);
    } catch (const sysid::NumericalFailure& failure) {
        const py::object error = public_error("NumericalError", failure);
        error.attr("sample") = failure.sample;
        raise(error);
    } catch (const std::range_error& error) {
        raise(public_error("NumericalError", error));
    } catch (const std::overflow_error& error) {
        raise(public_error("NumericalError", error));
    } catch (const std::underflow_error& error) {
        raise(public_error("NumericalError", error));
    } catch (const std::logic_error& error) {  // invalid_argument, out_of_range, domain_error, ...
        raise(public_error("InvalidInput", error));
    }
}

}  // namespace

PYBIND11_MODULE(_core, m) {
    using namespace sysid::bindings;
    m.attr("__version__") = SYSID_VERSION;
    py::register_local_exception_translator(&raise_public);
    register_interrupts(m);
    register_model(m);
    register_written(m);
    register_simulate(m);
    register_identify(m);
    register_lab_observer(m);
    register_lab_loop(m);
    register_lab_tyres(m);
    register_online_mu_slip(m);
    register_twin(m);
    register_online_sideslip(m);
    register_banded(m);
}
