// The filter whose gains are kept: its runs one sample after the other, or pieces of them side by
// side.
#include <algorithm>

#include "sysid/estimate/frozen.hpp"
#include "sysid/identify/prediction_error.hpp"
#include "sysid/identify/run_system.hpp"
#include "sysid/identify/side_by_side.hpp"

namespace sysid {

namespace {

std::size_t packed(std::size_t i, std::size_t j) { return i * (i + 1) / 2 + j; }

template <int NX>
void freeze_run(const Problem& problem, std::size_t number, const double* p, FrozenFilter& filter) {
    const Run& run = problem.runs[number];
    const RunSystem<NX> system(problem.model, run, p, filter.noise);
    const std::size_t own = system.own().count, n = filter.rows.size();
    std::vector<int> from(n);
    for (std::size_t i = 0; i < n; ++i) {
        const bool moves = i < kMotionStates + own;
        from[i] = i < kMotionStates ? static_cast<int>(i)
                  : moves           ? system.packed(i - kMotionStates)
                                    : system.disturbing(i - kMotionStates - own);
    }
    std::vector<int>& substeps = filter.runs[number].substeps;
    filter.log_likelihood +=
        filter_run<NX>(system, [&](std::size_t k, const FilterStep<NX, kChannels>& s) {
            double* to = filter.gain(number, k);
            for (const int row : from)
                for (int c = 0; c < kChannels; ++c) *to++ = s.update.gain(row, c);
            const auto whitener = whitener_of<kChannels>(s.update, run.measurements[k]);
            for (int i = 0; i < kChannels; ++i)
                for (int j = 0; j <= i; ++j) *to++ = whitener(i, j);
            if (k + 1 < run.size()) {
                substeps[k + 1] = substeps_for(problem.model, p, s.mean[0], run.dt);
                return;
            }
            for (std::size_t i = 0; i < n; ++i)
                filter.deviations[i] =
                    std::max(filter.deviations[i], std::sqrt(s.covariance(from[i], from[i])));
        });
}

/// The same for pieces of driving side by side. The states are in the order of the filter's rows,
/// their covariance stands behind them.
class FilterWalk {
  public:
    FilterWalk(const Problem& problem, const double* p, const std::vector<Piece>& pieces,
               FrozenFilter& filter)
        : problem_(problem),
          filter_(filter),
          model_(problem.model, p, {}, filter.noise.sloping()),
          rate_(problem.model.fastest_rate(p, 1.0)),
          n_(model_.moving()),
          state_(n_ + packed(n_, 0)),
          transition_(model_.states() * n_),
          observation_(kChannels * n_),
          by_state_(transition_.size()),
          seen_(observation_.size()),
          gain_(n_ * kChannels),
          forget_(model_.externals()),
          process_(n_),
          pieces_(pieces) {
        std::fill_n(one_.at, kLanes, 1.0);
        for (std::size_t c = 0; c < kChannels; ++c)
            std::fill_n(sensors_[c].at, kLanes, filter.noise.sensor[c] * filter.noise.sensor[c]);
        for (const Piece& piece : pieces) {
            first_block_.push_back(density_.size());
            density_.resize(density_.size() + (piece.size() + kMark - 1) / kMark);
        }
    }

    std::vector<LaneRow>& state() { return state_; }

    void begin(const Piece& piece, double* to) const {
        const Run& run = problem_.runs[piece.run];
        const std::size_t at = piece.begin > 0 ? piece.begin - 1 : 0;
        const auto x = initial_state(model_.model(), run, model_.parameters(), at);
        std::fill_n(to, state_.size(), 0.0);
        const auto variance = [&](std::size_t i) -> double& { return to[n_ + packed(i, i)]; };
        constexpr auto spreads = effect_state_spreads();
        for (std::size_t i = 0; i < kMotionStates; ++i) {
            to[i] = x[i];
            variance(i) = kFirstVariances[i];
        }
        for (std::size_t i = 0; i < model_.own().count; ++i) {
            const std::size_t place = model_.own().place[i];
            to[kMotionStates + i] = x[kMotionStates + place];
            variance(kMotionStates + i) = spreads[place] * spreads[place];
        }
        for (std::size_t i = 0; i < model_.externals(); ++i) {
            const double s = filter_.noise.deviation_of(i);
            variance(model_.states() + i) = s * s;
        }
    }

    double distance(const double* a, const double* b) const {
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
                const double change =
                    std::abs(a[at] - b[at]) / (10.0 * kMet * size * other + 1e-40);
                if (!(change <= far)) far = change;
            }
        }
        return far;
    }

    bool sample(const LaneSamples& samples) {
        std::array<int, kLanes> parts{};
        for (std::size_t lane = 0; lane < kLanes; ++lane) {
            const LaneSample& s = samples[lane];
            disturb(lane, *s.run);
            if (s.at > 0) parts[lane] = substeps_for(rate_, state_[0].at[lane], s.run->dt);
        }
        by_length(samples, parts, state_, [&](std::size_t like) {
            move_lanes(model_, samples, samples[like].run->dt, parts[like], state_.data(),
                       [&](RecordedModel::Ready& ready) {
                           differentiate(ready, transition_, by_state_);
                           lane_kernels().propagate(by_state_.data(), model_.states(), n_,
                                                    state_.data() + n_);
                       });
            for (std::size_t i = 0; i < model_.externals(); ++i)
                for (std::size_t lane = 0; lane < kLanes; ++lane)
                    state_[model_.states() + i].at[lane] *= forget_[i].at[lane];
            lane_kernels().disturb(forget_.data(), process_.data(), model_.states(), n_,
                                   state_.data() + n_);
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
        u.innovation = innovation_.data();
        u.variance = variance_.data();
        u.gain = gain_.data();
        u.whitener = whitener_.data();
        lane_kernels().correct(u, state_.data(), state_.data() + n_);
        for (std::size_t lane = 0; lane < kLanes; ++lane)
            if (samples[lane].keep && !keep(samples[lane], lane, parts[lane])) return false;
        return true;
    }

    /// Sums what is left where pieces were kept.
    void finish() const {
        for (const LogDensity& block : density_) filter_.log_likelihood += block.value();
    }

  private:
    struct Seen {
        double squares = 0.0, determinant = 1.0;
        int observed = 0;
    };

    /// The derivatives by what moves, a row each; nullptr where one is zero.
    void differentiate(RecordedModel::Ready& ready, std::vector<LaneRow>& values,
                       std::vector<const LaneRow*>& to) const {
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
    void disturb(std::size_t lane, const Run& run) {
        if (disturbed_[lane] == &run) return;
        disturbed_[lane] = &run;
        const Noise& noise = filter_.noise;
        for (std::size_t i = 0; i < n_; ++i) process_[i].at[lane] = 0.0;
        for (std::size_t i = 0; i < kMotionStates; ++i)
            process_[i].at[lane] = noise.motion[i] * noise.motion[i] * run.dt;
        for (std::size_t i = 0; i < model_.externals(); ++i) {
            const double left = noise.forget(i, run.dt), s = noise.deviation_of(i);
            forget_[i].at[lane] = left;
            process_[model_.states() + i].at[lane] = s * s * (1.0 - left * left);
        }
    }

    /// False where rounding may count: that is a matter of care, one sample after the other.
    bool keep(const LaneSample& s, std::size_t lane, int parts) {
        const Piece& piece = pieces_[s.piece];
        Seen seen;
        for (std::size_t c = 0; c < kChannels; ++c) {
            if (present_[c].at[lane] == 0.0) continue;
            const double variance = variance_[c].at[lane], e = innovation_[c].at[lane];
            if (!std::isfinite(variance) || !std::isfinite(e) || !(variance > 0.0) ||
                sensors_[c].at[lane] < kSurest * variance)
                return false;
            ++seen.observed;
            seen.squares += e * e / variance;
            seen.determinant *= variance;
        }
        LogDensity& block = density_[first_block_[s.piece] + (s.at - piece.begin) / kMark];
        if ((s.at - piece.begin) % kMark == 0) block = {};
        block.add(seen);
        double* to = filter_.gain(piece.run, s.at);
        for (const LaneRow& row : gain_) *to++ = row.at[lane];
        for (const LaneRow& row : whitener_) *to++ = row.at[lane];
        if (s.at > 0) filter_.runs[piece.run].substeps[s.at] = parts;
        for (std::size_t i = 0; i < n_ && s.at + 1 == s.run->size(); ++i)
            filter_.deviations[i] =
                std::max(filter_.deviations[i], std::sqrt(state_[n_ + packed(i, i)].at[lane]));
        return block.finite();
    }

    const Problem& problem_;
    FrozenFilter& filter_;
    RecordedModel model_;
    double rate_;
    std::size_t n_;
    std::vector<LaneRow> state_, transition_, observation_;
    std::vector<const LaneRow*> by_state_, seen_;
    std::vector<LaneRow> gain_, forget_, process_;
    std::array<LaneRow, kChannels> sensors_, present_, innovation_, variance_;
    std::array<LaneRow, kWhitener> whitener_;
    LaneRow one_;
    std::array<const Run*, kLanes> disturbed_{};
    const std::vector<Piece>& pieces_;
    std::vector<std::size_t> first_block_;
    std::vector<LogDensity> density_;
};

/// A filter with room for all samples.
FrozenFilter empty(const Problem& problem, const Noise& noise) {
    FrozenFilter filter;
    filter.noise = noise;
    filter.rows = filter_rows(problem.model.effects, noise.sloping());
    filter.deviations.assign(filter.rows.size(), 0.0);
    filter.runs.resize(problem.runs.size());
    for (std::size_t i = 0; i < problem.runs.size(); ++i) {
        for (const Vec<kChannels>& y : problem.runs[i].measurements)
            for (const double v : y) filter.observed += std::isnan(v) ? 0 : 1;
        filter.runs[i].numbers.resize(problem.runs[i].size() * filter.size());
        filter.runs[i].substeps.assign(problem.runs[i].size(), 1);
    }
    return filter;
}

}  // namespace

std::vector<int> filter_rows(EffectMask effects, bool sloping) {
    std::vector<int> rows;
    for (int i = 0; i < kMotionStates; ++i) rows.push_back(i);
    for (const std::size_t i : active_states(effects))
        rows.push_back(kStatesPlain + static_cast<int>(i));
    for (int i = 0; i < kMotionStates; ++i) rows.push_back(kMotionStates + i);
    for (int i = 0; i < kRoadStates && sloping; ++i) rows.push_back(kStatesFull + i);
    return rows;
}

std::vector<int> FrozenFilter::places(const std::vector<int>& of) const {
    std::vector<int> out;
    for (const int row : of) {
        const auto found = std::find(rows.begin(), rows.end(), row);
        out.push_back(found == rows.end() ? -1 : static_cast<int>(found - rows.begin()));
    }
    return out;
}

FrozenFilter freeze(const Problem& problem, const double* p, const Noise& noise) {
    FrozenFilter filter = empty(problem, noise);
    if (const std::vector<Piece> pieces = pieces_of(problem.runs); !pieces.empty()) {
        FilterWalk walk(problem, p, pieces, filter);
        if (side_by_side(problem.runs, pieces, walk)) {
            walk.finish();
            return filter;
        }
        filter = empty(problem, noise);
    }
    with_state_size(problem.model.effects, noise, [&](auto nx) {
        for (std::size_t i = 0; i < problem.runs.size(); ++i)
            freeze_run<decltype(nx)::value>(problem, i, p, filter);
    });
    return filter;
}

}  // namespace sysid
