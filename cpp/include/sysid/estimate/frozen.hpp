// Prediction errors of a filter whose gains are kept. Ljung, System Identification (2nd ed.),
// sec. 7.2.
#pragma once

#include <array>
#include <cmath>

#include "sysid/math/linear.hpp"

namespace sysid {

/// The inverse Cholesky factor that whitens an innovation; zero rows where `y`
/// is missing.
template <int NY, class U>
Mat<NY, NY> whitener_of(const U& update, const Vec<NY>& y) {
    Mat<NY, NY> whitener = update.whitening;
    for (int i = 0; i < NY; ++i)
        if (std::isnan(y[i])) whitener(i, i) = 0.0;  // alone in its row and column
    return whitener;
}

/// What was read less what was expected; zero where nothing was read.
template <std::size_t NY>
std::array<double, NY> errors_of(const Vec<static_cast<int>(NY)>& y,
                                 const std::array<double, NY>& expected) {
    std::array<double, NY> error;
    for (std::size_t i = 0; i < NY; ++i) {
        const double measured = y[static_cast<int>(i)];
        error[i] = std::isnan(measured) ? 0.0 : measured - expected[i];
    }
    return error;
}

}  // namespace sysid
