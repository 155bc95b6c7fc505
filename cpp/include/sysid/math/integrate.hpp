// Classical Runge-Kutta, the one rule by which every car of the project moves, and Dormand-Prince
// with error control to check it by.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "sysid/math/errors.hpp"

namespace sysid {

/// One step of length h. `rate(stage, at, k)` fills the derivatives k at the state `at`, at the
/// start (stage 0), twice in the middle (1, 2) and at the end (3); `each(use)` calls `use(i)` for
/// the elements that move.
template <class X, class Rate, class Each>
void runge_kutta_step(X& x, double h, Rate&& rate, Each&& each) {
    X k1, k2, k3, k4, at;
    const auto moved = [&](const X& k, double by) -> const X& {
        each([&](std::size_t i) { at[i] = x[i] + by * k[i]; });
        return at;
    };
    rate(0, x, k1);
    rate(1, moved(k1, 0.5 * h), k2);
    rate(2, moved(k2, 0.5 * h), k3);
    rate(3, moved(k3, h), k4);
    each([&](std::size_t i) { x[i] += (h / 6.0) * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]); });
}

/// The part of a step at which a stage stands.
constexpr std::array<double, 4> kStageAt{0.0, 0.5, 0.5, 1.0};

/// Dormand and Prince, J. Comp. Appl. Math. 6 (1980), 19-26: order 5 with an error estimate of
/// order 4. Keeps the error of a step below `tolerance` times `1 + |x|`; returns the steps taken.
template <std::size_t N, class Rate>
int dormand_prince(std::array<double, N>& x, double dt, double tolerance, Rate&& rate) {
    constexpr std::array<double, 7> node{0.0, 0.2, 0.3, 0.8, 8.0 / 9, 1.0, 1.0};
    constexpr std::array<std::array<double, 7>, 7> a{
        {
            {},
            {1.0 / 5},
            {3.0 / 40, 9.0 / 40},
            {44.0 / 45, -56.0 / 15, 32.0 / 9},
            {19372.0 / 6561, -25360.0 / 2187, 64448.0 / 6561, -212.0 / 729},
            {9017.0 / 3168, -355.0 / 33, 46732.0 / 5247, 49.0 / 176, -5103.0 / 18656},
            {35.0 / 384, 0.0, 500.0 / 1113, 125.0 / 192, -2187.0 / 6784, 11.0 / 84},
        },
    };
    constexpr std::array<double, 7> error_weight{
        71.0 / 57600, 0.0, -71.0 / 16695, 71.0 / 1920, -17253.0 / 339200, 22.0 / 525, -1.0 / 40,
    };
    constexpr int most = 100000;
    double done = 0.0;
    double h = dt;
    for (int taken = 1; taken <= most; ++taken) {
        h = std::min(h, dt - done);
        std::array<std::array<double, N>, 7> k{};
        std::array<double, N> next{};
        for (std::size_t s = 0; s < 7; ++s) {
            next = x;
            for (std::size_t j = 0; j < s; ++j)
                for (std::size_t i = 0; i < N; ++i) next[i] += h * a[s][j] * k[j][i];
            k[s] = rate((done + node[s] * h) / dt, next);
        }
        double worst = 0.0;
        for (std::size_t i = 0; i < N; ++i) {
            double error = 0.0;
            for (std::size_t s = 0; s < 7; ++s) error += h * error_weight[s] * k[s][i];
            const double relative = std::abs(error) / (tolerance * (1.0 + std::abs(next[i])));
            if (!std::isfinite(relative))
                throw NumericalFailure("the integration left all bounds", 0);
            worst = std::max(worst, relative);
        }
        if (worst <= 1.0) {
            x = next;
            done += h;
            if (done >= dt * (1.0 - 1e-12)) return taken;
        }
        h *= std::clamp(0.9 * std::pow(std::max(worst, 1e-10), -0.2), 0.2, 5.0);
    }
    throw NumericalFailure("the integration needs too many steps", 0);
}

}  // namespace sysid
