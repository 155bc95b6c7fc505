// What several tests need: a car, its parameters, short drives, and central differences.
#pragma once

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include "sysid/estimate/kalman.hpp"
#include "sysid/identify/in_time.hpp"

namespace sysid::test {

using Parameters = std::array<double, kParameterCount>;

/// A rear-driven saloon.
inline VehicleData saloon() {
    VehicleData car;
    car.mass_kg = 1500.0;
    car.lf_m = 1.2;
    car.lr_m = 1.5;
    car.cg_height_m = 0.5;
    car.drag_area_m2 = 0.7;
    car.brake_front_share = 0.6;
    car.drive_front_share = 0.0;
    return car;
}

/// Tyres with curvature, the rear stiffer than the front; effects at their null values.
inline Parameters plain_parameters() {
    Parameters p{};
    const std::array<double, kBaseParameterCount> base{10.0, 1.4, 1.0, 0.3,   12.0,
                                                       1.4,  1.1, 0.2, 2200.0};
    std::copy(base.begin(), base.end(), p.begin());
    for (std::size_t i = 0; i < kEffectCount; ++i)
        for (std::size_t j = 0; j < kEffectInfos[i].parameter_count(); ++j)
            p[kBaseParameterCount + effect_offset(i) + j] =
                kEffectInfos[i].parameters[j].null_value;
    return p;
}

inline std::size_t effect_index(const std::string& id) {
    for (std::size_t i = 0; i < kEffectCount; ++i)
        if (id == kEffectInfos[i].id) return i;
    throw std::invalid_argument("no effect " + id);
}

inline EffectMask mask_of(const std::vector<std::string>& ids) {
    EffectMask mask = 0;
    for (const std::string& id : ids) mask |= EffectMask{1} << effect_index(id);
    return mask;
}

constexpr EffectMask kAllEffects = (EffectMask{1} << kEffectCount) - 1;

/// Effects that lag at any size: those whose derivative at the null value does not exist.
inline EffectMask lagging_effects() {
    EffectMask mask = 0;
    for (std::size_t i = 0; i < kEffectCount; ++i)
        if (kEffectInfos[i].scored_at_typical) mask |= EffectMask{1} << i;
    return mask;
}

/// Position in the flat parameter vector of parameter number `which` of an effect.
inline std::size_t parameter_of(const std::string& effect, std::size_t which = 0) {
    return kBaseParameterCount + effect_offset(effect_index(effect)) + which;
}

/// Every effect at a size one meets in practice.
inline Parameters typical_parameters() {
    Parameters p = plain_parameters();
    for (std::size_t i = 0; i < kEffectCount; ++i)
        for (std::size_t j = 0; j < kEffectInfos[i].parameter_count(); ++j)
            p[kBaseParameterCount + effect_offset(i) + j] = kEffectInfos[i].parameters[j].typical;
    return p;
}

/// Position in the model's state of state number `which` of an effect.
inline std::size_t state_of(const std::string& effect, std::size_t which = 0) {
    return kMotionStates + effect_state_offset(effect_index(effect)) + which;
}

/// The motion's part of the derivatives: what effects with states of their own leave alone at null.
inline std::array<double, kMotionStates> motion_of(const ModelState<double>& rate) {
    return {rate[0], rate[1], rate[2]};
}

constexpr std::array<double, kExternals> kCalm{};

/// One evaluation: the workings, the derivatives of the state, the readings.
struct Evaluation {
    Workings<double> w;
    ModelState<double> rate{};
    std::array<double, kChannels> y{};
};

inline Evaluation evaluate(const SingleTrack& model, const ModelState<double>& x, const Input& u,
                           const Parameters& p,
                           const std::array<double, kExternals>& external = kCalm) {
    Evaluation e;
    e.w = model.evaluate(x.data(), external.data(), x.data() + kMotionStates, u, p.data(),
                         e.rate.data(), e.rate.data() + kMotionStates);
    model.sense(e.w, p.data(), x.data() + kMotionStates, e.y.data());
    return e;
}

/// Steering and force of a lively but smooth drive at time `t`.
inline Input lively(double t) {
    return {0.04 * std::sin(3.0 * t) + 0.01 * std::sin(11.0 * t) + 0.004,
            1500.0 * std::cos(1.7 * t) + 500.0, t,
            0.12 * std::cos(3.0 * t) + 0.11 * std::cos(11.0 * t)};
}

/// The readings along `inputs`, free of noise.
inline std::vector<Vec<kChannels>> drive(const SingleTrack& model, const Parameters& p,
                                         const std::vector<Input>& logged, double dt,
                                         double speed) {
    const Problem problem{model, {{dt, logged, {}, "", {}, {}}}};
    const InTime in_time(problem, p.data());
    const std::vector<Input>& inputs = (*in_time).runs[0].inputs;
    ModelState<double> x{};
    x[0] = speed;
    settle_auxiliary(model, x, kCalm.data(), inputs.front(), p.data());
    std::vector<Vec<kChannels>> out;
    for (std::size_t k = 0; k < inputs.size(); ++k) {
        if (k > 0)
            advance(model, x, kCalm.data(), inputs[k - 1], inputs[k], p.data(), dt,
                    substeps_for(model, p.data(), x[0], dt));
        const auto y = sense(model, x, kCalm.data(), inputs[k], p.data());
        out.emplace_back(Eigen::Map<const Vec<kChannels>>(y.data()));
    }
    return out;
}

/// Noise levels of ordinary sensors and of a model that is nearly right.
inline Noise ordinary_noise() {
    Noise noise;
    noise.sensor = {0.05, 0.03, 0.003, 0.1, 0.1};
    noise.motion = {0.05, 0.05, 0.01};
    noise.disturbance = {150.0, 150.0, 100.0};
    noise.correlation_time_s = {0.5, 0.5, 0.5};
    return noise;
}

/// The same without forces that have a correlation time.
inline Noise white_noise() {
    Noise noise = ordinary_noise();
    noise.disturbance = {0.0, 0.0, 0.0};
    return noise;
}

/// The same on a road that wanders.
inline Noise sloping_noise() {
    Noise noise = ordinary_noise();
    noise.correlation_time_s = {0.2, 0.5, 1.0};
    noise.road = {0.3, 0.2};
    noise.road_time_s = 3.0;
    return noise;
}

/// The same with noise of sensors that is correlated in time.
inline Noise coloured_noise() {
    Noise noise = sloping_noise();
    noise.colour = {0.001, 0.04, 0.05};
    noise.colour_time_s = {0.04, 0.1, 0.06};
    return noise;
}

/// A drive with sensor noise, `samples` long; `steer_part` scales the steering.
inline Run noisy_run(const SingleTrack& model, const Parameters& p, std::size_t samples, double dt,
                     unsigned seed, double steer_part = 1.0) {
    Run run;
    run.dt = dt;
    for (std::size_t k = 0; k < samples; ++k) {
        run.inputs.push_back(lively(static_cast<double>(k) * dt));
        run.inputs.back().steer_rad *= steer_part;
        const double moved = 300.0 * std::sin(2.0 * run.inputs.back().time_s);
        run.inputs.back().loads_n = {8000.0 + moved, 6500.0 - moved};
    }
    run.measurements = drive(model, p, run.inputs, dt, 20.0);
    std::mt19937 generator(seed);
    std::normal_distribution<double> normal;
    const Noise noise = ordinary_noise();
    for (auto& y : run.measurements)
        for (int i = 0; i < kChannels; ++i)
            y[i] += noise.sensor[static_cast<std::size_t>(i)] * normal(generator);
    return run;
}

/// Central difference of `f`, a function of one number, with two step sizes combined so that the
/// error is of the fourth order.
template <class F>
auto central_difference(F&& f, double at, double step) {
    using Value = decltype(f(at));
    const Value wide = (f(at + step) - f(at - step)) / (2.0 * step);
    const Value narrow = (f(at + 0.5 * step) - f(at - 0.5 * step)) / step;
    return Value((4.0 * narrow - wide) / 3.0);
}

/// x(k) = A x(k-1) + b(k) + noise Q, y(k) = H x(k) + d(k) + noise R, as the filter wants it.
template <int NX, int NY>
struct LinearSystem {
    Mat<NX, NX> A, Q;
    Mat<NY, NX> H;
    Mat<NY, NY> R;
    std::vector<Vec<NX>> b;
    std::vector<Vec<NY>> d;
    std::vector<Vec<NY>> y;

    std::size_t size() const { return y.size(); }
    Vec<NX> predict(std::size_t k, const Vec<NX>& x, Mat<NX, NX>& to_A, Mat<NX, NX>& to_Q) const {
        to_A = A;
        to_Q = Q;
        return A * x + b[k];
    }
    Vec<NY> observe(std::size_t k, const Vec<NX>& x, Mat<NY, NX>& to_H) const {
        to_H = H;
        return H * x + d[k];
    }
    const Vec<NY>& measurement(std::size_t k) const { return y[k]; }
    const Mat<NY, NY>& measurement_noise(std::size_t /*k*/) const { return R; }
};

using Small = LinearSystem<3, 2>;

/// A stable system of three states and two sensors with correlated noise, `samples` long; every
/// fifth first sensor and, at sample 3, both are missing.
inline Small small_system(std::size_t samples) {
    Small s;
    s.A << 0.9, 0.2, 0.0, -0.1, 0.8, 0.1, 0.05, 0.0, 0.95;
    s.Q << 0.04, 0.01, 0.0, 0.01, 0.03, 0.005, 0.0, 0.005, 0.02;
    s.H << 1.0, 0.0, 0.3, 0.0, 1.0, -0.5;
    s.R << 0.10, 0.03, 0.03, 0.20;
    std::mt19937 generator(23);
    std::normal_distribution<double> normal;
    for (std::size_t k = 0; k < samples; ++k) {
        const double t = static_cast<double>(k);
        s.b.emplace_back(0.1, -0.05 * t, 0.02);
        s.d.emplace_back(0.3, 0.1 * t);
        s.y.emplace_back(normal(generator), normal(generator) - 0.2 * t);
        if (k % 5 == 2) s.y.back()[0] = std::nan("");
        if (k == 3) s.y.back().setConstant(std::nan(""));
    }
    return s;
}

/// The same with uncorrelated sensors, of which the first one is a state.
struct Uncorrelated : Small {
    static constexpr int kDirectReadings = 1;
    explicit Uncorrelated(Small s) : Small(std::move(s)) {
        H.row(0) << 1.0, 0.0, 0.0;
        R(0, 1) = R(1, 0) = 0.0;
    }
};

const Vec<3> kSmallMean{0.5, -0.3, 0.2};
inline Mat<3, 3> small_covariance() {
    Mat<3, 3> P;
    P << 1.0, 0.2, 0.0, 0.2, 0.8, -0.1, 0.0, -0.1, 0.5;
    return P;
}

}  // namespace sysid::test
