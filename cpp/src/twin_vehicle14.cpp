#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "sysid/math/linear.hpp"
#include "sysid/twin/vehicle14.hpp"

namespace sysid {

namespace {

using namespace state14;

constexpr double kSlowest = 1.0;        // [m/s] below it slip is referred to this speed
constexpr double kStandingWheel = 1.0;  // [rad/s] below it brakes and rolling resistance fade out
constexpr double kStable = 2.0;  // rate times step that the Runge-Kutta method takes with ease

double sign_of_rotation(double speed) {
    return speed / std::sqrt(speed * speed + kStandingWheel * kStandingWheel);
}

double beyond(double travel, double limit) { return travel - std::clamp(travel, -limit, limit); }

}  // namespace

Vehicle14::Steered::Steered(const Input14& u) {
    for (std::size_t i = 0; i < 2; ++i) {
        cosine[i] = std::cos(u.steer_rad[i]);
        sine[i] = std::sin(u.steer_rad[i]);
    }
}

Vehicle14::Vehicle14(const CarData& car, const Load& load) : car_(car), load_(load) {
    const bool lagging = car.front.tyre.relaxation_m > 0.0 || car.rear.tyre.relaxation_m > 0.0;
    states_ = lagging ? kTwinStatesWithTyres : kTwinStates;
    // The body rests on its corners by where its mass is; each wheel adds its own weight.
    const Load& design = car.design;
    const double to_front = -design.cg_x_m;
    const double to_rear = car.wheelbase_m + design.cg_x_m;
    const double unsprung = 2.0 * (car.front.unsprung_kg + car.rear.unsprung_kg);
    for (std::size_t i = 0; i < kWheels; ++i) {
        const double side = i % 2 == 0 ? 1.0 : -1.0;
        const double share = (i < 2 ? to_rear : to_front) / car.wheelbase_m *
                             (0.5 + side * design.cg_y_m / axle(i).track_m);
        wheel_load_[i] = kTwinGravity * ((design.mass_kg - unsprung) * share + axle(i).unsprung_kg);
    }
    set_load(load);
}

void Vehicle14::set_load(const Load& load) {
    load_ = load;
    sprung_ = load.mass_kg - 2.0 * (car_.front.unsprung_kg + car_.rear.unsprung_kg);
    for (std::size_t i = 0; i < kWheels; ++i) {
        const double half = (i % 2 == 0 ? 0.5 : -0.5) * axle(i).track_m;
        x_[i] = (i < 2 ? 0.0 : -car_.wheelbase_m) - load.cg_x_m;
        y_[i] = half - load.cg_y_m;
        link_[i] = axle(i).roll_centre_m / half;
        tilt_[i] = load.cg_z_m - axle(i).roll_centre_m;
    }
}

double Vehicle14::spring_force(const AxleData& a, double travel) {
    return -a.spring_npm * travel - a.stop_npm * beyond(travel, a.travel_m);
}

void Vehicle14::rates(const State14& x, const Input14& u, const Steered& steered, State14& rate,
                      Output14* out) const {
    const double vx = x[Vx], vy = x[Vy], vz = x[Vz], p = x[P], q = x[Q], r = x[R];
    const double h = load_.cg_z_m;
    const double pressure = 0.5 * car_.air_density_kgpm3 * vx * std::abs(vx);
    std::array<double, kWheels> travel, corner_rate, arm_x, arm_y;
    const double tilted = 0.5 * (x[Roll] * x[Roll] + x[Pitch] * x[Pitch]);
    for (std::size_t i = 0; i < kWheels; ++i) {
        arm_x[i] = x_[i] - tilt_[i] * x[Pitch];
        arm_y[i] = y_[i] + tilt_[i] * x[Roll];
        const double corner = x[Z] + y_[i] * x[Roll] - x_[i] * x[Pitch] + tilt_[i] * tilted;
        travel[i] = corner - x[kWheelHeight + i];
        corner_rate[i] = vz + arm_y[i] * p - arm_x[i] * q;
    }

    double force_x = u.force_n[0] - car_.drag_area_m2 * pressure;
    double force_y = u.force_n[1];
    double force_z = u.force_n[2] - sprung_ * kTwinGravity;
    double moment_x = u.moment_nm[0], moment_y = u.moment_nm[1], moment_z = u.moment_nm[2];
    double ground_x = 0.0, ground_y = 0.0;
    for (std::size_t i = 0; i < kWheels; ++i) {
        const AxleData& a = axle(i);
        const double wheel_rate = x[kWheelHeightRate + i];
        const double opening = corner_rate[i] - wheel_rate;  // of the suspension
        const double deflection = u.road_m[i] - x[kWheelHeight + i];
        const double load =
            std::max(0.0, wheel_load_[i] + a.tyre_npm * deflection +
                              a.tyre_damping_nspm * (u.road_rate_mps[i] - wheel_rate));

        // Slip, in the axes of the wheel.
        const double along = vx - y_[i] * r - h * q - a.anti_slope * opening;
        const double across = vy + x_[i] * r + h * p - link_[i] * opening;
        const double c = i < 2 ? steered.cosine[i] : 1.0;
        const double s = i < 2 ? steered.sine[i] : 0.0;
        const double v_l = c * along + s * across;
        const double v_t = c * across - s * along;
        const double speed = std::max(std::abs(v_l), kSlowest);
        const double spin = x[kWheelSpeed + i];
        double kappa = (a.radius_m * spin - v_l) / speed;
        double tan_alpha = -v_t / speed;
        if (a.tyre.relaxation_m > 0.0) {
            const double pace = speed / a.tyre.relaxation_m;
            rate[kSlip + i] = pace * (kappa - x[kSlip + i]);
            rate[kSlipAngle + i] = pace * (tan_alpha - x[kSlipAngle + i]);
            kappa = x[kSlip + i];
            tan_alpha = x[kSlipAngle + i];
        } else {
            rate[kSlip + i] = rate[kSlipAngle + i] = 0.0;
        }
        const TyreForce tyre = tyre_force(a.tyre, load, kappa, tan_alpha);
        const double fx = c * tyre.fx - s * tyre.fy;
        const double fy = s * tyre.fx + c * tyre.fy;

        // Suspension and links, eq. (3).
        const std::size_t other = i ^ 1U;
        const double damping = opening < 0.0 ? a.bump_damping_nspm : a.rebound_damping_nspm;
        const double on_body = wheel_load_[i] - a.unsprung_kg * kTwinGravity +
                               spring_force(a, travel[i]) - damping * opening -
                               a.anti_roll_npm * (travel[i] - travel[other]) - link_[i] * fy -
                               a.anti_slope * fx;
        force_z += on_body + a.lift_area_m2 * 0.5 * pressure;
        moment_x += arm_y[i] * on_body;
        moment_y -= arm_x[i] * on_body + x_[i] * a.lift_area_m2 * 0.5 * pressure;
        moment_z += x_[i] * fy - y_[i] * fx;
        ground_x += fx;
        ground_y += fy;

        rate[kWheelHeight + i] = wheel_rate;
        rate[kWheelHeightRate + i] = (load - on_body) / a.unsprung_kg - kTwinGravity;
        rate[kWheelAngle + i] = spin;
        const double against = u.brake_nm[i] + a.rolling_resistance * load * a.radius_m;
        rate[kWheelSpeed + i] =
            (u.drive_nm[i] - sign_of_rotation(spin) * against - a.radius_m * tyre.fx) /
            a.wheel_inertia_kgm2;
        if (out != nullptr) {
            (*out)[output14::kFx + i] = tyre.fx;
            (*out)[output14::kFy + i] = tyre.fy;
            (*out)[output14::kFz + i] = load;
            (*out)[output14::kTravel + i] = travel[i];
            (*out)[output14::kWheelSpeed + i] = spin;
        }
    }
    force_x += ground_x;
    force_y += ground_y;
    moment_x += h * ground_y;
    moment_y -= h * ground_x;

    const double plane_ax = force_x / load_.mass_kg;
    const double plane_ay = force_y / load_.mass_kg;
    const double az = force_z / sprung_;
    rate[Vx] = plane_ax + r * vy;
    rate[Vy] = plane_ay - r * vx;
    rate[Vz] = az;
    rate[P] = (moment_x + (load_.jyy_kgm2 - load_.jzz_kgm2) * q * r) / load_.jxx_kgm2;
    rate[Q] = (moment_y + (load_.jzz_kgm2 - load_.jxx_kgm2) * p * r) / load_.jyy_kgm2;
    rate[R] = (moment_z + (load_.jxx_kgm2 - load_.jyy_kgm2) * p * q) / load_.jzz_kgm2;
    rate[Z] = vz;
    rate[Roll] = p;
    rate[Pitch] = q;
    rate[Yaw] = r;
    if (out == nullptr) return;
    Output14& o = *out;
    // An accelerometer feels all but gravity, in the axes of the tilted body.
    const double felt_z = az + kTwinGravity;
    o[output14::Ax] = plane_ax - felt_z * x[Pitch];
    o[output14::Ay] = plane_ay + felt_z * x[Roll];
    o[output14::Az] = felt_z;
    for (std::size_t i = 0; i < 3; ++i) {
        o[output14::P + i] = x[P + i];
        o[output14::kAngularAcceleration + i] = rate[P + i];
    }
    o[output14::kVx] = vx;
    o[output14::kVy] = vy;
    o[output14::kSideslip] = std::atan2(vy, vx);
    o[output14::kRoll] = x[Roll];
    o[output14::kPitch] = x[Pitch];
    o[output14::kPlaneAx] = plane_ax;
    o[output14::kPlaneAy] = plane_ay;
    o[output14::kRoadSteer] = 0.5 * (u.steer_rad[0] + u.steer_rad[1]);
    double wheel_force = 0.0;
    for (std::size_t i = 0; i < kWheels; ++i) wheel_force += o[output14::kFx + i];
    o[output14::kWheelForce] = wheel_force;
}

void Vehicle14::evaluate(const State14& x, const Input14& u, State14& rate, Output14* out) const {
    rates(x, u, Steered(u), rate, out);
    const double c = std::cos(x[Yaw]), s = std::sin(x[Yaw]);
    rate[X] = c * x[Vx] - s * x[Vy];
    rate[Y] = s * x[Vx] + c * x[Vy];
}

Output14 Vehicle14::output(const State14& x, const Input14& u) const {
    State14 rate;
    Output14 out;
    evaluate(x, u, rate, &out);
    return out;
}

int Vehicle14::parts(const State14& x, const Input14& u, double dt) const {
    const double speed = std::max(std::abs(x[Vx]), kSlowest);
    double fastest = 0.0;
    for (std::size_t i = 0; i < kWheels; i += 2) {
        const AxleData& a = axle(i);
        const double load = 1.5 * (wheel_load_[i] + wheel_load_[i + 1]) * 0.5;
        double pace = a.tyre.slip_stiffness * load * a.radius_m * a.radius_m / speed;
        if (std::abs(x[kWheelSpeed + i]) < 5.0 * kStandingWheel)
            pace += std::max(u.brake_nm[i], u.brake_nm[i + 1]) / kStandingWheel;
        fastest = std::max(fastest, pace / a.wheel_inertia_kgm2);
    }
    return std::max(1, static_cast<int>(std::ceil(fastest * dt / kStable)));
}

void Vehicle14::step(State14& x, const Input14& u, double dt) const {
    const Steered steered(u);
    const int n = parts(x, u, dt);
    const double part = dt / n;
    State14 k1, k2, k3, k4, at;
    for (int m = 0; m < n; ++m) {
        const auto shifted = [&](const State14& k, double by) {
            for (std::size_t i = 0; i < states_; ++i) at[i] = x[i] + by * k[i];
        };
        // Within one step the heading hardly turns, so the series of its change is exact.
        const double yaw = x[Yaw], c0 = std::cos(yaw), s0 = std::sin(yaw);
        const auto stage = [&](const State14& from, State14& k) {
            rates(from, u, steered, k, nullptr);
            const double d = from[Yaw] - yaw;
            const double cd = 1.0 - 0.5 * d * d, sd = d * (1.0 - d * d / 6.0);
            const double c = c0 * cd - s0 * sd, s = s0 * cd + c0 * sd;
            k[X] = c * from[Vx] - s * from[Vy];
            k[Y] = s * from[Vx] + c * from[Vy];
        };
        stage(x, k1);
        shifted(k1, 0.5 * part);
        stage(at, k2);
        shifted(k2, 0.5 * part);
        stage(at, k3);
        shifted(k3, part);
        stage(at, k4);
        for (std::size_t i = 0; i < states_; ++i)
            x[i] += part / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]);
    }
}

State14 Vehicle14::rest(double vx) const {
    State14 x{};
    x[Vx] = vx;
    for (std::size_t i = 0; i < kWheels; ++i) x[kWheelSpeed + i] = vx / axle(i).radius_m;
    // Height, roll, pitch and four wheels, such that nothing accelerates: Newton's method.
    constexpr std::array<std::size_t, 7> at{Z, Roll, Pitch, 12, 13, 14, 15};
    constexpr std::array<std::size_t, 7> must{Vz, P, Q, 16, 17, 18, 19};
    const Input14 u;
    State14 rate;
    for (int iteration = 0; iteration < 12; ++iteration) {
        evaluate(x, u, rate, nullptr);
        Vec<7> miss;
        Mat<7, 7> slope;
        for (int j = 0; j < 7; ++j) miss[j] = rate[must[static_cast<std::size_t>(j)]];
        if (miss.norm() < 1e-9) return x;
        const double step = 1e-6;
        for (int j = 0; j < 7; ++j) {
            State14 near = x;
            near[at[static_cast<std::size_t>(j)]] += step;
            evaluate(near, u, rate, nullptr);
            for (int i = 0; i < 7; ++i)
                slope(i, j) = (rate[must[static_cast<std::size_t>(i)]] - miss[i]) / step;
        }
        const Vec<7> change = slope.partialPivLu().solve(miss);
        for (int j = 0; j < 7; ++j) x[at[static_cast<std::size_t>(j)]] -= change[j];
    }
    evaluate(x, u, rate, nullptr);
    for (const std::size_t i : must)
        if (!(std::abs(rate[i]) < 1e-6))
            throw std::invalid_argument(
                "the car finds no rest: check its masses, springs and centre of mass");
    return x;
}

double Vehicle14::energy(const State14& x, const Input14& u) const {
    double e = load_.mass_kg * (x[Vx] * x[Vx] + x[Vy] * x[Vy]) + sprung_ * x[Vz] * x[Vz] +
               load_.jxx_kgm2 * x[P] * x[P] + load_.jyy_kgm2 * x[Q] * x[Q] +
               load_.jzz_kgm2 * x[R] * x[R];
    e = 0.5 * e + sprung_ * kTwinGravity * x[Z];
    const double tilted = 0.5 * (x[Roll] * x[Roll] + x[Pitch] * x[Pitch]);
    std::array<double, kWheels> travel;
    for (std::size_t i = 0; i < kWheels; ++i)
        travel[i] =
            x[Z] + y_[i] * x[Roll] - x_[i] * x[Pitch] + tilt_[i] * tilted - x[kWheelHeight + i];
    for (std::size_t i = 0; i < kWheels; ++i) {
        const AxleData& a = axle(i);
        const double height = x[kWheelHeight + i], rate = x[kWheelHeightRate + i];
        const double stop = beyond(travel[i], a.travel_m);
        const double deflection = u.road_m[i] - height;
        const double across = travel[i] - travel[i ^ 1U];
        e += 0.5 * (a.unsprung_kg * rate * rate +
                    a.wheel_inertia_kgm2 * x[kWheelSpeed + i] * x[kWheelSpeed + i] +
                    a.spring_npm * travel[i] * travel[i] + a.stop_npm * stop * stop +
                    0.5 * a.anti_roll_npm * across * across + a.tyre_npm * deflection * deflection);
        e += (a.unsprung_kg * kTwinGravity - wheel_load_[i]) * height -
             (wheel_load_[i] - a.unsprung_kg * kTwinGravity) * travel[i];
    }
    return e;
}

Run14 simulate14(const Vehicle14& car, State14& x, const Input14* inputs, std::size_t n,
                 double dt) {
    Run14 run;
    run.states.reserve(n * kTwinStates);
    run.outputs.reserve(n * kTwinOutputs);
    for (std::size_t k = 0; k < n; ++k) {
        const Output14 y = car.output(x, inputs[k]);
        run.states.insert(run.states.end(), x.begin(), x.begin() + kTwinStates);
        run.outputs.insert(run.outputs.end(), y.begin(), y.end());
        car.step(x, inputs[k], dt);
    }
    return run;
}

}  // namespace sysid
