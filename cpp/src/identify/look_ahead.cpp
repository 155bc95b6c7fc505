// Predictions some samples ahead: from many samples side by side.
#include <algorithm>
#include <map>
#include <stdexcept>
#include <utility>

#include "sysid/identify/in_time.hpp"
#include "sysid/identify/lane_filter.hpp"
#include "sysid/identify/prediction_error.hpp"
#include "sysid/identify/row_filter.hpp"
#include "sysid/identify/side_by_side.hpp"
#include "sysid/math/interrupt.hpp"

namespace sysid {

namespace {

/// States and disturbances after the readings of each sample, in the order of `filter_rows`.
class FilteredStates {
  public:
    FilteredStates(const Problem& problem, const double* p, const Noise& noise)
        : width_(filter_rows(problem.model.effects, noise.disturbances()).size()) {
        for (const Run& run : problem.runs) runs_.emplace_back(run.size() * width_);
        const std::vector<Piece> pieces =
            pieces_of(problem.runs, forgets_s(problem, noise), filter_samples(problem.model));
        if (!pieces.empty()) {
            LaneFilter walk(problem, {p}, noise, pieces);
            walk.keep = [&](const LaneSample& s, std::size_t lane, int /*parts*/) {
                double* to = runs_[pieces[s.piece].run].data() + s.at * width_;
                for (std::size_t i = 0; i < width_; ++i) to[i] = walk.state()[i].at[lane];
            };
            if (side_by_side(problem.runs, pieces, walk)) return;
        }
        with_state_size(problem.model.effects, noise, [&](auto nx) {
            for (std::size_t i = 0; i < problem.runs.size(); ++i)
                one_after_the_other<decltype(nx)::value>(problem, i, p, noise);
        });
    }

    const double* at(std::size_t run, std::size_t k) const {
        return runs_[run].data() + k * width_;
    }

  private:
    template <int NX>
    void one_after_the_other(const Problem& problem, std::size_t number, const double* p,
                             const Noise& noise) {
        const RunSystem<NX> system(problem.model, problem.runs[number], p, noise);
        filter_rows_of<NX>(system, [&](std::size_t k, const auto& s) {
            double* to = runs_[number].data() + k * width_;
            for (int i = 0; i < kMotionStates; ++i) *to++ = s.mean(i);
            for (std::size_t i = 0; i < system.own().count; ++i) *to++ = s.mean(system.packed(i));
            for (std::size_t i = 0; i < system.disturbances(); ++i)
                *to++ = s.mean(system.disturbing(i));
        });
    }

    std::size_t width_;
    std::vector<std::vector<double>> runs_;
};

/// Forces are not foreseen. Slopes of the road that are not told fade from where they are known.
class Predictions {
  public:
    Predictions(const Problem& problem, FilteredStates filtered, const double* p,
                const Noise& noise, const std::vector<Horizon>& horizons, bool readings,
                bool crossfall_told, double* errors)
        : problem_(problem),
          p_(p),
          noise_(noise),
          horizons_(horizons),
          readings_(readings),
          crossfall_told_(crossfall_told),
          errors_(errors),
          samples_(problem.samples()),
          filtered_(std::move(filtered)),
          model_(problem.model, p, {}, noise.disturbances()),
          rate_(problem.model.fastest_rate(p, 1.0)),
          state_(model_.moving()) {}

    void of_run(std::size_t number, std::size_t offset) {
        number_ = number;
        offset_ = offset;
        const Run& run = problem_.runs[number];
        // Predictions from one sample are one, read at each horizon; those that are read alike go
        // together.
        std::map<std::vector<std::size_t>, std::vector<std::size_t>> alike;
        std::vector<std::size_t> asked;  // the nearest first
        for (std::size_t k = 0; k < run.size(); ++k) {
            asked.clear();
            for (std::size_t h = 0; h < horizons_.size(); ++h)
                if (k % horizons_[h].every == 0 && horizons_[h].ahead < run.size() - k)
                    asked.push_back(h);
            std::sort(asked.begin(), asked.end(), [&](std::size_t a, std::size_t b) {
                return horizons_[a].ahead < horizons_[b].ahead;
            });
            if (!asked.empty()) alike[asked].push_back(k);
        }
        for (const auto& [read, starts] : alike)
            for (std::size_t first = 0; first < starts.size(); first += kLanes)
                together(run, read, starts.data() + first,
                         std::min<std::size_t>(kLanes, starts.size() - first));
    }

  private:
    /// What is known at a sample, with no forces.
    double begin(std::size_t k, std::size_t i) const {
        const double known = filtered_.at(number_, k)[i];
        if (i < model_.states()) return known;
        const std::size_t external = i - model_.states();
        if (external < kGravityX) return 0.0;
        const bool told = external == kGravityX || crossfall_told_;
        return problem_.model.slope_known && told ? 0.0 : known;
    }

    void together(const Run& run, const std::vector<std::size_t>& asked, const std::size_t* starts,
                  std::size_t count) {
        LaneSamples samples;
        for (std::size_t lane = 0; lane < kLanes; ++lane) {
            samples[lane].run = &run;
            samples[lane].at = starts[std::min(lane, count - 1)];
            for (std::size_t i = 0; i < state_.size(); ++i)
                state_[i].at[lane] = begin(samples[lane].at, i);
        }
        std::array<bool, kLanes> lost{};
        std::size_t ahead = 0;
        for (const std::size_t h : asked) {
            for (; ahead < horizons_[h].ahead; ++ahead) {
                poll_interrupt(ahead);
                std::array<int, kLanes> parts;
                for (std::size_t lane = 0; lane < kLanes; ++lane) {
                    ++samples[lane].at;
                    parts[lane] = substeps_for(rate_, state_[0].at[lane], run.dt);
                }
                by_length(samples, parts, state_, [&](std::size_t like) {
                    move_lanes(model_, samples, run.dt, parts[like], state_.data(),
                               [](RecordedModel::Ready&) {});
                    for (std::size_t i = kMotionStates; i < model_.externals(); ++i)
                        for (double& x : state_[model_.states() + i].at)
                            x *= noise_.forget(i, run.dt);
                });
            }
            const RecordedModel::Ready& ready = read_lanes(model_, samples, state_.data());
            for (std::size_t lane = 0; lane < count; ++lane) {
                std::array<double, kChannels> y;
                for (std::size_t c = 0; c < kChannels; ++c) {
                    y[c] = ready.output(c).at[lane];
                    lost[lane] = lost[lane] || !std::isfinite(y[c]);
                }
                keep(run, h, samples[lane].at, y);
            }
        }
        for (std::size_t lane = 0; lane < count; ++lane)
            if (lost[lane]) alone(run, asked, starts[lane]);
    }

    /// A prediction that comes to nothing is done again with more care.
    void alone(const Run& run, const std::vector<std::size_t>& asked, std::size_t start) const {
        ModelState<double> x = initial_state(problem_.model, run, p_);
        std::array<double, kExternals> external{};
        for (std::size_t i = 0; i < kMotionStates; ++i) x[i] = begin(start, i);
        for (std::size_t i = 0; i < model_.own().count; ++i)
            x[kMotionStates + model_.own().place[i]] = begin(start, kMotionStates + i);
        for (std::size_t i = 0; i < model_.externals(); ++i)
            external[i] = begin(start, model_.states() + i);
        std::size_t n = start;
        for (const std::size_t h : asked) {
            for (; n < start + horizons_[h].ahead; ++n) {
                advance(problem_.model, x, external.data(), run.inputs[n], run.inputs[n + 1], p_,
                        run.dt, substeps_for(problem_.model, p_, x[0], run.dt));
                for (std::size_t i = kMotionStates; i < model_.externals(); ++i)
                    external[i] *= noise_.forget(i, run.dt);
            }
            keep(run, h, n, sense(problem_.model, x, external.data(), run.inputs[n], p_));
        }
    }

    void keep(const Run& run, std::size_t h, std::size_t n,
              const std::array<double, kChannels>& y) const {
        double* const to = errors_ + (h * samples_ + offset_ + n) * kChannels;
        for (std::size_t c = 0; c < kChannels; ++c)
            to[c] = readings_ ? y[c] : run.measurements[n][static_cast<int>(c)] - y[c];
    }

    const Problem& problem_;
    const double* p_;
    const Noise& noise_;
    const std::vector<Horizon>& horizons_;
    bool readings_, crossfall_told_;
    double* errors_;
    std::size_t samples_;
    FilteredStates filtered_;
    RecordedModel model_;
    double rate_;
    std::vector<LaneRow> state_;
    std::size_t number_ = 0, offset_ = 0;
};

/// Gravity along and across, of each sample, becomes known.
void tell(Problem& problem, const double* slope) {
    problem.model.slope_known = true;
    for (Run& run : problem.runs)
        for (Input& u : run.inputs) {
            u.gravity_x_mps2 = *slope++;
            u.gravity_y_mps2 = *slope++;
        }
}

/// Gravity along as smoothed means tell it, and none across.
std::vector<double> smoothed_grade(const Problem& logged, const double* p, const Noise& noise) {
    std::vector<double> means(logged.samples() * kStatesTold), slope(logged.samples() * 2);
    smoothed_means(logged, p, noise, means.data());
    for (std::size_t k = 0; k < logged.samples(); ++k)
        slope[2 * k] = means[k * kStatesTold + kStatesFull];
    return slope;
}

}  // namespace

void look_ahead(const Problem& logged, const double* p, const Noise& noise,
                const std::vector<Horizon>& horizons, double* errors, bool readings,
                const double* road) {
    for (const Horizon& h : horizons)
        if (h.every == 0) throw std::invalid_argument("every = 0: give one or more");
    std::fill_n(errors, horizons.size() * logged.samples() * kChannels, std::nan(""));
    const InTime in_time(logged, p);
    Problem problem = *in_time;
    FilteredStates filtered(problem, p, noise);
    if (noise.sloping() && road)
        tell(problem, road);
    else if (noise.sloping() && !readings)
        tell(problem, smoothed_grade(logged, p, noise).data());
    Predictions predictions(problem, std::move(filtered), p, noise, horizons, readings,
                            road != nullptr, errors);
    std::size_t offset = 0;
    for (std::size_t i = 0; i < problem.runs.size(); ++i) {
        predictions.of_run(i, offset);
        offset += problem.runs[i].size();
    }
}

}  // namespace sysid
