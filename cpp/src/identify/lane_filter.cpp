#include "sysid/identify/lane_filter.hpp"

#include <algorithm>

#include "sysid/identify/start.hpp"

namespace sysid {

LaneFilter::LaneFilter(const Problem& problem, const std::vector<const double*>& sets,
                       const Noise& noise, const std::vector<Piece>& pieces)
    : problem_(problem),
      noise_(noise),
      pieces_(pieces),
      model_(problem.model, sets, {}, noise.disturbances()),
      n_(model_.moving()),
      state_(n_ + packed(n_, 0)),
      part_(model_.states() * n_),
      observation_(kChannels * n_),
      transition_(part_.size()),
      gain_(n_ * kChannels),
      forget_(model_.externals()),
      process_(n_),
      whitener_(kWhitener),
      innovation_(kChannels),
      present_(kChannels),
      variance_(kChannels),
      sensors_(kChannels),
      by_state_(part_.size()),
      seen_(observation_.size()) {
    std::fill_n(one_.at, kLanes, 1.0);
    for (std::size_t lane = 0; lane < kLanes; ++lane)
        rate_[lane] = problem.model.fastest_rate(model_.parameters(lane), 1.0);
    for (std::size_t c = 0; c < kChannels; ++c)
        std::fill_n(sensors_[c].at, kLanes, noise.sensor[c] * noise.sensor[c]);
    for (const Piece& piece : pieces) {
        first_block_.push_back(density_.size());
        density_.resize(density_.size() + (piece.size() + kMark - 1) / kMark);
    }
}

double LaneFilter::log_likelihood(std::size_t set) const {
    double sum = 0.0;
    for (std::size_t i = 0; i < pieces_.size(); ++i) {
        if (pieces_[i].set != set) continue;
        const std::size_t blocks = (pieces_[i].size() + kMark - 1) / kMark;
        for (std::size_t n = 0; n < blocks; ++n) sum += density_[first_block_[i] + n].value();
    }
    return sum;
}

void LaneFilter::write_sample(std::size_t lane, double* to) const {
    to = write(transition_, lane, to);
    for (const LaneRow* row : seen_) *to++ = row == nullptr ? 0.0 : row->at[lane];
    for (const Rows* rows : {&gain_, &whitener_, &innovation_, &state_})
        to = write(*rows, lane, to);
}

void LaneFilter::begin(const Piece& piece, double* to) const {
    const Run& run = problem_.runs[piece.run];
    const std::size_t at = piece.begin > 0 ? piece.begin - 1 : 0;
    const auto x = initial_state(model_.model(), run, model_.parameters(piece.set), at);
    std::fill_n(to, state_.size(), 0.0);
    for (std::size_t i = 0; i < kMotionStates; ++i) to[i] = x[i];
    for (std::size_t i = 0; i < model_.own().count; ++i)
        to[kMotionStates + i] = x[kMotionStates + model_.own().place[i]];
    const auto known =
        start_covariance(model_.model(), x, run.inputs[at], model_.parameters(piece.set));
    for (std::size_t i = 0; i < model_.states(); ++i)
        for (std::size_t j = 0; j <= i; ++j)
            to[n_ + packed(i, j)] = known(static_cast<int>(i), static_cast<int>(j));
    for (std::size_t i = 0; i < model_.externals(); ++i) {
        const double s = noise_.deviation_of(i);
        const std::size_t place = model_.states() + i;
        to[n_ + packed(place, place)] = s * s;
    }
}

double LaneFilter::distance(const double* a, const double* b) const {
    double far = 0.0;
    const auto variance = [&](std::size_t i) { return std::abs(a[n_ + packed(i, i)]); };
    for (std::size_t i = 0; i < n_; ++i) {
        const double s = std::sqrt(variance(i));
        const double off = apart(a[i], b[i], s);
        if (!(off <= far)) far = off;
        const double size = s + 1e-2 * std::abs(a[i]);
        for (std::size_t j = 0; j <= i; ++j) {
            const double other = std::sqrt(variance(j)) + 1e-2 * std::abs(a[j]);
            const std::size_t at = n_ + packed(i, j);
            const double change = std::abs(a[at] - b[at]) / (10.0 * kMet * size * other + 1e-40);
            if (!(change <= far)) far = change;
        }
    }
    return far;
}

bool LaneFilter::sample(const LaneSamples& samples) {
    const LaneKernels& kernels = lane_kernels();
    std::array<int, kLanes> parts{};
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
        const LaneSample& s = samples[lane];
        disturb(lane, *s.run);
        if (s.at > 0) parts[lane] = substeps_for(rate_[lane], state_[0].at[lane], s.run->dt);
    }
    by_length(samples, parts, state_, [&](std::size_t like) {
        LaneRow* covariance = state_.data() + n_;
        bool first = true;
        move_lanes(model_, samples, samples[like].run->dt, parts[like], state_.data(),
                   [&](RecordedModel::Ready& ready) {
                       differentiate(ready, part_, by_state_);
                       kernels.propagate(by_state_.data(), model_.states(), n_, covariance);
                       if (with_transition) chain(samples, parts, like, first);
                       first = false;
                   });
        for (std::size_t i = 0; i < model_.externals(); ++i)
            for (std::size_t lane = 0; lane < kLanes; ++lane)
                state_[model_.states() + i].at[lane] *= forget_[i].at[lane];
        kernels.disturb(forget_.data(), process_.data(), model_.states(), n_, covariance);
    });
    RecordedModel::Ready& ready = read_lanes(model_, samples, state_.data());
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
        const Vec<kChannels>& y = samples[lane].run->measurements[samples[lane].at];
        for (std::size_t c = 0; c < kChannels; ++c) {
            const double measured = y[static_cast<int>(c)];
            const bool there = !std::isnan(measured);
            present_[c].at[lane] = there ? 1.0 : 0.0;
            innovation_[c].at[lane] = there ? measured - ready.output(c).at[lane] : 0.0;
        }
    }
    differentiate(ready, observation_, seen_);
    LaneUpdate u;
    u.states = n_;
    u.readings = kChannels;
    u.observation = seen_.data();
    u.noise = sensors_.data();
    u.present = present_.data();
    one_after_ = innovation_;
    u.innovation = one_after_.data();
    u.variance = variance_.data();
    u.gain = gain_.data();
    u.whitener = whitener_.data();
    kernels.correct(u, state_.data(), state_.data() + n_);
    for (std::size_t lane = 0; lane < kLanes; ++lane)
        if (samples[lane].keep && !kept(samples[lane], lane, parts[lane])) return false;
    return true;
}

/// The derivatives by what moves, a row each; nullptr where one is zero.
void LaneFilter::differentiate(RecordedModel::Ready& ready, Rows& values, Pointers& to) const {
    std::fill(to.begin(), to.end(), nullptr);
    RecordedModel::sweep(ready, [&](std::size_t output, std::size_t input, const LaneRow* row) {
        const std::size_t at = output * n_ + input;
        to[at] = &one_;
        if (row == nullptr) return;
        values[at] = *row;
        to[at] = &values[at];
    });
}

/// What time does to the disturbances of a run, and what it adds to all.
void LaneFilter::disturb(std::size_t lane, const Run& run) {
    if (disturbed_[lane] == &run) return;
    disturbed_[lane] = &run;
    for (std::size_t i = 0; i < n_; ++i) process_[i].at[lane] = 0.0;
    for (std::size_t i = 0; i < kMotionStates; ++i)
        process_[i].at[lane] = noise_.motion[i] * noise_.motion[i] * run.dt;
    for (std::size_t i = 0; i < model_.externals(); ++i) {
        const double left = noise_.forget(i, run.dt), s = noise_.deviation_of(i);
        forget_[i].at[lane] = left;
        process_[model_.states() + i].at[lane] = s * s * (1.0 - left * left);
    }
}

/// The transition over one part more, of the lanes with steps like those of that lane.
void LaneFilter::chain(const LaneSamples& samples, const std::array<int, kLanes>& parts,
                       std::size_t like, bool first) {
    const std::size_t rows = model_.states();
    const Rows before = first ? Rows{} : transition_;
    for (std::size_t lane = like; lane < kLanes; ++lane) {
        if (parts[lane] != parts[like] || samples[lane].run->dt != samples[like].run->dt) continue;
        const auto by = [&](std::size_t r, std::size_t c) {
            const LaneRow* row = by_state_[r * n_ + c];
            return row == nullptr ? 0.0 : row->at[lane];
        };
        for (std::size_t r = 0; r < rows; ++r)
            for (std::size_t c = 0; c < n_; ++c) {
                double sum = first || c >= rows ? by(r, c) : 0.0;
                for (std::size_t k = 0; k < rows && !first; ++k)
                    sum += by(r, k) * before[k * n_ + c].at[lane];
                transition_[r * n_ + c].at[lane] = sum;
            }
    }
}

/// False where rounding may count: that is a matter of care, one sample after the other.
bool LaneFilter::kept(const LaneSample& s, std::size_t lane, int parts) {
    struct Seen {
        double squares = 0.0, determinant = 1.0;
        int observed = 0;
    } seen;
    for (std::size_t c = 0; c < kChannels; ++c) {
        if (present_[c].at[lane] == 0.0) continue;
        const double variance = variance_[c].at[lane], e = one_after_[c].at[lane];
        if (!std::isfinite(variance) || !std::isfinite(e) || !(variance > 0.0) ||
            sensors_[c].at[lane] < kSurest * variance)
            return false;
        ++seen.observed;
        seen.squares += e * e / variance;
        seen.determinant *= variance;
    }
    const std::size_t at = s.at - pieces_[s.piece].begin;
    LogDensity& block = density_[first_block_[s.piece] + at / kMark];
    if (at % kMark == 0) block = {};
    block.add(seen);
    if (keep) keep(s, lane, parts);
    return block.finite();
}

}  // namespace sysid
