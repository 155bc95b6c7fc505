// What lags and other stiff states need of the exponential function over a step, on any scalar.
// Hochbruck & Ostermann, "Exponential integrators", Acta Numerica 19 (2010), sec. 2.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>

#include "sysid/math/dual.hpp"
#include "sysid/math/recorded.hpp"

namespace sysid {

/// e^-z, and of the powers theta^n of the part of a step the integrals
/// J_n = int_0^1 z e^(-z (1 - theta)) theta^n dtheta, with their derivatives to z.
template <class S>
struct LagWeights;

template <>
struct LagWeights<double> {
    double kept, J0, J1, J2;
    double J1_slope, J2_slope;  // dJ0/dz = kept = -d(kept)/dz

    explicit LagWeights(double z) : kept(std::exp(-z)), J0(-std::expm1(-z)) {
        if (std::abs(z) < 0.5) {
            // J_n = n! sum_k (-1)^(k+1) z^k / (n + k)!: the recurrence below would cancel.
            series(z, 1, J1, J1_slope);
            series(z, 2, J2, J2_slope);
        } else {
            J1 = 1.0 - J0 / z;
            J2 = 1.0 - 2.0 * J1 / z;
            J1_slope = (J0 / z - kept) / z;
            J2_slope = 2.0 * (J1 / z - J1_slope) / z;
        }
    }

  private:
    static void series(double z, int n, double& sum, double& slope) {
        double term = 1.0;  // n! (-z)^(k-1) / (n + k)!
        sum = slope = 0.0;
        for (int k = 1; k <= 12; ++k) {
            term /= n + k;
            sum += term;
            slope += k * term;
            term *= -z;
        }
        sum *= z;
    }
};

/// phi_n(-z) = int_0^1 e^(-z (1 - theta)) theta^(n-1) / (n-1)! dtheta, phi_0(-z) = e^-z, with their
/// derivatives to z; z may be zero or negative.
struct PhiWeights {
    std::array<double, 4> value{}, slope{};

    explicit PhiWeights(double z) {
        value[0] = std::exp(-z);
        slope[0] = -value[0];
        double factorial = 1.0;  // 1 / n!
        for (std::size_t n = 1; n < value.size(); ++n) {
            if (std::abs(z) < 0.5) {
                series(z, static_cast<double>(n), factorial / static_cast<double>(n), n);
            } else {
                value[n] = (factorial - value[n - 1]) / z;
                slope[n] = -(slope[n - 1] + value[n]) / z;
            }
            factorial /= static_cast<double>(n);
        }
    }

  private:
    // phi_n(-z) = sum_k (-z)^k / (k + n)!: the recurrence would cancel.
    void series(double z, double n, double term, std::size_t at) {
        for (int k = 0; k < 14; ++k) {
            value[at] += term;
            term /= n + k + 1;
            slope[at] -= (k + 1) * term;
            term *= -z;
        }
    }
};

template <int N>
struct LagWeights<Dual<N>> {
    Dual<N> kept, J0, J1, J2;

    explicit LagWeights(const Dual<N>& z) {
        const LagWeights<double> w(z.v);
        kept = Dual<N>::chain(z, w.kept, -w.kept);
        J0 = Dual<N>::chain(z, w.J0, w.kept);
        J1 = Dual<N>::chain(z, w.J1, w.J1_slope);
        J2 = Dual<N>::chain(z, w.J2, w.J2_slope);
    }
};

template <>
struct LagWeights<Recorded> {
    Recorded kept, J0, J1, J2;

    explicit LagWeights(const Recorded& z)
        : kept(exp(-z)), J0(lag_integral(z, 0)), J1(lag_integral(z, 1)), J2(lag_integral(z, 2)) {}
};

inline std::array<double, 4> phi_weights(double z) { return PhiWeights(z).value; }
template <int N>
std::array<Dual<N>, 4> phi_weights(const Dual<N>& z) {
    const PhiWeights w(z.v);
    std::array<Dual<N>, 4> out;
    for (std::size_t n = 0; n < out.size(); ++n) out[n] = Dual<N>::chain(z, w.value[n], w.slope[n]);
    return out;
}
inline std::array<Recorded, 4> phi_weights(const Recorded& z) {
    return {exp(-z), phi_weight(z, 1), phi_weight(z, 2), phi_weight(z, 3)};
}

}  // namespace sysid
