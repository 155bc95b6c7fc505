// The filter whose gains are kept: its runs one sample after the other, or pieces of them side by
// side.
#include <algorithm>
#include <optional>

#include "sysid/dynamics/steer_delay.hpp"
#include "sysid/identify/in_time.hpp"
#include "sysid/identify/lane_filter.hpp"
#include "sysid/identify/prediction_error.hpp"
#include "sysid/identify/row_filter.hpp"

namespace sysid {

namespace {

template <int NX>
void freeze_run(const Problem& problem, std::size_t number, const double* p, FrozenFilter& filter) {
    const Run& run = problem.runs[number];
    const RunSystem<NX> system(problem.model, run, p, filter.noise);
    const std::size_t own = system.own().count, n = filter.rows.size();
    std::vector<int> from(n);
    for (std::size_t i = 0; i < n; ++i) {
        const std::size_t moved = kMotionStates + own;
        from[i] = static_cast<int>(i);
        if (i >= moved)
            from[i] = system.disturbing(i - moved);
        else if (i >= kMotionStates)
            from[i] = system.packed(i - kMotionStates);
    }
    std::vector<int>& substeps = filter.runs[number].substeps;
    filter.log_likelihood += filter_rows_of<NX>(system, [&](std::size_t k, const auto& s) {
        double* to = filter.gain(number, k);
        for (const int row : from)
            for (int c = 0; c < kChannels; ++c) *to++ = s.gain(row, c);
        for (int i = 0; i < kChannels; ++i)
            for (int j = 0; j <= i; ++j) *to++ = s.whitener(i, j);
        if (filter.tells()) {
            to = filter.told(number, k);
            for (int c = 0; c < kChannels; ++c) *to++ = s.innovation(c);
            for (const int row : from) *to++ = s.mean(row);
            for (std::size_t i = 0; i < n; ++i)
                for (std::size_t j = 0; j <= i; ++j) *to++ = s.covariance(from[i], from[j]);
        }
        if (k + 1 < run.size()) {
            substeps[k + 1] = substeps_for(problem.model, p, s.mean(0), run.dt);
            return;
        }
        for (std::size_t i = 0; i < n; ++i)
            filter.deviations[i] =
                std::max(filter.deviations[i], std::sqrt(s.covariance(from[i], from[i])));
    });
}

/// A filter with room for all samples.
FrozenFilter empty(const Problem& problem, const double* p, const Noise& noise) {
    FrozenFilter filter;
    filter.noise = noise;
    filter.rows = filter_rows(problem.model.effects, noise.disturbances());
    filter.deviations.assign(filter.rows.size(), 0.0);
    filter.runs.resize(problem.runs.size());
    const bool tells = problem.samples() <= kToldSamples;
    if (tells) filter.made_of = MadeOf(problem, p);
    for (std::size_t i = 0; i < problem.runs.size(); ++i) {
        for (const Vec<kChannels>& y : problem.runs[i].measurements)
            for (const double v : y) filter.observed += std::isnan(v) ? 0 : 1;
        filter.runs[i].numbers.resize(problem.runs[i].size() * filter.size());
        if (tells) filter.runs[i].told.resize(problem.runs[i].size() * filter.told_size());
        filter.runs[i].substeps.assign(problem.runs[i].size(), 1);
    }
    return filter;
}

}  // namespace

std::vector<int> filter_rows(EffectMask effects, std::size_t disturbances) {
    std::vector<int> rows;
    rows.reserve(kStatesFull + kRoadStates + kColourStates);
    for (int i = 0; i < kMotionStates; ++i) rows.push_back(i);
    for (const std::size_t i : active_states(effects))
        rows.push_back(kStatesPlain + static_cast<int>(i));
    for (int i = 0; i < static_cast<int>(disturbances); ++i)
        rows.push_back(i < kMotionStates ? kMotionStates + i : kStatesFull + i - kMotionStates);
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

bool FrozenFilter::tells_of(const Problem& problem) const {
    return tells() && rows == filter_rows(problem.model.effects, noise.disturbances());
}

FrozenFilter freeze(const Problem& logged, const double* p, const Noise& noise) {
    const InTime in_time(logged, p);
    const Problem& problem = *in_time;
    FrozenFilter filter = empty(problem, p, noise);
    const double forgotten_s = forgets_s(problem, noise);
    if (const std::vector<Piece> pieces =
            pieces_of(problem.runs, forgotten_s, filter_samples(problem.model));
        !pieces.empty()) {
        LaneFilter walk(problem, {p}, noise, pieces);
        walk.keep = [&](const LaneSample& sample, std::size_t lane, int parts) {
            const std::size_t run = pieces[sample.piece].run;
            LaneFilter::write(walk.gain(), lane, filter.gain(run, sample.at));
            LaneFilter::write(walk.whitener(), lane, filter.whitener(run, sample.at));
            if (filter.tells()) {
                double* to = filter.told(run, sample.at);
                to = LaneFilter::write(walk.innovation(), lane, to);
                LaneFilter::write(walk.state(), lane, to);
            }
            if (sample.at > 0) filter.runs[run].substeps[sample.at] = parts;
            if (sample.at + 1 < sample.run->size()) return;
            for (std::size_t i = 0; i < filter.rows.size(); ++i)
                filter.deviations[i] = std::max(filter.deviations[i], walk.deviation(i, lane));
        };
        if (side_by_side(problem.runs, pieces, walk)) {
            filter.log_likelihood = walk.log_likelihood();
            return filter;
        }
    }
    with_state_size(problem.model.effects, noise, [&](auto nx) {
        filter = empty(problem, p, noise);
        for (std::size_t i = 0; i < problem.runs.size(); ++i)
            freeze_run<decltype(nx)::value>(problem, i, p, filter);
    });
    return filter;
}

namespace {

/// Runs for sets of parameters side by side: each with the steering of its own delay.
class RunsOfSets {
  public:
    RunsOfSets(const Problem& logged, const std::vector<const double*>& sets)
        : logged_(logged), first_(logged, sets[0]) {
        for (const double* p : sets) {
            const double delay = steer_delay(logged.model, p);
            const auto known = std::find(delays_.begin(), delays_.end(), delay);
            of_.push_back(static_cast<std::size_t>(known - delays_.begin()));
            if (known != delays_.end()) continue;
            delays_.push_back(delay);
            if (delays_.size() > 1) join(p);
        }
    }

    /// One set of runs after the other.
    const Problem& operator*() const { return joined_ ? *joined_ : *first_; }
    /// Where run number `run` of a set stands.
    std::size_t of(std::size_t set, std::size_t run) const {
        return of_[set] * logged_.runs.size() + run;
    }

  private:
    void join(const double* p) {
        if (!joined_) joined_ = *first_;
        const InTime more(logged_, p);
        joined_->runs.insert(joined_->runs.end(), (*more).runs.begin(), (*more).runs.end());
    }

    const Problem& logged_;
    InTime first_;
    std::optional<Problem> joined_;
    std::vector<double> delays_;
    std::vector<std::size_t> of_;
};

/// How many delays of the steering sets of parameters have.
std::size_t delays_of(const SingleTrack& model, const std::vector<const double*>& sets) {
    std::vector<double> delays;
    delays.reserve(sets.size());
    for (const double* p : sets) delays.push_back(steer_delay(model, p));
    std::sort(delays.begin(), delays.end());
    return static_cast<std::size_t>(std::unique(delays.begin(), delays.end()) - delays.begin());
}

/// For sets of parameters in the lanes; false where that cannot be done.
bool likelihoods_together(const Problem& logged, std::vector<const double*> sets,
                          const Noise& noise, double* out) {
    constexpr std::size_t kFewest = 4;  // below, lanes gain nothing
    const std::size_t count = sets.size();
    if (count < kFewest) return false;
    // Each delay takes a copy of the runs.
    const std::size_t delays = delays_of(logged.model, sets);
    if (delays > 1 && delays * logged.samples() > kLanes * kToldSamples) return false;
    sets.resize(kLanes, sets[0]);
    const RunsOfSets runs(logged, sets);
    const Problem& problem = *runs;
    std::vector<Piece> pieces;
    for (std::size_t run = 0; run < logged.runs.size(); ++run)
        for (std::size_t set = 0; set < kLanes; ++set)
            pieces.push_back({runs.of(set, run), 0, logged.runs[run].size(), set});
    try {
        LaneFilter walk(problem, sets, noise, pieces);
        if (!side_by_side(problem.runs, pieces, walk)) return false;
        for (std::size_t i = 0; i < count; ++i) out[i] = walk.log_likelihood(i);
    } catch (const NumericalFailure&) {
        return false;
    }
    return true;
}

}  // namespace

void log_likelihoods(const Problem& problem, const std::vector<const double*>& sets,
                     const Noise& noise, double* out) {
    for (std::size_t first = 0; first < sets.size(); first += kLanes) {
        const std::size_t last = std::min<std::size_t>(sets.size(), first + kLanes);
        const std::vector<const double*> some(sets.begin() + static_cast<long>(first),
                                              sets.begin() + static_cast<long>(last));
        if (likelihoods_together(problem, some, noise, out + first)) continue;
        for (std::size_t i = first; i < last; ++i) try {
                out[i] = freeze(problem, sets[i], noise).log_likelihood;
            } catch (const NumericalFailure&) {
                out[i] = -std::numeric_limits<double>::infinity();
            }
    }
}

}  // namespace sysid
