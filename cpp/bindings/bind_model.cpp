// The model: vehicle data, the catalogue of effects, one evaluation.
#include <utility>

#include "arrays.hpp"
#include "fields.hpp"
#include "register.hpp"
#include "sysid/dynamics/step.hpp"

namespace sysid::bindings {

namespace {

const char* name_of(Scan scan) {
    if (scan == Scan::kTime) return "time";
    return scan == Scan::kRange ? "range" : "";
}

const char* name_of(Breaks breaks) {
    constexpr std::array names{"", "readings late", "readings elsewhere", "answers late",
                               "on a slope"};
    return names[static_cast<std::size_t>(breaks)];
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
    d["scan"] = name_of(info.scan);
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

/// Whether an effect changes numbers of the car itself: it acts at the stage `vehicle`.
template <class E>
constexpr bool kChangesCar =
    !std::is_same_v<decltype(E::vehicle(std::declval<const double*>(),
                                        std::declval<Workings<double>&>())),
                    Inactive>;

template <std::size_t... I>
constexpr std::array<bool, kEffectCount> collect_changes_car(std::index_sequence<I...> /*unused*/) {
    return {kChangesCar<std::tuple_element_t<I, Catalogue>>...};
}
constexpr auto kEffectsChangeCar = collect_changes_car(std::make_index_sequence<kEffectCount>{});

/// The numbers of the car as its effects make them, by their names in a vehicle file.
py::dict car_with_effects(const SingleTrack& model, const Array& p) {
    const Workings<double> w = model.car_with_effects(vector(p, kParameterCount, "parameters"));
    py::dict d;
    d["mass_kg"] = w.m;
    d["yaw_inertia_kgm2"] = w.I_z;
    d["lf_m"] = w.l_f;
    d["lr_m"] = w.l_r;
    d["cg_height_m"] = w.h;
    d["drag_area_m2"] = w.drag_area;
    d["brake_front_share"] = w.brake_front;
    d["drive_front_share"] = w.drive_front;
    return d;
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
        d["confounded_with"] = names(info.confounded_with);
        d["through"] = info.through;
        d["breaks"] = name_of(info.breaks);
        d["same_in_all_logs"] = info.same_in_all_logs;
        d["refines"] = names(info.refines);
        d["on_request"] = info.on_request;
        d["changes_car"] = kEffectsChangeCar[i];
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
    Input u{steer, longitudinal};
    u.channels.fill(std::nan(""));  // no log stands behind one evaluation
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
using FormulaStep = std::tuple<int, std::array<std::size_t, 3>, double>;
using FormulaSteps = std::vector<FormulaStep>;
using Act = std::pair<int, FormulaSteps>;
/// Rate of a state, minus its derivative by the state, and where it begins if that is said.
using OwnState = std::tuple<FormulaSteps, FormulaSteps, std::optional<FormulaSteps>>;
/// An effect: its place, the numbers of the channels that it reads, what it adds, its states.
using User =
    std::tuple<std::size_t, std::vector<std::size_t>, std::vector<Act>, std::vector<OwnState>>;

/// Channels and states are numbered by effect in `steps`, by model in the formula.
Formula formula(const FormulaSteps& steps, const std::vector<std::size_t>& channels,
                std::size_t first_state, std::size_t states) {
    std::vector<Instruction> all;
    all.reserve(steps.size());
    for (const auto& [number, from, constant] : steps) {
        if (number < 0 || number >= static_cast<int>(Operation::kOperations))
            throw std::invalid_argument("formula: there is no such operation");
        const auto operation = static_cast<Operation>(number);
        Instruction step{operation, from, constant};
        if (operation == Operation::kChannel || operation == Operation::kState) {
            const bool channel = operation == Operation::kChannel;
            if (from[0] >= (channel ? channels.size() : states))
                throw std::invalid_argument("formula: it reads what there is none of");
            step.from[0] = channel ? channels[from[0]] : first_state + from[0];
        }
        all.push_back(step);
    }
    return {std::move(all), kUserParameters};
}

/// Lets users' effects act in a model.
void set_user_effects(SingleTrack& model, const std::vector<User>& given) {
    if (given.empty()) return;
    std::vector<UserEffect> all;
    std::size_t first_state = 0;
    for (const auto& [slot, channels, acts, states] : given) {
        const std::size_t own = states.size();
        if (first_state + own > kUserStates)
            throw std::invalid_argument("user: there are more states than there is room for");
        const auto read = [&, &names = channels, first = first_state](const FormulaSteps& steps) {
            return formula(steps, names, first, own);
        };
        if (slot >= kUserEffects)
            throw std::invalid_argument("user: there is no such place for an effect");
        UserEffect effect;
        effect.slot = slot;
        for (const auto& [target, steps] : acts) {
            if (target < 0 || target >= static_cast<int>(Target::kTargets))
                throw std::invalid_argument("user: there is no such target");
            effect.acts.emplace_back(static_cast<Target>(target), read(steps));
        }
        effect.first_state = first_state;
        for (const auto& [rate, decay, initial] : states) {
            model.effects |= user_state_bit(first_state++);
            effect.states.push_back({read(rate), read(decay), std::nullopt});
            if (initial) effect.states.back().initial = read(*initial);
        }
        all.push_back(std::move(effect));
    }
    model.user = std::make_shared<const std::vector<UserEffect>>(std::move(all));
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
    py::list by_target;
    for (std::size_t i = 0; i < kTargetNames.size(); ++i) {
        py::list there;
        for (std::size_t n = 0; n < kSignalNames.size(); ++n)
            if (known(static_cast<Signal>(n), static_cast<Target>(i))) there.append(n);
        by_target.append(py::tuple(there));
    }
    d["signals_known"] = py::tuple(by_target);
    return d;
}

}  // namespace

void register_model(py::module_& m) {
    fields(py::class_<VehicleData>(m, "VehicleData").def(py::init<>()),
           SYSID_FIELD(VehicleData, mass_kg), SYSID_FIELD(VehicleData, lf_m),
           SYSID_FIELD(VehicleData, lr_m), SYSID_FIELD(VehicleData, cg_height_m),
           SYSID_FIELD(VehicleData, track_front_m), SYSID_FIELD(VehicleData, track_rear_m),
           SYSID_FIELD(VehicleData, drag_area_m2), SYSID_FIELD(VehicleData, air_density_kgpm3),
           SYSID_FIELD(VehicleData, brake_front_share),
           SYSID_FIELD(VehicleData, drive_front_share));
    py::class_<SingleTrack>(m, "SingleTrack")
        .def(py::init([](const VehicleData& car, EffectMask effects, bool force_known,
                         const std::vector<User>& user, bool loads_known, bool inputs_held) {
                 if (effects >> kEffectCount != 0)
                     throw std::invalid_argument(
                         "effects: the mask names effects there are none of");
                 SingleTrack model;
                 model.car = car;
                 model.effects = effects;
                 model.force_known = force_known;
                 model.loads_known = loads_known;
                 model.inputs_held = inputs_held;
                 set_user_effects(model, user);
                 return model;
             }),
             py::arg("car"), py::arg("effects"), py::arg("force_known"),
             py::arg("user") = std::vector<User>{}, py::arg("loads_known") = false,
             py::arg("inputs_held") = false)
        .def("on_known_slopes",
             [](SingleTrack model) {
                 model.slope_known = true;
                 return model;
             })
        .def("evaluate", &evaluate, py::arg("parameters"), py::arg("motion"), py::arg("steer"),
             py::arg("longitudinal"))
        .def("car", &car_with_effects, py::arg("parameters"));
    m.def("base_parameters", &base_parameters);
    m.def("effects", &effects);
    m.def("formula_parts", &formula_parts);
    m.attr("GRAVITY_MPS2") = kGravity;
    m.attr("USER_OFFSET") = kBaseParameterCount + user_offset(0);
    m.attr("USER_EFFECTS") = kUserEffects;
    m.attr("USER_PARAMETERS") = kUserParameters;
    m.attr("USER_CHANNELS") = kUserChannels;
    m.attr("USER_STATES") = kUserStates;
    m.attr("USER_STATES_FROM") = kMotionStates + kCatalogueStates;
}

}  // namespace sysid::bindings
