#include "sysid/lab/tyre_fit.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "sysid/math/dual.hpp"
#include "sysid/model/kinematics.hpp"

namespace sysid::lab {

namespace {

constexpr double kSlowestSlip = 1.0;  // slip angles are those at this speed below it [m/s]
}  // namespace

void TyreLoss::add(const TyreSample& s) {
    const double speed = std::max(s.v_x, kSlowestSlip);
    const double cosine = projects_steer_ ? std::cos(s.steer_rad) : 1.0;
    const double per_mass = s.a_y_weight / car_.mass_kg;
    const double per_inertia = s.yaw_weight / yaw_inertia_kgm2_;
    const double front = cosine * s.fz_front_n;
    const Axles<double> alpha = slip_angles(speed, s.v_y, s.r, car_.lf_m, car_.lr_m, s.steer_rad);
    const std::size_t i = samples_++ % kLanes;
    if (i == 0) blocks_.push_back({});
    CurveSamples& to = blocks_.back();
    to.alpha[0].at[i] = alpha.front;
    to.alpha[1].at[i] = alpha.rear;
    to.first[0].at[i] = per_mass * front;
    to.first[1].at[i] = per_mass * s.fz_rear_n;
    to.second[0].at[i] = per_inertia * car_.lf_m * front;
    to.second[1].at[i] = -per_inertia * car_.lr_m * s.fz_rear_n;
    to.rest[0].at[i] = s.a_y_weight * s.v_x * s.v_x;
    to.rest[1].at[i] = s.a_y_weight * s.v_y;
    to.rest[2].at[i] = s.a_y_weight * s.r;
    to.reading[0].at[i] = s.a_y_weight * s.a_y;
    to.reading[1].at[i] = s.yaw_weight * s.yaw_acceleration;
}

void residuals(const TyreLoss& loss, const double* p, std::nullptr_t /*filter*/, double* out) {
    loss.walk(p, [&](const auto& errors) { out = std::copy(errors.begin(), errors.end(), out); });
}

double half_sum_of_squares(const TyreLoss& loss, const double* p, std::nullptr_t /*filter*/) {
    return loss.squares(p, 0, nullptr, nullptr);
}

void sensitivities(const TyreLoss& loss, const double* p, std::nullptr_t /*filter*/,
                   const std::vector<int>& columns, double* out) {
    using D = Dual<kCurveParameters>;
    std::array<D, kCurveParameters> wide;
    for (int i = 0; i < kCurveParameters; ++i)
        wide[static_cast<std::size_t>(i)] = D::seeded(p[i], i);
    loss.walk(wide.data(), [&](const std::array<D, 2>& errors) {
        for (const D& e : errors)
            for (const int c : columns)
                *out++ = c < kCurveParameters ? -e.d[static_cast<std::size_t>(c)] : 0.0;
    });
}

double normal_equations(const TyreLoss& loss, const double* p, std::nullptr_t /*filter*/,
                        const std::vector<int>& columns, double* gradient, double* information) {
    // Nothing else has a part in it.
    const auto sought = [](int c) { return c < kCurveParameters; };
    const bool rest =
        std::any_of(columns.begin(), columns.end(), [&](int c) { return c >= kP1 && sought(c); });
    std::array<double, kCurveParameters> slope{};
    constexpr auto kAll = static_cast<std::size_t>(kCurveParameters);
    std::array<double, kAll * kAll> squares{};
    const double half =
        loss.squares(p, rest ? kCurveParameters : kP1, slope.data(), squares.data());
    const std::size_t n = columns.size();
    for (std::size_t i = 0; i < n; ++i) {
        gradient[i] = sought(columns[i]) ? slope[static_cast<std::size_t>(columns[i])] : 0.0;
        for (std::size_t j = 0; j < n; ++j) {
            const auto a = static_cast<std::size_t>(std::max(columns[i], columns[j]));
            const auto b = static_cast<std::size_t>(std::min(columns[i], columns[j]));
            information[i * n + j] = a < kAll ? squares[a * kAll + b] : 0.0;
        }
    }
    return half;
}

}  // namespace sysid::lab
