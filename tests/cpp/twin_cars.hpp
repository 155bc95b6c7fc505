// What tests of the fourteen-degree-of-freedom car share.
#pragma once

#include <cmath>

#include "sysid/twin/vehicle14.hpp"

namespace sysid {

/// The same axle in front and rear, the centre of mass in the middle.
inline CarData symmetric_car() {
    CarData car;
    car.design =
        Load{2000.0, 800.0, 3500.0, 3800.0, -0.5 * car.wheelbase_m, 0.0, 0.6, 0.0, 0.0, 0.0};
    return car;
}

inline CarData without_losses(CarData car) {
    car.drag_area_m2 = 0.0;
    for (AxleData* a : {&car.front, &car.rear}) {
        a->bump_damping_nspm = a->rebound_damping_nspm = a->tyre_damping_nspm = 0.0;
        a->rolling_resistance = 0.0;
        a->tyre.slip_stiffness = a->tyre.cornering_stiffness = 0.0;
    }
    return car;
}

inline State14 run(const Vehicle14& car, State14 x, const Input14& u, double duration, double dt) {
    const int n = static_cast<int>(std::lround(duration / dt));
    for (int k = 0; k < n; ++k) car.step(x, u, dt);
    return x;
}

}  // namespace sysid
