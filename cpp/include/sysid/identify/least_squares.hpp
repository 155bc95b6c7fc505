// What every search asks of a problem, from one walk over its residuals that is
// written on any scalar.
//
// `walk(p, keep)` is called with all parameters, as plain or as dual numbers,
// and calls `keep` with an array of residuals at a time.
#pragma once

#include <Eigen/Dense>
#include <algorithm>
#include <vector>

#include "sysid/math/dual.hpp"

namespace sysid {

template <class Walk>
void residuals_of(Walk&& walk, const double* p, double* out) {
    walk(p, [&](const auto& row) { out = std::copy(row.begin(), row.end(), out); });
}

template <class Walk>
double half_sum_of(Walk&& walk, const double* p) {
    double sum = 0.0;
    walk(p, [&](const auto& row) {
        for (double e : row) sum += e * e;
    });
    return 0.5 * sum;
}

/// The parameters in passes of `Many` directions, of `Few` where no more are
/// asked for.
template <int Few, int Many>
struct Passes {
    std::size_t parameters;

    /// Minus the derivatives by the parameters `columns`, row-major, and where
    /// `values` is given the residuals themselves, which the first pass has along
    /// the way.
    template <class Walk>
    void sensitivities(Walk&& walk, const double* p, const std::vector<int>& columns, double* out,
                       double* values = nullptr) const {
        const std::size_t width = columns.size();
        for (std::size_t first = 0; first < width; first += Many) {
            if (width - first <= Few)
                pass<Few>(walk, p, columns, first, out, values);
            else
                pass<Many>(walk, p, columns, first, out, values);
        }
    }

    /// Half the sum of squares of `rows` residuals, with G^T e and G^T G
    /// (row-major) of the sensitivities G.
    template <class Walk>
    double normal_equations(Walk&& walk, const double* p, std::size_t rows,
                            const std::vector<int>& columns, double* gradient,
                            double* information) const {
        using Wholes = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
        const auto n = static_cast<Eigen::Index>(rows);
        const auto width = static_cast<Eigen::Index>(columns.size());
        Wholes G(n, width);
        Eigen::VectorXd e(n);
        if (columns.empty()) residuals_of(walk, p, e.data());
        sensitivities(walk, p, columns, G.data(), e.data());
        Eigen::Map<Eigen::VectorXd>(gradient, width).noalias() = G.transpose() * e;
        Eigen::Map<Wholes>(information, width, width).noalias() = G.transpose() * G;
        return 0.5 * e.squaredNorm();
    }

  private:
    template <int N, class Walk>
    void pass(Walk&& walk, const double* p, const std::vector<int>& columns, std::size_t first,
              double* out, double* values) const {
        const std::size_t width = columns.size();
        const std::size_t count = std::min<std::size_t>(N, width - first);
        std::vector<Dual<N>> wide(p, p + parameters);
        for (std::size_t j = 0; j < count; ++j)
            wide[static_cast<std::size_t>(columns[first + j])].d[j] = 1.0;
        double* row = out + first;
        walk(static_cast<const Dual<N>*>(wide.data()), [&](const auto& errors) {
            for (const auto& e : errors) {
                for (std::size_t j = 0; j < count; ++j) row[j] = -e.d[j];
                row += width;
                if (first == 0 && values != nullptr) *values++ = e.v;
            }
        });
    }
};

}  // namespace sysid
