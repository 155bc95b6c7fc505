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
    const double squared = x[0] * x[0] + x[1] * x[1];
    const double lever = since.moves ? car.cg_height_m / (car.lf_m + car.lr_m) : 0.0;
    const double drag = pressure * p[kDragArea] * squared;
    // The front tyre's force moves load to its own axle, which answers itself.
    const double answer = 1.0 / (1.0 - lever * u.sin_steer * f.value);
    const double load_f = (u.fz_front_n + lever * (drag - since.drawn_n)) * answer;
    const double force_f = load_f * f.value;
    const double load_r = u.fz_rear_n - lever * (u.sin_steer * force_f + drag - since.drawn_n);
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
    // Forces by a newton drawn from the road or the air, through the loads.
    const double drawn_f = answer * f.value * lever;
    const auto shifted_r = [&](double by_front, double by_drawn) {
        return -r.value * lever * (u.sin_steer * by_front + by_drawn);
    };
    const double turn_f = -answer * load_f * f.by_alpha * per_speed / (1.0 + tan_f * tan_f);
    const double turn_r = -load_r * r.by_alpha * per_speed / (1.0 + tan_r * tan_r);
    const double drag_by = 2.0 * pressure * p[kDragArea];
    const std::array<double, 3> force_f_by{
        (rolling ? -turn_f * tan_f : 0.0) + drawn_f * drag_by * x[0],
        turn_f + drawn_f * drag_by * x[1],
        turn_f * car.lf_m,
    };
    const std::array<double, 3> force_r_by{
        (rolling ? -turn_r * tan_r : 0.0) + shifted_r(force_f_by[0], drag_by * x[0]),
        turn_r + shifted_r(force_f_by[1], drag_by * x[1]),
        -turn_r * car.lr_m + shifted_r(force_f_by[2], 0.0),
    };
    const double back_r = shifted_r(-drawn_f, -1.0);
    for (std::size_t i = 0; i < 4; ++i)
        out.by_drawn[i] = -lever_f[i] * drawn_f + lever_r[i] * back_r;
    for (std::size_t i = 0; i < 4; ++i)
        for (std::size_t j = 0; j < 3; ++j)
            out.by_state[i][j] = lever_f[i] * force_f_by[j] + lever_r[i] * force_r_by[j];
    out.by_state[0][0] -= drag_by * per_mass * x[0];
    out.by_state[0][1] += x[2] - drag_by * per_mass * x[1];
    out.by_state[0][2] += x[1];
    const std::array<double, 3> rest{2.0 * p[kP1] * x[0], p[kP2], p[kP3]};
    for (std::size_t j = 0; j < 3; ++j) {
        out.by_state[1][j] += rest[j];
        out.by_state[3][j] += rest[j];
    }
    out.by_state[1][0] -= x[2];
    out.by_state[1][2] -= x[0];
    if (!with_parameters) return;

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
        row[kMassFactor] = lateral ? -across / p[kMassFactor] : 0.0;
        row[kInertiaFactor] = 0.0;
        const double by_drag = drawn_f * pressure * squared;
        row[kDragArea] = lever_f[i] * by_drag + lever_r[i] * shifted_r(by_drag, pressure * squared);
    }
    out.by_parameter[0][kMassFactor] = -along * per_mass / p[kMassFactor];
    out.by_parameter[0][kDragArea] -= pressure * squared * per_mass;
    out.by_parameter[2][kInertiaFactor] = -turning / p[kInertiaFactor];
}

}  // namespace sysid::lab
