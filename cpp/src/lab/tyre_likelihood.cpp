#include "sysid/lab/tyre_likelihood.hpp"

#include <cmath>
#include <limits>
#include <stdexcept>

#include "sysid/math/errors.hpp"
#include "sysid/math/interrupt.hpp"
#include "sysid/math/linear.hpp"

namespace sysid::lab {

namespace {

using State = std::array<double, kGreyStates>;
template <std::size_t W>
using Tangent = std::array<std::array<double, W>, kGreyStates>;
using Noisy = Dual<kGreyNoises>;

constexpr double kLogTwoPi = 1.8378770664093453;

/// `grey_box_step` that carries derivatives along: by the first state if W is 3, by all parameters
/// otherwise.
template <std::size_t W>
void step_with_tangent(const GreyBoxCar& car, State& x, Tangent<W>& tangent, const GreyBoxInput& u,
                       const double* p, double dt) {
    constexpr bool kParameters = W == kTyreParameters;
    const int substeps = grey_box_substeps(car, u, p, x[0], dt);
    const double h = dt / substeps;
    constexpr std::array<double, 4> kReach{0.0, 0.5, 0.5, 1.0};
    constexpr std::array<double, 4> kWeight{1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0};
    GreyBoxSlope slope;
    LoadsSince<double> since;
    std::array<double, W> drawn_by{};
    std::array<double, W> squared_by{};
    for (int n = 0; n < substeps; ++n) {
        State k{};
        State moved = x;
        Tangent<W> rate{};
        Tangent<W> next = tangent;
        for (std::size_t stage = 0; stage < 4; ++stage) {
            const double reach = kReach[stage] * h;
            State at;
            for (std::size_t i = 0; i < kGreyStates; ++i) at[i] = x[i] + reach * k[i];
            grey_box_slope(car, at, u, p, kParameters, slope, since);
            Tangent<W> here;
            for (std::size_t i = 0; i < kGreyStates; ++i)
                for (std::size_t w = 0; w < W; ++w) here[i][w] = tangent[i][w] + reach * rate[i][w];
            const bool begins = stage == 0 && n == 0 && car.cg_height_m > 0.0;
            if (begins) since = loads_from(car, at, u, p, slope.value);
            for (std::size_t i = 0; i < kGreyStates; ++i) {
                const auto& a = slope.by_state[i];
                for (std::size_t w = 0; w < W; ++w) {
                    rate[i][w] = a[0] * here[0][w] + a[1] * here[1][w] + a[2] * here[2][w];
                    if constexpr (kParameters) rate[i][w] += slope.by_parameter[i][w];
                    // In the first stage nothing has moved yet, whatever it moves from.
                    if (!begins)
                        rate[i][w] += slope.by_drawn[i] * drawn_by[w] +
                                      slope.by_first_squared[i] * squared_by[w];
                    next[i][w] += h * kWeight[stage] * rate[i][w];
                }
                k[i] = slope.value[i];
                moved[i] += h * kWeight[stage] * k[i];
            }
            if (!begins) continue;
            const double mass = car.mass_kg * p[kMassFactor];
            for (std::size_t w = 0; w < W; ++w) {
                drawn_by[w] = mass * (at[2] * here[1][w] + at[1] * here[2][w] - rate[0][w]);
                squared_by[w] = 2.0 * at[0] * here[0][w];
            }
            // T is a force: the mass has no part in it but through the motion.
            if constexpr (kParameters)
                drawn_by[kMassFactor] += mass * slope.by_parameter[0][kMassFactor];
        }
        x = moved;
        tangent = next;
    }
}

State first_state(const TyreRun& run) {
    const auto first = [&](std::size_t channel, double otherwise) {
        for (std::size_t k = 0; k < run.size() && k < 50; ++k)
            if (!std::isnan(run.measurements[k][channel])) return run.measurements[k][channel];
        return otherwise;
    };
    return {first(0, 10.0), first(1, 0.0), first(2, 0.0)};
}

/// The filter, on a scalar that may carry derivatives by the noise. `visit(k, channel, error,
/// variance, gain)` is called for every reading there is.
template <class S, class Visit>
void run_filter(const GreyBoxCar& car, const TyreRun& run, const double* p,
                const std::array<S, kGreyNoises>& noise, Visit&& visit) {
    const State begin = first_state(run);
    std::array<S, kGreyStates> x{S(begin[0]), S(begin[1]), S(begin[2])};
    std::array<std::array<S, kGreyStates>, kGreyStates> cov{};
    for (auto& row : cov) row.fill(S(0.0));
    // Wide enough that the first readings, not the guess, decide.
    cov[0][0] = cov[1][1] = S(1.0);
    cov[2][2] = S(0.04);
    GreyBoxSlope slope;
    for (std::size_t k = 0; k < run.size(); ++k) {
        poll_interrupt(k);
        State at{value_of(x[0]), value_of(x[1]), value_of(x[2])};
        if (k > 0) {
            Tangent<kGreyStates> phi{{{1.0, 0.0, 0.0}, {0.0, 1.0, 0.0}, {0.0, 0.0, 1.0}}};
            const State before = at;
            step_with_tangent(car, at, phi, run.inputs[k - 1], p, run.dt);
            std::array<S, kGreyStates> moved;
            std::array<std::array<S, kGreyStates>, kGreyStates> half;
            for (std::size_t i = 0; i < kGreyStates; ++i) {
                moved[i] = S(at[i]);
                for (std::size_t j = 0; j < kGreyStates; ++j) {
                    moved[i] += phi[i][j] * (x[j] - before[j]);
                    half[i][j] =
                        phi[i][0] * cov[0][j] + phi[i][1] * cov[1][j] + phi[i][2] * cov[2][j];
                }
            }
            x = moved;
            for (std::size_t i = 0; i < kGreyStates; ++i) {
                for (std::size_t j = 0; j <= i; ++j)
                    cov[i][j] = cov[j][i] =
                        half[i][0] * phi[j][0] + half[i][1] * phi[j][1] + half[i][2] * phi[j][2];
                cov[i][i] += run.dt * (noise[kGreyChannels + i] * noise[kGreyChannels + i]);
            }
        }
        for (std::size_t c = 0; c < kGreyChannels; ++c) {
            const double reading = run.measurements[k][c];
            if (std::isnan(reading)) continue;
            std::array<S, kGreyStates> seen;  // covariance of the state with the reading
            S variance;
            S error;
            if (c < kGreyStates) {
                for (std::size_t i = 0; i < kGreyStates; ++i) seen[i] = cov[i][c];
                variance = seen[c];
                error = reading - x[c];
            } else {
                at = {value_of(x[0]), value_of(x[1]), value_of(x[2])};
                grey_box_slope(car, at, run.inputs[k], p, false, slope);
                const auto& row = slope.by_state[3];
                error = S(reading - slope.value[3]);
                variance = S(0.0);
                for (std::size_t i = 0; i < kGreyStates; ++i) {
                    seen[i] = cov[i][0] * row[0] + cov[i][1] * row[1] + cov[i][2] * row[2];
                    error += -row[i] * (x[i] - at[i]);
                }
                for (std::size_t i = 0; i < kGreyStates; ++i) variance += row[i] * seen[i];
            }
            variance += noise[c] * noise[c];
            std::array<S, kGreyStates> gain;
            for (std::size_t i = 0; i < kGreyStates; ++i) gain[i] = seen[i] / variance;
            // Of a reading surer than this the difference below leaves what rounding makes of it;
            // each variance then keeps a share that is larger.
            const bool sure = value_of(noise[c] * noise[c]) < kSurest * value_of(variance);
            for (std::size_t i = 0; i < kGreyStates; ++i) {
                x[i] += gain[i] * error;
                const double kept = sure ? 0.1 * kSurest * value_of(cov[i][i]) : 0.0;
                for (std::size_t j = 0; j <= i; ++j)
                    cov[i][j] = cov[j][i] = cov[i][j] - gain[i] * seen[j];
                cov[i][i] += kept;
            }
            visit(k, c, error, variance, gain);
        }
        if (!std::isfinite(value_of(x[0]) + value_of(x[1]) + value_of(x[2])))
            throw NumericalFailure("tyre filter: the state left the range of numbers", k);
    }
}

/// The mean of the filter with frozen gains. `keep(k, channel, error over its size)`.
template <class Keep>
void run_mean(const GreyBoxCar& car, const TyreRun& run, const double* p,
              const std::vector<FrozenGain>& gains, Keep&& keep) {
    State x = first_state(run);
    for (std::size_t k = 0; k < run.size(); ++k) {
        poll_interrupt(k);
        if (k > 0) {
            const auto& u = run.inputs[k - 1];
            grey_box_step(car, x, u, p, run.dt, grey_box_substeps(car, u, p, x[0], run.dt));
        }
        for (std::size_t c = 0; c < kGreyChannels; ++c) {
            double error = 0.0;
            if (gains[k].per_std[c] > 0.0) {
                const double expected =
                    c < kGreyStates ? x[c] : grey_box(car, x, run.inputs[k], p)[3];
                error = run.measurements[k][c] - expected;
                for (std::size_t i = 0; i < kGreyStates; ++i) x[i] += gains[k].gain[c][i] * error;
            }
            keep(k, c, error * gains[k].per_std[c], x);
        }
    }
}

/// The same with the derivatives by all parameters; `keep` receives both, whitened.
template <class Keep>
void run_tangent(const GreyBoxCar& car, const TyreRun& run, const double* p,
                 const std::vector<FrozenGain>& gains, Keep&& keep) {
    State x = first_state(run);
    Tangent<kTyreParameters> tangent{};
    GreyBoxSlope slope;
    std::array<double, kTyreParameters> by;
    for (std::size_t k = 0; k < run.size(); ++k) {
        poll_interrupt(k);
        if (k > 0) step_with_tangent(car, x, tangent, run.inputs[k - 1], p, run.dt);
        for (std::size_t c = 0; c < kGreyChannels; ++c) {
            const double per_std = gains[k].per_std[c];
            if (per_std == 0.0) continue;
            double expected = 0.0;
            if (c < kGreyStates) {
                expected = x[c];
                by = tangent[c];
            } else {
                grey_box_slope(car, x, run.inputs[k], p, true, slope);
                expected = slope.value[3];
                const auto& row = slope.by_state[3];
                for (std::size_t w = 0; w < kTyreParameters; ++w)
                    by[w] = slope.by_parameter[3][w] + row[0] * tangent[0][w] +
                            row[1] * tangent[1][w] + row[2] * tangent[2][w];
            }
            const double error = run.measurements[k][c] - expected;
            for (std::size_t i = 0; i < kGreyStates; ++i) {
                const double gain = gains[k].gain[c][i];
                x[i] += gain * error;
                for (std::size_t w = 0; w < kTyreParameters; ++w) tangent[i][w] -= gain * by[w];
            }
            for (double& b : by) b *= per_std;
            keep(k, c, error * per_std, by);
        }
    }
}

}  // namespace

std::size_t TyreProblem::samples() const {
    std::size_t n = 0;
    for (const TyreRun& run : runs_) n += run.size();
    return n;
}

FrozenGains TyreProblem::freeze(const double* p, const double* noise) const {
    FrozenGains out;
    std::array<double, kGreyNoises> values;
    std::copy(noise, noise + kGreyNoises, values.begin());
    for (const TyreRun& run : runs_) {
        out.runs.emplace_back(run.size(), FrozenGain{});
        auto& kept = out.runs.back();
        run_filter<double>(
            car_, run, p, values,
            [&](std::size_t k, std::size_t c, double error, double variance, const State& gain) {
                kept[k].gain[c] = gain;
                kept[k].per_std[c] = 1.0 / std::sqrt(variance);
                out.log_likelihood -=
                    0.5 * (error * error / variance + std::log(variance) + kLogTwoPi);
                ++out.observed;
            });
    }
    return out;
}

void TyreProblem::residuals(const double* p, const FrozenGains& gains, double* out) const {
    for (std::size_t i = 0; i < runs_.size(); ++i)
        run_mean(car_, runs_[i], p, gains.runs[i],
                 [&](std::size_t, std::size_t, double e, const State&) { *out++ = e; });
}

double TyreProblem::half_sum_of_squares(const double* p, const FrozenGains& gains) const {
    double sum = 0.0;
    for (std::size_t i = 0; i < runs_.size(); ++i)
        run_mean(car_, runs_[i], p, gains.runs[i],
                 [&](std::size_t, std::size_t, double e, const State&) { sum += e * e; });
    return 0.5 * sum;
}

void TyreProblem::sensitivities(const double* p, const FrozenGains& gains,
                                const std::vector<int>& columns, double* out) const {
    const std::size_t width = columns.size();
    std::fill(out, out + samples() * kGreyChannels * width, 0.0);
    for (std::size_t i = 0; i < runs_.size(); ++i) {
        run_tangent(car_, runs_[i], p, gains.runs[i],
                    [&](std::size_t k, std::size_t c, double, const auto& by) {
                        double* row = out + (k * kGreyChannels + c) * width;
                        for (std::size_t j = 0; j < width; ++j)
                            row[j] = by[static_cast<std::size_t>(columns[j])];
                    });
        out += runs_[i].size() * kGreyChannels * width;
    }
}

double TyreProblem::normal_equations(const double* p, const FrozenGains& gains,
                                     const std::vector<int>& columns, double* gradient,
                                     double* information) const {
    constexpr std::size_t kAll = kTyreParameters;
    std::array<double, kAll> g{};
    std::array<std::array<double, kAll>, kAll> n{};
    double sum = 0.0;
    for (std::size_t i = 0; i < runs_.size(); ++i)
        run_tangent(car_, runs_[i], p, gains.runs[i],
                    [&](std::size_t, std::size_t, double e, const auto& by) {
                        sum += e * e;
                        for (std::size_t a = 0; a < kAll; ++a) {
                            g[a] += by[a] * e;
                            for (std::size_t b = 0; b <= a; ++b) n[a][b] += by[a] * by[b];
                        }
                    });
    const std::size_t width = columns.size();
    for (std::size_t i = 0; i < width; ++i) {
        const auto a = static_cast<std::size_t>(columns[i]);
        gradient[i] = g[a];
        for (std::size_t j = 0; j < width; ++j) {
            const auto b = static_cast<std::size_t>(columns[j]);
            information[i * width + j] = a >= b ? n[a][b] : n[b][a];
        }
    }
    return 0.5 * sum;
}

double TyreProblem::noise_score(const double* p, const double* noise, double* gradient,
                                double* information) const {
    std::array<Noisy, kGreyNoises> values;
    for (int i = 0; i < kGreyNoises; ++i) {
        const auto n = static_cast<std::size_t>(i);
        values[n] = Noisy(noise[n]);
        values[n].d[n] = noise[n];  // derivative by the logarithm
    }
    std::fill_n(gradient, kGreyNoises, 0.0);
    std::fill_n(information, static_cast<std::size_t>(kGreyNoises) * kGreyNoises, 0.0);
    double value = 0.0;
    for (const TyreRun& run : runs_) {
        run_filter<Noisy>(
            car_, run, p, values,
            [&](std::size_t, std::size_t, const Noisy& error, const Noisy& variance, const auto&) {
                const double per = 1.0 / variance.v;
                const double squared = error.v * error.v * per;
                value -= 0.5 * (squared + std::log(variance.v) + kLogTwoPi);
                for (std::size_t i = 0; i < kGreyNoises; ++i) {
                    const double log_i = variance.d[i] * per;
                    gradient[i] -= 0.5 * log_i * (1.0 - squared) + error.v * error.d[i] * per;
                    for (std::size_t j = 0; j <= i; ++j)
                        information[i * kGreyNoises + j] +=
                            0.5 * log_i * variance.d[j] * per + error.d[i] * error.d[j] * per;
                }
            });
    }
    for (std::size_t i = 0; i < kGreyNoises; ++i)
        for (std::size_t j = 0; j < i; ++j)
            information[j * kGreyNoises + i] = information[i * kGreyNoises + j];
    return value;
}

void TyreProblem::states(const double* p, const FrozenGains& gains, double* out) const {
    for (std::size_t i = 0; i < runs_.size(); ++i)
        run_mean(car_, runs_[i], p, gains.runs[i],
                 [&](std::size_t, std::size_t c, double, const State& x) {
                     if (c + 1 == kGreyChannels) out = std::copy(x.begin(), x.end(), out);
                 });
}

void TyreProblem::look_ahead(const double* p, const FrozenGains& gains, std::size_t ahead,
                             double* out) const {
    std::vector<double> all(samples() * kGreyStates);
    states(p, gains, all.data());
    const double* filtered = all.data();
    const auto read = [&](const State& x, const GreyBoxInput& u, double* row) {
        std::copy(x.begin(), x.end(), row);
        row[3] = grey_box(car_, x, u, p)[3];
    };
    for (const TyreRun& run : runs_) {
        const std::size_t n = run.size();
        const auto go_on = [&](State& x, std::size_t k) {
            const auto& u = run.inputs[k];
            grey_box_step(car_, x, u, p, run.dt, grey_box_substeps(car_, u, p, x[0], run.dt));
        };
        std::fill(out, out + n * kGreyChannels, std::numeric_limits<double>::quiet_NaN());
        const auto filtered_at = [&](std::size_t k) {
            const double* at = filtered + k * kGreyStates;
            return State{at[0], at[1], at[2]};
        };
        if (ahead == 0) {
            State x = filtered_at(0);
            for (std::size_t k = 0; k < n; ++k) {
                if (k > 0) go_on(x, k - 1);
                read(x, run.inputs[k], out + k * kGreyChannels);
            }
        } else {
            for (std::size_t k = ahead; k < n; ++k) {
                poll_interrupt();
                State x = filtered_at(k - ahead);
                for (std::size_t j = k - ahead; j < k; ++j) go_on(x, j);
                read(x, run.inputs[k], out + k * kGreyChannels);
            }
        }
        out += n * kGreyChannels;
        filtered += n * kGreyStates;
    }
}

}  // namespace sysid::lab
