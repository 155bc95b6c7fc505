#include <algorithm>
#include <limits>

#include "arrays.hpp"
#include "fields.hpp"
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

std::vector<Reference> references_of(const Array& array) {
    const auto n = array.ndim() == 2 ? array.shape(0) : 0;
    if (n < 2) throw std::invalid_argument("references: expected two samples or more");
    const double* r = matrix(array, n, 3, "references");
    std::vector<Reference> wanted(static_cast<std::size_t>(n));
    for (auto& w : wanted) {
        w = {r[0], r[1], r[2]};
        r += 3;
    }
    return wanted;
}

void register_simulate(py::module_& m) {
    fields(py::class_<Driver>(m, "Driver").def(py::init<>()), SYSID_FIELD(Driver, reaction_s),
           SYSID_FIELD(Driver, yaw_rate_gain), SYSID_FIELD(Driver, yaw_rate_integral_ps),
           SYSID_FIELD(Driver, understeer_radps2pm), SYSID_FIELD(Driver, speed_gain_ps),
           SYSID_FIELD(Driver, steer_limit_rad), SYSID_FIELD(Driver, steer_rate_limit_radps),
           SYSID_FIELD(Driver, drive_limit_n), SYSID_FIELD(Driver, brake_limit_n),
           SYSID_FIELD(Driver, power_limit_w), SYSID_FIELD(Driver, force_rate_limit_nps),
           SYSID_FIELD(Driver, tracks_path));
    m.def(
        "simulate",
        [](const SingleTrack& model, const Array& p, double dt, const Array& references,
           const Driver& driver, const Array& disturbance, double initial_speed, double initial_vy,
           double initial_yaw_rate, double initial_steer, double start, const Array& channels,
           double farthest_m) {
            const std::vector<Reference> wanted = references_of(references);
            const auto n = references.shape(0);
            const double* values = vector(p, kParameterCount, "parameters");
            const bool slopes = disturbance.ndim() == 2 && disturbance.shape(1) == kPushes;
            const py::ssize_t wide = slopes ? kPushes : 3;
            const double* d = matrix(disturbance, n, wide, "disturbance");
            std::vector<double> external(static_cast<std::size_t>(n * kPushes));
            for (py::ssize_t k = 0; k < n; ++k)
                std::copy_n(d + k * wide, wide, external.begin() + k * kPushes);
            const py::ssize_t width = channels.ndim() == 2 ? channels.shape(1) : 0;
            if (width > static_cast<py::ssize_t>(kUserChannels))
                throw std::invalid_argument("channels: there are more than there is room for");
            const Logged logged{width > 0 ? matrix(channels, n, width, "channels") : nullptr,
                                static_cast<std::size_t>(width)};
            check_driver(driver, step_of(dt));
            const Beginning beginning{
                initial_speed, initial_vy, initial_yaw_rate, initial_steer, start,
            };
            const Drive drive = unlocked([&] {
                return simulate(model, values, dt, wanted, driver, external.data(), beginning,
                                logged, farthest_m);
            });
            return py::make_tuple(copy_of(drive.inputs, 2), copy_of(drive.states, kModelStates),
                                  copy_of(drive.outputs, kChannels), drive.lost_at);
        },
        py::arg("model"), py::arg("parameters"), py::arg("dt"), py::arg("references"),
        py::arg("driver"), py::arg("disturbance"), py::arg("initial_speed"),
        py::arg("initial_vy") = 0.0, py::arg("initial_yaw_rate") = 0.0,
        py::arg("initial_steer") = 0.0, py::arg("start") = 0.0, py::arg("channels") = Array(),
        py::arg("farthest_m") = std::numeric_limits<double>::infinity());
}

}  // namespace sysid::bindings
