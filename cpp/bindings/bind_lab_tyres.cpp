#include "arrays.hpp"
#include "register.hpp"
#include "sysid/lab/tyre_fit.hpp"
#include "sysid/lab/tyre_likelihood.hpp"

namespace sysid::bindings {

namespace {

using namespace sysid::lab;

const double* parameters(const Array& p) { return vector(p, kTyreParameters, "parameters"); }

void check(const std::vector<int>& columns) {
    for (int c : columns)
        if (c < 0 || c >= kTyreParameters)
            throw std::invalid_argument("columns: no parameter has number " + std::to_string(c));
}

void refuse_others(const TyreProblem& problem, const FrozenGains& gains) {
    bool same = problem.runs().size() == gains.runs.size();
    for (std::size_t i = 0; same && i < gains.runs.size(); ++i)
        same = problem.runs()[i].size() == gains.runs[i].size();
    if (!same) throw std::invalid_argument("gains: they belong to other runs");
}

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
        std::copy(y, y + kGreyChannels, reading.begin());
        u += 4;
        y += kGreyChannels;
    }
    return run;
}

void register_problem(py::module_& m) {
    py::class_<FrozenGains>(m, "FrozenGains")
        .def_readonly("log_likelihood", &FrozenGains::log_likelihood)
        .def_readonly("observed", &FrozenGains::observed);
    py::class_<TyreProblem>(m, "TyreProblem")
        .def(py::init<const GreyBoxCar&>(), py::arg("car"))
        .def_property_readonly("samples", &TyreProblem::samples)
        .def(
            "add_run",
            [](TyreProblem& self, double dt, const Array& inputs, const Array& measurements) {
                self.add_run(tyre_run(dt, inputs, measurements));
            },
            py::arg("dt"), py::arg("inputs"), py::arg("measurements"))
        .def(
            "freeze",
            [](const TyreProblem& self, const Array& p, const Array& noise) {
                const double* values = parameters(p);
                const double* n = vector(noise, kGreyNoises, "noise");
                return unlocked([&] { return self.freeze(values, n); });
            },
            py::arg("parameters"), py::arg("noise"))
        .def(
            "residuals",
            [](const TyreProblem& self, const Array& p, const FrozenGains& gains) {
                const double* values = parameters(p);
                refuse_others(self, gains);
                Array out = empty(self.samples(), kGreyChannels);
                double* o = out.mutable_data();
                unlocked([&] { self.residuals(values, gains, o); });
                return out;
            },
            py::arg("parameters"), py::arg("filter"))
        .def(
            "half_sum_of_squares",
            [](const TyreProblem& self, const Array& p, const FrozenGains& gains) {
                const double* values = parameters(p);
                refuse_others(self, gains);
                return unlocked([&] { return self.half_sum_of_squares(values, gains); });
            },
            py::arg("parameters"), py::arg("filter"))
        .def(
            "sensitivities",
            [](const TyreProblem& self, const Array& p, const FrozenGains& gains,
               const std::vector<int>& columns) {
                const double* values = parameters(p);
                refuse_others(self, gains);
                check(columns);
                Array out = empty(self.samples() * kGreyChannels, columns.size());
                double* o = out.mutable_data();
                unlocked([&] { self.sensitivities(values, gains, columns, o); });
                return out;
            },
            py::arg("parameters"), py::arg("filter"), py::arg("columns"))
        .def(
            "normal_equations",
            [](const TyreProblem& self, const Array& p, const FrozenGains& gains,
               const std::vector<int>& columns) {
                const double* values = parameters(p);
                refuse_others(self, gains);
                check(columns);
                Array g(static_cast<py::ssize_t>(columns.size()));
                Array n = empty(columns.size(), columns.size());
                double* go = g.mutable_data();
                double* no = n.mutable_data();
                const double cost =
                    unlocked([&] { return self.normal_equations(values, gains, columns, go, no); });
                return py::make_tuple(cost, g, n);
            },
            py::arg("parameters"), py::arg("filter"), py::arg("columns"))
        .def(
            "noise_score",
            [](const TyreProblem& self, const Array& p, const Array& noise) {
                const double* values = parameters(p);
                const double* n = vector(noise, kGreyNoises, "noise");
                Array g(static_cast<py::ssize_t>(kGreyNoises));
                Array info = empty(kGreyNoises, kGreyNoises);
                double* go = g.mutable_data();
                double* io = info.mutable_data();
                const double value = unlocked([&] { return self.noise_score(values, n, go, io); });
                return py::make_tuple(value, g, info);
            },
            py::arg("parameters"), py::arg("noise"))
        .def(
            "states",
            [](const TyreProblem& self, const Array& p, const FrozenGains& gains) {
                const double* values = parameters(p);
                refuse_others(self, gains);
                Array out = empty(self.samples(), kGreyStates);
                double* o = out.mutable_data();
                unlocked([&] { self.states(values, gains, o); });
                return out;
            },
            py::arg("parameters"), py::arg("filter"))
        .def(
            "look_ahead",
            [](const TyreProblem& self, const Array& p, const FrozenGains& gains,
               std::size_t ahead) {
                const double* values = parameters(p);
                refuse_others(self, gains);
                Array out = empty(self.samples(), kGreyChannels);
                double* o = out.mutable_data();
                unlocked([&] { self.look_ahead(values, gains, ahead, o); });
                return out;
            },
            py::arg("parameters"), py::arg("filter"), py::arg("ahead"));
}

void register_loss(py::module_& m) {
    py::class_<TyreLoss>(m, "TyreLoss")
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
        .def_property_readonly("samples", &TyreLoss::samples)
        .def(
            "residuals",
            [](const TyreLoss& self, const Array& p) {
                const double* values = parameters(p);
                Array out = empty(self.samples(), 2);
                double* o = out.mutable_data();
                unlocked([&] { self.residuals(values, o); });
                return out;
            },
            py::arg("parameters"))
        .def(
            "half_sum_of_squares",
            [](const TyreLoss& self, const Array& p) {
                const double* values = parameters(p);
                return unlocked([&] { return self.half_sum_of_squares(values); });
            },
            py::arg("parameters"))
        .def(
            "sensitivities",
            [](const TyreLoss& self, const Array& p, const std::vector<int>& columns) {
                const double* values = parameters(p);
                check(columns);
                Array out = empty(2 * self.samples(), columns.size());
                double* o = out.mutable_data();
                unlocked([&] { self.sensitivities(values, columns, o); });
                return out;
            },
            py::arg("parameters"), py::arg("columns"))
        .def(
            "normal_equations",
            [](const TyreLoss& self, const Array& p, const std::vector<int>& columns) {
                const double* values = parameters(p);
                check(columns);
                Array g(static_cast<py::ssize_t>(columns.size()));
                Array n = empty(columns.size(), columns.size());
                double* go = g.mutable_data();
                double* no = n.mutable_data();
                const double cost =
                    unlocked([&] { return self.normal_equations(values, columns, go, no); });
                return py::make_tuple(cost, g, n);
            },
            py::arg("parameters"), py::arg("columns"));
}

}  // namespace

void register_lab_tyres(py::module_& m) {
    py::class_<GreyBoxCar>(m, "GreyBoxCar")
        .def(py::init<>())
        .def_readwrite("mass_kg", &GreyBoxCar::mass_kg)
        .def_readwrite("yaw_inertia_kgm2", &GreyBoxCar::yaw_inertia_kgm2)
        .def_readwrite("lf_m", &GreyBoxCar::lf_m)
        .def_readwrite("lr_m", &GreyBoxCar::lr_m)
        .def_readwrite("air_density_kgpm3", &GreyBoxCar::air_density_kgpm3)
        .def_readwrite("cg_height_m", &GreyBoxCar::cg_height_m)
        .def_readwrite("slowest_mps", &GreyBoxCar::slowest_mps);
    register_problem(m);
    register_loss(m);
}

}  // namespace sysid::bindings
