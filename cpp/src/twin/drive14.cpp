#include "sysid/twin/drive14.hpp"

#include <algorithm>
#include <cmath>

#include "sysid/math/interrupt.hpp"

namespace sysid {

namespace {

constexpr double kLost = 0.7;  // [rad] of sideslip, from there on nobody catches the car
constexpr double kSlowestDrive = 0.5;

}  // namespace

Drive14 drive14(const Vehicle14& car, const Driver& driver, const Pedals& pedals,
                const std::vector<Reference>& references, const Input14* base, double dt) {
    const std::size_t n = references.size();
    const CarData& data = car.car();
    Drive14 out;
    out.lost_at = n;
    State14 x = car.rest(references.front().speed_mps);
    Output14 y;
    const double mass = data.design.mass_kg;
    const DrivenCar known{mass, data.wheelbase_m, data.air_density_kgpm3, data.drag_area_m2,
                          data.front.rolling_resistance * mass * kGravity};
    Hands hands(known, driver, dt);
    const std::size_t delay = hands.delay(), preview = hands.preview();
    Input acts{references.front().steer_rad,
               drag_force(data.air_density_kgpm3, data.drag_area_m2, x[state14::Vx])};
    std::vector<std::array<double, 2>> seen;  // speed and yaw rate
    for (std::size_t k = 0; k < n; ++k) {
        poll_interrupt(k);
        seen.push_back({x[state14::Vx], x[state14::R]});
        const std::size_t then = k > delay ? k - delay : 0;
        const std::size_t ahead = std::min(k + preview, n - 1);
        const auto [speed, yaw_rate] = seen[then];
        const std::size_t before = ahead > 0 ? ahead - 1 : 0;
        const double pace = (references[ahead].speed_mps - references[before].speed_mps) / dt;
        acts = hands.next(acts, references[ahead], pace, {speed, yaw_rate, references[then]});
        const double steer = acts.steer_rad, force = acts.longitudinal;

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
