// The model: vehicle data, the catalogue of effects, one evaluation.
#include "arrays.hpp"
#include "register.hpp"
#include "sysid/dynamics/step.hpp"

namespace sysid::bindings {

namespace {

const char* scan_name(Scan scan) {
    if (scan == Scan::kTime) return "time";
    return scan == Scan::kRange ? "range" : "";
}

py::dict describe(const ParameterInfo& info) {
    py::dict d;
    d["name"] = info.name;
    d["unit"] = info.unit;
    d["null_value"] = info.null_value;
    d["typical"] = info.typical;
    d["matters"] = info.matters;
    d["lower"] = info.bounds.low;
    d["upper"] = info.bounds.high;
    d["typical_low"] = info.usual.low;
    d["typical_high"] = info.usual.high;
    d["mirrored"] = info.mirrored;
    d["scan"] = scan_name(info.scan);
    return d;
}

/// The names between the commas of a list.
py::tuple names(const std::string& list) {
    py::list all;
    for (std::size_t at = 0; at < list.size();) {
        const std::size_t end = std::min(list.find(", ", at), list.size());
        all.append(list.substr(at, end - at));
        at = end + 2;
    }
    py::tuple fixed(all);
    return fixed;
}

py::list base_parameters() {
    py::list all;
    for (const ParameterInfo& info : kBaseParameterInfos) all.append(describe(info));
    return all;
}

py::list effects() {
    py::list all;
    for (std::size_t i = 0; i < kEffectCount; ++i) {
        const EffectInfo& info = kEffectInfos[i];
        py::dict d;
        d["id"] = info.id;
        d["title"] = info.title;
        d["equation"] = info.equation;
        d["source"] = info.source;
        d["excited_by"] = info.excited_by;
        d["moves"] = info.moves;
        d["needs"] = names(info.needs);
        d["twins"] = names(info.confounded_with);
        d["through"] = info.through;
        d["states"] = detail::kEffectStateCounts[i];
        d["scored_at_typical"] = info.scored_at_typical;
        d["needs_force"] = info.needs_force;
        d["offset"] = kBaseParameterCount + effect_offset(i);
        py::list parameters;
        for (std::size_t j = 0; j < info.parameter_count(); ++j)
            parameters.append(describe(info.parameters[j]));
        d["parameters"] = parameters;
        all.append(d);
    }
    return all;
}

Array evaluate(const SingleTrack& model, const Array& p, const Array& motion, double steer,
               double longitudinal) {
    const double* values = vector(p, kParameterCount, "parameters");
    const double* x = vector(motion, kMotionStates, "motion");
    const std::array<double, kExternals> calm{};
    const Input u{steer, longitudinal};
    ModelState<double> state{};
    std::copy(x, x + kMotionStates, state.begin());
    settle_auxiliary(model, state, calm.data(), u, values);
    ModelState<double> rate;
    const auto w = model.evaluate(state.data(), calm.data(), state.data() + kMotionStates, u,
                                  values, rate.data(), rate.data() + kMotionStates);
    const std::vector<double> all{
        rate[0],   rate[1], rate[2], w.a_x,  w.a_y,  w.alpha_f,
        w.alpha_r, w.fz_f,  w.fz_r,  w.fy_f, w.fy_r,
    };
    return copy_of(all, all.size());
}

/// As Python hands a formula over: what is added to, and steps (operation, operands, constant).
using Step = std::tuple<int, std::array<std::size_t, 3>, double>;
using Act = std::pair<int, std::vector<Step>>;

Formula formula(const std::vector<Step>& steps) {
    std::vector<Instruction> all;
    all.reserve(steps.size());
    for (const auto& [operation, from, constant] : steps) {
        if (operation < 0 || operation >= static_cast<int>(Operation::kOperations))
            throw std::invalid_argument("formula: there is no such operation");
        // Places that an operation does not read are zero; they are looked up all the same.
        if (operation > static_cast<int>(Operation::kParameter))
            for (const std::size_t place : from)
                if (place >= all.size())
                    throw std::invalid_argument("formula: a step reads a later one");
        all.push_back({static_cast<Operation>(operation), from, constant});
    }
    return {std::move(all), kUserParameters};
}

UserEffects user_effects(const std::vector<std::pair<std::size_t, std::vector<Act>>>& given) {
    if (given.empty()) return nullptr;
    std::vector<UserEffect> all;
    for (const auto& [slot, acts] : given) {
        if (slot >= kUserEffects)
            throw std::invalid_argument("user: there is no such place for an effect");
        UserEffect effect;
        effect.slot = slot;
        for (const auto& [target, steps] : acts) {
            if (target < 0 || target >= static_cast<int>(Target::kTargets))
                throw std::invalid_argument("user: there is no such target");
            effect.acts.emplace_back(static_cast<Target>(target), formula(steps));
        }
        all.push_back(std::move(effect));
    }
    return std::make_shared<const std::vector<UserEffect>>(std::move(all));
}

template <std::size_t N>
py::tuple texts(const std::array<const char*, N>& all) {
    py::list list;
    for (const char* text : all) list.append(text);
    py::tuple fixed(list);
    return fixed;
}

/// What formulas are made of, each name at its number.
py::dict formula_parts() {
    py::dict d;
    d["operations"] = texts(kOperationNames);
    d["signals"] = texts(kSignalNames);
    d["targets"] = texts(kTargetNames);
    py::list known;
    for (std::size_t i = 0; i < kTargetNames.size(); ++i)
        known.append(static_cast<int>(first_unknown(static_cast<Target>(i))));
    d["signals_known"] = py::tuple(known);
    return d;
}

}  // namespace

void register_model(py::module_& m) {
    py::class_<VehicleData>(m, "VehicleData")
        .def(py::init<>())
        .def_readwrite("mass_kg", &VehicleData::mass_kg)
        .def_readwrite("lf_m", &VehicleData::lf_m)
        .def_readwrite("lr_m", &VehicleData::lr_m)
        .def_readwrite("cg_height_m", &VehicleData::cg_height_m)
        .def_readwrite("drag_area_m2", &VehicleData::drag_area_m2)
        .def_readwrite("air_density_kgpm3", &VehicleData::air_density_kgpm3)
        .def_readwrite("brake_front_share", &VehicleData::brake_front_share)
        .def_readwrite("drive_front_share", &VehicleData::drive_front_share);
    py::class_<SingleTrack>(m, "SingleTrack")
        .def(py::init([](const VehicleData& car, EffectMask effects, bool force_known,
                         const std::vector<std::pair<std::size_t, std::vector<Act>>>& user) {
                 if (effects >> kEffectCount != 0)
                     throw std::invalid_argument(
                         "effects: the mask names effects there are none of");
                 SingleTrack model;
                 model.car = car;
                 model.effects = effects;
                 model.force_known = force_known;
                 model.user = user_effects(user);
                 return model;
             }),
             py::arg("car"), py::arg("effects"), py::arg("force_known"),
             py::arg("user") = std::vector<std::pair<std::size_t, std::vector<Act>>>{})
        .def("evaluate", &evaluate, py::arg("parameters"), py::arg("motion"), py::arg("steer"),
             py::arg("longitudinal"));
    m.def("base_parameters", &base_parameters);
    m.def("effects", &effects);
    m.def("formula_parts", &formula_parts);
    m.attr("GRAVITY_MPS2") = kGravity;
    m.attr("USER_OFFSET") = kBaseParameterCount + user_offset(0);
    m.attr("USER_EFFECTS") = kUserEffects;
    m.attr("USER_PARAMETERS") = kUserParameters;
}

}  // namespace sysid::bindings
