#include "sysid/dynamics/written_model.hpp"

#include <cmath>

#include "sysid/dynamics/step.hpp"

namespace sysid {

namespace {

using Number = double VehicleData::*;
using Written = Recorded VehicleDataOf<Recorded>::*;

struct Field {
    const char* name;
    Number number;
    Written written;
};

// NOLINTNEXTLINE(bugprone-macro-parentheses): names take none
#define SYSID_CAR_FIELD(name) \
    Field { #name, &VehicleData::name, &VehicleDataOf<Recorded>::name }
constexpr std::array<Field, 11> kCarFields{
    SYSID_CAR_FIELD(mass_kg),
    SYSID_CAR_FIELD(lf_m),
    SYSID_CAR_FIELD(lr_m),
    SYSID_CAR_FIELD(cg_height_m),
    SYSID_CAR_FIELD(track_front_m),
    SYSID_CAR_FIELD(track_rear_m),
    SYSID_CAR_FIELD(drag_area_m2),
    SYSID_CAR_FIELD(air_density_kgpm3),
    SYSID_CAR_FIELD(brake_front_share),
    SYSID_CAR_FIELD(drive_front_share),
    SYSID_CAR_FIELD(gravity_mps2),
};
#undef SYSID_CAR_FIELD

/// Names of all auxiliary states of the catalogue; those of users' effects have none.
std::array<StateInfo, kAuxiliaryStates> state_infos() {
    std::array<StateInfo, kAuxiliaryStates> all{};
    std::size_t at = 0;
    for (const EffectInfo& info : kEffectInfos)
        for (std::size_t i = 0; i < info.state_count(); ++i) all[at++] = info.states[i];
    return all;
}

ModelState<double> settled(const SingleTrack& model, const double* p, double v_x) {
    const std::array<double, kExternals> calm{};
    Input straight;
    straight.channels.fill(std::nan(""));  // no log stands behind a model
    ModelState<double> state{};
    state[0] = v_x;
    settle_auxiliary(model, state, calm.data(), straight, p);
    return state;
}

}  // namespace

WrittenModel write_model(const SingleTrack& model, const double* p, double v_x) {
    Recorder to{Recorder::Spelling{}};
    std::vector<Recorded> asked;
    std::vector<int*> places;  // where the steps of what was asked for are to be written
    WrittenModel out;
    const auto ask = [&](const Recorded& x, int& place) {
        asked.push_back(x);
        places.push_back(&place);
    };

    SingleTrackOf<Recorded> written;
    written.effects = model.effects;
    written.user = model.user;
    out.car.reserve(kCarFields.size());
    for (const Field& field : kCarFields) {
        written.car.*field.written = to.parameter(model.car.*field.number, false);
        out.car.emplace_back(field.name, -1);
        ask(written.car.*field.written, out.car.back().second);
    }
    // Effects have it as a constant.
    to.stand_for(kGravity, written.car.gravity_mps2);
    std::vector<Recorded> parameters;
    out.parameters.resize(kParameterCount, -1);
    for (std::size_t i = 0; i < kParameterCount; ++i) {
        parameters.push_back(to.parameter(p[i], false));
        ask(parameters.back(), out.parameters[i]);
    }
    InputFor<Recorded> u;
    for (Recorded* x : {&u.steer_rad, &u.longitudinal, &u.time_s, &u.steer_rate_radps})
        *x = to.input(false);
    for (Recorded& x : u.channels) x = to.input(false);
    ask(u.steer_rad, out.steer);
    ask(u.longitudinal, out.force);

    ModelState<Recorded> x, rate;
    for (Recorded& state : x) state = to.input(false);
    const std::array<Recorded, kExternals> calm{};
    const Workings<Recorded> w =
        written.evaluate(x.data(), calm.data(), x.data() + kMotionStates, u, parameters.data(),
                         rate.data(), rate.data() + kMotionStates);
    ask(w.a_x, out.a_x);
    ask(w.a_y, out.a_y);

    const ModelState<double> start = settled(model, p, v_x);
    const std::array<StateInfo, kAuxiliaryStates> infos = state_infos();
    const ActiveStates own = active_states(model.effects);
    out.states = {{"v_x", "m/s"}, {"v_y", "m/s"}, {"r", "rad/s"}};
    for (const std::size_t i : own) out.states.push_back({infos[i].name, infos[i].unit});
    for (std::size_t n = 0; n < out.states.size(); ++n) {
        const std::size_t i = n < kMotionStates ? n : kMotionStates + own.place[n - kMotionStates];
        out.states[n].start = start[i];
        ask(x[i], out.states[n].step);
        ask(rate[i], out.states[n].rate);
    }
    out.calculation = to.spelled(asked);
    for (std::size_t i = 0; i < places.size(); ++i) *places[i] = out.calculation.outputs[i];
    return out;
}

}  // namespace sysid
