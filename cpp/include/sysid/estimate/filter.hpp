// Extended, unscented and square-root unscented Kalman filter over one description of a model, a
// sample at a time. A whole record is the same calls in a loop, so the numbers are the same.
//
// A `Model` provides
//   static constexpr int kStates, kMeasured;
//   using Input = ...;                              anything; what is known at a sample
//   template <class S> void predict(const Input&, const S* x, S* next) const;
//   template <class S> void observe(const Input&, const S* x, S* y) const;
//   Mat<kStates, kStates> process_noise(const Input&) const;
//   Mat<kMeasured, kMeasured> measurement_noise(const Input&) const;
// `S` is double, or Dual for the exact Jacobians of the extended filter. NaN in a measurement marks
// an element that is missing: sensors of lower rate, drop-outs.
#pragma once

#include <array>
#include <deque>
#include <vector>

#include "sysid/estimate/gate.hpp"
#include "sysid/estimate/smoother.hpp"
#include "sysid/estimate/square_root.hpp"
#include "sysid/math/dual.hpp"

namespace sysid {

enum class Method { kExtended, kUnscented, kSquareRoot };

/// Whether somebody may go back over what the filter did: a model that only runs ahead says that
/// it is not `kSmoothed`, and the filter works out no transition of the states.
template <class Model>
constexpr bool kSmoothed = [] {
    if constexpr (requires { Model::kSmoothed; }) return Model::kSmoothed;
    return true;
}();

/// Follows the measurement noise by the residuals after the update (Mohamed & Schwarz, 1999): each
/// diagonal element is rescaled within [floor, ceiling] times its nominal variance.
struct NoiseAdaptation {
    double rate = 0.0;  // weight of one sample; 0 switches it off
    double floor = 0.1;
    double ceiling = 100.0;
};

template <class Model, Method method = Method::kUnscented>
class Filter {
  public:
    static constexpr int NX = Model::kStates;
    static constexpr int NY = Model::kMeasured;
    using Input = typename Model::Input;
    using Step = FilterStep<NX, NY>;

    Filter(Model model, const Vec<NX>& mean, const Mat<NX, NX>& covariance,
           Gate<NY> gate = Gate<NY>(), NoiseAdaptation adaptation = NoiseAdaptation(),
           const SigmaWeights& weights = SigmaWeights::even(NX))
        : model_(std::move(model)), gate_(gate), adaptation_(adaptation), weights_(weights) {
        state_.mean = mean;
        state_.covariance = covariance;
        if (!mean.allFinite()) throw NumericalFailure("the initial mean is not finite", 0);
        root_ = factor_of<NX>(covariance, 0);
        state_.transition.setIdentity();
        scale_.setOnes();
    }

    /// Predicts to this sample (not before the first one) and uses the measurement.
    const Step& step(const Input& input, Vec<NY> y) {
        for (int i = 0; i < NY; ++i)
            if (std::isinf(y[i])) throw NumericalFailure("an infinite measurement", index_);
        if (index_ > 0) predict(input);
        state_.predicted_mean = state_.mean;
        state_.predicted_covariance = state_.covariance;
        update(input, y);
        if (!state_.mean.allFinite()) throw NumericalFailure("the state is not finite", index_);
        ++index_;
        return state_;
    }

    /// Begins again from another mean and covariance; the count of samples goes on.
    void restart(const Vec<NX>& mean, const Mat<NX, NX>& covariance) {
        state_.mean = mean;
        state_.covariance = covariance;
        root_ = factor_of<NX>(covariance, index_);
        factored_ = true;
    }

    void set_gate(const Gate<NY>& gate) { gate_ = gate; }

    const Step& state() const { return state_; }
    const Mat<NX, NX>& root() const { return root_; }  // kept by the square-root filter only
    std::size_t samples() const { return index_; }
    int refusals() const { return refusals_; }
    /// The last measurement, with NaN for what the gate refused.
    const Vec<NY>& used() const { return used_; }
    double nis() const { return nis_; }
    Vec<NY> noise_scale() const { return scale_; }
    Model& model() { return model_; }
    const Model& model() const { return model_; }

    /// What the next step depends on, for `StateWriter` and `StateReader`; the model and the
    /// weights are those of the constructor.
    template <class Row>
    void remember(Row& row) {
        row(gate_, state_.mean, state_.covariance, root_, scale_, index_);
        factored_ = false;  // unknown of what was read
    }

  private:
    /// The unscented filter keeps a covariance; its factor is known where it has just begun again.
    void factorise() {
        if constexpr (method == Method::kUnscented) {
            if (!factored_) root_ = factor_of<NX>(state_.covariance, index_);
            factored_ = false;  // what follows changes the covariance
        }
    }

    void predict(const Input& input) {
        const auto f = [&](const Vec<NX>& x) {
            Vec<NX> next;
            model_.predict(input, x.data(), next.data());
            return next;
        };
        const Mat<NX, NX> Q = model_.process_noise(input);
        if constexpr (method == Method::kExtended) {
            std::array<Dual<NX>, NX> x;
            std::array<Dual<NX>, NX> next;
            seed(x);
            model_.predict(input, x.data(), next.data());
            unpack<NX>(next, state_.mean, state_.transition);
            propagate<NX>(state_.transition, state_.covariance);
            state_.covariance += Q;
        } else {
            factorise();
            const auto t = transform<NX, NX>(f, state_.mean, root_, weights_);
            // The regression of the new on the old state: what a smoother takes for the transition.
            if constexpr (kSmoothed<Model>) {
                state_.transition = t.slope_times_L;
                solve_from_the_right<NX, NX>(root_, state_.transition);
            }
            if constexpr (method == Method::kUnscented) {
                state_.mean = t.mean;
                state_.covariance = t.covariance(weights_) + Q;
                symmetrise(state_.covariance);
            } else {
                square_root_predict<NX>(t, state_.mean, root_, root_of<NX>(Q, index_), weights_);
                state_.covariance = times_transposed<NX, NX, NX>(root_, root_);
            }
        }
    }

    void update(const Input& input, Vec<NY>& y) {
        const auto h = [&](const Vec<NX>& x) {
            Vec<NY> expected;
            model_.observe(input, x.data(), expected.data());
            return expected;
        };
        Mat<NY, NY> R = model_.measurement_noise(input);
        for (int j = 0; j < NY; ++j)
            for (int i = 0; i < NY; ++i) R(i, j) *= std::sqrt(scale_[i]) * std::sqrt(scale_[j]);
        Regression<NX, NY> line;
        if constexpr (method == Method::kExtended) {
            std::array<Dual<NX>, NX> x;
            std::array<Dual<NX>, NY> expected;
            seed(x);
            model_.observe(input, x.data(), expected.data());
            unpack<NY>(expected, line.expected, line.H);
            line.noise = R;
            refusals_ = gate_.apply(y, line.expected, line.innovation_variance(state_.covariance));
        } else {
            factorise();
            const auto t = transform<NY, NX>(h, state_.mean, root_, weights_);
            line = Regression<NX, NY>::of(t, root_, R, weights_);
            refusals_ = gate_.apply(y, line.expected, line.innovation_variance(state_.covariance));
            if constexpr (method == Method::kSquareRoot) {
                square_root_update<NX, NY>(t, state_.mean, root_, y, root_of<NY>(R, index_),
                                           weights_, index_, state_.update);
                state_.covariance = times_transposed<NX, NX, NX>(root_, root_);
            }
        }
        if constexpr (method != Method::kSquareRoot)
            measurement_update<NX, NY>(state_.mean, state_.covariance, y, line.expected, line.H,
                                       line.noise, index_, state_.update);
        used_ = y;
        const auto& u = state_.update;
        nis_ = u.innovation.dot(u.information * u.innovation);
        if (adaptation_.rate > 0.0) adapt(y, h(state_.mean), line.H, R);
    }

    void adapt(const Vec<NY>& y, const Vec<NY>& fitted, const Mat<NY, NX>& H,
               const Mat<NY, NY>& R) {
        const Vec<NY> known = seen_variance<NX, NY>(H, state_.covariance);
        for (int i = 0; i < NY; ++i) {
            if (std::isnan(y[i])) continue;
            const double e = y[i] - fitted[i];
            const double seen = (e * e + known[i]) * scale_[i] / R(i, i);
            const double mixed = (1.0 - adaptation_.rate) * scale_[i] + adaptation_.rate * seen;
            scale_[i] = std::min(std::max(mixed, adaptation_.floor), adaptation_.ceiling);
        }
    }

    void seed(std::array<Dual<NX>, NX>& x) const {
        for (int i = 0; i < NX; ++i)
            x[static_cast<std::size_t>(i)] = Dual<NX>::seeded(state_.mean[i], i);
    }

    template <int N>
    static void unpack(const std::array<Dual<NX>, N>& from, Vec<N>& value, Mat<N, NX>& jacobian) {
        for (int i = 0; i < N; ++i) {
            const Dual<NX>& d = from[static_cast<std::size_t>(i)];
            value[i] = d.v;
            for (int j = 0; j < NX; ++j) jacobian(i, j) = d.d[static_cast<std::size_t>(j)];
        }
    }

    Model model_;
    Gate<NY> gate_;
    NoiseAdaptation adaptation_;
    SigmaWeights weights_;
    Step state_;
    Mat<NX, NX> root_;
    bool factored_ = true;  // whether `root_` is the factor of the covariance as it is
    Vec<NY> scale_;
    std::size_t index_ = 0;
    Vec<NY> used_ = Vec<NY>::Zero();
    int refusals_ = 0;
    double nis_ = 0.0;
};

/// Takes measurements that arrive late: keeps the last samples and runs them again.
template <class F>
class LateMeasurements {
  public:
    using Measured = Vec<F::NY>;

    LateMeasurements(F filter, std::size_t longest_delay)
        : filter_(std::move(filter)), longest_(longest_delay) {}

    const typename F::Step& step(const typename F::Input& input, const Measured& y) {
        past_.push_back({filter_, input, y});
        if (past_.size() > longest_ + 1) past_.pop_front();
        return filter_.step(input, y);
    }

    /// Element `row` measured `delay` samples before the latest one.
    const typename F::Step& late(std::size_t delay, int row, double value) {
        if (delay >= past_.size())
            throw NumericalFailure("a measurement came later than the longest delay allows",
                                   filter_.samples());
        if (row < 0 || row >= F::NY) throw std::invalid_argument("row: no such measurement");
        const std::size_t first = past_.size() - 1 - delay;
        past_[first].y[row] = value;
        filter_ = past_[first].before;
        for (std::size_t k = first; k < past_.size(); ++k) {
            past_[k].before = filter_;
            filter_.step(past_[k].input, past_[k].y);
        }
        return filter_.state();
    }

    const F& filter() const { return filter_; }

  private:
    struct Kept {
        F before;
        typename F::Input input;
        Measured y;
    };
    F filter_;
    std::size_t longest_;
    std::deque<Kept> past_;
};

}  // namespace sysid
