// Fixed-step Runge-Kutta for driving, and Dormand-Prince with error control to check it by.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "sysid/math/errors.hpp"

namespace sysid::lab {

/// `x + sum(weight_i * k_i)`, for arrays.
template <std::size_t N, std::size_t M>
std::array<double, N> combined(const std::array<double, N>& x,
                               const std::array<std::array<double, N>, M>& k,
                               const std::array<double, M>& weight) {
    std::array<double, N> y = x;
    for (std::size_t j = 0; j < M; ++j) {
        if (weight[j] == 0.0) continue;
        for (std::size_t i = 0; i < N; ++i) y[i] += weight[j] * k[j][i];
    }
    return y;
}

/// Classical Runge-Kutta over `dt` in equal steps; `rate(part, x)` at the part 0 to 1 of `dt`.
template <std::size_t N, class Rate>
void runge_kutta(std::array<double, N>& x, double dt, int steps, Rate&& rate) {
    const double h = dt / steps;
    std::array<std::array<double, N>, 4> k;
    for (int n = 0; n < steps; ++n) {
        const auto at = [&](double within) { return (n + within) / steps; };
        k[0] = rate(at(0.0), x);
        k[1] = rate(at(0.5), combined<N, 4>(x, k, {h / 2, 0.0, 0.0, 0.0}));
        k[2] = rate(at(0.5), combined<N, 4>(x, k, {0.0, h / 2, 0.0, 0.0}));
        k[3] = rate(at(1.0), combined<N, 4>(x, k, {0.0, 0.0, h, 0.0}));
        x = combined<N, 4>(x, k, {h / 6, h / 3, h / 3, h / 6});
    }
}

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
            std::array<double, 7> weight = a[s];
            for (double& w : weight) w *= h;
            next = combined<N, 7>(x, k, weight);
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

}  // namespace sysid::lab
