#include "sysid/identify/local_model.hpp"

#include <algorithm>

#include "sysid/math/lanes.hpp"

namespace sysid {

namespace {

std::size_t place(int i) { return static_cast<std::size_t>(i); }

constexpr std::size_t kGiven = 3 + kUserChannels;  // numbers of an `Input`

InputFor<Recorded> recorded_input(Recorder& to) {
    InputFor<Recorded> u;
    for (Recorded* x : {&u.steer_rad, &u.longitudinal, &u.time_s}) *x = to.input(false);
    for (Recorded& x : u.channels) x = to.input(false);
    return u;
}

std::array<double, kGiven> numbers(const Input& u) {
    std::array<double, kGiven> all{u.steer_rad, u.longitudinal, u.time_s};
    std::copy(u.channels.begin(), u.channels.end(), all.begin() + 3);
    return all;
}

double at(const LaneRow* row, std::size_t lane) { return row == nullptr ? 1.0 : row->at[lane]; }

}  // namespace

LocalModel::LocalModel(const SingleTrack& model, const double* p, const std::vector<int>& columns,
                       std::size_t width, bool all_externals)
    : model_(model),
      p_(p),
      columns_of_(kParameterCount),
      width_(width),
      own_(active_states(model.effects)),
      states_(kMotionStates + own_.count),
      externals_(all_externals ? kExternals : kMotionStates),
      step_parameters_(states_ * (states_ + externals_)),
      read_at_(step_parameters_ + states_ * width_),
      read_parameters_(read_at_ + kChannels * (states_ + externals_)) {
    for (std::size_t j = 0; j < columns.size(); ++j) columns_of_[place(columns[j])].push_back(j);
    Recorder to;
    const Moving now = moving(to);
    const InputFor<Recorded> u = recorded_input(to);
    const std::vector<Recorded> values = parameters(to);
    const auto y = sense(model_, now.x, now.external.data(), u, values.data());
    read_ = ready(to.program({y.begin(), y.end()}));
}

LocalModel::Moving LocalModel::moving(Recorder& to) const {
    Moving now;
    for (std::size_t i = 0; i < kMotionStates; ++i) now.x[i] = to.input(true);
    for (const std::size_t i : own_) now.x[kMotionStates + i] = to.input(true);
    for (std::size_t i = 0; i < externals_; ++i) now.external[i] = to.input(true);
    return now;
}

std::vector<Recorded> LocalModel::parameters(Recorder& to) const {
    std::vector<Recorded> all;
    all.reserve(kParameterCount);
    for (std::size_t i = 0; i < kParameterCount; ++i)
        all.push_back(to.parameter(p_[i], !columns_of_[i].empty()));
    return all;
}

std::vector<Recorded> LocalModel::packed(const ModelState<Recorded>& x) const {
    std::vector<Recorded> out(x.begin(), x.begin() + kMotionStates);
    for (const std::size_t i : own_) out.push_back(x[kMotionStates + i]);
    return out;
}

LocalModel::Ready LocalModel::ready(Program program) {
    Ready out;
    out.rows.resize(place(program.rows));
    for (const auto& [row, value] : program.uniform)
        std::fill_n(out.rows[place(row)].at, kLanes, value);
    out.adjoints.resize(place(program.slots * kSweep));
    out.program = std::move(program);
    return out;
}

LocalModel::Ready& LocalModel::step_of(double h) {
    const auto found = steps_.find(h);
    if (found != steps_.end()) return found->second;
    Recorder to;
    Moving now = moving(to);
    const InputFor<Recorded> from = recorded_input(to);
    const InputFor<Recorded> until = recorded_input(to);
    const std::vector<Recorded> values = parameters(to);
    advance(model_, now.x, now.external.data(), from, until, values.data(), h, 1);
    return steps_.emplace(h, ready(to.program(packed(now.x)))).first->second;
}

std::vector<double> LocalModel::start(const Run& run) const {
    std::vector<double> out(states_ * width_, 0.0);
    if (own_.count == 0) return out;
    Recorder to;
    const std::vector<Recorded> values = parameters(to);
    Ready all = ready(to.program(packed(initial_state<Recorded>(model_, run, values.data()))));
    sweep(all, [&](std::size_t output, std::size_t input, const LaneRow* row) {
        for (const std::size_t j : columns_of_[input]) out[output * width_ + j] = at(row, 0);
    });
    return out;
}

/// Calls `put(output, input, row)` for every derivative that is not zero; nullptr for ones.
template <class Put>
void LocalModel::sweep(Ready& ready, Put&& put) {
    const Program& program = ready.program;
    for (std::size_t o = 0; o < program.same_as.size(); ++o)
        if (program.same_as[o] >= 0) put(o, place(program.same_as[o]), nullptr);
    for (const Sweep& s : program.sweeps) {
        const std::size_t wide = s.outputs.size();
        const auto slot = [&](std::int32_t i) { return ready.adjoints.data() + place(i) * wide; };
        for (const std::int32_t seed : s.seeds)
            for (std::size_t m = 0; m < wide; ++m) std::fill_n(slot(seed)[m].at, kLanes, 0.0);
        for (std::size_t m = 0; m < wide; ++m) std::fill_n(slot(s.seeds[m])[m].at, kLanes, 1.0);
        lane_kernels().backward(s.steps.data(), s.steps.size(), static_cast<int>(wide),
                                ready.rows.data(), ready.adjoints.data());
        for (std::size_t i = 0; i < s.inputs.size(); ++i)
            for (std::size_t m = 0; s.inputs[i] >= 0 && m < wide; ++m)
                put(place(s.outputs[m]), i, slot(s.inputs[i]) + m);
    }
}

/// The same by places among the numbers of a sample; between states and parameters there are
/// `given` inputs.
template <class Put>
void LocalModel::spread(Ready& ready, std::size_t given, std::size_t by_state,
                        std::size_t by_parameter, Put&& put) const {
    const std::size_t columns = states_ + externals_, first = columns + given;
    sweep(ready, [&](std::size_t output, std::size_t input, const LaneRow* row) {
        if (input < columns) return put(by_state + output * columns + input, row);
        for (const std::size_t j : columns_of_[input - first])
            put(by_parameter + output * width_ + j, row);
    });
}

void LocalModel::read(const PathSample* samples, std::size_t count, double* out) {
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
        const PathSample& s = samples[std::min(lane, count - 1)];
        std::size_t input = 0;
        for (std::size_t i = 0; i < states_; ++i) read_.set(input++, lane, s.here[i]);
        for (std::size_t i = 0; i < externals_; ++i) read_.set(input++, lane, s.pushed_here[i]);
        for (const double v : numbers(s.run->inputs[s.at])) read_.set(input++, lane, v);
    }
    const auto& steps = read_.program.steps;
    lane_kernels().forward(steps.data(), steps.size(), read_.rows.data());
    spread(read_, kGiven, read_at_, read_parameters_, [&](std::size_t to, const LaneRow* row) {
        for (std::size_t lane = 0; lane < count; ++lane) out[lane * size() + to] = at(row, lane);
    });
}

void LocalModel::step(const PathSample* samples, const std::size_t* which, std::size_t count,
                      double* out) {
    const int parts = samples[which[0]].substeps;
    Ready& ready = step_of(samples[which[0]].run->dt / parts);
    const auto& steps = ready.program.steps;
    std::vector<LaneRow> now(states_);
    std::vector<std::vector<double>> later;
    for (int n = 0; n < parts; ++n) {
        for (std::size_t i = 0; n > 0 && i < states_; ++i)
            now[i] = ready.rows[place(ready.program.outputs[i])];
        for (std::size_t lane = 0; lane < kLanes; ++lane) {
            const PathSample& s = samples[which[std::min(lane, count - 1)]];
            std::size_t input = 0;
            for (std::size_t i = 0; i < states_; ++i)
                ready.set(input++, lane, n > 0 ? now[i].at[lane] : s.before[i]);
            for (std::size_t i = 0; i < externals_; ++i) ready.set(input++, lane, s.pushed[i]);
            const Input &from = s.run->inputs[s.at - 1], &to = s.run->inputs[s.at];
            for (const int end : {n, n + 1})
                for (const double v : numbers(between(from, to, static_cast<double>(end) / parts)))
                    ready.set(input++, lane, v);
        }
        lane_kernels().forward(steps.data(), steps.size(), ready.rows.data());
        if (n == 0) {
            spread(ready, 2 * kGiven, 0, step_parameters_, [&](std::size_t to, const LaneRow* row) {
                for (std::size_t lane = 0; lane < count; ++lane)
                    out[which[lane] * size() + to] = at(row, lane);
            });
            continue;
        }
        later.assign(count, std::vector<double>(read_at_, 0.0));
        spread(ready, 2 * kGiven, 0, step_parameters_, [&](std::size_t to, const LaneRow* row) {
            for (std::size_t lane = 0; lane < count; ++lane) later[lane][to] = at(row, lane);
        });
        for (std::size_t lane = 0; lane < count; ++lane)
            chain(later[lane], out + which[lane] * size());
    }
}

/// Derivatives D of what came before, and those J of a later part: D <- J_x D + (0, J_external,
/// J_parameters).
void LocalModel::chain(const std::vector<double>& part, double* whole) const {
    const std::vector<double> before(whole, whole + read_at_);
    const std::size_t columns = states_ + externals_;
    std::copy(part.begin(), part.end(), whole);
    for (std::size_t o = 0; o < states_; ++o) {
        const double* J = part.data() + o * columns;
        double* row = whole + o * columns;
        double* by = whole + step_parameters_ + o * width_;
        std::fill_n(row, states_, 0.0);
        for (std::size_t i = 0; i < states_; ++i) {
            if (J[i] == 0.0) continue;
            for (std::size_t c = 0; c < columns; ++c) row[c] += J[i] * before[i * columns + c];
            for (std::size_t c = 0; c < width_; ++c)
                by[c] += J[i] * before[step_parameters_ + i * width_ + c];
        }
    }
}

void LocalModel::differentiate(const PathSample* samples, std::size_t count, double* out) {
    std::fill_n(out, count * size(), 0.0);
    for (std::size_t first = 0; first < count; first += kLanes)
        read(samples + first, std::min<std::size_t>(kLanes, count - first), out + first * size());
    // Those with steps of one length go together.
    std::map<std::pair<double, int>, std::vector<std::size_t>> alike;
    for (std::size_t k = 0; k < count; ++k)
        if (samples[k].substeps > 0) alike[{samples[k].run->dt, samples[k].substeps}].push_back(k);
    for (const auto& [length, which] : alike)
        for (std::size_t first = 0; first < which.size(); first += kLanes)
            step(samples, which.data() + first, std::min<std::size_t>(kLanes, which.size() - first),
                 out);
}

}  // namespace sysid
