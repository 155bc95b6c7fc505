// Refusing measurements that are too improbable, without ever locking a sensor out.
#pragma once

#include <array>
#include <cmath>
#include <stdexcept>

#include "sysid/math/linear.hpp"

namespace sysid {

/// Two-sided Gaussian bound: |e| / sigma exceeds it with the given probability.
inline double gaussian_bound(double probability) {
    if (!(probability > 0.0) || probability >= 1.0)
        throw std::invalid_argument("gate probability: must lie between 0 and 1");
    double low = 0.0;
    double high = 40.0;
    for (int i = 0; i < 200 && high - low > 1e-14; ++i) {
        const double middle = 0.5 * (low + high);
        (std::erfc(middle / std::sqrt(2.0)) > probability ? low : high) = middle;
    }
    return 0.5 * (low + high);
}

/// Gates each element of a measurement by the probability of its innovation. After `patience`
/// refusals in a row the element is taken until it agrees again: the filter is wrong then, not the
/// sensor.
template <int NY>
class Gate {
  public:
    Gate() { refused_.fill(0); }
    Gate(double probability, int patience) : Gate() {
        if (patience < 1) throw std::invalid_argument("gate patience: must be 1 or more");
        const double bound = gaussian_bound(probability);
        bound_squared_ = bound * bound;
        patience_ = patience;
    }

    /// Replaces refused elements of `y` by NaN; `variance` is that of the innovations. Returns how
    /// many were refused.
    int apply(Vec<NY>& y, const Vec<NY>& expected, const Vec<NY>& variance) {
        if (bound_squared_ <= 0.0) return 0;
        int refusals = 0;
        for (int i = 0; i < NY; ++i) {
            if (std::isnan(y[i])) continue;
            int& row = refused_[static_cast<std::size_t>(i)];
            const double e = y[i] - expected[i];
            if (e * e <= bound_squared_ * variance[i]) {
                row = 0;
                continue;
            }
            if (row >= patience_) continue;  // until it agrees again
            ++row;
            ++refusals;
            y[i] = std::nan("");
        }
        return refusals;
    }

    /// What it remembers, for `StateWriter` and `StateReader`.
    template <class Row>
    void remember(Row& row) {
        row(bound_squared_, patience_);
        for (int& count : refused_) row(count);
    }

  private:
    double bound_squared_ = 0.0;  // 0: everything passes
    int patience_ = 1;
    std::array<int, static_cast<std::size_t>(NY)> refused_{};
};

}  // namespace sysid
