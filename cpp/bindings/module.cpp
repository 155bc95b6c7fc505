// Table of contents of the private extension; the Python package wraps all of it.
#include "arrays.hpp"
#include "register.hpp"
#include "sysid/math/errors.hpp"

PYBIND11_MODULE(_core, m) {
    using namespace sysid::bindings;
    m.attr("__version__") = SYSID_VERSION;
    py::register_exception<sysid::NumericalFailure>(m, "NumericalFailure", PyExc_ArithmeticError);
    register_model(m);
    register_simulate(m);
    register_identify(m);
    register_lab_observer(m);
    register_lab_loop(m);
    register_lab_tyres(m);
    register_online_mu_slip(m);
    register_twin(m);
    register_online_sideslip(m);
}
