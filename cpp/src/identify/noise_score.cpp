// The score of the noise that fitting, comparing, diagnosing and validating share; its recursion
// stands in `estimate/noise_score.hpp`.
#include "sysid/estimate/noise_score.hpp"

#include <optional>

#include "sysid/identify/in_time.hpp"
#include "sysid/identify/lane_filter.hpp"
#include "sysid/identify/run_system.hpp"
#include "sysid/identify/told_path.hpp"
#include "sysid/math/interrupt.hpp"

namespace sysid {

namespace {

constexpr int deviation_lane(std::size_t i) {
    if (i >= kPushes) return kRoadNoiseParameters + static_cast<int>(i) - kPushes;
    const int before = i < kMotionStates ? kMotionStates : 2 * kMotionStates;
    return kChannels + before + static_cast<int>(i);
}
constexpr int time_lane(std::size_t i) {
    if (i >= kPushes) return deviation_lane(i) + kColourStates;
    return i < kMotionStates ? kChannels + 2 * kMotionStates + static_cast<int>(i)
                             : kRoadNoiseParameters - 1;
}

/// Of `L` noise parameters: those of disturbances, road and colour only where there are such. Of
/// `n` states the first `moving` have a transition; the disturbances stand where `disturbing` says.
template <int L, class Disturbing>
NoiseScore<kChannels, L> score_of(const Noise& noise, const Run& run, int n, int moving,
                                  Disturbing&& disturbing) {
    const std::size_t disturbances = noise.disturbances();
    Vec<kChannels> sensor;
    for (int i = 0; i < kChannels; ++i) {
        const double s = noise.sensor[static_cast<std::size_t>(i)];
        sensor[i] = 2.0 * s * s;
    }
    std::vector<double> forget;
    for (std::size_t i = 0; i < disturbances && moving < n; ++i)
        forget.push_back(noise.forget(i, run.dt));
    NoiseScore<kChannels, L> score(n, moving, std::move(forget), sensor);
    for (int i = 0; i < kMotionStates; ++i) {
        const double s = noise.motion[static_cast<std::size_t>(i)];
        score.white(i, kChannels + i, 2.0 * s * s * run.dt);
    }
    for (std::size_t i = 0; i < disturbances; ++i) {
        const double s = noise.deviation_of(i);
        score.correlated(disturbing(i), deviation_lane(i), time_lane(i), s * s,
                         noise.forget(i, run.dt), run.dt / noise.time_of(i));
    }
    return score;
}

template <int L>
struct Sum {
    Eigen::Array<double, L, 1> score = Eigen::Array<double, L, 1>::Zero();
    Mat<L, L> information = Mat<L, L>::Zero();
    double log_likelihood = 0.0;
    void add(const NoiseScore<kChannels, L>& of) {
        score += of.score_sum();
        information += of.information();
    }
};

template <int L>
Sum<L> one_after_the_other(const Problem& problem, const double* p, const Noise& noise) {
    Sum<L> sum;
    with_state_size(problem.model.effects, noise, [&](auto nx) {
        constexpr int NX = decltype(nx)::value;
        for (const Run& run : problem.runs) {
            const RunSystem<NX> system(problem.model, run, p, noise);
            const int n = system.taking_part();
            auto score =
                score_of<L>(noise, run, n, n, [&](std::size_t i) { return system.disturbing(i); });
            sum.log_likelihood +=
                filter_run<NX>(system, [&](std::size_t k, const FilterStep<NX, kChannels>& s) {
                    score.add(s, run.measurements[k], k == 0);
                });
            sum.add(score);
        }
    });
    return sum;
}

/// The same with the filter in pieces side by side; false where that cannot be done. Numbers of the
/// samples are kept until a group of pieces is done, which are therefore not long.
template <int L>
bool in_pieces(const Problem& problem, const double* p, const Noise& noise, Sum<L>& sum) {
    constexpr std::size_t kLongest = 1024;
    const std::vector<Piece> pieces =
        pieces_of(problem.runs, forgets_s(problem, noise), filter_samples(problem.model), kLongest);
    if (pieces.empty()) return false;
    LaneFilter filter(problem, {p}, noise, pieces);
    filter.with_transition = true;
    const std::size_t n = filter.states(), moving = filter.moving();
    const std::size_t wide = filter.sample_size();
    std::size_t room = 0;
    for (const Piece& piece : pieces) room = std::max(room, piece.size());
    std::vector<double> numbers(std::min<std::size_t>(kLanes, pieces.size()) * room * wide);
    const auto place = [&](std::size_t piece, std::size_t at) {
        return numbers.data() + (piece % kLanes * room + at - pieces[piece].begin) * wide;
    };
    filter.keep = [&](const LaneSample& s, std::size_t lane, int /*parts*/) {
        filter.write_sample(lane, place(s.piece, s.at));
    };
    std::optional<NoiseScore<kChannels, L>> score;
    filter.done = [&](std::size_t first, std::size_t last) {
        for (std::size_t i = first; i < last; ++i) {
            const Run& run = problem.runs[pieces[i].run];
            if (pieces[i].begin == 0)
                score.emplace(
                    score_of<L>(noise, run, static_cast<int>(n), static_cast<int>(moving),
                                [&](std::size_t d) { return static_cast<int>(moving + d); }));
            for (std::size_t k = pieces[i].begin; k < pieces[i].end; ++k) {
                const ScoreSample s = score_sample(place(i, k), n, moving, k);
                score->add(s, run.measurements[k]);
            }
            if (pieces[i].end == run.size()) sum.add(*score);
        }
    };
    if (!side_by_side(problem.runs, pieces, filter)) return false;
    sum.log_likelihood = filter.log_likelihood();
    return true;
}

/// The same along a path that a filter has told.
template <int L>
Sum<L> along(const Problem& problem, const double* p, const FrozenFilter& filter) {
    ToldPath path(problem, p, filter);
    const std::size_t moving = path.moving();
    Sum<L> sum;
    for (std::size_t i = 0; i < problem.runs.size(); ++i) {
        const Run& run = problem.runs[i];
        auto score = score_of<L>(filter.noise, run, static_cast<int>(path.states()),
                                 static_cast<int>(moving),
                                 [&](std::size_t d) { return static_cast<int>(moving + d); });
        for (std::size_t first = 0; first < run.size(); first += ToldPath::kTogether) {
            poll_interrupt();
            const std::size_t end = std::min(first + ToldPath::kTogether, run.size());
            path.linearise(i, first, end - first);
            for (std::size_t k = first; k < end; ++k)
                score.add(path.sample(i, k), run.measurements[k]);
        }
        sum.add(score);
    }
    sum.log_likelihood = filter.log_likelihood;
    return sum;
}

template <int L>
double handed_on(Sum<L> sum, double* gradient, double* information) {
    symmetrise(sum.information);
    using All = Mat<kNoiseParameters, kNoiseParameters>;
    Eigen::Map<Vec<kNoiseParameters>> to{gradient};
    Eigen::Map<All> table{information};
    to.setZero();
    table.setZero();
    to.template head<L>() = sum.score.matrix();
    table.template topLeftCorner<L, L>() = sum.information;
    return sum.log_likelihood;
}

/// Calls `score` with the number of noise parameters that there are.
template <class Score>
double with_parameters(const Noise& noise, Score&& score) {
    if (noise.white()) return score(std::integral_constant<int, kChannels + kMotionStates>{});
    if (noise.coloured()) return score(std::integral_constant<int, kNoiseParameters>{});
    if (noise.sloping()) return score(std::integral_constant<int, kRoadNoiseParameters>{});
    return score(std::integral_constant<int, kPlainNoiseParameters>{});
}

}  // namespace

double noise_score(const Problem& logged, const double* p, const Noise& noise, double* gradient,
                   double* information) {
    const InTime in_time(logged, p);
    const Problem& problem = *in_time;
    return with_parameters(noise, [&](auto parameters) {
        constexpr int L = decltype(parameters)::value;
        Sum<L> sum;
        if (!in_pieces(problem, p, noise, sum)) sum = one_after_the_other<L>(problem, p, noise);
        return handed_on(sum, gradient, information);
    });
}

double noise_score(const Problem& logged, const double* p, const FrozenFilter& filter,
                   double* gradient, double* information) {
    if (!filter.tells_of(logged))
        return noise_score(logged, p, filter.noise, gradient, information);
    const InTime in_time(logged, p);
    return with_parameters(filter.noise, [&](auto parameters) {
        constexpr int L = decltype(parameters)::value;
        return handed_on(along<L>(*in_time, p, filter), gradient, information);
    });
}

}  // namespace sysid
