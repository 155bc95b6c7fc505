#include "sysid/identify/start.hpp"

#include <algorithm>

#include "sysid/math/dual.hpp"

namespace sysid {

namespace {

/// Rate of change of brisk driving, about 1 Hz [rad/s].
constexpr double kDriving = 6.0;

/// Derivatives of the settled states by the motion, shape (states, 3).
Eigen::MatrixXd settled_slopes(const SingleTrack& model, const ModelState<double>& x,
                               const Input& u, const double* p, const ActiveStates& own) {
    using D = Dual<kMotionStates>;
    ModelState<D> settled{};
    for (std::size_t i = 0; i < x.size(); ++i) settled[i] = D(x[i]);
    for (std::size_t i = 0; i < kMotionStates; ++i) settled[i].d[i] = 1.0;
    const std::array<D, kExternals> calm{};
    settle_auxiliary(model, settled, calm.data(), u, p);
    Eigen::MatrixXd slopes(own.count, kMotionStates);
    for (std::size_t i = 0; i < own.count; ++i)
        for (std::size_t j = 0; j < kMotionStates; ++j)
            slopes(static_cast<int>(i), static_cast<int>(j)) =
                settled[kMotionStates + own.place[i]].d[j];
    return slopes;
}

/// How fast each state forgets, minus the derivative of its rate by itself [1/s].
Eigen::VectorXd forgetting(const SingleTrack& model, const ModelState<double>& x, const Input& u,
                           const double* p, const ActiveStates& own) {
    using D = Dual<kWideStatePass>;
    const std::array<D, kExternals> calm{};
    Eigen::VectorXd rates(own.count);
    for (std::size_t first = 0; first < own.count; first += kWideStatePass) {
        const std::size_t end = std::min<std::size_t>(first + kWideStatePass, own.count);
        ModelState<D> at{}, rate{};
        for (std::size_t i = 0; i < x.size(); ++i) at[i] = D(x[i]);
        for (std::size_t i = first; i < end; ++i)
            at[kMotionStates + own.place[i]].d[i - first] = 1.0;
        model.evaluate(at.data(), calm.data(), at.data() + kMotionStates, u, p, rate.data(),
                       rate.data() + kMotionStates);
        for (std::size_t i = first; i < end; ++i)
            rates[static_cast<int>(i)] = -rate[kMotionStates + own.place[i]].d[i - first];
    }
    return rates;
}

}  // namespace

Eigen::MatrixXd start_covariance(const SingleTrack& model, const ModelState<double>& x,
                                 const Input& u, const double* p) {
    const ActiveStates own = active_states(model.effects);
    const auto n = static_cast<int>(own.count);
    Eigen::Vector<double, kMotionStates> motion;
    for (int i = 0; i < kMotionStates; ++i)
        motion[i] = kFirstVariances[static_cast<std::size_t>(i)];
    Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(kMotionStates + n, kMotionStates + n);
    covariance.topLeftCorner<kMotionStates, kMotionStates>() = motion.asDiagonal();
    if (n == 0) return covariance;
    Eigen::MatrixXd follows = settled_slopes(model, x, u, p, own);
    const Eigen::VectorXd rates = forgetting(model, x, u, p, own);
    constexpr auto spreads = effect_state_spreads();
    for (int i = 0; i < n; ++i) {
        // Of a quantity that changes at this frequency a first-order lag shows so much in phase.
        const double square = std::max(rates[i], 0.0) * std::max(rates[i], 0.0);
        const double in_phase = square / (square + kDriving * kDriving);
        const double spread = spreads[own.place[static_cast<std::size_t>(i)]];
        follows.row(i) *= in_phase;
        covariance(kMotionStates + i, kMotionStates + i) = spread * spread * (1.0 - in_phase);
    }
    const Eigen::MatrixXd with_motion = follows * motion.asDiagonal();
    covariance.bottomLeftCorner(n, kMotionStates) = with_motion;
    covariance.topRightCorner(kMotionStates, n) = with_motion.transpose();
    covariance.bottomRightCorner(n, n) += with_motion * follows.transpose();
    return covariance;
}

}  // namespace sysid
