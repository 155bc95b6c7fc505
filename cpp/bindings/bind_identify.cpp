// The prediction errors of a problem, their derivatives, the noise score, filter and smoother.
#include "arrays.hpp"
#include "register.hpp"
#include "sysid/identify/prediction_error.hpp"

namespace sysid::bindings {

namespace {

void add_run(Problem& problem, double dt, const Array& inputs, const Array& measurements,
             double start, const std::string& name) {
    const auto n = inputs.ndim() == 2 ? inputs.shape(0) : 0;
    const double* u = matrix(inputs, n, 2, "inputs");
    const double* y = matrix(measurements, n, kChannels, "measurements");
    if (n < 2) throw std::invalid_argument("inputs: expected two samples or more");
    if (!(dt > 0.0) || !std::isfinite(dt)) throw std::invalid_argument("dt: expected above zero");
    const std::string log = name.empty() ? "" : name + ", ";
    Run run;
    run.dt = dt;
    run.name = name;
    run.inputs.resize(static_cast<std::size_t>(n));
    run.measurements.resize(static_cast<std::size_t>(n));
    for (std::size_t k = 0; k < run.size(); ++k) {
        run.inputs[k] = {u[2 * k], u[2 * k + 1], start + static_cast<double>(k) * dt};
        if (!std::isfinite(u[2 * k]) || !std::isfinite(u[2 * k + 1]))
            throw std::invalid_argument(log + "inputs: not finite at sample " + std::to_string(k));
        run.measurements[k] = Eigen::Map<const Vec<kChannels>>(y + kChannels * k);
        if (run.measurements[k].array().isInf().any())
            throw std::invalid_argument(log + "measurements: infinite at sample " +
                                        std::to_string(k));
    }
    problem.runs.push_back(std::move(run));
}

Noise to_noise(const Array& values) {
    const double* v = vector(values, kNoiseParameters, "noise");
    Noise noise;
    for (auto& s : noise.sensor) s = *v++;
    for (auto& s : noise.motion) s = *v++;
    for (auto& s : noise.disturbance) s = *v++;
    for (auto& s : noise.correlation_time_s) s = *v++;
    for (auto& s : noise.road) s = *v++;
    noise.road_time_s = *v;
    return noise;
}

const double* values_of(const Array& p) { return vector(p, kParameterCount, "parameters"); }

void check(const std::vector<int>& numbers, int count, const char* name) {
    for (int c : numbers)
        if (c < 0 || c >= count)
            throw std::invalid_argument(std::string(name) + ": there is no " + std::to_string(c));
}

void check_columns(const std::vector<int>& columns) {
    check(columns, static_cast<int>(kParameterCount), "columns");
}

void check(const Problem& problem, const FrozenFilter& filter) {
    bool fits = filter.runs.size() == problem.runs.size();
    for (std::size_t i = 0; fits && i < filter.runs.size(); ++i)
        fits = filter.runs[i].size() == problem.runs[i].size();
    if (!fits) throw std::invalid_argument("filter: was made from other runs");
}

}  // namespace

void register_identify(py::module_& m) {
    m.attr("NOISE_PARAMETERS") = kNoiseParameters;
    m.attr("PARAMETERS") = kParameterCount;
    m.attr("CHANNELS") = static_cast<int>(kChannels);
    m.attr("EXTERNALS") = static_cast<int>(kExternals);
    py::class_<FrozenFilter>(m, "FrozenFilter")
        .def_readonly("log_likelihood", &FrozenFilter::log_likelihood)
        .def_readonly("observed", &FrozenFilter::observed);
    py::class_<Problem>(m, "Problem")
        .def(py::init([](const SingleTrack& model) { return Problem{model, {}}; }),
             py::arg("model"))
        .def("add_run", &add_run, py::arg("dt"), py::arg("inputs"), py::arg("measurements"),
             py::arg("start") = 0.0, py::arg("name") = "")
        .def(
            "with_model",
            [](const Problem& self, const SingleTrack& model) { return Problem{model, self.runs}; },
            py::arg("model"))
        .def_property_readonly("samples", &Problem::samples)
        .def(
            "freeze",
            [](const Problem& self, const Array& p, const Array& noise) {
                const double* values = values_of(p);
                const Noise n = to_noise(noise);
                return unlocked([&] { return freeze(self, values, n); });
            },
            py::arg("parameters"), py::arg("noise"))
        .def(
            "residuals",
            [](const Problem& self, const Array& p, const FrozenFilter& filter) {
                check(self, filter);
                const double* values = values_of(p);
                Array out = empty(self.samples(), kChannels);
                double* to = out.mutable_data();
                unlocked([&] { residuals(self, values, filter, to); });
                return out;
            },
            py::arg("parameters"), py::arg("filter"))
        .def(
            "half_sum_of_squares",
            [](const Problem& self, const Array& p, const FrozenFilter& filter) {
                check(self, filter);
                const double* values = values_of(p);
                return unlocked([&] { return half_sum_of_squares(self, values, filter); });
            },
            py::arg("parameters"), py::arg("filter"))
        .def(
            "sensitivities",
            [](const Problem& self, const Array& p, const FrozenFilter& filter,
               const std::vector<int>& columns) {
                check_columns(columns);
                check(self, filter);
                const double* values = values_of(p);
                Array out = empty(self.samples() * kChannels, columns.size());
                double* to = out.mutable_data();
                unlocked([&] { sensitivities(self, values, filter, columns, to); });
                return out;
            },
            py::arg("parameters"), py::arg("filter"), py::arg("columns"))
        .def(
            "normal_equations",
            [](const Problem& self, const Array& p, const FrozenFilter& filter,
               const std::vector<int>& columns) {
                check_columns(columns);
                check(self, filter);
                const double* values = values_of(p);
                Array gradient(static_cast<py::ssize_t>(columns.size()));
                Array information = empty(columns.size(), columns.size());
                double* g = gradient.mutable_data();
                double* h = information.mutable_data();
                const double cost =
                    unlocked([&] { return normal_equations(self, values, filter, columns, g, h); });
                return py::make_tuple(cost, gradient, information);
            },
            py::arg("parameters"), py::arg("filter"), py::arg("columns"))
        .def(
            "signal_sensitivities",
            [](const Problem& self, const Array& p, const FrozenFilter& filter,
               const Array& signals, const std::vector<int>& targets) {
                check(self, filter);
                check(targets, kExternals + kChannels, "targets");
                const double* values = values_of(p);
                const double* s = matrix(signals, static_cast<py::ssize_t>(self.samples()),
                                         static_cast<py::ssize_t>(targets.size()), "signals");
                Array out = empty(self.samples() * kChannels, targets.size());
                double* to = out.mutable_data();
                unlocked([&] { signal_sensitivities(self, values, filter, s, targets, to); });
                return out;
            },
            py::arg("parameters"), py::arg("filter"), py::arg("signals"), py::arg("targets"))
        .def(
            "noise_score",
            [](const Problem& self, const Array& p, const Array& noise) {
                const double* values = values_of(p);
                const Noise n = to_noise(noise);
                Array gradient(kNoiseParameters);
                Array information = empty(kNoiseParameters, kNoiseParameters);
                double* g = gradient.mutable_data();
                double* h = information.mutable_data();
                const double value = unlocked([&] { return noise_score(self, values, n, g, h); });
                return py::make_tuple(value, gradient, information);
            },
            py::arg("parameters"), py::arg("noise"))
        .def(
            "trace",
            [](const Problem& self, const Array& p, const Array& noise, bool smoothed) {
                const double* values = values_of(p);
                const Noise n = to_noise(noise);
                const Trace t = unlocked([&] { return trace(self, values, n, smoothed); });
                py::dict out;
                out["innovation"] = copy_of(t.innovation, kChannels);
                out["spread"] = copy_of(t.spread, kChannels);
                out["whitened"] = copy_of(t.whitened, kChannels);
                out["state"] = copy_of(t.state, kStatesFull);
                out["state_std"] = copy_of(t.state_std, kStatesFull);
                const auto n_samples = static_cast<py::ssize_t>(t.log_density.size());
                Array density(n_samples);
                std::copy(t.log_density.begin(), t.log_density.end(), density.mutable_data());
                out["log_density"] = density;
                out["log_likelihood"] = t.log_likelihood;
                return out;
            },
            py::arg("parameters"), py::arg("noise"), py::arg("smoothed"))
        .def(
            "look_ahead",
            [](const Problem& self, const Array& p, const Array& noise, std::size_t ahead,
               std::size_t every) {
                const double* values = values_of(p);
                const Noise n = to_noise(noise);
                Array out = empty(self.samples(), kChannels);
                double* to = out.mutable_data();
                unlocked([&] { look_ahead(self, values, n, ahead, every, to); });
                return out;
            },
            py::arg("parameters"), py::arg("noise"), py::arg("ahead"), py::arg("every") = 1);
}

}  // namespace sysid::bindings
