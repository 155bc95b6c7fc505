// The model as the steps of its calculation, for what is written of it as text.
#include <pybind11/stl.h>

#include <stdexcept>
#include <tuple>
#include <vector>

#include "arrays.hpp"
#include "register.hpp"
#include "sysid/dynamics/written_model.hpp"

namespace sysid::bindings {

namespace {

const char* name_of(Op op) {
    switch (op) {
        case Op::kInput:
            return "input";
        case Op::kUniform:
            return "constant";
        case Op::kAdd:
            return "add";
        case Op::kSubtract:
            return "subtract";
        case Op::kMultiply:
            return "multiply";
        case Op::kDivide:
            return "divide";
        case Op::kTimes:
            return "negative";
        case Op::kSin:
            return "sin";
        case Op::kCos:
            return "cos";
        case Op::kAtan:
            return "arctan";
        case Op::kDirection:
            return "arctan2";
        case Op::kSqrt:
            return "sqrt";
        case Op::kExp:
            return "exp";
        case Op::kLog:
            return "log";
        case Op::kTanh:
            return "tanh";
        case Op::kAbs:
            return "absolute";
        case Op::kIfBelow:
            return "where_below";
        default:
            throw std::logic_error("written: a step that has no text");
    }
}

using WrittenStep = std::tuple<const char*, int, int, int, double>;

std::vector<WrittenStep> steps(const WrittenModel& model) {
    std::vector<WrittenStep> all;
    all.reserve(model.calculation.steps.size());
    for (const SpelledStep& s : model.calculation.steps)
        all.emplace_back(name_of(s.op), s.a, s.b, s.c, s.constant);
    return all;
}

py::list states(const WrittenModel& model) {
    py::list all;
    for (const WrittenModel::State& s : model.states)
        all.append(py::make_tuple(s.name != nullptr ? s.name : "", s.unit != nullptr ? s.unit : "",
                                  s.step, s.rate, s.start));
    return all;
}

}  // namespace

void register_written(py::module_& m) {
    py::class_<WrittenModel>(m, "WrittenModel")
        .def_property_readonly("steps", &steps)
        .def_property_readonly("names", [](const WrittenModel& w) { return w.calculation.names; })
        .def_property_readonly("parts", [](const WrittenModel& w) { return w.calculation.parts; })
        .def_property_readonly("states", &states)
        .def_readonly("car", &WrittenModel::car)
        .def_readonly("parameters", &WrittenModel::parameters)
        .def_readonly("steer", &WrittenModel::steer)
        .def_readonly("force", &WrittenModel::force)
        .def_readonly("a_x", &WrittenModel::a_x)
        .def_readonly("a_y", &WrittenModel::a_y);
    m.def(
        "write_model",
        [](const SingleTrack& model, const Array& p, double v_x) {
            return write_model(model, vector(p, kParameterCount, "parameters"), v_x);
        },
        py::arg("model"), py::arg("parameters"), py::arg("v_x"));
}

}  // namespace sysid::bindings
