// Estimators of friction over slip; one class of kernels per curve.
#include "arrays.hpp"
#include "register.hpp"
#include "stateful.hpp"
#include "sysid/online/mu_slip.hpp"

namespace sysid::bindings {

namespace {

/// Column of values, one per item.
template <class Items, class Get>
Array column(const Items& items, Get&& get) {
    Array out(static_cast<py::ssize_t>(items.size()));
    double* to = out.mutable_data();
    for (const auto& item : items) *to++ = get(item);
    return out;
}

/// Vectors or matrices of one item each, stacked.
template <int N, class Items, class Get>
Array stacked(const Items& items, bool matrices, Get&& get) {
    std::vector<py::ssize_t> shape{static_cast<py::ssize_t>(items.size()), N};
    if (matrices) shape.push_back(N);
    Array out(shape);
    double* to = out.mutable_data();
    for (const auto& item : items) {
        const auto& m = get(item);
        to = std::copy(m.data(), m.data() + m.size(), to);
    }
    return out;
}

CurveReadings to_readings(const Array& slip, const Array& mu) {
    const auto n = static_cast<std::size_t>(slip.size());
    const double* s = vector(slip, n, "slip");
    const double* f = vector(mu, n, "mu");
    if (n == 0) throw std::invalid_argument("slip: expected one reading or more");
    return {{s, s + n}, {f, f + n}};
}

template <class Curve>
CurveVec<Curve> to_vector(const Array& values, const char* name) {
    return Eigen::Map<const CurveVec<Curve>>(vector(values, Curve::kParameters, name));
}

template <class Curve>
CurvePrior<Curve> to_prior(const Array& mean, const Array& covariance) {
    const double* P = matrix(covariance, Curve::kParameters, Curve::kParameters, "covariance");
    return {to_vector<Curve>(mean, "mean"), Eigen::Map<const CurveMat<Curve>>(P)};
}

template <class Curve>
CurveFilterSettings<Curve> to_settings(double noise_std, bool pseudo_noise, int iterations,
                                       const Array& drift_std) {
    if (!(noise_std > 0.0)) throw std::invalid_argument("noise_std: expected more than 0");
    if (iterations < 1) throw std::invalid_argument("iterations: expected 1 or more");
    return {noise_std, pseudo_noise, iterations, to_vector<Curve>(drift_std, "drift_std")};
}

template <class Curve>
py::dict filtered(const std::vector<CurveStep<Curve>>& steps) {
    constexpr int n = Curve::kParameters;
    using Step = CurveStep<Curve>;
    py::dict out;
    out["predicted_mean"] =
        stacked<n>(steps, false, [](const Step& s) -> auto& { return s.filter.predicted_mean; });
    out["mean"] = stacked<n>(steps, false, [](const Step& s) -> auto& { return s.filter.mean; });
    out["covariance"] =
        stacked<n>(steps, true, [](const Step& s) -> auto& { return s.filter.covariance; });
    out["innovation"] = column(steps, [](const Step& s) { return s.filter.update.innovation[0]; });
    out["innovation_variance"] = column(steps, [](const Step& s) {
        const double root = s.filter.update.lower(0, 0);
        return root * root;
    });
    out["pseudo_variance"] = column(steps, [](const Step& s) { return s.pseudo_variance; });
    out["signal_before"] = column(steps, [](const Step& s) { return s.signal_before; });
    out["signal_after"] = column(steps, [](const Step& s) { return s.signal_after; });
    return out;
}

template <class Curve>
void add_points(py::class_<Curve>& kernels) {
    constexpr int n = Curve::kParameters;
    kernels.def_static(
        "points",
        [](const Array& slip, const Array& parameters) {
            const auto size = static_cast<std::size_t>(slip.size());
            const double* s = vector(slip, size, "slip");
            const auto x = to_vector<Curve>(parameters, "parameters");
            std::vector<CurvePoint<n>> points;
            points.reserve(size);
            for (std::size_t k = 0; k < size; ++k) points.push_back(curve_point<Curve>(s[k], x));
            using Point = CurvePoint<n>;
            return py::make_tuple(
                column(points, [](const Point& p) { return p.mu; }),
                stacked<n>(points, false, [](const Point& p) -> auto& { return p.gradient; }),
                stacked<n>(points, true, [](const Point& p) -> auto& { return p.hessian; }));
        },
        py::arg("slip"), py::arg("parameters"));
}

template <class Curve>
void add_estimators(py::class_<Curve>& kernels) {
    constexpr int n = Curve::kParameters;
    kernels.def_static(
        "filter",
        [](const Array& slip, const Array& mu, const Array& mean, const Array& covariance,
           double noise_std, bool pseudo, int iterations, const Array& drift_std) {
            const auto readings = to_readings(slip, mu);
            const auto prior = to_prior<Curve>(mean, covariance);
            const auto settings = to_settings<Curve>(noise_std, pseudo, iterations, drift_std);
            return filtered<Curve>(
                unlocked([&] { return filter_curve<Curve>(readings, prior, settings); }));
        },
        py::arg("slip"), py::arg("mu"), py::arg("mean"), py::arg("covariance"),
        py::arg("noise_std"), py::arg("pseudo_noise"), py::arg("iterations"), py::arg("drift_std"));
    kernels.def_static(
        "smooth",
        [](const Array& slip, const Array& mu, const Array& mean, const Array& covariance,
           double noise_std, bool pseudo, const Array& drift_std, int max_rounds) {
            const auto readings = to_readings(slip, mu);
            const auto prior = to_prior<Curve>(mean, covariance);
            const auto settings = to_settings<Curve>(noise_std, pseudo, 1, drift_std);
            const auto found = unlocked(
                [&] { return smooth_curve<Curve>(readings, prior, settings, max_rounds); });
            py::dict out;
            out["mean"] = stacked<n>(found.mean, false, [](const auto& m) -> auto& { return m; });
            out["covariance"] =
                stacked<n>(found.covariance, true, [](const auto& m) -> auto& { return m; });
            out["rounds"] = found.rounds;
            out["converged"] = found.converged;
            return out;
        },
        py::arg("slip"), py::arg("mu"), py::arg("mean"), py::arg("covariance"),
        py::arg("noise_std"), py::arg("pseudo_noise"), py::arg("drift_std"), py::arg("max_rounds"));
    kernels.def_static(
        "fit",
        [](const Array& slip, const Array& mu, const Array& start, const Array& lower,
           const Array& upper, int max_iterations) {
            const auto readings = to_readings(slip, mu);
            const auto x = to_vector<Curve>(start, "start");
            const auto low = to_vector<Curve>(lower, "lower");
            const auto high = to_vector<Curve>(upper, "upper");
            const auto found =
                unlocked([&] { return fit_curve<Curve>(readings, x, low, high, max_iterations); });
            py::dict out;
            out["mean"] = to_array<n>(found.mean);
            out["covariance"] = to_array<n>(found.covariance);
            out["bias"] = to_array<n>(found.bias);
            out["sum_of_squares"] = found.sum_of_squares;
            out["used"] = found.used;
            out["determined"] = found.determined;
            out["iterations"] = found.iterations;
            out["converged"] = found.converged;
            return out;
        },
        py::arg("slip"), py::arg("mu"), py::arg("start"), py::arg("lower"), py::arg("upper"),
        py::arg("max_iterations"));
}

template <class Curve>
void register_curve(py::module_& m, const char* kernels_name, const char* filter_name) {
    constexpr int n = Curve::kParameters;
    py::class_<Curve> kernels(m, kernels_name);
    const auto bounds = [](const std::array<double, n>& values) {
        return to_array<n>(Vec<n>(Eigen::Map<const Vec<n>>(values.data())));
    };
    kernels.attr("LOWER") = bounds(Curve::kLower);
    kernels.attr("UPPER") = bounds(Curve::kUpper);
    add_points(kernels);
    add_estimators(kernels);

    using Filter = CurveFilter<Curve>;
    using Held = Guarded<Filter>;
    py::class_<Held> bound(m, filter_name);
    bound
        .def(py::init([](const Array& mean, const Array& covariance, double noise_std, bool pseudo,
                         int iterations, const Array& drift_std) {
                 return std::make_unique<Held>(
                     to_prior<Curve>(mean, covariance),
                     to_settings<Curve>(noise_std, pseudo, iterations, drift_std));
             }),
             py::arg("mean"), py::arg("covariance"), py::arg("noise_std"), py::arg("pseudo_noise"),
             py::arg("iterations"), py::arg("drift_std"))
        .def(
            "update",
            [](Held& self, double slip, double mu) {
                self.with([&](Filter& filter) { filter.update(slip, mu); });
            },
            py::arg("slip"), py::arg("mu"))
        .def_property_readonly("mean", [](Held& f) { return to_array<n>(f.snapshot().mean()); })
        .def_property_readonly("covariance",
                               [](Held& f) { return to_array<n>(f.snapshot().covariance()); })
        .def_property_readonly("readings", [](Held& f) { return f.snapshot().readings(); });
    add_state(bound,
              [] { return Filter({CurveVec<Curve>::Zero(), CurveMat<Curve>::Identity()}, {}); });
}

}  // namespace

void register_online_mu_slip(py::module_& m) {
    register_curve<TwoParameterCurve>(m, "TwoParameterCurve", "TwoParameterFilter");
    register_curve<MagicFormulaCurve>(m, "MagicFormulaCurve", "MagicFormulaFilter");
    m.def(
        "magic_formula_coefficients",
        [](const Array& parameters) {
            const double* p = vector(parameters, MagicFormulaCurve::kParameters, "parameters");
            const auto c = MagicFormulaCurve::coefficients(p);
            return py::make_tuple(c.B, c.C, c.D, c.E);
        },
        py::arg("parameters"));
}

}  // namespace sysid::bindings
