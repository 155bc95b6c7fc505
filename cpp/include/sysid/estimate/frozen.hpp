// The update of a filter with gains that are kept: the prediction errors are
// then a smooth function of the model, on any scalar. Ljung, System
// Identification (2nd ed.), sec. 7.2.
#pragma once

#include <array>
#include <cmath>

#include "sysid/math/linear.hpp"

namespace sysid {

/// The inverse Cholesky factor that whitens an innovation; zero rows where `y`
/// is missing.
template <int NY, class U>
Mat<NY, NY> whitener_of(const U& update, const Vec<NY>& y) {
    Mat<NY, NY> present = Mat<NY, NY>::Identity();
    for (int i = 0; i < NY; ++i)
        if (std::isnan(y[i])) present(i, i) = 0.0;
    return update.lower.template triangularView<Eigen::Lower>().solve(present);
}

/// What was read less what was expected; zero where nothing was read.
template <class S, std::size_t NY>
std::array<S, NY> errors_of(const Vec<static_cast<int>(NY)>& y, const std::array<S, NY>& expected) {
    std::array<S, NY> error;
    for (std::size_t i = 0; i < NY; ++i) {
        const double measured = y[static_cast<int>(i)];
        error[i] = std::isnan(measured) ? S(0.0) : measured - expected[i];
    }
    return error;
}

/// Errors over their expected size.
template <class S, std::size_t NY, class W>
std::array<S, NY> whitened(const W& whitener, const std::array<S, NY>& error) {
    std::array<S, NY> white;
    for (std::size_t i = 0; i < NY; ++i) {
        S sum(0.0);
        for (std::size_t j = 0; j <= i; ++j)
            sum += whitener(static_cast<int>(i), static_cast<int>(j)) * error[j];
        white[i] = sum;
    }
    return white;
}

/// Corrects the state that has this row of the gain.
template <class S, std::size_t NY, class G>
void correct(const G& gain, int row, const std::array<S, NY>& error, S& state) {
    S correction(0.0);
    for (std::size_t j = 0; j < NY; ++j) correction += gain(row, static_cast<int>(j)) * error[j];
    state += correction;
}

}  // namespace sysid
