// The extended-state observer: over whole logs, one sample at a time, and learning its noise.
#include "arrays.hpp"
#include "register.hpp"
#include "sysid/published/observer_em.hpp"

namespace sysid::bindings {

namespace {

using namespace sysid::lab;

template <int R, int C>
Mat<R, C> to_matrix(const Array& a, const char* name) {
    using RowMajor = Eigen::Matrix<double, R, C, Eigen::RowMajor>;
    return Eigen::Map<const RowMajor>(matrix(a, R, C, name));
}

template <int N>
Vec<N> to_vector(const Array& a, const char* name) {
    return Eigen::Map<const Vec<N>>(vector(a, N, name));
}

ObserverModel to_model(const Array& car, const std::array<bool, 5>& form, double dt,
                       bool inputs_held = true) {
    const double* c = vector(car, 5, "car");
    const ObserverCar believed{c[0], c[1], c[2], c[3], c[4]};
    const ObserverForm equations{form[0], form[1], form[2], form[3], form[4], inputs_held};
    return {believed, equations, dt};
}

ObserverNoise to_noise(const Array& process, const Array& sensors) {
    return {to_matrix<6, 6>(process, "process noise"), to_matrix<4, 4>(sensors, "sensor noise")};
}

ObserverStart to_start(const Array& mean, const Array& covariance, bool one_before) {
    return {
        to_vector<6>(mean, "start mean"),
        to_matrix<6, 6>(covariance, "start covariance"),
        one_before,
    };
}

ObserverInput to_input(const double* u) { return {u[0], u[1], u[2], u[3]}; }

ObserverLog to_log(const Array& car, const std::array<bool, 5>& form, double dt,
                   const Array& inputs, const Array& readings, const Array& mean,
                   const Array& covariance, bool one_before, bool inputs_held) {
    const auto n = inputs.ndim() == 2 ? inputs.shape(0) : 0;
    if (n < 2) throw std::invalid_argument("inputs: expected two samples or more");
    const double* u = matrix(inputs, n, 4, "inputs");
    const double* y = matrix(readings, n, 4, "readings");
    ObserverLog log{
        to_model(car, form, dt, inputs_held), {}, {}, to_start(mean, covariance, one_before)};
    for (py::ssize_t k = 0; k < n; ++k) {
        log.inputs.push_back(to_input(u + 4 * k));
        log.readings.emplace_back(Eigen::Map<const ObserverReading>(y + 4 * k));
    }
    return log;
}

template <int N>
NoiseStructure<N> to_structure(const std::array<int, N>& scale, const std::array<int, N>& block,
                               const Array& floor) {
    return {scale, block, to_vector<N>(floor, "floor")};
}

py::dict to_dict(const ObserverTrace& t) {
    py::dict out;
    out["log_likelihood"] = t.log_likelihood;
    out["state"] = copy_of(t.state, 6);
    out["covariance"] = copy_of(t.covariance, 36);
    out["reading"] = copy_of(t.reading, 4);
    out["reading_std"] = copy_of(t.reading_std, 4);
    out["innovation"] = copy_of(t.innovation, 4);
    out["innovation_std"] = copy_of(t.innovation_std, 4);
    return out;
}

py::dict to_dict(const ObserverEm& em) {
    py::dict out;
    out["process"] = to_array<6, 6>(em.noise.process);
    out["sensors"] = to_array<4, 4>(em.noise.sensors);
    out["log_likelihood"] = em.log_likelihood;
    out["converged"] = em.converged;
    out["shortened"] = em.shortened;
    out["fell"] = em.fell;
    out["leaps"] = em.leaps;
    return out;
}

}  // namespace

void register_lab_observer(py::module_& m) {
    py::class_<ObserverLog>(m, "ObserverLog")
        .def(py::init(&to_log), py::arg("car"), py::arg("form"), py::arg("dt"), py::arg("inputs"),
             py::arg("readings"), py::arg("mean"), py::arg("covariance"), py::arg("one_before"),
             py::arg("inputs_held"))
        .def_property_readonly("samples", &ObserverLog::size)
        .def(
            "log_likelihood",
            [](const ObserverLog& self, const Array& process, const Array& sensors) {
                const ObserverNoise noise = to_noise(process, sensors);
                return unlocked([&] { return log_likelihood(self, noise); });
            },
            py::arg("process"), py::arg("sensors"))
        .def(
            "trace",
            [](const ObserverLog& self, const Array& process, const Array& sensors, bool smoothed) {
                const ObserverNoise noise = to_noise(process, sensors);
                return to_dict(unlocked([&] { return trace(self, noise, smoothed); }));
            },
            py::arg("process"), py::arg("sensors"), py::arg("smoothed"));
    py::class_<Observer>(m, "Observer")
        .def(py::init([](const Array& car, const std::array<bool, 5>& form, double dt,
                         const Array& process, const Array& sensors, const Array& mean,
                         const Array& covariance, bool one_before) {
                 return Observer(to_model(car, form, dt), to_noise(process, sensors),
                                 to_start(mean, covariance, one_before));
             }),
             py::arg("car"), py::arg("form"), py::arg("dt"), py::arg("process"), py::arg("sensors"),
             py::arg("mean"), py::arg("covariance"), py::arg("one_before"))
        .def(
            "step",
            [](Observer& self, const Array& input, const Array& reading) {
                const double* u = vector(input, 4, "input");
                return to_array<6, 1>(self.step(to_input(u), to_vector<4>(reading, "reading")));
            },
            py::arg("input"), py::arg("reading"))
        .def_property_readonly(
            "covariance", [](const Observer& self) { return to_array<6, 6>(self.covariance()); })
        .def_property_readonly("log_likelihood", &Observer::log_likelihood);
    m.def(
        "observer_start",
        [](const Array& car, const Array& reading, const Array& sensors) {
            ObserverNoise noise;
            noise.sensors = to_matrix<4, 4>(sensors, "sensor noise");
            const auto start = ObserverStart::from_reading(to_vector<4>(reading, "reading"), noise,
                                                           to_model(car, {}, 1.0).car());
            return py::make_tuple(to_array<6, 1>(start.mean), to_array<6, 6>(start.covariance));
        },
        py::arg("car"), py::arg("reading"), py::arg("sensors"));
    m.def(
        "learn_observer_noise",
        [](const std::vector<const ObserverLog*>& several, const Array& process,
           const Array& sensors, const std::array<int, 6>& process_scale,
           const std::array<int, 6>& process_block, const Array& process_floor,
           const std::array<int, 4>& sensor_scale, const std::array<int, 4>& sensor_block,
           const Array& sensor_floor, int most_iterations, double tolerance, bool never_fall,
           bool accelerate) {
            if (several.empty()) throw std::invalid_argument("logs: expected one or more");
            std::vector<ObserverLog> logs;
            logs.reserve(several.size());
            for (const auto* log : several) {
                if (log == nullptr) throw std::invalid_argument("logs: expected no None");
                logs.push_back(*log);
            }
            const ObserverNoise start = to_noise(process, sensors);
            const auto q = to_structure<6>(process_scale, process_block, process_floor);
            const auto r = to_structure<4>(sensor_scale, sensor_block, sensor_floor);
            const EmOptions options{most_iterations, tolerance, never_fall, accelerate};
            const bool as_published = logs.at(0).model.form() == published_form();
            return to_dict(unlocked([&] {
                return as_published ? learn_as_published(logs, start, q, r, options)
                                    : learn(logs, start, q, r, options);
            }));
        },
        py::arg("logs"), py::arg("process"), py::arg("sensors"), py::arg("process_scale"),
        py::arg("process_block"), py::arg("process_floor"), py::arg("sensor_scale"),
        py::arg("sensor_block"), py::arg("sensor_floor"), py::arg("most_iterations"),
        py::arg("tolerance"), py::arg("never_fall"), py::arg("accelerate"));
}

}  // namespace sysid::bindings
