// Sideslip observers, a sample at a time and over a whole log, and the recursive least squares of
// the cornering stiffness.
#include "arrays.hpp"
#include "register.hpp"
#include "stateful.hpp"
#include "sysid/online/cornering_rls.hpp"
#include "sysid/online/sideslip_dual.hpp"
#include "sysid/online/sideslip_ukf.hpp"
#include "sysid/published/sideslip_observer.hpp"

namespace sysid::bindings {

namespace {

TyreCoefficients<double> to_tyre(const std::array<double, 4>& t) {
    return {t[0], t[1], t[2], t[3]};
}

ObserverSettings to_settings(const py::dict& values) {
    ObserverSettings out;
    std::size_t known = 0;
    for (const auto& [name, member, meaning] : kObserverSettings)
        if (values.contains(name)) {
            out.*member = values[name].cast<double>();
            ++known;
        }
    if (known != values.size()) throw std::invalid_argument("settings: a name is not known");
    return out;
}

/// Adds step and whole-log call; both go through the same `step`, so the numbers are the same.
template <class Observer, class Blank>
void add_calls(py::class_<Guarded<Observer>>& bound, Blank&& blank) {
    using Held = Guarded<Observer>;
    bound
        .def(
            "step",
            [](Held& self, double dt, double steer, double vx, double r, double ax, double ay) {
                return self.with([&](Observer& observer) {
                    return columns_of(observer.step(dt, {steer, vx, r, ax, ay}));
                });
            },
            py::arg("dt_s"), py::arg("steer_rad"), py::arg("vx_mps"), py::arg("yaw_rate_radps"),
            py::arg("ax_mps2"), py::arg("ay_mps2"))
        .def(
            "run",
            [](Held& self, const Array& dt, const Array& sensors) {
                const auto n = static_cast<std::size_t>(dt.size());
                const double* step = vector(dt, n, "dt_s");
                const double* s = matrix(sensors, dt.size(), 5, "sensors");
                Array out = empty(n, kEstimateColumns);
                double* to = out.mutable_data();
                self.with([&](Observer& observer) {
                    for (std::size_t k = 0; k < n; ++k, s += 5) {
                        poll_interrupt(k);
                        const auto row =
                            columns_of(observer.step(step[k], {s[0], s[1], s[2], s[3], s[4]}));
                        to = std::copy(row.begin(), row.end(), to);
                    }
                });
                return out;
            },
            py::arg("dt_s"), py::arg("sensors"))
        .def_property_readonly("samples", [](Held& self) {
            return self.with([](const Observer& observer) { return observer.samples(); });
        });
    add_state(bound, blank);
}

template <Method method>
void register_ukf(py::module_& m, const char* name) {
    using Observer = SideslipUkf<method>;
    py::class_<Guarded<Observer>> bound(m, name);
    bound.def(py::init([](const ObservedCar& car, const py::dict& settings, bool linear) {
                  return std::make_unique<Guarded<Observer>>(car, to_settings(settings), linear);
              }),
              py::arg("car"), py::arg("settings"), py::arg("linear"));
    add_calls(bound, [] { return Observer(ObservedCar(), ObserverSettings(), false); });
}

void register_cornering_rls(py::module_& m) {
    using Held = Guarded<CorneringRls>;
    const auto pair = [](double front, double rear) { return py::make_tuple(front, rear); };
    py::class_<Held> bound(m, "CorneringRls");
    bound
        .def(py::init([](double mass, double inertia, double lf, double lr, double forgetting,
                         double prior_std, double ay_std, double yaw_std, double most_slip,
                         double least_slip, double cf, double cr) {
                 const CorneringRlsSettings settings{
                     mass,      inertia, lf,      lr,        forgetting,
                     prior_std, ay_std,  yaw_std, most_slip, least_slip,
                 };
                 return std::make_unique<Held>(settings, cf, cr);
             }),
             py::arg("mass_kg"), py::arg("yaw_inertia_kgm2"), py::arg("lf_m"), py::arg("lr_m"),
             py::arg("forgetting"), py::arg("prior_std_npr"), py::arg("ay_std_mps2"),
             py::arg("yaw_acceleration_std_radps2"), py::arg("most_slip_rad"),
             py::arg("least_slip_rad"), py::arg("cf_npr"), py::arg("cr_npr"))
        .def(
            "step",
            [](Held& self, double alpha_f, double alpha_r, double ay, double yaw_acceleration) {
                return self.with([&](CorneringRls& rls) {
                    return rls.step(alpha_f, alpha_r, ay, yaw_acceleration);
                });
            },
            py::arg("alpha_f_rad"), py::arg("alpha_r_rad"), py::arg("ay_mps2"),
            py::arg("yaw_acceleration_radps2"))
        .def(
            "run",
            [](Held& self, const Array& readings) {
                const double* r = matrix(readings, readings.shape(0), 4, "readings");
                const auto n = static_cast<std::size_t>(readings.shape(0));
                Array out = empty(n, 5);
                double* to = out.mutable_data();
                self.with([&](CorneringRls& rls) {
                    for (std::size_t k = 0; k < n; ++k, r += 4) {
                        poll_interrupt(k);
                        const bool used = rls.step(r[0], r[1], r[2], r[3]);
                        const auto& P = rls.covariance();
                        for (const double v : {
                                 rls.stiffness_npr()[0],
                                 rls.stiffness_npr()[1],
                                 std::sqrt(P(0, 0)),
                                 std::sqrt(P(1, 1)),
                                 used ? 1.0 : 0.0,
                             })
                            *to++ = v;
                    }
                });
                return out;
            },
            py::arg("readings"))
        .def("reset", [](Held& self) { self.with([](CorneringRls& rls) { rls.reset(); }); })
        .def_property_readonly("stiffness_npr",
                               [pair](Held& self) {
                                   const CorneringRls now = self.snapshot();
                                   return pair(now.stiffness_npr()[0], now.stiffness_npr()[1]);
                               })
        .def_property_readonly("std_npr",
                               [pair](Held& self) {
                                   const Mat<2, 2> P = self.snapshot().covariance();
                                   return pair(std::sqrt(P(0, 0)), std::sqrt(P(1, 1)));
                               })
        .def_property_readonly("samples", [](Held& self) { return self.snapshot().samples(); })
        .def_property_readonly("used", [](Held& self) { return self.snapshot().used(); });
    add_state(bound, [] { return CorneringRls({1.0, 1.0, 1.0, 1.0}, 0.0, 0.0); });
}

}  // namespace

void register_online_sideslip(py::module_& m) {
    py::class_<ObservedCar>(m, "ObservedCar")
        .def(py::init([](const VehicleData& data, double yaw_inertia,
                         const std::array<double, 4>& front, const std::array<double, 4>& rear) {
                 return ObservedCar{data, yaw_inertia, to_tyre(front), to_tyre(rear)};
             }),
             py::arg("data"), py::arg("yaw_inertia_kgm2"), py::arg("front"), py::arg("rear"));
    m.def("sideslip_defaults", [] {
        py::dict out;
        const ObserverSettings defaults;
        for (const auto& setting : kObserverSettings) out[setting.name] = defaults.*setting.value;
        return out;
    });
    m.def("sideslip_meanings", [] {
        py::dict out;
        for (const auto& setting : kObserverSettings) out[setting.name] = setting.meaning;
        return out;
    });

    py::class_<Guarded<SideslipDual>> dual(m, "SideslipDual");
    dual.def(py::init([](const ObservedCar& car, const py::dict& settings) {
                 return std::make_unique<Guarded<SideslipDual>>(car, to_settings(settings));
             }),
             py::arg("car"), py::arg("settings"));
    add_calls(dual, [] { return SideslipDual(ObservedCar(), ObserverSettings()); });
    py::class_<Guarded<PublishedDual>> published(m, "PublishedDual");
    published.def(py::init<const ObservedCar&, double, double>(), py::arg("car"), py::arg("cf_npr"),
                  py::arg("cr_npr"));
    add_calls(published, [] { return PublishedDual(ObservedCar(), 0.0, 0.0); });
    register_ukf<Method::kExtended>(m, "SideslipEkf");
    register_ukf<Method::kUnscented>(m, "SideslipUkf");
    register_ukf<Method::kSquareRoot>(m, "SideslipSquareRootUkf");

    register_cornering_rls(m);
}

}  // namespace sysid::bindings
