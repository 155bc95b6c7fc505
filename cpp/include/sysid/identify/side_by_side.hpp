// Pieces of driving side by side, one in each lane.
//
// A filter forgets where it began. Each piece begins at a guess; those that follow another piece
// are done again from where that one ended, until both ways have met, to `kMet` of what the filter
// does not know. Where they do not meet soon the samples have to be done one after the other.
#pragma once

#include <array>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "sysid/identify/recorded_model.hpp"
#include "sysid/math/interrupt.hpp"

namespace sysid {

/// Samples `begin` to `end` of a run, with a set of parameters where there are several.
struct Piece {
    std::size_t run, begin, end, set = 0;
    std::size_t size() const { return end - begin; }
};

/// Seconds in which a filter with this noise has forgotten where it began: the slowest pole of the
/// stationary filters of the motion along and across, each with its force and the slope of the
/// road. What is read of these two alone says which of them it is takes longest to forget.
double forgets_s(const Problem& problem, const Noise& noise);

/// Samples done one after the other that cost as much as a step of all lanes, along a path with
/// frozen gains and of the filter.
constexpr std::size_t kPathSamples = 6, kFilterSamples = 4;

/// The same of the filter of a model. With states of effects a single sample takes another stage of
/// the step, with many of them two passes through the model; lanes take what there is.
std::size_t filter_samples(const SingleTrack& model);

/// How runs are cut so that the lanes are full, into pieces of so many samples at most; nothing
/// where lanes would gain nothing, because the pieces are not much longer than what is forgotten.
std::vector<Piece> pieces_of(const std::vector<Run>& runs, double forgotten_s = 0.0,
                             std::size_t samples_of_step = kFilterSamples,
                             std::size_t most = std::numeric_limits<std::size_t>::max());

/// A sample in a lane. Where it is not to be kept the lane has nothing to do.
struct LaneSample {
    const Run* run = nullptr;
    std::size_t piece = 0, at = 0;
    bool keep = false;
    const Input& input() const { return run->inputs[at]; }
    const Input& input_before() const { return run->inputs[at > 0 ? at - 1 : 0]; }
};
using LaneSamples = std::array<LaneSample, kLanes>;

constexpr double kMet = 1e-12;
constexpr int kRounds = 8;         // more of them cost as much as no lanes at all
constexpr std::size_t kMark = 32;  // samples from one comparison of two ways to the next

/// How far apart two values of a state are, in what is tolerated for a standard deviation.
inline double apart(double a, double b, double deviation) {
    return std::abs(a - b) / (kMet * (deviation + 1e-2 * std::abs(a)) + 1e-20);
}

/// The pieces of one group, for `side_by_side`.
class LaneGroup {
  public:
    LaneGroup(const std::vector<Run>& runs, const std::vector<Piece>& pieces, std::size_t first,
              std::size_t numbers);

    std::size_t count() const { return count_; }
    std::size_t longest() const { return longest_; }
    const Piece& piece(std::size_t lane) const { return pieces_[first_ + lane]; }
    /// Whether a lane goes on where that before it ends.
    bool follows(std::size_t lane) const { return piece(lane).begin > 0; }
    /// What is handed on before sample `at` of the piece, a multiple of `kMark`, or its end.
    double* mark(std::size_t lane, std::size_t at) {
        return marks_[lane].data() + (at + kMark - 1) / kMark * numbers_;
    }
    double* end(std::size_t lane) { return mark(lane, piece(lane).size()); }
    void put(std::size_t lane, const double* from, std::vector<LaneRow>& state) const;
    void get(std::size_t lane, const std::vector<LaneRow>& state, double* to) const;
    LaneSamples samples(std::size_t j) const;

    std::array<bool, kLanes> going{};
    std::array<std::size_t, kLanes> source{};  // the lane that an idle one repeats

  private:
    const std::vector<Run>& runs_;
    const std::vector<Piece>& pieces_;
    std::size_t first_, count_, numbers_, longest_ = 0;
    std::vector<std::vector<double>> marks_;
};

/// Walks all pieces. False where a sample is none for lanes, or ways do not meet; what was kept is
/// then worth nothing.
///
/// `walk.state()` are the numbers handed from sample to sample, `walk.begin(piece, to)` writes
/// those of a guess, of what is known where a run begins; `walk.sample(samples)` does a sample in
/// each lane, false if it cannot; `walk.distance(a, b)` is at most one where two such lists of
/// numbers are the same; `walk.finish(first, last)` gets the pieces of a group that are done.
template <class Walk>
bool side_by_side(const std::vector<Run>& runs, const std::vector<Piece>& pieces, Walk& walk) {
    std::vector<LaneRow>& state = walk.state();
    const std::size_t numbers = state.size();
    std::vector<double> here(numbers), before(numbers);
    for (std::size_t first = 0; first < pieces.size(); first += kLanes) {
        LaneGroup group(runs, pieces, first, numbers);
        double worst = std::numeric_limits<double>::infinity();
        for (int round = 0;; ++round) {
            double far = 0.0;
            for (std::size_t lane = 0; lane < group.count(); ++lane) {
                double* begin = group.mark(lane, 0);
                if (round == 0) {
                    if (lane == 0 && group.follows(0))
                        std::copy(before.begin(), before.end(), begin);
                    else
                        walk.begin(group.piece(lane), begin);
                }
                group.going[lane] = round == 0;
                if (round == 0 || lane == 0 || !group.follows(lane)) continue;
                const double distance = walk.distance(group.end(lane - 1), begin);
                if (distance <= 1.0) continue;
                group.going[lane] = true;
                far = distance > far ? distance : far;
                if (!std::isfinite(distance)) return false;
                std::copy_n(group.end(lane - 1), numbers, begin);
            }
            if (round > 0 && far == 0.0) break;
            if (round == kRounds) return false;
            if (round > 1 && !(std::log(far) < (kRounds - round) * std::log(worst / far)))
                return false;  // it would not come near in time
            worst = round == 0 ? worst : far;
            std::size_t any = 0;
            while (!group.going[any]) ++any;
            for (std::size_t lane = 0; lane < kLanes; ++lane) {
                group.source[lane] = group.going[lane] ? lane : any;
                group.put(lane, group.mark(group.source[lane], 0), state);
            }
            for (std::size_t j = 0; j < group.longest(); ++j) {
                poll_interrupt(j);
                bool left = false;
                for (std::size_t lane = 0; lane < group.count(); ++lane) {
                    if (j % kMark == 0 && j > 0 && group.going[lane] &&
                        j < group.piece(lane).size()) {
                        group.get(lane, state, here.data());
                        if (round > 0 && walk.distance(here.data(), group.mark(lane, j)) <= 1.0)
                            group.going[lane] = false;
                        else
                            std::copy(here.begin(), here.end(), group.mark(lane, j));
                    }
                    left = left || (group.going[lane] && j < group.piece(lane).size());
                }
                if (!left) break;
                if (!walk.sample(group.samples(j))) return false;
                for (std::size_t lane = 0; lane < group.count(); ++lane)
                    if (group.going[lane] && j + 1 == group.piece(lane).size())
                        group.get(lane, state, group.end(lane));
            }
        }
        std::copy_n(group.end(group.count() - 1), numbers, before.begin());
        walk.finish(first, first + group.count());
    }
    return true;
}

/// Calls `move(lane)` for lanes with steps of the same length and number as that lane, for each
/// such length, so that it moves `state`; what stands in the others is put back. Lanes with no
/// parts stay.
template <class Move>
void by_length(const LaneSamples& samples, const std::array<int, kLanes>& parts,
               std::vector<LaneRow>& state, Move&& move) {
    const auto alike = [&](std::size_t a, std::size_t b) {
        return parts[a] == parts[b] && samples[a].run->dt == samples[b].run->dt;
    };
    std::size_t same = 0;
    while (same < kLanes && alike(0, same)) ++same;
    if (same == kLanes) {
        if (parts[0] > 0) move(0);
        return;
    }
    const std::vector<LaneRow> before = state;
    std::vector<LaneRow> after = state;
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
        std::size_t first = 0;
        while (!alike(first, lane)) ++first;
        if (first < lane || parts[lane] == 0) continue;
        state = before;
        move(lane);
        for (std::size_t other = lane; other < kLanes; ++other)
            for (std::size_t i = 0; alike(lane, other) && i < state.size(); ++i)
                after[i].at[other] = state[i].at[other];
    }
    state.swap(after);
}

/// Moves states and externals `x` over `parts` steps to the sample; `part(ready)` after each of
/// them.
template <class Part>
void move_lanes(RecordedModel& model, const LaneSamples& samples, double dt, int parts, LaneRow* x,
                Part&& part) {
    RecordedModel::Ready& ready = model.step_of(dt, parts);
    const int programs = model.programs(parts);
    for (int n = 0; n < programs; ++n) {
        ready.set(0, x, model.moving());
        for (std::size_t lane = 0; lane < kLanes; ++lane) {
            const Input &from = samples[lane].input_before(), &to = samples[lane].input();
            if (programs == 1) {
                ready.give(0, lane, from);
                ready.give(1, lane, to);
            } else {
                ready.give(0, lane, between(from, to, static_cast<double>(n) / programs));
                ready.give(1, lane, between(from, to, (n + 1.0) / programs));
            }
        }
        ready.run();
        part(ready);
        for (std::size_t i = 0; i < model.states(); ++i) x[i] = ready.output(i);
    }
}

/// The reading of states and externals `x` at the sample.
inline RecordedModel::Ready& read_lanes(RecordedModel& model, const LaneSamples& samples,
                                        const LaneRow* x) {
    RecordedModel::Ready& ready = model.reading();
    ready.set(0, x, model.moving());
    for (std::size_t lane = 0; lane < kLanes; ++lane) ready.give(0, lane, samples[lane].input());
    ready.run();
    return ready;
}

}  // namespace sysid
