// The prediction errors of a problem, their derivatives, the noise score, filter and smoother.
#include "least_squares.hpp"
#include "register.hpp"
#include "sysid/identify/logwise.hpp"
#include "sysid/math/program.hpp"
#include "sysid/math/shift.hpp"

namespace sysid::bindings {

namespace {

void add_run(LogwiseProblem& logwise, double dt, const Array& inputs, const Array& measurements,
             double start, const std::string& name, const std::vector<double>& steer_before,
             const std::vector<double>& steer_after, const std::vector<double>& shift) {
    if (!shift.empty() && shift.size() != kParameterCount)
        throw std::invalid_argument("shift: expected one number for each parameter, or none");
    SingleTrack& model = logwise.shifted(shift).model;
    const auto n = inputs.ndim() == 2 ? inputs.shape(0) : 0;
    const py::ssize_t own = 2 + (model.loads_known ? 2 : 0) + (model.slope_known ? 2 : 0);
    const auto width =
        std::clamp<py::ssize_t>(inputs.ndim() == 2 ? inputs.shape(1) : 0, own, own + kUserChannels);
    const double* u = matrix(inputs, n, width, "inputs");
    const double* y = matrix(measurements, n, kChannels, "measurements");
    if (n < 2) throw std::invalid_argument("inputs: expected two samples or more");
    const std::string log = name.empty() ? "" : name + ", ";
    Run run;
    run.dt = step_of(dt);
    run.name = name;
    run.steer_before = steer_before;
    run.steer_after = steer_after;
    run.inputs.resize(static_cast<std::size_t>(n));
    run.measurements.resize(static_cast<std::size_t>(n));
    for (std::size_t k = 0; k < run.size(); ++k, u += width) {
        run.inputs[k] = {u[0], u[1], start + static_cast<double>(k) * dt};
        // Channels that the log lacks are no numbers, for whatever model should read them.
        auto& channels = run.inputs[k].channels;
        channels.fill(std::nan(""));
        std::copy(u + own, u + width, channels.begin());
        if (model.loads_known) {
            Axles<double>& most = model.most_n;
            run.inputs[k].loads_n = {u[2], u[3]};
            most = {std::max(most.front, u[2]), std::max(most.rear, u[3])};
        }
        if (model.slope_known) {
            run.inputs[k].gravity_x_mps2 = u[own - 2];
            run.inputs[k].gravity_y_mps2 = u[own - 1];
        }
        if (!std::all_of(u, u + own, [](double x) { return std::isfinite(x); }))
            throw std::invalid_argument(log + "inputs: not finite at sample " + std::to_string(k));
        run.measurements[k] = Eigen::Map<const Vec<kChannels>>(y + kChannels * k);
        if (run.measurements[k].array().isInf().any())
            throw std::invalid_argument(log + "measurements: infinite at sample " +
                                        std::to_string(k));
    }
    logwise.add(shift, std::move(run));
}

Noise to_noise(const Array& values) {
    const double* v = vector(values, kNoiseParameters, "noise");
    Noise noise;
    for (auto& s : noise.sensor) s = *v++;
    for (auto& s : noise.motion) s = *v++;
    for (auto& s : noise.disturbance) s = *v++;
    for (auto& s : noise.correlation_time_s) s = *v++;
    for (auto& s : noise.road) s = *v++;
    noise.road_time_s = *v++;
    for (auto& s : noise.colour) s = *v++;
    for (auto& s : noise.colour_time_s) s = *v++;
    return noise;
}

py::dict as_dict(const Trace& t) {
    py::dict out;
    out["innovation"] = copy_of(t.innovation, kChannels);
    out["spread"] = copy_of(t.spread, kChannels);
    out["whitened"] = copy_of(t.whitened, kChannels);
    out["state"] = copy_of(t.state, kStatesTold);
    out["state_std"] = copy_of(t.state_std, kStatesTold);
    out["log_density"] = row_of(t.log_density);
    out["log_likelihood"] = t.log_likelihood;
    return out;
}

const double* values_of(const Array& p) { return vector(p, kParameterCount, "parameters"); }

}  // namespace

void register_identify(py::module_& m) {
    m.attr("NOISE_PARAMETERS") = kNoiseParameters;
    m.attr("PARAMETERS") = kParameterCount;
    m.attr("TOLD_SAMPLES") = kToldSamples;
    m.attr("LANES") = kLanes;
    m.attr("SHIFT_REACH") = kShiftReach;
    m.attr("CHANNELS") = static_cast<int>(kChannels);
    m.attr("EXTERNALS") = static_cast<int>(kPushes);
    py::class_<LogwiseProblem> bound(m, "Problem");
    py::class_<LogwiseFilter>(m, "FrozenFilter")
        .def_readonly("log_likelihood", &LogwiseFilter::log_likelihood)
        .def_readonly("observed", &LogwiseFilter::observed);
    bind_least_squares<LogwiseFilter>(bound, kParameterCount, kChannels);
    bound
        .def(py::init([](const SingleTrack& model) { return LogwiseProblem(model); }),
             py::arg("model"))
        .def("add_run", &add_run, py::arg("dt"), py::arg("inputs"), py::arg("measurements"),
             py::arg("start") = 0.0, py::arg("name") = "",
             py::arg("steer_before") = std::vector<double>{},
             py::arg("steer_after") = std::vector<double>{},
             py::arg("shift") = std::vector<double>{})
        .def("with_model", &LogwiseProblem::with_model, py::arg("model"))
        .def_property_readonly("samples", &LogwiseProblem::samples)
        .def(
            "freeze",
            [](const LogwiseProblem& self, const Array& p, const Array& noise) {
                const double* values = values_of(p);
                const Noise n = to_noise(noise);
                return unlocked([&] { return freeze(self, values, n); });
            },
            py::arg("parameters"), py::arg("noise"))
        .def(
            "noise_score",
            [](const LogwiseProblem& self, const Array& p, const Array& noise) {
                const double* values = values_of(p);
                const Noise n = to_noise(noise);
                return with_derivatives(kNoiseParameters, [&](double* g, double* h) {
                    return noise_score(self, values, n, g, h);
                });
            },
            py::arg("parameters"), py::arg("noise"))
        .def(
            "filtered_noise_score",
            [](const LogwiseProblem& self, const Array& p, const LogwiseFilter& filter) {
                check_runs(self, filter);
                const double* values = values_of(p);
                return with_derivatives(kNoiseParameters, [&](double* g, double* h) {
                    return noise_score(self, values, filter, g, h);
                });
            },
            py::arg("parameters"), py::arg("filter"))
        .def(
            "log_likelihoods",
            [](const LogwiseProblem& self, const Array& sets, const Array& noise) {
                const auto count = sets.ndim() == 2 ? sets.shape(0) : 0;
                const double* values = matrix(sets, count, kParameterCount, "parameters");
                const Noise n = to_noise(noise);
                std::vector<const double*> each;
                each.reserve(static_cast<std::size_t>(count));
                for (py::ssize_t i = 0; i < count; ++i)
                    each.push_back(values + i * kParameterCount);
                std::vector<double> out(each.size());
                unlocked([&] { log_likelihoods(self, each, n, out.data()); });
                return row_of(out);
            },
            py::arg("parameters"), py::arg("noise"))
        .def(
            "signal_sensitivities",
            [](const LogwiseProblem& self, const Array& p, const LogwiseFilter& filter,
               const Array& signals, const std::vector<int>& targets) {
                check_runs(self, filter);
                check_numbers(targets, kPushes + kChannels, "targets");
                const double* values = values_of(p);
                const double* s = matrix(signals, static_cast<py::ssize_t>(self.samples()),
                                         static_cast<py::ssize_t>(targets.size()), "signals");
                return filled(self.samples() * kChannels, targets.size(), [&](double* to) {
                    signal_sensitivities(self, values, filter, s, targets, to);
                });
            },
            py::arg("parameters"), py::arg("filter"), py::arg("signals"), py::arg("targets"))
        .def(
            "trace",
            [](const LogwiseProblem& self, const Array& p, const Array& noise, bool smoothed) {
                const double* values = values_of(p);
                const Noise n = to_noise(noise);
                return as_dict(unlocked([&] { return trace(self, values, n, smoothed); }));
            },
            py::arg("parameters"), py::arg("noise"), py::arg("smoothed"))
        .def(
            "filtered_trace",
            [](const LogwiseProblem& self, const Array& p, const LogwiseFilter& filter) {
                check_runs(self, filter);
                const double* values = values_of(p);
                return as_dict(unlocked([&] { return trace(self, values, filter); }));
            },
            py::arg("parameters"), py::arg("filter"))
        .def(
            "smoothed_means",
            [](const LogwiseProblem& self, const Array& p, const Array& noise) {
                const double* values = values_of(p);
                const Noise n = to_noise(noise);
                return filled(self.samples(), kStatesTold,
                              [&](double* to) { smoothed_means(self, values, n, to); });
            },
            py::arg("parameters"), py::arg("noise"))
        .def(
            "filtered_smoothed_means",
            [](const LogwiseProblem& self, const Array& p, const LogwiseFilter& filter) {
                check_runs(self, filter);
                const double* values = values_of(p);
                return filled(self.samples(), kStatesTold,
                              [&](double* to) { smoothed_means(self, values, filter, to); });
            },
            py::arg("parameters"), py::arg("filter"))
        .def(
            "look_ahead",
            [](const LogwiseProblem& self, const Array& p, const Array& noise,
               const std::vector<std::pair<std::size_t, std::size_t>>& horizons, bool readings,
               const std::optional<Array>& road) {
                const double* values = values_of(p);
                const Noise n = to_noise(noise);
                std::vector<Horizon> asked;
                asked.reserve(horizons.size());
                for (const auto& [ahead, every] : horizons) asked.push_back({ahead, every});
                const auto samples = static_cast<py::ssize_t>(self.samples());
                const double* slopes = road ? matrix(*road, samples, 2, "road") : nullptr;
                Array found = filled(asked.size() * self.samples(), kChannels, [&](double* to) {
                    look_ahead(self, values, n, asked, to, readings, slopes);
                });
                return found.reshape({asked.size(), self.samples(), std::size_t{kChannels}});
            },
            py::arg("parameters"), py::arg("noise"), py::arg("horizons"),
            py::arg("readings") = false, py::arg("road") = py::none())
        .def(
            "free_run",
            [](const LogwiseProblem& self, const Array& p) {
                const double* values = values_of(p);
                return filled(self.samples(), kChannels,
                              [&](double* to) { free_run(self, values, to); });
            },
            py::arg("parameters"));
}

}  // namespace sysid::bindings
