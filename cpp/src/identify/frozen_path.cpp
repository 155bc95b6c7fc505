#include "sysid/identify/frozen_path.hpp"

#include <algorithm>

#include "sysid/estimate/frozen.hpp"
#include "sysid/identify/side_by_side.hpp"
#include "sysid/math/interrupt.hpp"

namespace sysid {

namespace {

// Of the fastest rate in a part of an interval, see `substeps_for`. More parts than where the
// filter was frozen are needed only far from there, where fewer were unstable.
constexpr double kTurn = 1.6;

using Errors = std::array<double, kChannels>;

/// What both ways of walking need of a filter.
class Gains {
  public:
    Gains(const Problem& problem, const FrozenFilter& filter)
        : filter_(filter),
          places_(filter.places(filter_rows(problem.model.effects, filter.noise.disturbances()))),
          tells_(filter.tells_of(problem)) {
        std::size_t samples = 0;
        for (const Run& run : problem.runs) {
            first_.push_back(samples);
            samples += run.size();
        }
    }

    /// Keeps the whitened errors of a sample; `state(i)` is a reference to state number i, which is
    /// corrected.
    template <class State>
    void use(std::size_t run, std::size_t k, const Errors& error, FrozenPath& path,
             State&& state) const {
        const std::size_t at = first_[run] + k;
        filter_.whiten(run, k, error.data(), path.whitened.data() + at * kChannels);
        const double* gains = filter_.gain(run, k);
        for (std::size_t i = 0; i < places_.size(); ++i) {
            double& x = state(i);
            if (path.states > 0) path.predicted[at * path.states + i] = x;
            if (places_[i] >= 0) {
                const double* gain = gains + static_cast<std::size_t>(places_[i]) * kChannels;
                double sum = 0.0;
                for (std::size_t j = 0; j < kChannels; ++j) sum += gain[j] * error[j];
                x += sum;
            }
            if (path.states > 0) path.corrected[at * path.states + i] = x;
        }
    }

    /// Whether states of effects follow the motion uncorrected: the filter was frozen without them.
    bool without(std::size_t states) const {
        return std::any_of(places_.begin() + kMotionStates,
                           places_.begin() + static_cast<long>(kMotionStates + states),
                           [](int place) { return place < 0; });
    }

    /// Keeps states that have changed since `use`.
    template <class State>
    void keep_corrected(std::size_t run, std::size_t k, FrozenPath& path, State&& state) const {
        for (std::size_t i = 0; i < path.states && i < places_.size(); ++i)
            path.corrected[(first_[run] + k) * path.states + i] = state(i);
    }

    void keep_parts(std::size_t run, std::size_t k, int parts, FrozenPath& path) const {
        if (path.states > 0) path.parts[first_[run] + k] = parts;
    }

    /// Of state number `i`, as the filter knew it.
    double deviation(std::size_t i) const {
        return places_[i] < 0 ? 0.0 : filter_.deviations[static_cast<std::size_t>(places_[i])];
    }
    const FrozenFilter& filter() const { return filter_; }
    std::size_t states() const { return places_.size(); }
    /// Whether the filter told states like those of the path.
    bool tells() const { return tells_; }

  private:
    const FrozenFilter& filter_;
    std::vector<int> places_;
    bool tells_;
    std::vector<std::size_t> first_;  // sample of each run
};

/// Lets states of effects follow the motion that the first reading has corrected: that reading's
/// noise would be a kick to them.
void settle_at_first(const SingleTrack& model, const Run& run, ModelState<double>& x,
                     const double* p) {
    const std::array<double, kExternals> calm{};
    settle_auxiliary(model, x, calm.data(), run.inputs[0], p);
}

void walk_run(const Problem& problem, std::size_t number, const double* p, const Gains& gains,
              FrozenPath& path) {
    const SingleTrack& model = problem.model;
    const Run& run = problem.runs[number];
    const ActiveStates own = active_states(model.effects);
    const std::size_t moved = kMotionStates + own.count, disturbances = gains.states() - moved;
    std::array<double, kExternals> forget;
    for (std::size_t i = 0; i < kExternals; ++i) forget[i] = gains.filter().noise.forget(i, run.dt);
    ModelState<double> x = initial_state(model, run, p);
    const bool settles = gains.without(own.count);
    std::array<double, kExternals> disturbance{};
    for (std::size_t k = 0; k < run.size(); ++k) {
        poll_interrupt(k);
        if (k > 0) {
            const int parts = std::max(gains.filter().runs[number].substeps[k],
                                       substeps_for(model, p, x[0], run.dt, kTurn));
            gains.keep_parts(number, k, parts, path);
            advance(model, x, disturbance.data(), run.inputs[k - 1], run.inputs[k], p, run.dt,
                    parts);
            for (std::size_t i = 0; i < disturbances; ++i) disturbance[i] *= forget[i];
        }
        const auto y = sense(model, x, disturbance.data(), run.inputs[k], p);
        const auto state = [&](std::size_t i) -> double& {
            if (i < kMotionStates) return x[i];
            return i < moved ? x[kMotionStates + own.place[i - kMotionStates]]
                             : disturbance[i - moved];
        };
        gains.use(number, k, errors_of(run.measurements[k], y), path, state);
        if (k > 0 || !settles) continue;
        settle_at_first(model, run, x, p);
        gains.keep_corrected(number, k, path, state);
    }
}

/// The same for pieces of driving side by side.
class PathWalk {
  public:
    PathWalk(const Problem& problem, const double* p, const std::vector<Piece>& pieces,
             const Gains& gains, FrozenPath& path)
        : problem_(problem),
          pieces_(pieces),
          gains_(gains),
          path_(path),
          model_(problem.model, p, {}, gains.filter().noise.disturbances()),
          rate_(problem.model.fastest_rate(p, 1.0)),
          settles_(gains.without(model_.own().count)),
          state_(model_.moving()),
          forget_(model_.externals()) {}

    std::vector<LaneRow>& state() { return state_; }

    void begin(const Piece& piece, double* to) const {
        const std::size_t at = piece.begin > 0 ? piece.begin - 1 : 0;
        if (piece.begin > 0 && gains_.tells()) {
            // Its parameters were not far from these.
            std::copy_n(gains_.filter().told(piece.run, at) + kChannels, gains_.states(), to);
            return;
        }
        const auto x = initial_state(model_.model(), problem_.runs[piece.run],
                                     model_.parameters(piece.set), at);
        std::fill_n(to, state_.size(), 0.0);
        to = std::copy_n(x.begin(), kMotionStates, to);
        for (const std::size_t i : model_.own()) *to++ = x[kMotionStates + i];
    }

    double distance(const double* a, const double* b) const {
        double far = 0.0;
        for (std::size_t i = 0; i < state_.size(); ++i) {
            const double off = apart(a[i], b[i], gains_.deviation(i));
            if (!(off <= far)) far = off;
        }
        return far;
    }

    bool sample(const LaneSamples& samples) {
        std::array<int, kLanes> parts{};
        for (std::size_t lane = 0; lane < kLanes; ++lane) {
            const LaneSample& s = samples[lane];
            if (disturbed_[lane] != s.run) {
                disturbed_[lane] = s.run;
                for (std::size_t i = 0; i < model_.externals(); ++i)
                    forget_[i].at[lane] = gains_.filter().noise.forget(i, s.run->dt);
            }
            if (s.at > 0)
                parts[lane] = std::max(gains_.filter().runs[pieces_[s.piece].run].substeps[s.at],
                                       substeps_for(rate_, state_[0].at[lane], s.run->dt, kTurn));
        }
        by_length(samples, parts, state_, [&](std::size_t like) {
            move_lanes(model_, samples, samples[like].run->dt, parts[like], state_.data(),
                       [](RecordedModel::Ready&) {});
            for (std::size_t i = 0; i < model_.externals(); ++i)
                for (std::size_t lane = 0; lane < kLanes; ++lane)
                    state_[model_.states() + i].at[lane] *= forget_[i].at[lane];
        });
        const RecordedModel::Ready& ready = read_lanes(model_, samples, state_.data());
        for (std::size_t lane = 0; lane < kLanes; ++lane) {
            const LaneSample& s = samples[lane];
            if (!s.keep) continue;
            Errors y;
            for (std::size_t c = 0; c < kChannels; ++c) y[c] = ready.output(c).at[lane];
            const Errors error = errors_of(s.run->measurements[s.at], y);
            for (const double e : error)
                if (!std::isfinite(e)) return false;
            const std::size_t run = pieces_[s.piece].run;
            gains_.keep_parts(run, s.at, parts[lane], path_);
            const auto state = [&](std::size_t i) -> double& { return state_[i].at[lane]; };
            gains_.use(run, s.at, error, path_, state);
            if (s.at > 0 || !settles_) continue;
            settle(*s.run, lane, pieces_[s.piece].set);
            gains_.keep_corrected(run, s.at, path_, state);
        }
        return true;
    }

    void finish(std::size_t /*first*/, std::size_t /*last*/) const {}

  private:
    void settle(const Run& run, std::size_t lane, std::size_t set) {
        ModelState<double> x{};
        for (std::size_t i = 0; i < kMotionStates; ++i) x[i] = state_[i].at[lane];
        settle_at_first(model_.model(), run, x, model_.parameters(set));
        std::size_t to = kMotionStates;
        for (const std::size_t i : model_.own()) state_[to++].at[lane] = x[kMotionStates + i];
    }

    const Problem& problem_;
    const std::vector<Piece>& pieces_;
    const Gains& gains_;
    FrozenPath& path_;
    RecordedModel model_;
    double rate_;
    bool settles_;
    std::vector<LaneRow> state_, forget_;
    std::array<const Run*, kLanes> disturbed_{};
};

/// The path of the parameters that the filter has run with.
void as_told(const Problem& problem, const FrozenFilter& filter, FrozenPath& path) {
    const std::size_t n = filter.rows.size();
    double *predicted = path.predicted.data(), *corrected = path.corrected.data();
    for (std::size_t i = 0, at = 0; i < problem.runs.size(); ++i)
        for (std::size_t k = 0; k < problem.runs[i].size(); ++k, ++at) {
            poll_interrupt(k);
            const double *error = filter.told(i, k), *mean = error + kChannels;
            filter.whiten(i, k, error, path.whitened.data() + at * kChannels);
            if (path.states == 0) continue;
            path.parts[at] = filter.runs[i].substeps[k];
            std::copy_n(mean, n, corrected + at * path.states);
            filter.predicted(i, k, predicted + at * path.states);
        }
}

}  // namespace

void FrozenPath::resize(std::size_t samples, std::size_t states_kept) {
    states = states_kept;
    whitened.resize(samples * kChannels);
    predicted.resize(samples * states);
    corrected.resize(samples * states);
    if (states > 0) parts.resize(samples);
}

FrozenPath frozen_path(const Problem& problem, const double* p, const FrozenFilter& filter,
                       bool with_states) {
    const Gains gains(problem, filter);
    FrozenPath path;
    const std::size_t moved = kMotionStates + active_states(problem.model.effects).count;
    path.resize(problem.samples(), with_states ? moved + kExternals : 0);
    if (filter.tells_of(problem) && filter.made_of.is(problem, p)) {
        as_told(problem, filter, path);
        return path;
    }
    const double forgotten_s = forgets_s(problem, filter.noise);
    if (const std::vector<Piece> pieces = pieces_of(problem.runs, forgotten_s, kPathSamples);
        !pieces.empty()) {
        PathWalk walk(problem, p, pieces, gains, path);
        if (side_by_side(problem.runs, pieces, walk)) return path;
    }
    for (std::size_t i = 0; i < problem.runs.size(); ++i) walk_run(problem, i, p, gains, path);
    return path;
}

}  // namespace sysid
