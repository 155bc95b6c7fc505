#include "least_squares.hpp"
#include "register.hpp"
#include "sysid/lab/tyre_fit.hpp"

namespace sysid::bindings {

using namespace sysid::lab;

void register_lab_tyres(py::module_& m) {
    py::class_<TyreLoss> bound(m, "TyreLoss");
    bind_least_squares<std::nullptr_t>(bound, kTyreParameters, 2);
    bound
        .def(py::init([](const VehicleData& car, double yaw_inertia_kgm2, bool projects_steer,
                         const Array& motion, const Array& targets, const Array& weights) {
                 const auto n = motion.ndim() == 2 ? motion.shape(0) : 0;
                 const double* x = matrix(motion, n, 6, "motion");
                 const double* t = matrix(targets, n, 2, "targets");
                 const double* w = matrix(weights, n, 2, "weights");
                 TyreLoss loss(car, yaw_inertia_kgm2, projects_steer);
                 for (py::ssize_t k = 0; k < n; ++k, x += 6, t += 2, w += 2)
                     loss.add({x[0], x[1], x[2], x[3], x[4], x[5], t[0], t[1], w[0], w[1]});
                 return loss;
             }),
             py::arg("car"), py::arg("yaw_inertia_kgm2"), py::arg("projects_steer"),
             py::arg("motion"), py::arg("targets"), py::arg("weights"))
        .def_property_readonly("samples", &TyreLoss::samples);
}

}  // namespace sysid::bindings
