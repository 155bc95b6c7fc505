#include "sysid/twin/drive14.hpp"

#include <algorithm>
#include <cmath>

#include "sysid/math/interrupt.hpp"

namespace sysid {

namespace {

constexpr double kLost = 0.7;  // [rad] of sideslip, from there on nobody catches the car
constexpr double kSlowestDrive = 0.5;

double towards(double from, double to, double step) {
    return from + std::clamp(to - from, -step, step);
}

}  // namespace

Drive14 drive14(const Vehicle14& car, const Driver& driver, const Pedals& pedals,
                const std::vector<Reference>& references, const Input14* base, double dt) {
    const std::size_t n = references.size();
    const CarData& data = car.car();
    Drive14 out;
    out.lost_at = n;
    State14 x = car.rest(references.front().speed_mps);
    Output14 y;
    const double drag = 0.5 * data.air_density_kgpm3 * data.drag_area_m2;
    const double weight = data.design.mass_kg * kTwinGravity;
    double steer = references.front().steer_rad;
    double force = drag * x[state14::Vx] * x[state14::Vx];
    double integral = 0.0;
    const auto delay = static_cast<std::size_t>(std::lround(driver.reaction_s / dt));
    const std::size_t preview = driver.tracks_path ? delay / 2 + 1 : 1;
    std::vector<std::array<double, 2>> seen;  // speed and yaw rate
    for (std::size_t k = 0; k < n; ++k) {
        poll_interrupt(k);
        seen.push_back({x[state14::Vx], x[state14::R]});
        const std::size_t then = k > delay ? k - delay : 0;
        const std::size_t ahead = std::min(k + preview, n - 1);
        const auto [speed, yaw_rate] = seen[then];
        const double v = std::max(speed, 1.0);

        double wanted = references[ahead].steer_rad;
        if (driver.tracks_path) {
            const double error = references[then].curvature_radpm * v - yaw_rate;
            if (std::abs(steer) < driver.steer_limit_rad) integral += error * dt;
            const double mending =
                driver.yaw_rate_gain * error + driver.yaw_rate_integral_ps * integral;
            wanted += (data.wheelbase_m + driver.understeer_radps2pm * v * v) *
                      (references[ahead].curvature_radpm + mending / v);
        }
        wanted = std::clamp(wanted, -driver.steer_limit_rad, driver.steer_limit_rad);
        steer = towards(steer, wanted, driver.steer_rate_limit_radps * dt);

        const std::size_t before = ahead > 0 ? ahead - 1 : 0;
        const double pace = (references[ahead].speed_mps - references[before].speed_mps) / dt;
        const double lacking = references[then].speed_mps - speed;
        const double pull = data.design.mass_kg * (pace + driver.speed_gain_ps * lacking) +
                            drag * v * v + data.front.rolling_resistance * weight;
        const double most = std::min(driver.drive_limit_n, driver.power_limit_w / v);
        force = towards(force, std::clamp(pull, -driver.brake_limit_n, most),
                        driver.force_rate_limit_nps * dt);

        Input14 u = base[k];
        u.steer_rad = {steer, steer};
        const double front = force < 0.0 ? pedals.brake_front_share : pedals.drive_front_share;
        for (std::size_t i = 0; i < kWheels; ++i) {
            const double radius = (i < 2 ? data.front : data.rear).radius_m;
            const double torque = 0.5 * (i < 2 ? front : 1.0 - front) * force * radius;
            u.drive_nm[i] = std::max(torque, 0.0);
            u.brake_nm[i] = std::max(-torque, 0.0);
        }
        const auto* row = reinterpret_cast<const double*>(&u);
        out.inputs.insert(out.inputs.end(), row, row + kTwinInputs);
        out.states.insert(out.states.end(), x.begin(), x.begin() + kTwinStates);
        car.read_and_step(x, u, dt, y);
        out.outputs.insert(out.outputs.end(), y.begin(), y.end());
        // Asked so that a state that is not a number counts as lost.
        const bool held =
            y[output14::kVx] >= kSlowestDrive && std::abs(y[output14::kSideslip]) <= kLost;
        if (!held) {
            out.lost_at = k;
            break;
        }
    }
    return out;
}

}  // namespace sysid
