#include "sysid/identify/side_by_side.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "sysid/math/linear.hpp"

namespace sysid {

namespace {

constexpr double kForgotten = 4.5;  // seconds in which a filter forgets its beginning at best
const double kTimesMet = -std::log(kMet);  // time constants until two ways have met
constexpr int kDoublings = 30;             // of samples, in which a filter forgets
constexpr std::size_t kFewOwnStates = 6, kFilterSamplesOfFew = 3, kFilterSamplesOfMany = 2;

std::vector<Piece> cut(const std::vector<Run>& runs, std::size_t longest) {
    std::vector<Piece> pieces;
    for (std::size_t r = 0; r < runs.size(); ++r) {
        const std::size_t n = runs[r].size(), parts = (n + longest - 1) / longest;
        for (std::size_t i = 0; i < parts; ++i)
            pieces.push_back({r, n * i / parts, n * (i + 1) / parts, 0});
    }
    return pieces;
}

/// Steps of all lanes that it takes to walk the pieces.
std::size_t steps_of(const std::vector<Run>& runs, const std::vector<Piece>& pieces,
                     double forgotten_s) {
    std::size_t steps = 0;
    for (std::size_t first = 0; first < pieces.size(); first += kLanes) {
        std::size_t longest = 0;
        double again = 0.0;
        std::vector<double> intervals;  // each takes a step of its own (`by_length`)
        for (std::size_t i = first; i < pieces.size() && i < first + kLanes; ++i) {
            const double dt = runs[pieces[i].run].dt;
            longest = std::max(longest, pieces[i].size());
            if (pieces[i].begin > 0) again = std::max(again, forgotten_s / dt);
            if (std::find(intervals.begin(), intervals.end(), dt) == intervals.end())
                intervals.push_back(dt);
        }
        // Ways that meet too late are not walked to their end.
        if (again > kRounds * static_cast<double>(longest)) again = 1e9;
        steps += intervals.size() * (longest + static_cast<std::size_t>(std::min(again, 1e9)));
    }
    return steps;
}

/// The motion along one axis, moved by a force that is felt and a slope of the road that is not.
struct Axis {
    double motion = 0.0;  // white, per square root of a second
    double force_mps2 = 0.0, force_s = 1.0, road_mps2 = 0.0, road_s = 1.0;
    double speed = 0.0, felt = 0.0;  // noise of readings; zero where there is none
};

bool is_read(const std::vector<Run>& runs, int channel) {
    return std::any_of(runs.begin(), runs.end(), [&](const Run& run) {
        return std::any_of(run.measurements.begin(), run.measurements.end(),
                           [&](const Vec<kChannels>& y) { return !std::isnan(y[channel]); });
    });
}

/// Of the slowest pole of its stationary filter. The doubling algorithm gives the product of the
/// filter's transitions over 1, 2, 4, ... samples (Anderson, Int. J. Control 28, 1978, 295).
double time_constant_s(const Axis& axis, double dt) {
    Mat<3, 3> through = Mat<3, 3>::Zero(), read = through, spread = through;
    through(0, 0) = 1.0;
    spread(0, 0) = axis.motion * axis.motion * dt;
    const auto pushed = [&](int i, double deviation, double time_s) {
        if (deviation <= 0.0) return;
        const double left = std::exp(-dt / time_s);
        through(i, 0) = dt;
        through(i, i) = left;
        spread(i, i) = deviation * deviation * (1.0 - left * left);
    };
    pushed(1, axis.force_mps2, axis.force_s);
    pushed(2, axis.road_mps2, axis.road_s);
    read(0, 0) = 1.0 / (axis.speed * axis.speed);
    if (axis.felt > 0.0) read(1, 1) = 1.0 / (axis.felt * axis.felt);
    double before = std::log(through.norm()), rate = 0.0, samples = 1.0;
    for (int n = 0; n < kDoublings && before > -kTimesMet; ++n) {
        const Mat<3, 3> known = (Mat<3, 3>::Identity() + read * spread).inverse();
        const Mat<3, 3> half = through * known;
        const Mat<3, 3> more = through.transpose() * spread * known * through;
        read += half * read * through.transpose();
        spread += more;
        through = half * through;
        symmetrise(read);
        symmetrise(spread);
        const double now = std::log(through.norm());
        rate = (before - now) / samples;
        samples *= 2.0;
        before = now;
    }
    return rate > 0.0 ? dt / rate : std::numeric_limits<double>::infinity();
}

}  // namespace

double forgets_s(const Problem& problem, const Noise& noise) {
    double slowest = 0.0, dt = 0.0;
    for (const Run& run : problem.runs) {
        if (run.dt == dt) continue;
        dt = run.dt;
        for (std::size_t i = 0; i < kRoadStates; ++i) {
            Axis axis;
            axis.motion = noise.motion[i];
            axis.force_mps2 = noise.disturbance[i] / problem.model.car.mass_kg;
            axis.force_s = noise.time_of(i);
            axis.road_mps2 = noise.road[i];
            axis.road_s = noise.road_time_s;
            if (is_read(problem.runs, kVx + static_cast<int>(i)))
                axis.speed = noise.sensor[kVx + i];
            if (is_read(problem.runs, kAx + static_cast<int>(i))) axis.felt = noise.sensor[kAx + i];
            if (axis.speed > 0.0) slowest = std::max(slowest, time_constant_s(axis, dt));
        }
    }
    return kTimesMet * slowest;
}

std::size_t filter_samples(const SingleTrack& model) {
    const std::size_t own = active_states(model.effects).count;
    if (own == 0) return kFilterSamples;
    return own <= kFewOwnStates ? kFilterSamplesOfFew : kFilterSamplesOfMany;
}

std::vector<Piece> pieces_of(const std::vector<Run>& runs, double forgotten_s,
                             std::size_t samples_of_step, std::size_t most) {
    forgotten_s = std::max(forgotten_s, kForgotten);
    std::size_t all = 0, longest = 1;
    for (const Run& run : runs) {
        all += run.size();
        longest = std::max(longest, run.size());
    }
    std::vector<Piece> whole = cut(runs, std::min(longest, most));
    const std::size_t lanes = (runs.size() + kLanes - 1) / kLanes * kLanes;
    std::size_t low = 1, high = longest;  // the shortest pieces that fit into so many lanes
    while (low < high) {
        const std::size_t middle = (low + high) / 2;
        if (cut(runs, middle).size() <= lanes)
            high = middle;
        else
            low = middle + 1;
    }
    std::vector<Piece> parts = cut(runs, std::min(high, most));
    const std::size_t steps_whole = steps_of(runs, whole, forgotten_s);
    const std::size_t steps_parts = steps_of(runs, parts, forgotten_s);
    if (samples_of_step * std::min(steps_whole, steps_parts) >= all) return {};
    return steps_parts < steps_whole ? parts : whole;
}

LaneGroup::LaneGroup(const std::vector<Run>& runs, const std::vector<Piece>& pieces,
                     std::size_t first, std::size_t numbers)
    : runs_(runs),
      pieces_(pieces),
      first_(first),
      count_(std::min<std::size_t>(kLanes, pieces.size() - first)),
      numbers_(numbers) {
    for (std::size_t lane = 0; lane < count_; ++lane) {
        const std::size_t size = piece(lane).size();
        longest_ = std::max(longest_, size);
        marks_.emplace_back(((size + kMark - 1) / kMark + 1) * numbers);
    }
}

void LaneGroup::put(std::size_t lane, const double* from, std::vector<LaneRow>& state) const {
    for (std::size_t i = 0; i < numbers_; ++i) state[i].at[lane] = from[i];
}

void LaneGroup::get(std::size_t lane, const std::vector<LaneRow>& state, double* to) const {
    for (std::size_t i = 0; i < numbers_; ++i) to[i] = state[i].at[lane];
}

LaneSamples LaneGroup::samples(std::size_t j) const {
    LaneSamples out;
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
        const Piece& p = piece(source[lane]);
        LaneSample& s = out[lane];
        s.run = &runs_[p.run];
        s.piece = first_ + source[lane];
        s.at = std::min(p.begin + j, p.end - 1);
        s.keep = lane < count_ && going[lane] && j < p.size();
    }
    return out;
}

}  // namespace sysid
