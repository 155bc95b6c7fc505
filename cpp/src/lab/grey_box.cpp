#include "sysid/lab/grey_box.hpp"

namespace sysid::lab {

void grey_box_slope(const GreyBoxCar& car, const std::array<double, kGreyStates>& x,
                    const GreyBoxInput& u, const double* p, bool with_parameters, GreyBoxSlope& out,
                    const LoadsSince<double>& since) {
    const bool rolling = x[0] > car.slowest_mps;
    const double per_speed = 1.0 / (rolling ? x[0] : car.slowest_mps);
    const double tan_f = (x[1] + car.lf_m * x[2]) * per_speed;
    const double tan_r = (x[1] - car.lr_m * x[2]) * per_speed;
    const TyreSlope f = magic_formula_slope(u.steer_rad - std::atan(tan_f), p + kFront);
    const TyreSlope r = magic_formula_slope(-std::atan(tan_r), p + kRear);
    const double per_mass = 1.0 / (car.mass_kg * p[kMassFactor]);
    const double per_inertia = 1.0 / (car.yaw_inertia_kgm2 * p[kInertiaFactor]);
    const double pressure = 0.5 * car.air_density_kgpm3;
    const double squared = x[0] * x[0];
    const double lever = since.moves ? car.cg_height_m / (car.lf_m + car.lr_m) : 0.0;
    const double drag = pressure * p[kDragArea] * squared;
    // The front tyre's force moves load to its own axle, which answers itself.
    const double answer = 1.0 / (1.0 - lever * u.sin_steer * f.value);
    const double growth = air_growth(since, x[0]);
    const double shift = lever * (u.fx_n - since.drawn_n);
    const double weight = car.mass_kg * p[kMassFactor] * (kGravity / (car.lf_m + car.lr_m));
    const double air_f = u.fz_front_n - weight * car.lr_m + shift;
    const double air_r = u.fz_rear_n - weight * car.lf_m - shift;
    const double fz_f = u.fz_front_n + growth * air_f;
    const double load_f = (fz_f + lever * (drag - since.drawn_n)) * answer;
    const double force_f = load_f * f.value;
    const double fz_r = u.fz_rear_n + growth * air_r;
    const double load_r = fz_r - lever * (u.sin_steer * force_f + drag - since.drawn_n);
    const double force_r = load_r * r.value;
    const double along = u.fx_n - u.sin_steer * force_f - drag;
    const double across = (u.cos_steer * force_f + force_r) * per_mass;
    const double turning = (car.lf_m * u.cos_steer * force_f - car.lr_m * force_r) * per_inertia;
    const double a_y = across + p[kP1] * x[0] * x[0] + p[kP2] * x[1] + p[kP3] * x[2];
    out.value = {x[1] * x[2] + along * per_mass, a_y - x[0] * x[2], turning, a_y};

    // What one newton at an axle does to each row.
    const std::array<double, 4> lever_f{
        -u.sin_steer * per_mass,
        u.cos_steer * per_mass,
        car.lf_m * u.cos_steer * per_inertia,
        u.cos_steer * per_mass,
    };
    const std::array<double, 4> lever_r{0.0, per_mass, -car.lr_m * per_inertia, per_mass};
    // Forces by a newton of front load, and by one drawn from the road or the air, through the
    // loads.
    const double loaded_f = answer * f.value;
    const double drawn_f = loaded_f * lever;
    const auto shifted_r = [&](double by_front, double by_drawn) {
        return -r.value * lever * (u.sin_steer * by_front + by_drawn);
    };
    const double turn_f = -answer * load_f * f.by_alpha * per_speed / (1.0 + tan_f * tan_f);
    const double turn_r = -load_r * r.by_alpha * per_speed / (1.0 + tan_r * tan_r);
    const double drag_by = 2.0 * pressure * p[kDragArea] * x[0];
    // By what the air's part has grown, and that by the speeds.
    const double grown_f = loaded_f * air_f;
    const double grown_r = shifted_r(grown_f, 0.0) + r.value * air_r;
    const bool grows = since.speed_squared > 0.0;
    const double growth_by = grows ? 2.0 * x[0] / since.speed_squared : 0.0;
    const double growth_by_first = grows ? -(growth + 1.0) / since.speed_squared : 0.0;
    const std::array<double, 3> force_f_by{
        (rolling ? -turn_f * tan_f : 0.0) + drawn_f * drag_by + grown_f * growth_by,
        turn_f,
        turn_f * car.lf_m,
    };
    const std::array<double, 3> force_r_by{
        (rolling ? -turn_r * tan_r : 0.0) + shifted_r(force_f_by[0], drag_by) +
            r.value * air_r * growth_by,
        turn_r + shifted_r(force_f_by[1], 0.0),
        -turn_r * car.lr_m + shifted_r(force_f_by[2], 0.0),
    };
    // T(0) also tells the air's part from what the acceleration moves.
    const double back_f = -drawn_f * (1.0 + growth);
    const double back_r = shifted_r(back_f, -1.0 - growth);
    for (std::size_t i = 0; i < 4; ++i) {
        out.by_drawn[i] = lever_f[i] * back_f + lever_r[i] * back_r;
        out.by_first_squared[i] = growth_by_first * (lever_f[i] * grown_f + lever_r[i] * grown_r);
    }
    for (std::size_t i = 0; i < 4; ++i)
        for (std::size_t j = 0; j < 3; ++j)
            out.by_state[i][j] = lever_f[i] * force_f_by[j] + lever_r[i] * force_r_by[j];
    out.by_state[0][0] -= drag_by * per_mass;
    out.by_state[0][1] += x[2];
    out.by_state[0][2] += x[1];
    const std::array<double, 3> rest{2.0 * p[kP1] * x[0], p[kP2], p[kP3]};
    for (std::size_t j = 0; j < 3; ++j) {
        out.by_state[1][j] += rest[j];
        out.by_state[3][j] += rest[j];
    }
    out.by_state[1][0] -= x[2];
    out.by_state[1][2] -= x[0];
    if (!with_parameters) return;

    // A heavier car leaves less of the loads to the air.
    const double per_factor = -growth * weight / p[kMassFactor];
    const double heavier_f = per_factor * car.lr_m * loaded_f;
    const double heavier_r = shifted_r(heavier_f, 0.0) + per_factor * car.lf_m * r.value;
    const std::array<double, 4> tyre_f{f.by_b, f.by_c, f.by_d, f.by_e};
    const std::array<double, 4> tyre_r{r.by_b, r.by_c, r.by_d, r.by_e};
    for (std::size_t i = 0; i < 4; ++i) {
        auto& row = out.by_parameter[i];
        for (std::size_t j = 0; j < 4; ++j) {
            const double by_front = answer * load_f * tyre_f[j];
            row[kFront + j] = lever_f[i] * by_front + lever_r[i] * shifted_r(by_front, 0.0);
            row[kRear + j] = lever_r[i] * load_r * tyre_r[j];
        }
        const bool lateral = i == 1 || i == 3;
        row[kP1] = lateral ? x[0] * x[0] : 0.0;
        row[kP2] = lateral ? x[1] : 0.0;
        row[kP3] = lateral ? x[2] : 0.0;
        row[kMassFactor] = (lateral ? -across / p[kMassFactor] : 0.0) + lever_f[i] * heavier_f +
                           lever_r[i] * heavier_r;
        row[kInertiaFactor] = 0.0;
        const double by_drag = drawn_f * pressure * squared;
        row[kDragArea] = lever_f[i] * by_drag + lever_r[i] * shifted_r(by_drag, pressure * squared);
    }
    out.by_parameter[0][kMassFactor] -= along * per_mass / p[kMassFactor];
    out.by_parameter[0][kDragArea] -= pressure * squared * per_mass;
    out.by_parameter[2][kInertiaFactor] = -turning / p[kInertiaFactor];
}

}  // namespace sysid::lab
