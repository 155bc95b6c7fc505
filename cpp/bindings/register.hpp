#pragma once

#include <pybind11/pybind11.h>

#include <vector>

#include "arrays.hpp"

namespace sysid {
struct Driver;
struct Reference;
}  // namespace sysid

namespace sysid::bindings {

/// Throws std::invalid_argument unless a driver can be simulated in steps of `dt`.
void check_driver(const Driver& driver, double dt);

/// What a driver follows, sample by sample; `array` has a row of three for each, two at least.
std::vector<Reference> references_of(const Array& array);

void register_interrupts(pybind11::module_& m);
void register_model(pybind11::module_& m);
void register_written(pybind11::module_& m);
void register_simulate(pybind11::module_& m);
void register_identify(pybind11::module_& m);
void register_lab_observer(pybind11::module_& m);
void register_lab_loop(pybind11::module_& m);
void register_lab_tyres(pybind11::module_& m);
void register_online_mu_slip(pybind11::module_& m);
void register_twin(pybind11::module_& m);
void register_online_sideslip(pybind11::module_& m);
void register_banded(pybind11::module_& m);

}  // namespace sysid::bindings
