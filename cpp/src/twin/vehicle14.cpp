#include "sysid/twin/vehicle14.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace sysid {

namespace {

using namespace state14;

template <class T>
T beyond(T travel, T limit) {
    return larger(travel - limit, T(0.0)) - larger(-limit - travel, T(0.0));
}

/// Of the tensor with -J_xy and so on beside its diagonal: xx, yy, zz, xy, xz, yz.
std::array<double, 6> inverse_inertia(const Load& l) {
    const double xx = l.jyy_kgm2 * l.jzz_kgm2 - l.jyz_kgm2 * l.jyz_kgm2;
    const double xy = l.jxy_kgm2 * l.jzz_kgm2 + l.jxz_kgm2 * l.jyz_kgm2;
    const double xz = l.jxy_kgm2 * l.jyz_kgm2 + l.jxz_kgm2 * l.jyy_kgm2;
    const double yy = l.jxx_kgm2 * l.jzz_kgm2 - l.jxz_kgm2 * l.jxz_kgm2;
    const double yz = l.jxx_kgm2 * l.jyz_kgm2 + l.jxy_kgm2 * l.jxz_kgm2;
    const double zz = l.jxx_kgm2 * l.jyy_kgm2 - l.jxy_kgm2 * l.jxy_kgm2;
    const double all = l.jxx_kgm2 * xx - l.jxy_kgm2 * xy - l.jxz_kgm2 * xz;
    const bool positive = l.jxx_kgm2 > 0.0 && zz > 0.0 && all > 0.0;
    if (!positive)
        throw std::invalid_argument(
            "the moments of inertia must be positive and the products small beside them");
    const double per = 1.0 / all;
    return {per * xx, per * yy, per * zz, per * xy, per * xz, per * yz};
}

}  // namespace

Steered::Steered(const Input14& u) {
    const auto& [left, right] = u.steer_rad;
    cosine = {Pair{std::cos(left), std::cos(right)}, Pair{1.0, 1.0}};
    sine = {Pair{std::sin(left), std::sin(right)}, Pair{}};
}

Vehicle14::OfWheels::OfWheels(const CarData& car) : tyre(car.front.tyre, car.rear.tyre) {
    const auto take = [&](double AxleData::* of) { return Wheels(car.front.*of, car.rear.*of); };
    const double f = 0.5 * car.front.track_m, r = 0.5 * car.rear.track_m;
    half_track = {Pair{f, -f}, Pair{r, -r}};
    spring = take(&AxleData::spring_npm);
    bump = take(&AxleData::bump_damping_nspm);
    rebound = take(&AxleData::rebound_damping_nspm);
    anti_roll = take(&AxleData::anti_roll_npm);
    travel = take(&AxleData::travel_m);
    stop = take(&AxleData::stop_npm);
    roll_centre = take(&AxleData::roll_centre_m);
    link = roll_centre / half_track;
    lean = Wheels(car.front.radius_m, car.rear.radius_m) / half_track;
    anti_slope = take(&AxleData::anti_slope);
    unsprung = take(&AxleData::unsprung_kg);
    per_unsprung = Wheels(1.0) / unsprung;
    weight = unsprung * kGravity;
    unsprung_all = sum(unsprung);
    tyre_spring = take(&AxleData::tyre_npm);
    tyre_damping = take(&AxleData::tyre_damping_nspm);
    radius = take(&AxleData::radius_m);
    unsprung_moment = sum(unsprung * radius);
    inertia = take(&AxleData::wheel_inertia_kgm2);
    per_inertia = Wheels(1.0) / inertia;
    rolling = take(&AxleData::rolling_resistance) * radius;
    relaxation = {car.front.tyre.relaxation_m, car.rear.tyre.relaxation_m};
}

Vehicle14::Vehicle14(const CarData& car, const Load& load) : car_(car), w_(car), load_(load) {
    const bool lagging = car.front.tyre.relaxation_m > 0.0 || car.rear.tyre.relaxation_m > 0.0;
    states_ = lagging ? kTwinStatesWithTyres : kTwinStates;
    // The body rests on its corners by where its mass is; each wheel adds its own weight.
    const Load& design = car.design;
    const double to_front = -design.cg_x_m;
    const double to_rear = car.wheelbase_m + design.cg_x_m;
    const double body = design.mass_kg - sum(w_.unsprung);
    const Wheels share = Wheels(to_rear, to_front) / car.wheelbase_m *
                         (Wheels(0.5) + Wheels(0.5 * design.cg_y_m) / w_.half_track);
    design_load_ = Wheels(kGravity * body) * share + w_.weight;
    for (std::size_t i = 0; i < 2; ++i) {
        const AxleData& a = i == 0 ? car.front : car.rear;
        const double mean = 0.5 * (design_load_[2 * i] + design_load_[2 * i + 1]);
        slip_pace_[i] =
            a.tyre.slip_stiffness * 1.5 * mean * a.radius_m * a.radius_m / a.wheel_inertia_kgm2;
        if (a.tyre.relaxation_m > 0.0)
            fastest_relaxation_ = std::max(fastest_relaxation_, 1.0 / a.tyre.relaxation_m);
    }
    set_load(load);
}

void Vehicle14::set_load(const Load& load) {
    const double unsprung = w_.unsprung_all;
    if (!(load.mass_kg > unsprung))
        throw std::invalid_argument("a mass of " + std::to_string(load.mass_kg) +
                                    " kg is not more than its unsprung part of " +
                                    std::to_string(unsprung) + " kg");
    inverse_ = inverse_inertia(load);
    load_ = load;
    sprung_ = load.mass_kg - unsprung;
    sprung_height_ = (load.mass_kg * load.cg_z_m - w_.unsprung_moment) / sprung_;
    x_ = {-load.cg_x_m, -car_.wheelbase_m - load.cg_x_m};
    y_ = w_.half_track - load.cg_y_m;
    tilt_ = Wheels(sprung_height_) - w_.roll_centre;
}

void Vehicle14::rates(const State14& x, const Input14& u, const Steered& steered, State14& rate,
                      Output14* out) const {
    const double vx = x[Vx], vy = x[Vy], vz = x[Vz], p = x[P], q = x[Q], r = x[R];
    const double h = load_.cg_z_m, h_s = sprung_height_;
    const double pressure = 0.5 * car_.air_density_kgpm3 * vx * std::abs(vx);
    const double tilted = 0.5 * (x[Roll] * x[Roll] + x[Pitch] * x[Pitch]);
    const Wheels height = Wheels::at(&x[kWheelHeight]);
    const Wheels wheel_rate = Wheels::at(&x[kWheelHeightRate]);
    const Wheels spin = Wheels::at(&x[kWheelSpeed]);
    const Wheels arm_x = x_ - tilt_ * x[Pitch];
    const Wheels arm_y = y_ + tilt_ * x[Roll];
    const Wheels travel = y_ * x[Roll] - x_ * x[Pitch] + tilt_ * tilted + x[Z] - height;
    const Wheels opening = arm_y * p - arm_x * q + vz - wheel_rate;  // of the suspension
    const Wheels pressed = w_.tyre_spring * (Wheels::at(u.road_m.data()) - height) +
                           w_.tyre_damping * (Wheels::at(u.road_rate_mps.data()) - wheel_rate);
    const Wheels load = larger(design_load_ + pressed, 0.0);

    // Slip, in the axes of the wheel.
    const Wheels along = Wheels(vx - h * q) - y_ * r - w_.anti_slope * opening;
    const Wheels sideways = Wheels(h_s * p) - w_.link * opening;
    const double shift =
        sum(w_.unsprung * (sideways - w_.lean * wheel_rate)) * (1.0 / load_.mass_kg);
    const Wheels across = x_ * r + (vy - shift) + sideways;
    const Wheels c = steered.cosine, s = steered.sine;
    const Wheels v_l = c * along + s * across;
    const Wheels v_t = c * across - s * along;
    const Wheels speed = larger(magnitude(v_l), kSlowest);
    Wheels kappa = (w_.radius * spin - v_l) / speed;
    Wheels tan_alpha = -v_t / speed;
    if (states_ > kTwinStates) {
        const WheelMask lags = w_.relaxation > 0.0;
        const Wheels pace = choose(lags, speed / w_.relaxation, 0.0);
        const Wheels held_kappa = Wheels::at(&x[kSlip]), held_alpha = Wheels::at(&x[kSlipAngle]);
        (pace * (kappa - held_kappa)).put(&rate[kSlip]);
        (pace * (tan_alpha - held_alpha)).put(&rate[kSlipAngle]);
        kappa = choose(lags, held_kappa, kappa);
        tan_alpha = choose(lags, held_alpha, tan_alpha);
    }
    const TyreForce<Wheels> tyre = tyre_force(w_.tyre, load, kappa, tan_alpha);
    const Wheels fx = c * tyre.fx - s * tyre.fy;
    const Wheels fy = s * tyre.fx + c * tyre.fy;

    const double ground_x = sum(fx), ground_y = sum(fy);
    const double force_x = u.force_n[0] - car_.drag_area_m2 * pressure + ground_x;
    const double plane_ax = force_x / load_.mass_kg;
    const double plane_ay = (u.force_n[1] + ground_y) / load_.mass_kg;

    // Suspension and links, eq. (3): what an unsprung mass needs to turn with the car stays there.
    const Wheels own = w_.unsprung * plane_ay;
    const Wheels carried = fy - own;
    const Wheels damping = choose(opening < 0.0, w_.bump, w_.rebound);
    const Wheels on_body = design_load_ - w_.weight - w_.spring * travel -
                           w_.stop * beyond(travel, w_.travel) - damping * opening -
                           w_.anti_roll * (travel - across_axle(travel)) - w_.link * carried -
                           w_.anti_slope * fx;
    const Wheels against = Wheels::at(u.brake_nm.data()) + w_.rolling * load;
    const Wheels turning = spin / root(spin * spin + kStandingWheel * kStandingWheel);
    wheel_rate.put(&rate[kWheelHeight]);
    ((load - on_body + w_.lean * own) * w_.per_unsprung - kGravity).put(&rate[kWheelHeightRate]);
    spin.put(&rate[kWheelAngle]);
    ((Wheels::at(u.drive_nm.data()) - turning * against - w_.radius * tyre.fx) * w_.per_inertia)
        .put(&rate[kWheelSpeed]);

    const double lift_front = car_.front.lift_area_m2 * pressure;
    const double lift_rear = car_.rear.lift_area_m2 * pressure;
    const double force_z =
        u.force_n[2] - sprung_ * kGravity + sum(on_body) + lift_front + lift_rear;
    const double moment_x =
        u.moment_nm[0] + sum(arm_y * on_body) + h_s * sum(carried) + (h_s - h) * u.force_n[1];
    const double moment_y = u.moment_nm[1] - sum(arm_x * on_body) - h * ground_x -
                            x_[0] * lift_front - x_[2] * lift_rear;
    const double moment_z = u.moment_nm[2] + sum(x_ * fy - y_ * fx);

    const double az = force_z / sprung_;
    rate[Vx] = plane_ax + r * vy;
    rate[Vy] = plane_ay - r * vx;
    rate[Vz] = az;
    const double spin_x = load_.jxx_kgm2 * p - load_.jxy_kgm2 * q - load_.jxz_kgm2 * r;
    const double spin_y = load_.jyy_kgm2 * q - load_.jxy_kgm2 * p - load_.jyz_kgm2 * r;
    const double spin_z = load_.jzz_kgm2 * r - load_.jxz_kgm2 * p - load_.jyz_kgm2 * q;
    const double left_x = moment_x + r * spin_y - q * spin_z;
    const double left_y = moment_y + p * spin_z - r * spin_x;
    const double left_z = moment_z + q * spin_x - p * spin_y;
    const auto& [ixx, iyy, izz, ixy, ixz, iyz] = inverse_;
    rate[P] = ixx * left_x + ixy * left_y + ixz * left_z;
    rate[Q] = ixy * left_x + iyy * left_y + iyz * left_z;
    rate[R] = ixz * left_x + iyz * left_y + izz * left_z;
    rate[Z] = vz;
    rate[Roll] = p;
    rate[Pitch] = q;
    rate[Yaw] = r;
    if (out == nullptr) return;
    Output14& o = *out;
    // An accelerometer feels all but gravity, in the axes of the tilted body.
    const double felt_z = az + kGravity;
    o[output14::Ax] = plane_ax - felt_z * x[Pitch];
    o[output14::Ay] = plane_ay + felt_z * x[Roll];
    o[output14::Az] = felt_z;
    for (std::size_t i = 0; i < 3; ++i) {
        o[output14::P + i] = x[P + i];
        o[output14::kAngularAcceleration + i] = rate[P + i];
    }
    spin.put(&o[output14::kWheelSpeed]);
    tyre.fx.put(&o[output14::kFx]);
    tyre.fy.put(&o[output14::kFy]);
    load.put(&o[output14::kFz]);
    travel.put(&o[output14::kTravel]);
    o[output14::kVx] = vx;
    o[output14::kVy] = vy;
    o[output14::kSideslip] = std::atan2(vy, vx);
    o[output14::kRoll] = x[Roll];
    o[output14::kPitch] = x[Pitch];
    o[output14::kPlaneAx] = plane_ax;
    o[output14::kPlaneAy] = plane_ay;
    o[output14::kRoadSteer] = 0.5 * (u.steer_rad[0] + u.steer_rad[1]);
    o[output14::kWheelForce] = sum(tyre.fx);
}

void Vehicle14::evaluate(const State14& x, const Input14& u, State14& rate, Output14* out) const {
    rate.fill(0.0);
    rates(x, u, Steered(u), rate, out);
    const double c = std::cos(x[Yaw]), s = std::sin(x[Yaw]);
    rate[X] = c * x[Vx] - s * x[Vy];
    rate[Y] = s * x[Vx] + c * x[Vy];
}

Output14 Vehicle14::output(const State14& x, const Input14& u) const {
    return output(x, u, Steered(u));
}

Output14 Vehicle14::output(const State14& x, const Input14& u, const Steered& steered) const {
    State14 rate;
    Output14 out;
    rates(x, u, steered, rate, &out);
    return out;
}

double Vehicle14::energy(const State14& x, const Input14& u) const {
    double e = load_.mass_kg * (x[Vx] * x[Vx] + x[Vy] * x[Vy]) + sprung_ * x[Vz] * x[Vz] +
               load_.jxx_kgm2 * x[P] * x[P] + load_.jyy_kgm2 * x[Q] * x[Q] +
               load_.jzz_kgm2 * x[R] * x[R] -
               2.0 * (load_.jxy_kgm2 * x[P] * x[Q] + load_.jxz_kgm2 * x[P] * x[R] +
                      load_.jyz_kgm2 * x[Q] * x[R]);
    e = 0.5 * e + sprung_ * kGravity * x[Z];
    const double tilted = 0.5 * (x[Roll] * x[Roll] + x[Pitch] * x[Pitch]);
    const Wheels height = Wheels::at(&x[kWheelHeight]), spin = Wheels::at(&x[kWheelSpeed]);
    const Wheels rate = Wheels::at(&x[kWheelHeightRate]);
    const Wheels travel = y_ * x[Roll] - x_ * x[Pitch] + tilt_ * tilted + x[Z] - height;
    const Wheels stopped = beyond(travel, w_.travel);
    const Wheels across = travel - across_axle(travel);
    const Wheels deflection = Wheels::at(u.road_m.data()) - height;
    const Wheels stored = w_.unsprung * rate * rate + w_.inertia * spin * spin +
                          w_.spring * travel * travel + w_.stop * stopped * stopped +
                          Wheels(0.5) * w_.anti_roll * across * across +
                          w_.tyre_spring * deflection * deflection;
    return e + 0.5 * sum(stored) +
           sum((w_.weight - design_load_) * height - (design_load_ - w_.weight) * travel);
}

}  // namespace sysid
