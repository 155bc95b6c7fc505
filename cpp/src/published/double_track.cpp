#include "sysid/published/double_track.hpp"

#include <algorithm>
#include <cmath>

#include "sysid/math/errors.hpp"
#include "sysid/math/interrupt.hpp"
#include "sysid/model/tyre.hpp"

namespace sysid {

namespace {

constexpr double kSlowestSlip = 2.0;  // [m/s] slip is referred to no lower speed

struct Forces {
    double x, y, moment;
};

/// Eqs. (28) to (30) at one instant.
Forces forces(const DoubleTrackData& c, const std::array<double, 4>& s, double steer,
              const double* wheel_speed, double ax, double ay) {
    const double wheelbase = c.lf_m + c.lr_m;
    const double mass = c.mass_kg + s[3];
    const double half = 0.5 * c.track_m;
    const Axles<double> rest = static_loads(mass * kGravity, c.lf_m, c.lr_m);
    const double pitch = mass * ax * c.height_m / (2.0 * wheelbase);
    const double roll = mass * ay * c.height_m / c.track_m;
    std::array<double, 4> fx, fy;
    for (std::size_t i = 0; i < 4; ++i) {
        const bool front = i < 2;
        const double side = i % 2 == 0 ? 1.0 : -1.0;
        const double share = front ? c.roll_share_front : 1.0 - c.roll_share_front;
        const double load = std::max(0.0, 0.5 * (front ? rest.front : rest.rear) +
                                              (front ? -pitch : pitch) - side * share * roll);
        const double along = s[0] - side * half * s[2];
        const double across = s[1] + (front ? c.lf_m : -c.lr_m) * s[2];
        const double angle = front ? steer : 0.0;
        const double v_l = std::cos(angle) * along + std::sin(angle) * across;
        const double rolling = c.radius_m * wheel_speed[i];
        const double slip = (rolling - v_l) / std::max({rolling, v_l, kSlowestSlip});
        const double alpha = slip_angle(std::max(along, kSlowestSlip), across, angle);
        const PacejkaPair& t = front ? c.front : c.rear;
        fx[i] = load * magic_formula(slip, TyreCoefficients<double>{t.bx, t.cx, t.dx, t.ex});
        fy[i] = load * magic_formula(alpha, TyreCoefficients<double>{t.by, t.cy, t.dy, t.ey});
    }
    const double cs = std::cos(steer), sn = std::sin(steer);
    const double drag = drag_force(c.air_density_kgpm3, c.drag_area_m2, s[0]);
    return {
        (fx[0] + fx[1]) * cs - (fy[0] + fy[1]) * sn + fx[2] + fx[3] - drag,
        (fx[0] + fx[1]) * sn + (fy[0] + fy[1]) * cs + fy[2] + fy[3],
        c.lf_m * ((fy[0] + fy[1]) * cs + (fx[0] + fx[1]) * sn) - c.lr_m * (fy[2] + fy[3]) +
            half * ((fy[0] - fy[1]) * sn - (fx[0] - fx[1]) * cs - (fx[2] - fx[3])),
    };
}

}  // namespace

std::vector<double> observe_double_track(const DoubleTrackData& car, const DoubleTrackGains& gains,
                                         const std::array<double, 4>& start, const Input14* inputs,
                                         const double* measured, std::size_t n, double dt) {
    std::vector<double> out;
    out.reserve(4 * n);
    std::array<double, 4> s = start;
    std::array<double, 10> held{};  // readings that are missing stay at their last value
    for (std::size_t k = 0; k < n; ++k) {
        poll_interrupt(k);
        const double* y = measured + k * kReadings;
        for (std::size_t i = 0; i < held.size(); ++i)
            if (!std::isnan(y[i])) held[i] = y[i];
        out.insert(out.end(), s.begin(), s.end());
        const double steer = 0.5 * (inputs[k].steer_rad[0] + inputs[k].steer_rad[1]);
        const double mx = held[output14::Ax], my = held[output14::Ay], mr = held[output14::R];
        const Forces f = forces(car, s, steer, held.data() + output14::kWheelSpeed, mx, my);
        const double mass = car.mass_kg + s[3];
        const double ax = f.x / mass, ay = f.y / mass;
        const double error_x = mx - ax;
        const std::array<double, 4> before = s;
        s[0] += dt * (ax + before[1] * before[2] + gains.ax_vx * error_x);
        s[1] += dt * (ay - before[0] * before[2] + gains.ay_vy * (my - ay));
        s[2] += dt * (f.moment / car.jzz_kgm2 + gains.yaw_yaw * (mr - before[2]));
        if (std::abs(mr) < gains.yaw_rate_below_radps) {
            const double direction = gains.published_sign ? 1.0 : -1.0;
            s[3] += dt * direction * gains.ax_mass * std::copysign(1.0, ax) * error_x;
            s[3] = std::clamp(s[3], gains.lowest_mass_kg, gains.highest_mass_kg);
        }
        if (!(std::abs(s[1]) < 1e3))
            throw NumericalFailure("the double track left the range of numbers", k);
    }
    return out;
}

}  // namespace sysid
