// The twin: car, tyres, loads, observer loops.
#include <cmath>

#include "arrays.hpp"
#include "fields.hpp"
#include "register.hpp"
#include "sysid/published/double_track.hpp"
#include "sysid/twin/drive14.hpp"
#include "sysid/twin/observer.hpp"

namespace sysid::bindings {

namespace {

const Input14* inputs_of(const Array& a) {
    return reinterpret_cast<const Input14*>(
        matrix(a, a.ndim() == 2 ? a.shape(0) : 0, kTwinInputs, "inputs"));
}

const Input14& input_of(const Array& a) {
    return *reinterpret_cast<const Input14*>(matrix(a, 1, kTwinInputs, "input"));
}

/// A place that crossed as a number.
std::size_t place(double value, std::size_t size, const std::string& what) {
    // Asked so that what is no number is refused before it is cast.
    const bool there =
        value >= 0.0 && value < static_cast<double>(size) && value == std::floor(value);
    if (!there)
        throw std::invalid_argument(what + " " + std::to_string(value) +
                                    " is not a whole number from 0 to " + std::to_string(size - 1));
    return static_cast<std::size_t>(value);
}

/// Readings of car and twin for laws that need so many.
const double* readings(const Array& a, std::size_t least, const char* name) {
    if (a.ndim() != 1 || a.size() < static_cast<py::ssize_t>(least))
        throw std::invalid_argument(std::string(name) + ": expected " + std::to_string(least) +
                                    " values or more, got " + std::to_string(a.size()));
    return a.data();
}

State14 state_of(const Array& a) {
    const double* x = vector(a, kTwinStatesWithTyres, "state");
    State14 state;
    std::copy(x, x + kTwinStatesWithTyres, state.begin());
    return state;
}

void register_data(py::module_& m) {
    py::class_<TyreData> tyre(m, "TwinTyre");
    tyre.def(py::init<>());
    fields(tyre, SYSID_FIELD(TyreData, nominal_load_n), SYSID_FIELD(TyreData, friction_x),
           SYSID_FIELD(TyreData, friction_y), SYSID_FIELD(TyreData, friction_slope),
           SYSID_FIELD(TyreData, slip_stiffness), SYSID_FIELD(TyreData, cornering_stiffness),
           SYSID_FIELD(TyreData, load_at_peak_stiffness), SYSID_FIELD(TyreData, shape),
           SYSID_FIELD(TyreData, curvature), SYSID_FIELD(TyreData, relaxation_m));
    py::class_<AxleData> axle(m, "TwinAxle");
    axle.def(py::init<>());
    fields(axle, SYSID_FIELD(AxleData, track_m), SYSID_FIELD(AxleData, spring_npm),
           SYSID_FIELD(AxleData, bump_damping_nspm), SYSID_FIELD(AxleData, rebound_damping_nspm),
           SYSID_FIELD(AxleData, anti_roll_npm), SYSID_FIELD(AxleData, travel_m),
           SYSID_FIELD(AxleData, stop_npm), SYSID_FIELD(AxleData, roll_centre_m),
           SYSID_FIELD(AxleData, anti_slope), SYSID_FIELD(AxleData, unsprung_kg),
           SYSID_FIELD(AxleData, tyre_npm), SYSID_FIELD(AxleData, tyre_damping_nspm),
           SYSID_FIELD(AxleData, radius_m), SYSID_FIELD(AxleData, wheel_inertia_kgm2),
           SYSID_FIELD(AxleData, rolling_resistance), SYSID_FIELD(AxleData, lift_area_m2),
           SYSID_FIELD(AxleData, tyre));
    py::class_<CarData> car(m, "TwinCar");
    car.def(py::init<>());
    fields(car, SYSID_FIELD(CarData, wheelbase_m), SYSID_FIELD(CarData, drag_area_m2),
           SYSID_FIELD(CarData, air_density_kgpm3), SYSID_FIELD(CarData, front),
           SYSID_FIELD(CarData, rear));
    car.def_property(
        "design", [](const CarData& c) { return to_vector(c.design); },
        [](CarData& c, const LoadVector& v) { c.design = to_load(v); });
    m.def("loaded",
          [](const LoadVector& car_load, const std::vector<std::array<double, 4>>& masses) {
              std::vector<PointMass> points;
              points.reserve(masses.size());
              for (const auto& p : masses) points.push_back({p[0], p[1], p[2], p[3]});
              return to_vector(loaded(to_load(car_load), points));
          });
}

void register_vehicle(py::module_& m) {
    py::class_<Vehicle14>(m, "Vehicle14")
        .def(py::init([](const CarData& car, const LoadVector& load) {
                 return Vehicle14(car, to_load(load));
             }),
             py::arg("car"), py::arg("load"))
        .def_property(
            "load", [](const Vehicle14& v) { return to_vector(v.load()); },
            [](Vehicle14& v, const LoadVector& load) { v.set_load(to_load(load)); })
        .def(
            "rest", [](const Vehicle14& v, double vx) { return row_of(v.rest(vx)); }, py::arg("vx"))
        .def(
            "evaluate",
            [](const Vehicle14& v, const Array& x, const Array& u) {
                State14 rate;
                Output14 out;
                v.evaluate(state_of(x), input_of(u), rate, &out);
                return py::make_tuple(row_of(rate), row_of(out));
            },
            py::arg("state"), py::arg("input"))
        .def(
            "step",
            [](const Vehicle14& v, const Array& x, const Array& u, double dt) {
                State14 state = state_of(x);
                v.step(state, input_of(u), step_of(dt));
                return row_of(state);
            },
            py::arg("state"), py::arg("input"), py::arg("dt"))
        .def(
            "energy",
            [](const Vehicle14& v, const Array& x, const Array& u) {
                return v.energy(state_of(x), input_of(u));
            },
            py::arg("state"), py::arg("input"))
        .def(
            "simulate",
            [](const Vehicle14& v, const Array& start, const Array& inputs, double dt) {
                State14 x = state_of(start);
                const Input14* u = inputs_of(inputs);
                const auto n = static_cast<std::size_t>(inputs.shape(0));
                step_of(dt);
                Array states = empty(n, kTwinStates), outputs = empty(n, kTwinOutputs);
                double *to_states = states.mutable_data(), *to_outputs = outputs.mutable_data();
                unlocked([&] { simulate14(v, x, u, n, dt, to_states, to_outputs); });
                return py::make_tuple(states, outputs, row_of(x));
            },
            py::arg("start"), py::arg("inputs"), py::arg("dt"))
        .def(
            "drive",
            [](const Vehicle14& v, const Driver& driver, const std::array<double, 2>& pedals,
               const Array& references, const Array& base, double dt) {
                const std::vector<Reference> wanted = references_of(references);
                const Input14* u = inputs_of(base);
                if (base.shape(0) != references.shape(0))
                    throw std::invalid_argument("base: as long as references");
                check_driver(driver, step_of(dt));
                const Drive14 out = unlocked(
                    [&] { return drive14(v, driver, {pedals[0], pedals[1]}, wanted, u, dt); });
                return py::make_tuple(copy_of(out.inputs, kTwinInputs),
                                      copy_of(out.states, kTwinStates),
                                      copy_of(out.outputs, kTwinOutputs), out.lost_at);
            },
            py::arg("driver"), py::arg("pedals"), py::arg("references"), py::arg("base"),
            py::arg("dt"));
}

void register_laws(py::module_& m) {
    py::class_<ParameterLaw> law(m, "ParameterLaw");
    law.def(py::init<>())
        .def_property(
            "by_gradient", [](const ParameterLaw& l) { return l.kind == LawKind::kGradient; },
            [](ParameterLaw& l, bool yes) { l.kind = yes ? LawKind::kGradient : LawKind::kSign; })
        .def_property(
            "sign_measured", [](const ParameterLaw& l) { return l.sign == SignSource::kMeasured; },
            [](ParameterLaw& l, bool yes) {
                l.sign = yes ? SignSource::kMeasured : SignSource::kTwin;
            });
    fields(law, SYSID_FIELD(ParameterLaw, parameter), SYSID_FIELD(ParameterLaw, channel),
           SYSID_FIELD(ParameterLaw, differentiate), SYSID_FIELD(ParameterLaw, published_sign),
           SYSID_FIELD(ParameterLaw, gain), SYSID_FIELD(ParameterLaw, first_gain),
           SYSID_FIELD(ParameterLaw, first_gain_s), SYSID_FIELD(ParameterLaw, deadband),
           SYSID_FIELD(ParameterLaw, floor), SYSID_FIELD(ParameterLaw, averaging_s),
           SYSID_FIELD(ParameterLaw, lower), SYSID_FIELD(ParameterLaw, upper),
           SYSID_FIELD(ParameterLaw, yaw_rate_below_radps),
           SYSID_FIELD(ParameterLaw, yaw_rate_above_radps), SYSID_FIELD(ParameterLaw, stage));
    py::class_<ParameterLaws>(m, "ParameterLaws")
        .def(py::init([](std::vector<ParameterLaw> laws, double dt, std::size_t yaw_rate_channel,
                         double derivative_hz, const std::array<double, 3>& schedule) {
                 return ParameterLaws(std::move(laws), dt, yaw_rate_channel, derivative_hz,
                                      {schedule[0], schedule[1], schedule[2]});
             }),
             py::arg("laws"), py::arg("dt"), py::arg("yaw_rate_channel"), py::arg("derivative_hz"),
             py::arg("schedule"))
        .def(
            "update",
            [](ParameterLaws& laws, const Array& car, const Array& twin, Estimates parameters) {
                const std::size_t n = laws.readings();
                laws.update(readings(car, n, "car"), readings(twin, n, "twin"), parameters);
                return parameters;
            },
            py::arg("car"), py::arg("twin"), py::arg("parameters"))
        .def_property_readonly("stage", &ParameterLaws::stage);
    py::class_<BatchEstimator>(m, "BatchEstimator")
        .def(py::init([](const std::vector<std::array<double, 7>>& parameters,
                         const std::vector<std::array<double, 3>>& channels, double dt,
                         const std::array<double, 5>& s) {
                 std::vector<BatchParameter> ps;
                 ps.reserve(parameters.size());
                 for (const auto& p : parameters)
                     ps.push_back({
                         static_cast<int>(place(p[0], kEstimates, "batch: parameter")),
                         p[1],
                         p[2],
                         p[3],
                         p[4],
                         p[5],
                         p[6] == 1.0,
                         p[6] == 2.0,
                     });
                 std::vector<BatchChannel> cs;
                 cs.reserve(channels.size());
                 for (const auto& c : channels)
                     cs.push_back({place(c[0], kMostReadings, "batch: reading"), c[1], c[2]});
                 return BatchEstimator(std::move(ps), std::move(cs), dt,
                                       {s[0], s[1], s[2], s[3], s[4]});
             }),
             py::arg("parameters"), py::arg("channels"), py::arg("dt"), py::arg("settings"))
        .def("of_twin", &BatchEstimator::of_twin, py::arg("which"), py::arg("estimate"))
        .def(
            "update",
            [](BatchEstimator& batch, const Array& car, const Array& twins, Estimates estimate) {
                readings(car, batch.readings(), "car");
                const auto n = static_cast<std::size_t>(car.size());
                const double* y = matrix(twins, static_cast<py::ssize_t>(batch.twins()),
                                         static_cast<py::ssize_t>(n), "twins");
                const Eigen::VectorXd moved = batch.update(vector(car, n, "car"), y, n, estimate);
                return py::make_tuple(estimate, row_of(moved));
            },
            py::arg("car"), py::arg("twins"), py::arg("estimate"))
        .def_property_readonly("spread",
                               [](const BatchEstimator& batch) { return row_of(batch.spread()); });
}

void register_observers(py::module_& m) {
    m.def(
        "observe14",
        [](const Vehicle14& twin, const Array& start, const Array& inputs, const Array& measured,
           double dt, const std::vector<std::array<double, 4>>& gains,
           const std::optional<ParameterLaws>& laws, const std::optional<BatchEstimator>& batch,
           std::size_t stride, const std::vector<std::size_t>& scaled,
           const std::vector<std::array<double, 3>>& starts) {
            const Input14* u = inputs_of(inputs);
            const auto n = inputs.shape(0);
            const double* y = matrix(measured, n, kReadings, "measured");
            TwinObserverSettings settings{{}, laws, batch, stride, scaled, {}};
            const std::size_t twins = batch ? batch->twins() : 1;
            for (const auto& s : starts)
                settings.starts.push_back({
                    place(s[0], twins, "starts: twin"),
                    place(s[1], kTwinStatesWithTyres, "starts: state"),
                    s[2],
                });
            for (const auto& g : gains)
                settings.gains.push_back({
                    place(g[0], kReadings, "gains: reading"),
                    place(g[1], kTwinStatesWithTyres, "gains: state"),
                    g[2],
                    g[3] != 0.0,
                });
            const State14 x = state_of(start);
            const Observation seen = unlocked([&] {
                return observe14(twin, x, u, y, static_cast<std::size_t>(n), dt,
                                 std::move(settings));
            });
            return py::make_tuple(copy_of(seen.loads, kEstimates),
                                  copy_of(seen.readings, kTwinOutputs), seen.stages, seen.spread);
        },
        py::arg("twin"), py::arg("start"), py::arg("inputs"), py::arg("measured"), py::arg("dt"),
        py::arg("gains"), py::arg("laws"), py::arg("batch"), py::arg("stride"), py::arg("scaled"),
        py::arg("starts"));
    m.def(
        "observe_double_track",
        [](const std::array<double, 10>& car, const std::array<double, 8>& front,
           const std::array<double, 8>& rear, const std::array<double, 7>& gains,
           const std::array<double, 4>& start, const Array& inputs, const Array& measured,
           double dt, bool published_sign) {
            const auto pair = [](const std::array<double, 8>& t) {
                return PacejkaPair{t[0], t[1], t[2], t[3], t[4], t[5], t[6], t[7]};
            };
            const DoubleTrackData data{
                car[0], car[1], car[2], car[3], car[4],      car[5],
                car[6], car[7], car[8], car[9], pair(front), pair(rear),
            };
            const DoubleTrackGains k{
                gains[0], gains[1],       gains[2], gains[3],
                gains[4], published_sign, gains[5], gains[6],
            };
            if (!(k.lowest_mass_kg <= k.highest_mass_kg))
                throw std::invalid_argument("gains: limits of the mass are not in their order");
            const Input14* u = inputs_of(inputs);
            const auto n = inputs.shape(0);
            const double* y = matrix(measured, n, kReadings, "measured");
            return copy_of(unlocked([&] {
                               return observe_double_track(
                                   data, k, start, u, y, static_cast<std::size_t>(n), step_of(dt));
                           }),
                           4);
        },
        py::arg("car"), py::arg("front"), py::arg("rear"), py::arg("gains"), py::arg("start"),
        py::arg("inputs"), py::arg("measured"), py::arg("dt"), py::arg("published_sign"));
}

}  // namespace

void register_twin(py::module_& m) {
    m.attr("TWIN_ESTIMATES") = kEstimates;
    register_data(m);
    register_vehicle(m);
    register_laws(m);
    register_observers(m);
}

}  // namespace sysid::bindings
