// What problems of least squares offer to Python, bound once for all of them; what each method does
// is said in `identify/prediction_error.hpp`.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "arrays.hpp"

namespace sysid::bindings {

inline void check_numbers(const std::vector<int>& numbers, std::size_t count, const char* name) {
    for (int c : numbers)
        if (c < 0 || c >= static_cast<int>(count))
            throw std::invalid_argument(std::string(name) + ": there is no " + std::to_string(c));
}

template <class P, class Gains>
void check_runs(const P& problem, const Gains& filter) {
    if (!fits(problem, filter)) throw std::invalid_argument("filter: was made from other runs");
}
template <class P>
void check_runs(const P& /*problem*/, std::nullptr_t /*filter*/) {}

/// Of a problem with so many parameters in all, and so many residuals a sample. `Gains` is the
/// frozen filter; nullptr where none has a part in it.
template <class Gains, class P>
void bind_least_squares(py::class_<P>& bound, std::size_t parameters, std::size_t residuals_each) {
    bound
        .def(
            "residuals",
            [=](const P& self, const Array& p, const Gains& filter) {
                check_runs(self, filter);
                const double* values = vector(p, parameters, "parameters");
                return filled(self.samples(), residuals_each,
                              [&](double* to) { residuals(self, values, filter, to); });
            },
            py::arg("parameters"), py::arg("filter"))
        .def(
            "half_sum_of_squares",
            [=](const P& self, const Array& p, const Gains& filter) {
                check_runs(self, filter);
                const double* values = vector(p, parameters, "parameters");
                return unlocked([&] { return half_sum_of_squares(self, values, filter); });
            },
            py::arg("parameters"), py::arg("filter"))
        .def(
            "sensitivities",
            [=](const P& self, const Array& p, const Gains& filter,
                const std::vector<int>& columns) {
                check_numbers(columns, parameters, "columns");
                check_runs(self, filter);
                const double* values = vector(p, parameters, "parameters");
                return filled(self.samples() * residuals_each, columns.size(), [&](double* to) {
                    sensitivities(self, values, filter, columns, to);
                });
            },
            py::arg("parameters"), py::arg("filter"), py::arg("columns"))
        .def(
            "normal_equations",
            [=](const P& self, const Array& p, const Gains& filter,
                const std::vector<int>& columns) {
                check_numbers(columns, parameters, "columns");
                check_runs(self, filter);
                const double* values = vector(p, parameters, "parameters");
                return with_derivatives(columns.size(), [&](double* g, double* h) {
                    return normal_equations(self, values, filter, columns, g, h);
                });
            },
            py::arg("parameters"), py::arg("filter"), py::arg("columns"));
}

}  // namespace sysid::bindings
