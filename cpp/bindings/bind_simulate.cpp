#include "arrays.hpp"
#include "register.hpp"
#include "sysid/simulate/simulator.hpp"

namespace sysid::bindings {

void check_driver(const Driver& d, double dt) {
    for (const double limit : {d.steer_limit_rad, d.steer_rate_limit_radps, d.drive_limit_n,
                               d.brake_limit_n, d.power_limit_w, d.force_rate_limit_nps})
        if (!(limit >= 0.0)) throw std::invalid_argument("driver: no limit may be negative");
    const bool possible = d.reaction_s >= 0.0 && d.reaction_s < dt * 1e9;
    if (!possible) throw std::invalid_argument("driver: reaction_s must not be negative");
}

void register_simulate(py::module_& m) {
    py::class_<Driver>(m, "Driver")
        .def(py::init<>())
        .def_readwrite("reaction_s", &Driver::reaction_s)
        .def_readwrite("yaw_rate_gain", &Driver::yaw_rate_gain)
        .def_readwrite("yaw_rate_integral_ps", &Driver::yaw_rate_integral_ps)
        .def_readwrite("understeer_radps2pm", &Driver::understeer_radps2pm)
        .def_readwrite("speed_gain_ps", &Driver::speed_gain_ps)
        .def_readwrite("steer_limit_rad", &Driver::steer_limit_rad)
        .def_readwrite("steer_rate_limit_radps", &Driver::steer_rate_limit_radps)
        .def_readwrite("drive_limit_n", &Driver::drive_limit_n)
        .def_readwrite("brake_limit_n", &Driver::brake_limit_n)
        .def_readwrite("power_limit_w", &Driver::power_limit_w)
        .def_readwrite("force_rate_limit_nps", &Driver::force_rate_limit_nps)
        .def_readwrite("tracks_path", &Driver::tracks_path);
    m.def(
        "simulate",
        [](const SingleTrack& model, const Array& p, double dt, const Array& references,
           const Driver& driver, const Array& disturbance, double initial_speed, double initial_vy,
           double initial_yaw_rate, double initial_steer, double start, const Array& channels) {
            const auto n = references.ndim() == 2 ? references.shape(0) : 0;
            if (n < 2) throw std::invalid_argument("references: expected two samples or more");
            const double* r = matrix(references, n, 3, "references");
            const double* values = vector(p, kParameterCount, "parameters");
            const double* d = matrix(disturbance, n, 3, "disturbance");
            std::vector<Reference> wanted(static_cast<std::size_t>(n));
            for (auto& w : wanted) {
                w = {r[0], r[1], r[2]};
                r += 3;
            }
            const py::ssize_t width = channels.ndim() == 2 ? channels.shape(1) : 0;
            if (width > static_cast<py::ssize_t>(kUserChannels))
                throw std::invalid_argument("channels: there are more than there is room for");
            const Logged logged{width > 0 ? matrix(channels, n, width, "channels") : nullptr,
                                static_cast<std::size_t>(width)};
            check_driver(driver, step_of(dt));
            const Beginning beginning{
                initial_speed, initial_vy, initial_yaw_rate, initial_steer, start,
            };
            const Drive drive = unlocked(
                [&] { return simulate(model, values, dt, wanted, driver, d, beginning, logged); });
            return py::make_tuple(copy_of(drive.inputs, 2), copy_of(drive.states, kModelStates),
                                  copy_of(drive.outputs, kChannels), drive.lost_at);
        },
        py::arg("model"), py::arg("parameters"), py::arg("dt"), py::arg("references"),
        py::arg("driver"), py::arg("disturbance"), py::arg("initial_speed"),
        py::arg("initial_vy") = 0.0, py::arg("initial_yaw_rate") = 0.0,
        py::arg("initial_steer") = 0.0, py::arg("start") = 0.0, py::arg("channels") = Array());
}

}  // namespace sysid::bindings
