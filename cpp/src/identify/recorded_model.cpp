#include "sysid/identify/recorded_model.hpp"

#include "sysid/math/errors.hpp"
#include "sysid/math/whole.hpp"

namespace sysid {

namespace {

InputFor<Recorded> recorded_input(Recorder& to) {
    InputFor<Recorded> u;
    for (Recorded* x : {&u.steer_rad, &u.longitudinal, &u.time_s, &u.steer_rate_radps,
                        &u.loads_n.front, &u.loads_n.rear, &u.gravity_x_mps2, &u.gravity_y_mps2})
        *x = to.input(false);
    for (Recorded& x : u.channels) x = to.input(false);
    return u;
}

double number_of(const Input& u, std::size_t i) {
    if (i == 0) return u.steer_rad;
    if (i == 1) return u.longitudinal;
    if (i == 2) return u.time_s;
    if (i == 3) return u.steer_rate_radps;
    if (i == 4) return u.loads_n.front;
    if (i == 5) return u.loads_n.rear;
    if (i == 6) return u.gravity_x_mps2;
    return i == 7 ? u.gravity_y_mps2 : u.channels[i - 8];
}

/// Whether two programs differ in numbers that are the same for all samples alone.
bool same_steps(const Program& a, const Program& b) {
    const auto numbered = [](const auto& x, const auto& y) { return x.first == y.first; };
    return a.rows == b.rows && a.inputs == b.inputs && a.outputs == b.outputs &&
           a.same_as == b.same_as && a.slots == b.slots &&
           std::ranges::equal(a.uniform, b.uniform, numbered) &&
           std::ranges::equal(a.steps, b.steps, [](const ForwardStep& x, const ForwardStep& y) {
               return x.op == y.op && x.to == y.to && x.a == y.a && x.b == y.b && x.c == y.c &&
                      x.constant == y.constant;
           });
}

}  // namespace

void RecordedModel::Ready::set(std::size_t first, const LaneRow* values, std::size_t count) {
    for (std::size_t i = 0; i < count; ++i)
        if (const std::int32_t row = program.inputs[first + i]; row >= 0)
            rows[index(row)] = values[i];
}

void RecordedModel::Ready::give(std::size_t which, std::size_t lane, const Input& u) {
    for (const auto& [number, row] : given[which]) rows[row].at[lane] = number_of(u, number);
}

RecordedModel::RecordedModel(const SingleTrack& model, const double* p,
                             const std::vector<int>& columns, std::size_t externals)
    : RecordedModel(model, std::vector<const double*>{p}, columns, externals) {}

RecordedModel::RecordedModel(const SingleTrack& model, const std::vector<const double*>& sets,
                             const std::vector<int>& columns, std::size_t externals)
    : model_(model),
      sets_(sets),
      wanted_(kParameterCount, false),
      own_(active_states(model.effects)),
      states_(kMotionStates + own_.count),
      externals_(externals) {
    for (const int column : columns) wanted_[index(column)] = true;
    read_ = ready(1, [&](Recorder& to, const double* p) {
        const Moving now = moving(to);
        const InputFor<Recorded> u = recorded_input(to);
        const std::vector<Recorded> values = parameters(to, p);
        const auto y = sense(model_, now.x, now.external.data(), u, values.data());
        return std::vector<Recorded>{y.begin(), y.end()};
    });
}

RecordedModel::Moving RecordedModel::moving(Recorder& to) const {
    Moving now;
    for (std::size_t i = 0; i < kMotionStates; ++i) now.x[i] = to.input(true);
    for (const std::size_t i : own_) now.x[kMotionStates + i] = to.input(true);
    for (std::size_t i = 0; i < externals_; ++i) now.external[i] = to.input(true);
    return now;
}

std::vector<Recorded> RecordedModel::parameters(Recorder& to, const double* p) const {
    std::vector<Recorded> all;
    all.reserve(kParameterCount);
    for (std::size_t i = 0; i < kParameterCount; ++i) all.push_back(to.parameter(p[i], wanted_[i]));
    return all;
}

std::vector<Recorded> RecordedModel::packed(const ModelState<Recorded>& x) const {
    std::vector<Recorded> out(x.begin(), x.begin() + kMotionStates);
    for (const std::size_t i : own_) out.push_back(x[kMotionStates + i]);
    return out;
}

template <class Record>
RecordedModel::Ready RecordedModel::ready(std::size_t inputs_given, Record&& record) const {
    const auto program_of = [&](const double* p) {
        Recorder to;
        return to.program(record(to, p));
    };
    Ready out;
    Program program = program_of(sets_[0]);
    out.rows.resize(index(program.rows));
    for (const auto& [row, value] : program.uniform)
        std::fill_n(out.rows[index(row)].at, kLanes, value);
    for (std::size_t lane = 1; lane < sets_.size(); ++lane) {
        if (sets_[lane] == sets_[0]) continue;
        const Program other = program_of(sets_[lane]);
        if (!same_steps(program, other)) throw NumericalFailure("the model takes other steps", 0);
        for (const auto& [row, value] : other.uniform) out.rows[index(row)].at[lane] = value;
    }
    out.adjoints.resize(index(program.slots * kSweep));
    out.given.resize(inputs_given);
    for (std::size_t which = 0; which < inputs_given; ++which)
        for (std::size_t i = 0; i < kGiven; ++i)
            if (const std::int32_t row = program.inputs[moving() + which * kGiven + i]; row >= 0)
                out.given[which].emplace_back(i, index(row));
    out.program = std::move(program);
    return out;
}

RecordedModel::Ready& RecordedModel::step_of(double dt, int parts) {
    const int apart = programs(parts), together = parts / apart;
    const std::pair<double, int> of{dt / apart, together};
    const auto found = steps_.find(of);
    if (found != steps_.end()) return found->second;
    return steps_
        .emplace(of, ready(2,
                           [&](Recorder& to, const double* p) {
                               Moving now = moving(to);
                               const InputFor<Recorded> from = recorded_input(to);
                               const InputFor<Recorded> until = recorded_input(to);
                               const std::vector<Recorded> values = parameters(to, p);
                               advance(model_, now.x, now.external.data(), from, until,
                                       values.data(), dt / apart, together);
                               return packed(now.x);
                           }))
        .first->second;
}

RecordedModel::Ready RecordedModel::start_of(const Run& run) const {
    return ready(0, [&](Recorder& to, const double* p) {
        const std::vector<Recorded> values = parameters(to, p);
        return packed(initial_state<Recorded>(model_, run, values.data()));
    });
}

}  // namespace sysid
