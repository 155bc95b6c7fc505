// The closed loop: its settings as plain classes, and the run.
#include "arrays.hpp"
#include "fields.hpp"
#include "register.hpp"
#include "sysid/lab/closed_loop.hpp"

namespace sysid::bindings {

namespace {

constexpr int kMostSteps = 1000;  // of Runge-Kutta in a sample

/// Everything but the references, the noise and the model.
struct LabLoop {
    lab::LoopData loop;
    lab::LoopObserverData observer;
    lab::PlantOptions plant;
    double gravity_mps2 = kGravity;
};

void set_sensors(LabLoop& s, const Array& values) {
    const double* row = matrix(values, lab::kSensorCount, 4, "sensors");
    for (lab::SensorData& sensor : s.loop.sensors) {
        const bool late = row[2] >= 0.0 && std::isfinite(row[2]);
        if (!late) throw std::invalid_argument("sensors: a delay is negative or no number");
        sensor = {row[0], row[1], row[2], row[3]};
        row += 4;
    }
}

void set_noise(LabLoop& s, const Array& process, const Array& sensors) {
    using Process = Eigen::Matrix<double, 6, 6, Eigen::RowMajor>;
    using Sensors = Eigen::Matrix<double, 4, 4, Eigen::RowMajor>;
    s.observer.noise.process = Eigen::Map<const Process>(matrix(process, 6, 6, "process"));
    s.observer.noise.sensors = Eigen::Map<const Sensors>(matrix(sensors, 4, 4, "sensors"));
}

void set_track(LabLoop& s, const Array& points, double metres, double seconds) {
    const auto n = points.ndim() == 2 ? points.shape(0) : 0;
    const double* p = matrix(points, n, 2, "points");
    s.loop.track = {{}, metres, seconds};
    for (py::ssize_t i = 0; i < n; ++i) s.loop.track.points.push_back({p[2 * i], p[2 * i + 1]});
}

void set_actuator(lab::Actuator& actuator, const std::array<double, 4>& v) {
    if (!(v[0] <= v[1])) throw std::invalid_argument("actuator: limits are not in their order");
    actuator = {v[0], v[1], v[2], v[3]};
}

py::dict run(const LabLoop& settings, const SingleTrack& model, const Array& parameters,
             const Array& wanted, const Array& normal, const Array& external) {
    const auto n = wanted.ndim() == 2 ? wanted.shape(0) : 0;
    if (n < 2) throw std::invalid_argument("wanted: expected two samples or more");
    const double* w = matrix(wanted, n, 5, "wanted");
    const double* values = vector(parameters, kParameterCount, "parameters");
    const double* noise = matrix(normal, n, lab::kSensorCount, "normal");
    const double* outside = matrix(external, n, 3, "external");
    step_of(settings.loop.dt);
    if (settings.loop.steer_by == lab::SteerBy::kTrack && settings.loop.track.points.size() < 3)
        throw std::invalid_argument("track: expected three points or more");
    std::vector<lab::Wanted> references(static_cast<std::size_t>(n));
    for (lab::Wanted& r : references) {
        r = {w[0], w[1], w[2], w[3], w[4]};
        w += 5;
    }
    if (steer_delay(model, values) < 0.0)
        throw std::invalid_argument(
            "steer_delay.delay_s: below zero it is of a log, and the loop has none; give 0 or "
            "more");
    SingleTrack car = model;
    car.car.gravity_mps2 = settings.gravity_mps2;
    const lab::LoopRecord record = unlocked([&] {
        const lab::Plant plant(car, values, settings.plant);
        return lab::run_closed_loop(settings.loop, plant, settings.observer, references, noise,
                                    outside);
    });
    py::dict out;
    out["truth"] = copy_of(record.truth, lab::LoopRecord::kTruths);
    out["sensed"] = copy_of(record.sensed, lab::kSensorCount);
    out["estimate"] = copy_of(record.estimate, lab::kEstimated);
    out["reference"] = copy_of(record.reference, lab::LoopRecord::kReferences);
    out["inputs"] = copy_of(record.inputs, lab::LoopRecord::kInputs);
    out["limits"] = py::array_t<std::uint32_t>(static_cast<py::ssize_t>(record.limits.size()),
                                               record.limits.data());
    out["lost_at"] = record.lost_at;
    return out;
}

}  // namespace

void register_lab_loop(py::module_& m) {
    using lab::AdrcData;
    using lab::NominalCar;
    fields(py::class_<NominalCar>(m, "LabCar"), SYSID_FIELD(NominalCar, mass_kg),
           SYSID_FIELD(NominalCar, yaw_inertia_kgm2), SYSID_FIELD(NominalCar, lf_m),
           SYSID_FIELD(NominalCar, lr_m), SYSID_FIELD(NominalCar, cg_height_m),
           SYSID_FIELD(NominalCar, gravity_mps2), SYSID_FIELD(NominalCar, drag_nspm),
           SYSID_FIELD(NominalCar, stiffness_front), SYSID_FIELD(NominalCar, stiffness_rear));
    fields(py::class_<AdrcData>(m, "LabController"), SYSID_FIELD(AdrcData, speed_gain_ps),
           SYSID_FIELD(AdrcData, yaw_rate_gain_ps), SYSID_FIELD(AdrcData, heading_gain_ps),
           SYSID_FIELD(AdrcData, yaw_rate_limit_radps),
           SYSID_FIELD(AdrcData, yaw_acceleration_limit_radps2),
           SYSID_FIELD(AdrcData, lateral_limit_mps2), SYSID_FIELD(AdrcData, slip_limit_rad),
           SYSID_FIELD(AdrcData, rear_slip_limit_rad), SYSID_FIELD(AdrcData, rear_slip_gain_ps),
           SYSID_FIELD(AdrcData, brakes_from_mps2), SYSID_FIELD(AdrcData, feed_forward),
           SYSID_FIELD(AdrcData, coupling), SYSID_FIELD(AdrcData, lowest_speed_mps),
           SYSID_FIELD(AdrcData, added_speed_mps));
    py::class_<LabLoop>(m, "LabLoop")
        .def(py::init<>())
        .def_property_readonly("car", [](LabLoop& s) { return &s.loop.car; })
        .def_property_readonly("controller", [](LabLoop& s) { return &s.loop.controller; })
        .def(
            "set_force",
            [](LabLoop& s, const std::array<double, 4>& v) { set_actuator(s.loop.force, v); },
            py::arg("least_most_rate_lag"))
        .def(
            "set_steer",
            [](LabLoop& s, const std::array<double, 4>& v) { set_actuator(s.loop.steer, v); },
            py::arg("least_most_rate_lag"))
        .def("set_sensors", &set_sensors, py::arg("sensors"))
        .def("set_noise", &set_noise, py::arg("process"), py::arg("sensors"))
        .def("set_track", &set_track, py::arg("points"), py::arg("metres"), py::arg("seconds"))
        .def(
            "set_observer_form",
            [](LabLoop& s, const std::array<bool, 5>& form) {
                s.observer.form = {form[0], form[1], form[2], form[3], form[4]};
            },
            py::arg("form"))
        .def_property(
            "steer_by", [](const LabLoop& s) { return static_cast<int>(s.loop.steer_by); },
            [](LabLoop& s, int v) {
                if (v < 0 || v > static_cast<int>(lab::SteerBy::kAngle))
                    throw std::invalid_argument("steer_by: there is no such way to steer");
                s.loop.steer_by = static_cast<lab::SteerBy>(v);
            })
        .def_property(
            "dt", [](const LabLoop& s) { return s.loop.dt; },
            [](LabLoop& s, double v) { s.loop.dt = v; })
        .def(
            "set_start",
            [](LabLoop& s, double speed_mps, double x_m, double y_m) {
                s.loop.first_speed_mps = s.observer.first_speed_mps = speed_mps;
                s.loop.first_x_m = x_m;
                s.loop.first_y_m = y_m;
            },
            py::arg("speed_mps"), py::arg("x_m"), py::arg("y_m"))
        .def(
            "set_ways",
            [](LabLoop& s, double pose_gain, bool load_sensors, bool late_feedback,
               double first_late_load_n, bool certain_start, bool inputs_linear) {
                s.loop.pose_gain = pose_gain;
                s.loop.load_sensors = load_sensors;
                s.loop.late_feedback = late_feedback;
                s.loop.first_late_load_n = first_late_load_n;
                s.observer.certain_start = certain_start;
                s.loop.inputs_linear = inputs_linear;
            },
            py::arg("pose_gain"), py::arg("load_sensors"), py::arg("late_feedback"),
            py::arg("first_late_load_n"), py::arg("certain_start"), py::arg("inputs_linear"))
        .def(
            "set_plant",
            [](LabLoop& s, double load_share, bool late_loads, bool air_speed_of_both, int steps,
               double tolerance, double gravity_mps2) {
                if (steps < 0 || steps > kMostSteps)
                    throw std::invalid_argument("steps: expected 0 to " +
                                                std::to_string(kMostSteps));
                s.plant = {load_share, late_loads, air_speed_of_both, steps, tolerance};
                s.gravity_mps2 = gravity_mps2;
            },
            py::arg("load_share"), py::arg("late_loads"), py::arg("air_speed_of_both"),
            py::arg("steps"), py::arg("tolerance"), py::arg("gravity_mps2"))
        .def("run", &run, py::arg("model"), py::arg("parameters"), py::arg("wanted"),
             py::arg("normal"), py::arg("external"));
}

}  // namespace sysid::bindings
