#include "sysid/identify/recorded_model.hpp"

namespace sysid {

namespace {

std::size_t place(int i) { return static_cast<std::size_t>(i); }

InputFor<Recorded> recorded_input(Recorder& to) {
    InputFor<Recorded> u;
    for (Recorded* x : {&u.steer_rad, &u.longitudinal, &u.time_s}) *x = to.input(false);
    for (Recorded& x : u.channels) x = to.input(false);
    return u;
}

double number_of(const Input& u, std::size_t i) {
    if (i == 0) return u.steer_rad;
    if (i == 1) return u.longitudinal;
    return i == 2 ? u.time_s : u.channels[i - 3];
}

}  // namespace

void RecordedModel::Ready::set(std::size_t first, const LaneRow* values, std::size_t count) {
    for (std::size_t i = 0; i < count; ++i)
        if (const std::int32_t row = program.inputs[first + i]; row >= 0)
            rows[place(row)] = values[i];
}

void RecordedModel::Ready::give(std::size_t which, std::size_t lane, const Input& u) {
    for (const auto& [number, row] : given[which]) rows[row].at[lane] = number_of(u, number);
}

RecordedModel::RecordedModel(const SingleTrack& model, const double* p,
                             const std::vector<int>& columns, bool all_externals)
    : model_(model),
      p_(p),
      wanted_(kParameterCount, false),
      own_(active_states(model.effects)),
      states_(kMotionStates + own_.count),
      externals_(all_externals ? kExternals : kMotionStates) {
    for (const int column : columns) wanted_[place(column)] = true;
    Recorder to;
    const Moving now = moving(to);
    const InputFor<Recorded> u = recorded_input(to);
    const std::vector<Recorded> values = parameters(to);
    const auto y = sense(model_, now.x, now.external.data(), u, values.data());
    read_ = ready(to.program({y.begin(), y.end()}), 1);
}

RecordedModel::Moving RecordedModel::moving(Recorder& to) const {
    Moving now;
    for (std::size_t i = 0; i < kMotionStates; ++i) now.x[i] = to.input(true);
    for (const std::size_t i : own_) now.x[kMotionStates + i] = to.input(true);
    for (std::size_t i = 0; i < externals_; ++i) now.external[i] = to.input(true);
    return now;
}

std::vector<Recorded> RecordedModel::parameters(Recorder& to) const {
    std::vector<Recorded> all;
    all.reserve(kParameterCount);
    for (std::size_t i = 0; i < kParameterCount; ++i)
        all.push_back(to.parameter(p_[i], wanted_[i]));
    return all;
}

std::vector<Recorded> RecordedModel::packed(const ModelState<Recorded>& x) const {
    std::vector<Recorded> out(x.begin(), x.begin() + kMotionStates);
    for (const std::size_t i : own_) out.push_back(x[kMotionStates + i]);
    return out;
}

RecordedModel::Ready RecordedModel::ready(Program program, std::size_t inputs_given) const {
    Ready out;
    out.rows.resize(place(program.rows));
    for (const auto& [row, value] : program.uniform)
        std::fill_n(out.rows[place(row)].at, kLanes, value);
    out.adjoints.resize(place(program.slots * kSweep));
    out.given.resize(inputs_given);
    for (std::size_t which = 0; which < inputs_given; ++which)
        for (std::size_t i = 0; i < kGiven; ++i)
            if (const std::int32_t row = program.inputs[moving() + which * kGiven + i]; row >= 0)
                out.given[which].emplace_back(i, place(row));
    out.program = std::move(program);
    return out;
}

RecordedModel::Ready& RecordedModel::step_of(double h) {
    const auto found = steps_.find(h);
    if (found != steps_.end()) return found->second;
    Recorder to;
    Moving now = moving(to);
    const InputFor<Recorded> from = recorded_input(to);
    const InputFor<Recorded> until = recorded_input(to);
    const std::vector<Recorded> values = parameters(to);
    advance(model_, now.x, now.external.data(), from, until, values.data(), h, 1);
    return steps_.emplace(h, ready(to.program(packed(now.x)), 2)).first->second;
}

RecordedModel::Ready RecordedModel::start_of(const Run& run) const {
    Recorder to;
    const std::vector<Recorded> values = parameters(to);
    return ready(to.program(packed(initial_state<Recorded>(model_, run, values.data()))), 0);
}

}  // namespace sysid
