#include "sysid/lab/tyre_fit.hpp"

#include <cmath>

namespace sysid::lab {

namespace {

constexpr std::size_t kTyres = 8;   // coefficients of both axles
constexpr std::size_t kLinear = 3;  // P_1, P_2, P_3

}  // namespace

void TyreLoss::add(const TyreSample& s) {
    const double speed = std::max(s.v_x, car_.slowest_mps);
    const double cosine = projects_steer_ ? std::cos(s.steer_rad) : 1.0;
    Row row;
    row.alpha_f = s.steer_rad - std::atan((s.v_y + car_.lf_m * s.r) / speed);
    row.alpha_r = -std::atan((s.v_y - car_.lr_m * s.r) / speed);
    row.lateral_f = s.a_y_weight * cosine * s.fz_front_n / car_.mass_kg;
    row.lateral_r = s.a_y_weight * s.fz_rear_n / car_.mass_kg;
    const double per_inertia = s.yaw_weight / car_.yaw_inertia_kgm2;
    row.yaw_f = per_inertia * car_.lf_m * cosine * s.fz_front_n;
    row.yaw_r = -per_inertia * car_.lr_m * s.fz_rear_n;
    row.rest = {s.a_y_weight * s.v_x * s.v_x, s.a_y_weight * s.v_y, s.a_y_weight * s.r};
    row.a_y = s.a_y_weight * s.a_y;
    row.yaw_acceleration = s.yaw_weight * s.yaw_acceleration;
    rows_.push_back(row);
}

void TyreLoss::residuals(const double* p, double* out) const {
    each(p, [&](const Errors& e) {
        *out++ = e.lateral;
        *out++ = e.yaw;
    });
}

void TyreLoss::sensitivities(const double* p, const std::vector<int>& columns, double* out) const {
    std::array<std::array<double, kTyreParameters>, 2> by{};
    for (const Row& row : rows_) {
        const TyreSlope f = magic_formula_slope(row.alpha_f, p + kFront);
        const TyreSlope r = magic_formula_slope(row.alpha_r, p + kRear);
        const std::array<double, 4> front{f.by_b, f.by_c, f.by_d, f.by_e};
        const std::array<double, 4> rear{r.by_b, r.by_c, r.by_d, r.by_e};
        for (std::size_t j = 0; j < 4; ++j) {
            by[0][kFront + j] = row.lateral_f * front[j];
            by[1][kFront + j] = row.yaw_f * front[j];
            by[0][kRear + j] = row.lateral_r * rear[j];
            by[1][kRear + j] = row.yaw_r * rear[j];
        }
        for (std::size_t j = 0; j < kLinear; ++j) by[0][kTyres + j] = row.rest[j];
        for (const auto& one : by)
            for (int c : columns) *out++ = one[static_cast<std::size_t>(c)];
    }
}

double TyreLoss::half_sum_of_squares(const double* p) const {
    double sum = 0.0;
    each(p, [&](const Errors& e) { sum += e.lateral * e.lateral + e.yaw * e.yaw; });
    return 0.5 * sum;
}

double TyreLoss::normal_equations(const double* p, const std::vector<int>& columns,
                                  double* gradient, double* information) const {
    // Both rows of a sample depend on the coefficients through the same two friction values: their
    // products are summed axle by axle.
    std::array<double, kTyreParameters> g{};
    std::array<std::array<double, kTyreParameters>, kTyreParameters> n{};
    double sum = 0.0;
    std::array<double, kTyres> slope;
    for (const Row& row : rows_) {
        const TyreSlope f = magic_formula_slope(row.alpha_f, p + kFront);
        const TyreSlope r = magic_formula_slope(row.alpha_r, p + kRear);
        slope = {f.by_b, f.by_c, f.by_d, f.by_e, r.by_b, r.by_c, r.by_d, r.by_e};
        const auto [lateral, yaw] = errors(row, f.value, r.value, p);
        sum += lateral * lateral + yaw * yaw;
        const double e_f = row.lateral_f * lateral + row.yaw_f * yaw;
        const double e_r = row.lateral_r * lateral + row.yaw_r * yaw;
        const double ff = row.lateral_f * row.lateral_f + row.yaw_f * row.yaw_f;
        const double rr = row.lateral_r * row.lateral_r + row.yaw_r * row.yaw_r;
        const double fr = row.lateral_f * row.lateral_r + row.yaw_f * row.yaw_r;
        for (std::size_t a = 0; a < 4; ++a) {
            g[a] += slope[a] * e_f;
            g[a + 4] += slope[a + 4] * e_r;
            for (std::size_t b = 0; b <= a; ++b) {
                n[a][b] += ff * slope[a] * slope[b];
                n[a + 4][b + 4] += rr * slope[a + 4] * slope[b + 4];
            }
            for (std::size_t b = 0; b < 4; ++b) n[a + 4][b] += fr * slope[a + 4] * slope[b];
        }
        for (std::size_t i = 0; i < kLinear; ++i) {
            g[kTyres + i] += row.rest[i] * lateral;
            for (std::size_t b = 0; b < 4; ++b) {
                n[kTyres + i][b] += row.rest[i] * row.lateral_f * slope[b];
                n[kTyres + i][b + 4] += row.rest[i] * row.lateral_r * slope[b + 4];
            }
            for (std::size_t j = 0; j <= i; ++j)
                n[kTyres + i][kTyres + j] += row.rest[i] * row.rest[j];
        }
    }
    const std::size_t width = columns.size();
    for (std::size_t i = 0; i < width; ++i) {
        const auto a = static_cast<std::size_t>(columns[i]);
        gradient[i] = g[a];
        for (std::size_t j = 0; j < width; ++j) {
            const auto b = static_cast<std::size_t>(columns[j]);
            information[i * width + j] = a >= b ? n[a][b] : n[b][a];
        }
    }
    return 0.5 * sum;
}

}  // namespace sysid::lab
