#include "fields.hpp"
#include "least_squares.hpp"
#include "register.hpp"
#include "sysid/lab/tyre_fit.hpp"
#include "sysid/lab/tyre_likelihood.hpp"

namespace sysid::bindings {

namespace {

using namespace sysid::lab;

TyreRun tyre_run(double dt, const Array& inputs, const Array& measurements) {
    const auto n = inputs.ndim() == 2 ? inputs.shape(0) : 0;
    if (n < 2) throw std::invalid_argument("inputs: expected two samples or more");
    if (!(dt > 0.0)) throw std::invalid_argument("dt: must be positive");
    const double* u = matrix(inputs, n, 4, "inputs");
    const double* y = matrix(measurements, n, kGreyChannels, "measurements");
    TyreRun run;
    run.dt = dt;
    run.inputs.reserve(static_cast<std::size_t>(n));
    run.measurements.resize(static_cast<std::size_t>(n));
    for (auto& reading : run.measurements) {
        run.inputs.push_back({u[0], u[1], std::sin(u[1]), std::cos(u[1]), u[2], u[3]});
        reading = Eigen::Map<const Vec<kGreyChannels>>(y);
        u += 4;
        y += kGreyChannels;
    }
    return run;
}

void register_problem(py::module_& m) {
    py::class_<TyreProblem> bound(m, "TyreProblem");
    bind_filter<FrozenGains>(
        m, "FrozenGains", bound, kTyreParameters, kGreyNoises,
        [](const Array& noise) { return vector(noise, kGreyNoises, "noise"); });
    bind_least_squares<FrozenGains>(bound, kTyreParameters, kGreyChannels);
    const auto parameters = [](const Array& p) { return vector(p, kTyreParameters, "parameters"); };
    bound.def(py::init([](const GreyBoxCar& car) { return TyreProblem{car, {}}; }), py::arg("car"))
        .def(
            "add_run",
            [](TyreProblem& self, double dt, const Array& inputs, const Array& measurements) {
                self.runs.push_back(tyre_run(dt, inputs, measurements));
            },
            py::arg("dt"), py::arg("inputs"), py::arg("measurements"))
        .def(
            "states",
            [=](const TyreProblem& self, const Array& p, const FrozenGains& gains) {
                const double* values = parameters(p);
                check_runs(self, gains);
                return filled(self.samples(), kGreyStates,
                              [&](double* to) { states(self, values, gains, to); });
            },
            py::arg("parameters"), py::arg("filter"))
        .def(
            "look_ahead",
            [=](const TyreProblem& self, const Array& p, const FrozenGains& gains,
                std::size_t ahead) {
                const double* values = parameters(p);
                check_runs(self, gains);
                return filled(self.samples(), kGreyChannels,
                              [&](double* to) { look_ahead(self, values, gains, ahead, to); });
            },
            py::arg("parameters"), py::arg("filter"), py::arg("ahead"));
}

void register_loss(py::module_& m) {
    py::class_<TyreLoss> bound(m, "TyreLoss");
    bind_least_squares<std::nullptr_t>(bound, kTyreParameters, 2);
    bound
        .def(py::init([](const GreyBoxCar& car, bool projects_steer, const Array& motion,
                         const Array& targets, const Array& weights) {
                 const auto n = motion.ndim() == 2 ? motion.shape(0) : 0;
                 const double* x = matrix(motion, n, 6, "motion");
                 const double* t = matrix(targets, n, 2, "targets");
                 const double* w = matrix(weights, n, 2, "weights");
                 TyreLoss loss(car, projects_steer);
                 for (py::ssize_t k = 0; k < n; ++k, x += 6, t += 2, w += 2)
                     loss.add({x[0], x[1], x[2], x[3], x[4], x[5], t[0], t[1], w[0], w[1]});
                 return loss;
             }),
             py::arg("car"), py::arg("projects_steer"), py::arg("motion"), py::arg("targets"),
             py::arg("weights"))
        .def_property_readonly("samples", &TyreLoss::samples);
}

}  // namespace

void register_lab_tyres(py::module_& m) {
    fields(py::class_<GreyBoxCar>(m, "GreyBoxCar").def(py::init<>()),
           SYSID_FIELD(GreyBoxCar, mass_kg), SYSID_FIELD(GreyBoxCar, yaw_inertia_kgm2),
           SYSID_FIELD(GreyBoxCar, lf_m), SYSID_FIELD(GreyBoxCar, lr_m),
           SYSID_FIELD(GreyBoxCar, air_density_kgpm3), SYSID_FIELD(GreyBoxCar, cg_height_m),
           SYSID_FIELD(GreyBoxCar, slowest_mps));
    register_problem(m);
    register_loss(m);
}

}  // namespace sysid::bindings
