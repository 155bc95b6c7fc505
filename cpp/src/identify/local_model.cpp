#include "sysid/identify/local_model.hpp"

#include <algorithm>
#include <map>

#include "sysid/math/whole.hpp"

namespace sysid {

namespace {

double at(const LaneRow* row, std::size_t lane) { return row == nullptr ? 1.0 : row->at[lane]; }

}  // namespace

LocalModel::LocalModel(const SingleTrack& model, const double* p, const std::vector<int>& columns,
                       std::size_t width, std::size_t externals)
    : model_(model, p, columns, externals),
      columns_of_(kParameterCount),
      width_(width),
      step_parameters_(states() * model_.moving()),
      read_at_(step_parameters_ + states() * width_),
      read_parameters_(read_at_ + kChannels * model_.moving()) {
    for (std::size_t j = 0; j < columns.size(); ++j) columns_of_[index(columns[j])].push_back(j);
}

std::vector<double> LocalModel::start(const Run& run) const {
    std::vector<double> out(states() * width_, 0.0);
    Ready all = model_.start_of(run);
    RecordedModel::sweep(all, [&](std::size_t output, std::size_t input, const LaneRow* row) {
        for (const std::size_t j : columns_of_[input]) out[output * width_ + j] = at(row, 0);
    });
    return out;
}

/// Calls `put(place, row)` for every derivative that is not zero, with its place among the numbers
/// of a sample.
template <class Put>
void LocalModel::spread(Ready& ready, std::size_t inputs_given, std::size_t by_state,
                        std::size_t by_parameter, Put&& put) const {
    const std::size_t columns = model_.moving();
    const std::size_t first = columns + inputs_given * RecordedModel::kGiven;
    RecordedModel::sweep(ready, [&](std::size_t output, std::size_t input, const LaneRow* row) {
        if (input < columns) return put(by_state + output * columns + input, row);
        for (const std::size_t j : columns_of_[input - first])
            put(by_parameter + output * width_ + j, row);
    });
}

void LocalModel::read(const PathSample* samples, std::size_t count, double* out) {
    Ready& ready = model_.reading();
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
        const PathSample& s = samples[std::min(lane, count - 1)];
        for (std::size_t i = 0; i < states(); ++i) ready.set(i, lane, s.here[i]);
        for (std::size_t i = 0; i < externals(); ++i)
            ready.set(states() + i, lane, s.pushed_here[i]);
        ready.give(0, lane, s.run->inputs[s.at]);
    }
    ready.run();
    spread(ready, 1, read_at_, read_parameters_, [&](std::size_t to, const LaneRow* row) {
        for (std::size_t lane = 0; lane < count; ++lane) out[lane * size() + to] = at(row, lane);
    });
}

void LocalModel::step(const PathSample* samples, const std::size_t* which, std::size_t count,
                      double* out) {
    const int parts = samples[which[0]].substeps;
    Ready& ready = model_.step_of(samples[which[0]].run->dt, parts);
    const int programs = model_.programs(parts);
    std::vector<LaneRow> now(states());
    std::vector<std::vector<double>> later;
    for (int n = 0; n < programs; ++n) {
        for (std::size_t i = 0; n > 0 && i < states(); ++i) now[i] = ready.output(i);
        for (std::size_t lane = 0; lane < kLanes; ++lane) {
            const PathSample& s = samples[which[std::min(lane, count - 1)]];
            for (std::size_t i = 0; i < states(); ++i)
                ready.set(i, lane, n > 0 ? now[i].at[lane] : s.before[i]);
            for (std::size_t i = 0; i < externals(); ++i)
                ready.set(states() + i, lane, s.pushed[i]);
            const Input &from = s.run->inputs[s.at - 1], &to = s.run->inputs[s.at];
            ready.give(0, lane, between(from, to, static_cast<double>(n) / programs));
            ready.give(1, lane, between(from, to, (n + 1.0) / programs));
        }
        ready.run();
        if (n == 0) {
            spread(ready, 2, 0, step_parameters_, [&](std::size_t to, const LaneRow* row) {
                for (std::size_t lane = 0; lane < count; ++lane)
                    out[which[lane] * size() + to] = at(row, lane);
            });
            continue;
        }
        later.assign(count, std::vector<double>(read_at_, 0.0));
        spread(ready, 2, 0, step_parameters_, [&](std::size_t to, const LaneRow* row) {
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
    const std::size_t columns = model_.moving();
    std::copy(part.begin(), part.end(), whole);
    for (std::size_t o = 0; o < states(); ++o) {
        const double* J = part.data() + o * columns;
        double* row = whole + o * columns;
        double* by = whole + step_parameters_ + o * width_;
        std::fill_n(row, states(), 0.0);
        for (std::size_t i = 0; i < states(); ++i) {
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
