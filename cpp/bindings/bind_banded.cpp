// Banded information matrices of a motion that is free.
#include "arrays.hpp"
#include "register.hpp"
#include "sysid/math/banded.hpp"

namespace sysid::bindings {

namespace {

using Places = py::array_t<std::int32_t, py::array::c_style | py::array::forcecast>;

std::span<const std::int32_t> span_of(const Places& places) {
    return {places.data(), static_cast<std::size_t>(places.size())};
}

SparseRows rows_of(const Places& pointers, const Places& columns, const Array& values) {
    return {span_of(pointers),
            span_of(columns),
            {values.data(), static_cast<std::size_t>(values.size())}};
}

}  // namespace

void register_banded(py::module_& m) {
    m.def(
        "banded_gram",
        [](const Places& pointers, const Places& columns, const Array& values, std::size_t size) {
            const SparseRows rows = rows_of(pointers, columns, values);
            const LowerBand band = unlocked([&] { return gram(rows, size); });
            return copy_of(band.entries, band.width + 1);
        },
        py::arg("pointers"), py::arg("columns"), py::arg("values"), py::arg("size"));
    m.def(
        "banded_squares",
        [](const Array& factor, const Places& pointers, const Places& columns,
           const Array& values) {
            const std::size_t size = factor.ndim() == 2 ? factor.shape(0) : 0;
            const std::span<const double> entries{factor.data(),
                                                  static_cast<std::size_t>(factor.size())};
            const SparseRows rows = rows_of(pointers, columns, values);
            return row_of(unlocked([&] { return squares(entries, size, rows); }));
        },
        py::arg("factor"), py::arg("pointers"), py::arg("columns"), py::arg("values"));
}

}  // namespace sysid::bindings
