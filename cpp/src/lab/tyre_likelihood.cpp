#include "sysid/lab/tyre_likelihood.hpp"

#include <cmath>
#include <limits>

#include "sysid/estimate/frozen.hpp"
#include "sysid/estimate/noise_score.hpp"
#include "sysid/identify/least_squares.hpp"
#include "sysid/math/interrupt.hpp"

namespace sysid::lab {

namespace {

template <class S>
using State = std::array<S, kGreyStates>;
template <class S>
using Reading = std::array<S, kGreyChannels>;
using Step = FilterStep<kGreyStates, kGreyChannels>;

// Both tyres and the drag; factors of mass and inertia as well.
constexpr Passes<9, 11> kPasses{kTyreParameters};

State<double> first_state(const TyreRun& run) {
    const auto first = [&](int channel, double otherwise) {
        for (std::size_t k = 0; k < run.size() && k < 50; ++k)
            if (!std::isnan(run.measurements[k][channel])) return run.measurements[k][channel];
        return otherwise;
    };
    return {first(0, 10.0), first(1, 0.0), first(2, 0.0)};
}

/// Moves on from sample `k`; `values` are those of the parameters `p`.
template <class S, class T>
void go_on(const GreyBoxCar& car, const TyreRun& run, std::size_t k, const double* values,
           const T* p, State<S>& x) {
    const GreyBoxInput& u = run.inputs[k];
    grey_box_step(car, x, u, p, run.dt, grey_box_substeps(car, u, values, value_of(x[0]), run.dt));
}

template <class S, class T>
Reading<S> expected(const GreyBoxCar& car, const State<S>& x, const GreyBoxInput& u, const T* p) {
    return {x[0], x[1], x[2], grey_box(car, x, u, p)[kGreyStates]};
}

/// A run as the `System` of `extended_kalman_filter`.
class GreySystem {
  public:
    static constexpr int kDirectReadings = kGreyStates;
    static constexpr bool kSteadyNoise = true;
    using StateVec = Vec<kGreyStates>;
    using StateMat = Mat<kGreyStates, kGreyStates>;
    using Sensors = Mat<kGreyChannels, kGreyChannels>;

    GreySystem(const GreyBoxCar& car, const TyreRun& run, const double* p, const double* noise)
        : car_(car), run_(run), p_(p) {
        const Eigen::Map<const Vec<kGreyNoises>> std(noise);
        sensors_ = std.head<kGreyChannels>().cwiseAbs2().asDiagonal();
        process_ = (run.dt * std.tail<kGreyStates>().cwiseAbs2()).asDiagonal();
    }

    /// Wide enough that the first readings, not the guess, decide.
    template <class Keep>
    double filter(Keep&& keep) const {
        const State<double> x = first_state(run_);
        return extended_kalman_filter<kGreyStates, kGreyChannels>(
            *this, StateVec(x[0], x[1], x[2]), StateMat(StateVec(1.0, 1.0, 0.04).asDiagonal()),
            keep);
    }

    std::size_t size() const { return run_.size(); }
    const StateMat& process_noise() const { return process_; }
    StateVec predict(std::size_t k, const StateVec& x, StateMat& A, StateMat& /*steady*/) const {
        State<D> moved = seeded(x);
        go_on(car_, run_, k - 1, p_, p_, moved);
        return taken(moved, A);
    }
    Vec<kGreyChannels> observe(std::size_t k, const StateVec& x,
                               Mat<kGreyChannels, kGreyStates>& H) const {
        return taken(expected(car_, seeded(x), run_.inputs[k], p_), H);
    }
    const Vec<kGreyChannels>& measurement(std::size_t k) const { return run_.measurements[k]; }
    const Sensors& measurement_noise(std::size_t /*k*/) const { return sensors_; }

  private:
    using D = Dual<kGreyStates>;
    static State<D> seeded(const StateVec& x) {
        return {D::seeded(x[0], 0), D::seeded(x[1], 1), D::seeded(x[2], 2)};
    }
    template <std::size_t N>
    static Vec<static_cast<int>(N)> taken(const std::array<D, N>& from,
                                          Mat<static_cast<int>(N), kGreyStates>& slopes) {
        Vec<static_cast<int>(N)> values;
        for (std::size_t i = 0; i < N; ++i) {
            const auto row = static_cast<int>(i);
            values[row] = from[i].v;
            slopes.row(row) = Eigen::Map<const StateVec>(from[i].d.data());
        }
        return values;
    }

    const GreyBoxCar& car_;
    const TyreRun& run_;
    const double* p_;
    StateMat process_;
    Sensors sensors_;
};

/// The mean of the filter with frozen gains; `keep(e, x)` gets whitened errors and the state that
/// has seen them.
template <class T, class Keep>
void run_frozen(const TyreProblem& problem, const FrozenGains& gains, const double* values,
                const T* p, Keep&& keep) {
    for (std::size_t i = 0; i < problem.runs.size(); ++i) {
        const TyreRun& run = problem.runs[i];
        const State<double> start = first_state(run);
        State<T> x{T(start[0]), T(start[1]), T(start[2])};
        for (std::size_t k = 0; k < run.size(); ++k) {
            poll_interrupt(k);
            if (k > 0) go_on(problem.car, run, k - 1, values, p, x);
            const FrozenGain& step = gains.runs[i][k];
            const Reading<T> error =
                errors_of(run.measurements[k], expected(problem.car, x, run.inputs[k], p));
            for (std::size_t n = 0; n < kGreyStates; ++n)
                correct(step.gain, static_cast<int>(n), error, x[n]);
            keep(whitened(step.whitener, error), x);
        }
    }
}

/// As `identify/least_squares.hpp` takes it.
auto walk_of(const TyreProblem& problem, const double* values, const FrozenGains& gains) {
    return [&problem, values, &gains](const auto* p, auto&& keep) {
        run_frozen(problem, gains, values, p, [&](const auto& white, const auto&) { keep(white); });
    };
}

}  // namespace

FrozenGains freeze(const TyreProblem& problem, const double* p, const double* noise) {
    FrozenGains out;
    for (const TyreRun& run : problem.runs) {
        auto& kept = out.runs.emplace_back(run.size());
        out.log_likelihood +=
            GreySystem(problem.car, run, p, noise).filter([&](std::size_t k, const Step& s) {
                kept[k] = {s.update.gain,
                           whitener_of<kGreyChannels>(s.update, run.measurements[k])};
                out.observed += static_cast<std::size_t>(s.update.observed);
            });
    }
    return out;
}

void residuals(const TyreProblem& problem, const double* p, const FrozenGains& gains, double* out) {
    residuals_of(walk_of(problem, p, gains), p, out);
}

double half_sum_of_squares(const TyreProblem& problem, const double* p, const FrozenGains& gains) {
    return half_sum_of(walk_of(problem, p, gains), p);
}

void sensitivities(const TyreProblem& problem, const double* p, const FrozenGains& gains,
                   const std::vector<int>& columns, double* out) {
    kPasses.sensitivities(walk_of(problem, p, gains), p, columns, out);
}

double normal_equations(const TyreProblem& problem, const double* p, const FrozenGains& gains,
                        const std::vector<int>& columns, double* gradient, double* information) {
    return kPasses.normal_equations(walk_of(problem, p, gains), p,
                                    problem.samples() * kGreyChannels, columns, gradient,
                                    information);
}

double noise_score(const TyreProblem& problem, const double* p, const double* noise,
                   double* gradient, double* information) {
    using Score = NoiseScore<kGreyChannels, kGreyNoises>;
    Score::Lanes slope = Score::Lanes::Zero();
    Score::Table info = Score::Table::Zero();
    const Vec<kGreyNoises> by = 2.0 * Eigen::Map<const Vec<kGreyNoises>>(noise).cwiseAbs2();
    double value = 0.0;
    for (const TyreRun& run : problem.runs) {
        Score score(kGreyStates, kGreyStates, {}, by.head<kGreyChannels>());
        for (int i = 0; i < kGreyStates; ++i)
            score.white(i, kGreyChannels + i, by[kGreyChannels + i] * run.dt);
        const GreySystem system(problem.car, run, p, noise);
        value += system.filter(
            [&](std::size_t k, const Step& s) { score.add(s, run.measurements[k], k == 0); });
        slope += score.score_sum();
        info += score.information();
    }
    Eigen::Map<Score::Lanes>{gradient} = slope;
    Eigen::Map<Score::Table>{information} = info;
    return value;
}

void states(const TyreProblem& problem, const double* p, const FrozenGains& gains, double* out) {
    run_frozen(problem, gains, p, p, [&](const auto& /*white*/, const State<double>& x) {
        out = std::copy(x.begin(), x.end(), out);
    });
}

void look_ahead(const TyreProblem& problem, const double* p, const FrozenGains& gains,
                std::size_t ahead, double* out) {
    std::vector<double> all(problem.samples() * kGreyStates);
    states(problem, p, gains, all.data());
    const double* filtered = all.data();
    for (const TyreRun& run : problem.runs) {
        const std::size_t n = run.size();
        std::fill(out, out + n * kGreyChannels, std::numeric_limits<double>::quiet_NaN());
        State<double> x{};
        for (std::size_t k = ahead; k < n; ++k) {
            poll_interrupt();
            const std::size_t from = ahead == 0 && k > 0 ? k - 1 : k - ahead;
            if (ahead > 0 || k == 0)
                std::copy_n(filtered + from * kGreyStates, kGreyStates, x.begin());
            for (std::size_t j = from; j < k; ++j) go_on(problem.car, run, j, p, p, x);
            const Reading<double> read = expected(problem.car, x, run.inputs[k], p);
            std::copy(read.begin(), read.end(), out + k * kGreyChannels);
        }
        out += n * kGreyChannels;
        filtered += n * kGreyStates;
    }
}

}  // namespace sysid::lab
