// A car with fourteen degrees of freedom: body 6, suspension 4, wheels 4; 28 states, and 8 more
// for tyres with relaxation lengths.
//
// ISO 8855 axes. v_x, v_y lie in the horizontal frame that yaws with the car, at the centre of
// mass; roll, pitch and yaw rate are the derivatives of the angles. Displacements count from the
// design position, in which the car of the design load rests on flat ground.
// With corner i at (x_i, y_i) from the centre of mass, h the height of the whole car's and
// h_s = (M h - sum m_u R)/m_s of the sprung mass's, h' = h_s - h_rc, a_y = dv_y + r v_x:
//   c_i = z + y_i phi - x_i theta + h'/2 (phi^2 + theta^2)        corner of the body         (1)
//   v_t = v_y + x_i r + h_s p + g_i (dz_u - dc_i) - sum m_u e/M,
//   v_l = v_x - y_i r - h q + a_i (dz_u - dc_i)                                              (2)
//   F_b = F_s - g_i (F_y - m_u a_y) - a_i F_x                     on the body at the corner  (3)
//   M (dv_x - r v_y) = sum F_x - drag,  M (dv_y + r v_x) = sum F_y,  m_s dv_z = sum F_b - m_s g
//   J (dp, dq, dr) + (p, q, r) x J (p, q, r) = moment, with                                  (4)
//     moment_x = sum (y_i + h' phi) F_b + h_s sum (F_y - m_u a_y)
//     moment_y = -sum (x_i - h' theta) F_b - h sum F_x
//     moment_z = sum (x_i F_y - y_i F_x)
//   m_u ddz_u = F_z - F_b - m_u g + R/y_i m_u a_y,                                           (5)
//   I_w dOmega = T_d - s (T_b + f_r F_z R) - R F_x
// An unsprung mass has its centre at the height R of the wheel's. It goes sideways with the wheel,
// not with the body: e = h_s p + g_i (dz_u - dc_i) - R/y_i dz_u is its lateral speed less the
// sprung mass's. The force m_u a_y that takes it round a bend therefore passes by the springs, and
// a steady roll angle is phi = m_s h' a_y/(K - m_s g h') with the stiffness K of the springs.
// That, and m_u a_y R as the load transfer of the unsprung mass: Barton and Fieldhouse, Automotive
// Chassis Engineering (2018), eq. (3.18) and the example beside it. J_xx is all that resists p.
// A sideways push acts on the body at the height h.
// g_i = h_rc/y_i and a_i (anti-dive, anti-squat) are the slopes of the path of the contact point;
// as they stand in (2) and in (3) to (5) alike, the suspension neither makes nor loses energy. The
// square in (1) is what makes weight tilt a rolled body.
// Shim and Ghike, Vehicle System Dynamics 45 (2007) 435, extended by the link slopes and by the
// unsprung masses' own lever.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "sysid/model/kinematics.hpp"
#include "sysid/twin/load.hpp"
#include "sysid/twin/tyre14.hpp"
#include "sysid/twin/wheels.hpp"

namespace sysid {

constexpr std::size_t kTwinStates = 28;
constexpr std::size_t kTwinStatesWithTyres = kTwinStates + 2 * kWheels;
constexpr std::size_t kTwinInputs = 24;
constexpr std::size_t kTwinOutputs = 38;
constexpr double kSlowest = 1.0;        // [m/s] below it slip is referred to this speed
constexpr double kStandingWheel = 1.0;  // [rad/s] below it brakes and rolling resistance fade out

/// Positions of the states in the state vector.
namespace state14 {
enum : std::size_t { X, Y, Z, Roll, Pitch, Yaw, Vx, Vy, Vz, P, Q, R };
constexpr std::size_t kWheelHeight = 12, kWheelHeightRate = 16, kWheelAngle = 20, kWheelSpeed = 24,
                      kSlip = 28, kSlipAngle = 32;
}  // namespace state14

/// Positions of the outputs; the first ten are the measurements of eq. (20) of the paper.
namespace output14 {
enum : std::size_t { Ax, Ay, Az, P, Q, R };
constexpr std::size_t kWheelSpeed = 6, kAngularAcceleration = 10, kVx = 13, kVy = 14,
                      kSideslip = 15, kFx = 16, kFy = 20, kFz = 24, kTravel = 28, kRoll = 32,
                      kPitch = 33, kPlaneAx = 34, kPlaneAy = 35, kRoadSteer = 36, kWheelForce = 37;
}  // namespace output14

/// What may be measured: the outputs up to the sideslip angle.
constexpr std::size_t kReadings = 16;

using State14 = std::array<double, kTwinStatesWithTyres>;
using Output14 = std::array<double, kTwinOutputs>;

/// Wheels in the order above; the wrench acts at the centre of mass, in the yaw frame.
struct Input14 {
    std::array<double, 2> steer_rad{};
    std::array<double, kWheels> drive_nm{}, brake_nm{}, road_m{}, road_rate_mps{};
    std::array<double, 3> force_n{}, moment_nm{};
};
static_assert(sizeof(Input14) == kTwinInputs * sizeof(double), "rows of an array become inputs");

struct AxleData {
    double track_m = 1.62;
    double spring_npm = 33000.0;
    double bump_damping_nspm = 2400.0, rebound_damping_nspm = 2400.0;
    double anti_roll_npm = 12000.0;  // force at one wheel per difference of travel
    double travel_m = 0.10;          // to the bump stops, either way
    double stop_npm = 200000.0;
    double roll_centre_m = 0.08;
    double anti_slope = 0.0;    // a_i in (2): contact moves forward per lift of the wheel
    double unsprung_kg = 45.0;  // one wheel
    double tyre_npm = 230000.0, tyre_damping_nspm = 150.0;
    double radius_m = 0.35;
    double wheel_inertia_kgm2 = 1.6;
    double rolling_resistance = 0.011;
    double lift_area_m2 = 0.0;  // C_l A of the axle, upwards
    TyreData tyre;
};

/// The car without its load.
struct CarData {
    double wheelbase_m = 2.75;
    double drag_area_m2 = 0.85;
    double air_density_kgpm3 = 1.225;
    Load design;  // sets the free lengths of the springs, once
    AxleData front, rear;
};

/// Sines and cosines of the steering: the same all through a step, and for all twins.
struct Steered {
    explicit Steered(const Input14& u);
    Wheels cosine, sine;
};

class Vehicle14 {
  public:
    explicit Vehicle14(const CarData& car) : Vehicle14(car, car.design) {}
    Vehicle14(const CarData& car, const Load& load);

    const CarData& car() const { return car_; }
    const Load& load() const { return load_; }
    /// Takes another load from now on; the springs keep their free lengths. Throws
    /// std::invalid_argument if no body has such a mass or such moments of inertia.
    void set_load(const Load& load);

    /// The state of rest of this load at speed `vx` on flat ground, wheels rolling freely.
    State14 rest(double vx) const;

    /// Derivatives of the states and, if wanted, what sensors and analysts may read.
    void evaluate(const State14& x, const Input14& u, State14& rate, Output14* out) const;

    /// One step with the input held: classical Runge-Kutta of fourth order, in parts where the
    /// slip of a slow wheel, a brake on it or a short relaxation length is faster than the step.
    void step(State14& x, const Input14& u, double dt) const;
    void step(State14& x, const Input14& u, const Steered& steered, double dt) const;

    Output14 output(const State14& x, const Input14& u) const;
    Output14 output(const State14& x, const Input14& u, const Steered& steered) const;

    /// What `output` gives, then what `step` does, with the derivatives they share.
    void read_and_step(State14& x, const Input14& u, double dt, Output14& out) const;

    /// Kinetic energy plus energy of springs, tyres and height [J], from the design position.
    double energy(const State14& x, const Input14& u) const;

    std::size_t states() const { return states_; }

  private:
    /// All derivatives but those of the place on the plane.
    void rates(const State14& x, const Input14& u, const Steered& steered, State14& rate,
               Output14* out) const;
    void travel_along(State14& x, const Input14& u, const Steered& steered, double dt,
                      const State14* first) const;
    int parts(const State14& x, const Input14& u, double dt) const;

    /// What the equations take of the axles, for all wheels at once.
    struct OfWheels {
        OfWheels(const CarData& car);
        Wheels half_track, spring, bump, rebound, anti_roll, travel, stop, roll_centre, link, lean,
            anti_slope, unsprung, per_unsprung, weight, tyre_spring, tyre_damping, radius, inertia,
            per_inertia, rolling, relaxation;
        TyreCurve<Wheels> tyre;
        double unsprung_all, unsprung_moment;  // mass, and mass times height
    };

    CarData car_;
    OfWheels w_;
    Load load_;
    std::size_t states_;
    std::array<double, 2> slip_pace_{};  // times speed: how fast slip answers, front and rear
    double fastest_relaxation_ = 0.0;    // per speed
    Wheels design_load_;                 // of the wheels, at the design position
    Wheels x_, y_, tilt_;
    double sprung_ = 0.0, sprung_height_ = 0.0;
    std::array<double, 6> inverse_{};  // of the inertia tensor: xx, yy, zz, xy, xz, yz
};

/// Runs a car over `n` rows of inputs: its first 28 states and its outputs at each sample, row by
/// row; `x` ends after the last.
void simulate14(const Vehicle14& car, State14& x, const Input14* inputs, std::size_t n, double dt,
                double* states, double* outputs);

}  // namespace sysid
