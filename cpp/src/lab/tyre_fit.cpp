#include "sysid/lab/tyre_fit.hpp"

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
    rows_.push_back({
        slip_angles(speed, s.v_y, s.r, car_.lf_m, car_.lr_m, s.steer_rad),
        {per_mass * front, per_mass * s.fz_rear_n},
        {per_inertia * car_.lf_m * front, -per_inertia * car_.lr_m * s.fz_rear_n},
        {s.a_y_weight * s.v_x * s.v_x, s.a_y_weight * s.v_y, s.a_y_weight * s.r},
        s.a_y_weight * s.a_y,
        s.yaw_weight * s.yaw_acceleration,
    });
}

void residuals(const TyreLoss& loss, const double* p, std::nullptr_t /*filter*/, double* out) {
    residuals_of(walk_of(loss), p, out);
}

double half_sum_of_squares(const TyreLoss& loss, const double* p, std::nullptr_t /*filter*/) {
    return half_sum_of(walk_of(loss), p);
}

void sensitivities(const TyreLoss& loss, const double* p, std::nullptr_t /*filter*/,
                   const std::vector<int>& columns, double* out) {
    kPasses.sensitivities(walk_of(loss), p, columns, out);
}

double normal_equations(const TyreLoss& loss, const double* p, std::nullptr_t /*filter*/,
                        const std::vector<int>& columns, double* gradient, double* information) {
    return kPasses.normal_equations(walk_of(loss), p, 2 * loss.samples(), columns, gradient,
                                    information);
}

}  // namespace sysid::lab
