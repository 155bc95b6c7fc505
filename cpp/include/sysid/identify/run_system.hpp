// A run of a car as a state-space system for the extended Kalman filter.
#pragma once

#include <algorithm>
#include <functional>

#include "sysid/estimate/kalman.hpp"
#include "sysid/identify/problem.hpp"
#include "sysid/identify/start.hpp"

namespace sysid {

/// State: v_x, v_y, r, disturbing F_x, F_y, M_z where there are such, then the states of the
/// model's own effects, gravity along and across where the slope varies, coloured noise of sensors
/// where there is any; what is left of NX stands still at zero and is certain.
template <int NX>
class RunSystem {
  public:
    RunSystem(const SingleTrack& model, const Run& run, const double* p, const Noise& noise)
        : model_(model),
          run_(run),
          p_(p),
          own_(active_states(model.effects)),
          start_(initial_state(model, run, p)),
          disturbances_(noise.disturbances()) {
        process_.setZero();
        for (int i = 0; i < kMotionStates; ++i) {
            const auto n = static_cast<std::size_t>(i);
            process_(i, i) = noise.motion[n] * noise.motion[n] * run.dt;
        }
        for (std::size_t i = 0; i < disturbances_; ++i) {
            const int at = disturbing(i);
            forget_[i] = noise.forget(i, run.dt);
            variance_[i] = noise.deviation_of(i) * noise.deviation_of(i);
            process_(at, at) = variance_[i] * (1.0 - forget_[i] * forget_[i]);
        }
        sensors_.setZero();
        for (int i = 0; i < kChannels; ++i) {
            const double s = noise.sensor[static_cast<std::size_t>(i)];
            sensors_(i, i) = s * s;
        }
    }

    const Run& run() const { return run_; }
    const ModelState<double>& start() const { return start_; }

    Vec<NX> initial_mean() const {
        Vec<NX> x = Vec<NX>::Zero();
        for (int i = 0; i < kMotionStates; ++i) x[i] = start_[static_cast<std::size_t>(i)];
        for (std::size_t i = 0; i < own_.count; ++i) x[packed(i)] = start_[place(i)];
        return x;
    }

    Mat<NX, NX> initial_covariance() const {
        Mat<NX, NX> covariance = Mat<NX, NX>::Zero();
        const Eigen::MatrixXd known = start_covariance(model_, start_, run_.inputs[0], p_);
        const auto at = [&](int i) {
            return i < kMotionStates ? i : packed(static_cast<std::size_t>(i - kMotionStates));
        };
        for (int i = 0; i < known.rows(); ++i)
            for (int j = 0; j < known.cols(); ++j) covariance(at(i), at(j)) = known(i, j);
        for (std::size_t i = 0; i < disturbances_; ++i)
            covariance(disturbing(i), disturbing(i)) = variance_[i];
        return covariance;
    }

    std::size_t size() const { return run_.size(); }

    Vec<NX> predict(std::size_t k, const Vec<NX>& x, Mat<NX, NX>& A, Mat<NX, NX>& Q) const {
        A.setZero();
        Q = process_;
        return moved(k, x, A);
    }

    /// x(k) from x(k-1), and what is not zero of the Jacobian, an `A(i, j)` that is zero elsewhere.
    template <class Matrix>
    Vec<NX> moved(std::size_t k, const Vec<NX>& x, Matrix& A) const {
        Vec<NX> next = Vec<NX>::Zero();
        for (std::size_t i = 0; i < disturbances_; ++i) {
            const int at = disturbing(i);
            next[at] = forget_[i] * x[at];
            A(at, at) = forget_[i];
        }
        const int substeps = substeps_for(model_, p_, x[0], run_.dt);
        in_passes(x, [&](ModelState<D>& s, const auto& external, auto&& keep) {
            advance(model_, s, external.data(), run_.inputs[k - 1], run_.inputs[k], p_, run_.dt,
                    substeps);
            for (int i = 0; i < kMotionStates; ++i)
                keep(s[static_cast<std::size_t>(i)], i, next, A);
            for (std::size_t i = 0; i < own_.count; ++i) keep(s[place(i)], packed(i), next, A);
        });
        return next;
    }

    Vec<kChannels> observe(std::size_t k, const Vec<NX>& x, Mat<kChannels, NX>& H) const {
        H.setZero();  // not every pass is made
        return seen(k, x, H);
    }

    /// The expected measurement, and what is not zero of its Jacobian, as `moved`.
    template <class Matrix>
    Vec<kChannels> seen(std::size_t k, const Vec<NX>& x, Matrix& H) const {
        Vec<kChannels> expected;
        in_passes(x, [&](ModelState<D>& s, const auto& external, auto&& keep) {
            const auto y = sense(model_, s, external.data(), run_.inputs[k], p_);
            for (int i = 0; i < kChannels; ++i)
                keep(y[static_cast<std::size_t>(i)], i, expected, H);
        });
        return expected;
    }

    /// Where the effects' state number `i` stands in the filter's state, and in the model's.
    int packed(std::size_t i) const {
        return static_cast<int>(kMotionStates +
                                std::min<std::size_t>(disturbances_, kMotionStates) + i);
    }
    std::size_t place(std::size_t i) const { return kMotionStates + own_.place[i]; }
    const ActiveStates& own() const { return own_; }

    /// How many disturbances there are, and where number `i`, an `External`, stands.
    std::size_t disturbances() const { return disturbances_; }
    int disturbing(std::size_t i) const {
        return i < kMotionStates ? kMotionStates + static_cast<int>(i)
                                 : packed(own_.count + i - kMotionStates);
    }
    /// States that take part.
    int taking_part() const { return kMotionStates + static_cast<int>(disturbances_ + own_.count); }
    double forget(std::size_t i) const { return forget_[i]; }
    /// Variance that a sample adds to state number `i`.
    double process_noise(int i) const { return process_(i, i); }

    const Vec<kChannels>& measurement(std::size_t k) const { return run_.measurements[k]; }
    const Mat<kChannels, kChannels>& measurement_noise(std::size_t /*k*/) const { return sensors_; }

  private:
    // So many directions at once: the model is compiled for few widths.
    static constexpr int kPass = [] {
        if (NX == kMotionStates) return static_cast<int>(kMotionStates);
        if (NX == kWidestStatePass) return kWidestStatePass;
        return NX % kWideStatePass == 0 ? kWideStatePass : kStatePass;
    }();
    static_assert(NX % kPass == 0);
    using D = Dual<kPass>;

    /// Calls `use` with every state in turn as a direction; `keep` stores a row of what results.
    template <class Use>
    void in_passes(const Vec<NX>& x, Use&& use) const {
        const int wanted = taking_part();
        for (int first = 0; first < NX; first += kPass) {
            ModelState<D> s{};
            std::array<D, kExternals> external{};
            const auto seeded = [&](int i) {
                D value(x[i]);
                if (i >= first && i < first + kPass)
                    value.d[static_cast<std::size_t>(i - first)] = 1.0;
                return value;
            };
            for (int i = 0; i < kMotionStates; ++i) s[static_cast<std::size_t>(i)] = seeded(i);
            for (std::size_t i = 0; i < disturbances_; ++i) external[i] = seeded(disturbing(i));
            for (std::size_t i = 0; i < own_.count; ++i) s[place(i)] = seeded(packed(i));
            use(s, external, [&](const D& value, int row, auto& values, auto& slopes) {
                values[row] = value.v;
                for (int j = 0; j < kPass; ++j)
                    slopes(row, first + j) = value.d[static_cast<std::size_t>(j)];
            });
            if (first + kPass >= wanted) {
                break;
            }
        }
    }

    const SingleTrack& model_;
    const Run& run_;
    const double* p_;
    ActiveStates own_;
    ModelState<double> start_;
    std::size_t disturbances_;
    std::array<double, kExternals> forget_{}, variance_{};
    Mat<NX, NX> process_;
    Mat<kChannels, kChannels> sensors_;
};

/// State sizes for models without states of the effects' own, with a few, with some, with delays of
/// all sensors on a road of varying slope, and with all; `kMotionStates` where white noise alone
/// disturbs the first of these. What a sample costs grows with the cube.
constexpr int kStatesFew = kStatesPlain + 3;
constexpr int kStatesSome = kStatesPlain + 6;
constexpr int kStatesSeveral = kStatesPlain + 12;
constexpr int kStatesMost = (kStatesFull + kRoadStates + kColourStates + kWideStatePass - 1) /
                            kWideStatePass * kWideStatePass;

/// Calls `use(std::integral_constant<int, NX>)` with a state size that holds the effects' states
/// and those of the road and of coloured sensors.
template <class Use>
auto with_state_size(EffectMask effects, const Noise& noise, Use&& use) {
    const std::size_t disturbances = noise.disturbances();
    const std::size_t own = active_states(effects).count +
                            (disturbances > kMotionStates ? disturbances - kMotionStates : 0);
    if (own == 0 && noise.white()) return use(std::integral_constant<int, kMotionStates>{});
    if (own == 0) return use(std::integral_constant<int, kStatesPlain>{});
    if (own <= 3) return use(std::integral_constant<int, kStatesFew>{});
    if (own <= 6) return use(std::integral_constant<int, kStatesSome>{});
    if (own <= 12) return use(std::integral_constant<int, kStatesSeveral>{});
    return use(std::integral_constant<int, kStatesMost>{});
}

template <int NX>
using KeepStep = std::function<void(std::size_t, const FilterStep<NX, kChannels>&)>;

/// The filter over a run from its usual start; compiled once, in `run_system.cpp`.
template <int NX>
double filter_run(const RunSystem<NX>& system, const KeepStep<NX>& keep);

extern template double filter_run(const RunSystem<kMotionStates>&, const KeepStep<kMotionStates>&);
extern template double filter_run(const RunSystem<kStatesPlain>&, const KeepStep<kStatesPlain>&);
extern template double filter_run(const RunSystem<kStatesFew>&, const KeepStep<kStatesFew>&);
extern template double filter_run(const RunSystem<kStatesSome>&, const KeepStep<kStatesSome>&);
extern template double filter_run(const RunSystem<kStatesSeveral>&,
                                  const KeepStep<kStatesSeveral>&);
extern template double filter_run(const RunSystem<kStatesMost>&, const KeepStep<kStatesMost>&);

}  // namespace sysid
