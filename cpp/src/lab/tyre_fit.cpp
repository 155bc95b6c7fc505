#include "sysid/lab/tyre_fit.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "sysid/identify/least_squares.hpp"

namespace sysid::lab {

namespace {

constexpr Passes<8, kP3 + 1> kPasses{kTyreParameters};  // both tyres; P_1, P_2, P_3 as well

auto walk_of(const TyreLoss& loss) {
    return [&loss](const auto* p, auto&& keep) { loss.walk(p, keep); };
}

}  // namespace

void TyreLoss::add(const TyreSample& s) {
    const double speed = std::max(s.v_x, car_.slowest_mps);
    const double cosine = projects_steer_ ? std::cos(s.steer_rad) : 1.0;
    const double per_mass = s.a_y_weight / car_.mass_kg;
    const double per_inertia = s.yaw_weight / car_.yaw_inertia_kgm2;
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
    residuals_of(walk_of(loss), p, out);
}

double half_sum_of_squares(const TyreLoss& loss, const double* p, std::nullptr_t /*filter*/) {
    return loss.squares(p, 0, nullptr, nullptr);
}

void sensitivities(const TyreLoss& loss, const double* p, std::nullptr_t /*filter*/,
                   const std::vector<int>& columns, double* out) {
    kPasses.sensitivities(walk_of(loss), p, columns, out);
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
