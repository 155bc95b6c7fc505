#include "sysid/identify/side_by_side.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace sysid {

namespace {

constexpr double kForgotten = 4.5;  // seconds in which a filter forgets its beginning at best
const double kTimesMet = -std::log(kMet);  // time constants until two ways have met
constexpr std::size_t kGain = 2;           // steps of all lanes that cost less than so many samples

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
        for (std::size_t i = first; i < pieces.size() && i < first + kLanes; ++i) {
            longest = std::max(longest, pieces[i].size());
            if (pieces[i].begin > 0) again = std::max(again, forgotten_s / runs[pieces[i].run].dt);
        }
        steps += longest + static_cast<std::size_t>(std::min(again, 1e9));
    }
    return steps;
}

}  // namespace

double forgets_s(const Problem& problem, const Noise& noise) {
    // A random walk of q per root of a second, read with r each dt, is known with the time constant
    // r sqrt(dt) / q. An acceleration with a correlation time tau is in the long run a walk of its
    // standard deviation times sqrt(2 tau); where tau is longer than that time constant, the filter
    // follows it with the geometric mean of both.
    std::vector<std::pair<double, double>> pushed{
        {noise.disturbance[0] / problem.model.car.mass_kg, noise.time_of(0)}};
    if (noise.sloping()) pushed.emplace_back(noise.road[0], noise.road_time_s);
    double slowest = 0.0;
    for (const Run& run : problem.runs) {
        const double read = noise.sensor[0] * std::sqrt(run.dt);
        double quickest = read / noise.motion[0];
        for (const auto& [std_mps2, time_s] : pushed) {
            const double walk = read / (std_mps2 * std::sqrt(2.0 * time_s));
            quickest = std::min(quickest, std::max(walk, std::sqrt(walk * time_s)));
        }
        slowest = std::max(slowest, quickest);
    }
    return kTimesMet * slowest;
}

std::vector<Piece> pieces_of(const std::vector<Run>& runs, double forgotten_s, std::size_t most) {
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
    if (kGain * std::min(steps_whole, steps_parts) >= all) return {};
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
