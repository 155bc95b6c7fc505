// Extended-state observer: a linear-tyre single-track model whose unknown forces are states.
//
//   x = v_x, v_y [m/s], r [rad/s], xi_x, xi_y [N], xi_psi [N m]     y = v_x, v_y, r, a_y
//   m v_x' = m v_y r - c v_x + F_x + xi_x
//   m v_y' = Y - m v_x r + xi_y           Y = -(C_f + C_r) v_y/s - (C_f l_f - C_r l_r) r/s + C_f d
//   I r'   = N + xi_psi        N = -(C_f l_f - C_r l_r) v_y/s - (C_f l_f^2 + C_r l_r^2) r/s
//                                  + C_f l_f d
//   a_y    = (Y + xi_y) / m               s = max(v_x, 1)
//
// The xi are random walks: what the sensors say and the model does not, a virtual force
// sensor (Han, IEEE Trans. Ind. Electron. 2009).
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "sysid/estimate/kalman.hpp"
#include "sysid/lab/car.hpp"
#include "sysid/math/exponential.hpp"
#include "sysid/model/kinematics.hpp"

namespace sysid::lab {

constexpr int kObserverStates = 6;
constexpr int kObserverMeasurements = 4;
using ObserverVec = Vec<kObserverStates>;
using ObserverMat = Mat<kObserverStates, kObserverStates>;
using ObserverReading = Vec<kObserverMeasurements>;  // v_x, v_y, r, a_y; NaN where missing
using ObserverRow = Mat<kObserverMeasurements, kObserverStates>;

/// Which model of the two the filter uses, feature by feature; the default has all of them
/// corrected.
struct ObserverForm {
    bool feed_through = true;     // the steering angle enters a_y at once
    bool input_before = true;     // x(k) follows from the inputs of k-1, not of k
    bool exact_sampling = true;   // inputs held and dynamics sampled exactly, not by Euler's rule
    bool coupling = true;         // v_y r in the v_x equation and the full Jacobian
    bool speed_predicted = true;  // a_y with the predicted speed, not the estimate before it
    // Inputs stay from their sample to the next, as a controller gives them; otherwise they go
    // there in a straight line, as a driver turns the wheel. Asked only with `input_before`.
    bool inputs_held = true;

    static ObserverForm corrected() { return {}; }
    bool operator==(const ObserverForm&) const = default;
};

/// Inputs of one sample; the stiffness is that of the axle, nominal value times load.
struct ObserverInput {
    double force_x_n = 0.0;
    double steer_rad = 0.0;
    double stiffness_front_nprad = 0.0;
    double stiffness_rear_nprad = 0.0;

    /// Half way to another. Of inputs that go there in a straight line over h the mean acts alike,
    /// but for J h / 12 of what they change by; the first one leaves out half of that.
    ObserverInput half_way(const ObserverInput& to) const {
        return {0.5 * (force_x_n + to.force_x_n), 0.5 * (steer_rad + to.steer_rad),
                0.5 * (stiffness_front_nprad + to.stiffness_front_nprad),
                0.5 * (stiffness_rear_nprad + to.stiffness_rear_nprad)};
    }
};

struct ObserverNoise {
    ObserverMat process = ObserverMat::Identity();
    Mat<kObserverMeasurements, kObserverMeasurements> sensors =
        Mat<kObserverMeasurements, kObserverMeasurements>::Identity();
};

/// The equations alone.
class ObserverModel {
  public:
    ObserverModel(ObserverCar car, ObserverForm form, double dt)
        : car_(car),
          form_(form),
          dt_(dt),
          per_mass_(1.0 / car.mass_kg),
          per_inertia_(1.0 / car.yaw_inertia_kgm2) {}

    const ObserverForm& form() const { return form_; }
    const ObserverCar& car() const { return car_; }
    ObserverModel with_form(const ObserverForm& form) const { return {car_, form, dt_}; }

    /// State one sample after `x`, and the first three rows of the Jacobian `A` that leads there;
    /// the others are the unit matrix's, as the forces are random walks. Without any reading at the
    /// new sample (`unread`) nothing holds Euler's rule where it grows, at low speed: estimate and
    /// covariance would overflow within seconds. The rates are sampled exactly there in any form.
    ObserverVec predict(const ObserverVec& x, const ObserverInput& before, const ObserverInput& now,
                        ObserverMat& A, bool unread = false) const {
        ObserverInput u = form_.input_before ? before : now;
        if (form_.input_before && !form_.inputs_held) u = before.half_way(now);
        const Lateral c = lateral(x[0], u);
        Mat<3, 3> J;
        J << -car_.drag_nspm * per_mass_, 0.0, 0.0, 0.0, c.y_v, c.y_r - x[0], 0.0, c.n_v, c.n_r;
        Vec<3> rate = J * x.head<3>();
        rate[0] += (u.force_x_n + x[3]) * per_mass_;
        rate[1] += (u.stiffness_front_nprad * u.steer_rad + x[4]) * per_mass_;
        rate[2] += (u.stiffness_front_nprad * car_.lf_m * u.steer_rad + x[5]) * per_inertia_;
        if (form_.coupling) {
            rate[0] += x[1] * x[2];
            J(0, 1) = x[2];
            J(0, 2) = x[1];
            J(1, 0) = c.slope * (c.y_v * x[1] + c.y_r * x[2]) - x[2];
            J(2, 0) = c.slope * (c.n_v * x[1] + c.n_r * x[2]);
        }
        // Local linearisation (Ozaki, Statistica Sinica 1992): the rate's own Jacobian is what is
        // sampled exactly. It stays stable at walking pace, where Euler's rule does not.
        ObserverVec next = x;
        if (!form_.exact_sampling && !(unread && euler_grows(J))) {
            A.topRows<3>().setZero();
            A.topLeftCorner<3, 3>() = dt_ * J;
            A.topLeftCorner<3, 3>().diagonal().array() += 1.0;
            A(0, 3) = A(1, 4) = dt_ * per_mass_;
            A(2, 5) = dt_ * per_inertia_;
            next.head<3>() += dt_ * rate;
            return next;
        }
        const HeldResponse<3> held = held_response<3>(J, dt_);
        const Mat<3, 3>& response = held.response;
        A.topLeftCorner<3, 3>() = held.transition;
        A.col(3).head<3>() = response.col(0) * per_mass_;
        A.col(4).head<3>() = response.col(1) * per_mass_;
        A.col(5).head<3>() = response.col(2) * per_inertia_;
        next.head<3>() += response * rate;
        return next;
    }

    /// Expected reading in state `x` and its Jacobian `H`, with the coefficients of speed `v_x`.
    ObserverReading observe(double v_x, const ObserverVec& x, const ObserverInput& now,
                            ObserverRow& H) const {
        const Lateral c = lateral(v_x, now);
        H.setZero();
        H.topLeftCorner<3, 3>().setIdentity();
        H(3, 1) = c.y_v;
        H(3, 2) = c.y_r;
        H(3, 4) = per_mass_;
        ObserverReading y;
        y.head<3>() = x.head<3>();
        y[3] = c.y_v * x[1] + c.y_r * x[2] + per_mass_ * x[4];
        if (form_.coupling) H(3, 0) = c.slope * (c.y_v * x[1] + c.y_r * x[2]);
        if (form_.feed_through) y[3] += now.stiffness_front_nprad * now.steer_rad * per_mass_;
        return y;
    }

  private:
    // Tyre forces per mass, moments per inertia, per unit of v_y and r; all go with 1/s.
    struct Lateral {
        double y_v, y_r, n_v, n_r;
        double slope;  // derivative by v_x of each, relative to itself
    };
    Lateral lateral(double v_x, const ObserverInput& u) const {
        const double per_speed = 1.0 / std::max(v_x, 1.0);
        const double f = u.stiffness_front_nprad * per_speed;
        const double r = u.stiffness_rear_nprad * per_speed;
        const double turn = f * car_.lf_m - r * car_.lr_m;
        return {
            -(f + r) * per_mass_,
            -turn * per_mass_,
            -turn * per_inertia_,
            -(f * car_.lf_m * car_.lf_m + r * car_.lr_m * car_.lr_m) * per_inertia_,
            v_x > 1.0 ? -per_speed : 0.0,
        };
    }

    /// Whether a step of Euler's rule enlarges the lateral motion (Jury's criterion).
    bool euler_grows(const Mat<3, 3>& J) const {
        const double a = 1.0 + dt_ * J(1, 1), d = 1.0 + dt_ * J(2, 2);
        const double determinant = a * d - dt_ * dt_ * J(1, 2) * J(2, 1);
        const bool shrinks = std::abs(a + d) < 1.0 + determinant && determinant < 1.0;
        return !shrinks;
    }

    ObserverCar car_;
    ObserverForm form_;
    double dt_;
    double per_mass_, per_inertia_;
};

/// What the observer starts from. `one_before`: it belongs to the sample before the first.
struct ObserverStart {
    ObserverVec mean = ObserverVec::Zero();
    ObserverMat covariance = ObserverMat::Zero();
    bool one_before = false;

    /// Straight on at a speed that is certain one sample earlier.
    static ObserverStart certain(double speed_mps) {
        ObserverStart start;
        start.mean[0] = speed_mps;
        start.one_before = true;
        return start;
    }

    /// From the first reading alone: what it lacks is widely uncertain, as are the forces.
    static ObserverStart from_reading(const ObserverReading& y, const ObserverNoise& noise,
                                      const ObserverCar& car) {
        const double weight = kGravity * car.mass_kg;
        ObserverStart start;
        const double wide[] = {10.0, 1.0, 0.5};  // m/s, m/s, rad/s
        for (int i = 0; i < 3; ++i) {
            const bool there = !std::isnan(y[i]);
            start.mean[i] = there ? y[i] : 0.0;
            start.covariance(i, i) = there ? noise.sensors(i, i) : wide[i] * wide[i];
        }
        const double force = 0.3 * weight;
        const double moment = force * 0.5 * (car.lf_m + car.lr_m);
        start.covariance(3, 3) = start.covariance(4, 4) = force * force;
        start.covariance(5, 5) = moment * moment;
        return start;
    }
};

/// A log as the `System` of `extended_kalman_filter`.
class ObserverSystem {
  public:
    static constexpr int kMovingStates = 3;
    static constexpr int kDirectReadings = 3;
    static constexpr bool kSteadyNoise = true;

    ObserverSystem(const ObserverModel& model, const std::vector<ObserverInput>& inputs,
                   const std::vector<ObserverReading>& readings, ObserverNoise noise)
        : model_(&model), inputs_(&inputs), readings_(&readings), noise_(std::move(noise)) {}

    std::size_t size() const { return readings_->size(); }
    const ObserverMat& process_noise() const { return noise_.process; }
    ObserverVec predict(std::size_t k, const ObserverVec& x, ObserverMat& A,
                        ObserverMat& /*steady*/) const {
        speed_ = x[0];
        return model_->predict(x, (*inputs_)[k > 0 ? k - 1 : 0], (*inputs_)[k], A,
                               (*readings_)[k].array().isNaN().all());
    }
    ObserverReading observe(std::size_t k, const ObserverVec& x, ObserverRow& H) const {
        const bool early = !model_->form().speed_predicted && !std::isnan(speed_);
        return model_->observe(early ? speed_ : x[0], x, (*inputs_)[k], H);
    }
    const ObserverReading& measurement(std::size_t k) const { return (*readings_)[k]; }
    const Mat<kObserverMeasurements, kObserverMeasurements>& measurement_noise(std::size_t) const {
        return noise_.sensors;
    }

  private:
    const ObserverModel* model_;
    const std::vector<ObserverInput>* inputs_;
    const std::vector<ObserverReading>* readings_;
    ObserverNoise noise_;
    mutable double speed_ = std::numeric_limits<double>::quiet_NaN();
};

/// The same filter, one sample at a time, for use inside a control loop.
class Observer {
  public:
    Observer(const ObserverModel& model, ObserverNoise noise, ObserverStart start)
        : model_(model),
          noise_(std::move(noise)),
          start_(std::move(start)),
          x_(start_.mean),
          P_(start_.covariance) {}

    /// Uses the reading and the inputs of the present sample. Returns the new estimate.
    const ObserverVec& step(const ObserverInput& now, const ObserverReading& y) {
        double speed = x_[0];
        if (samples_ > 0 || start_.one_before) {
            ObserverMat A = ObserverMat::Identity();
            x_ = model_.predict(x_, samples_ > 0 ? before_ : now, now, A, y.array().isNaN().all());
            propagate<ObserverSystem::kMovingStates>(A, P_);
            P_ += noise_.process;
        }
        if (model_.form().speed_predicted) speed = x_[0];
        ObserverRow H;
        const ObserverReading expected = model_.observe(speed, x_, now, H);
        Update<kObserverStates, kObserverMeasurements> update;
        measurement_update<kObserverStates, kObserverMeasurements, ObserverSystem::kDirectReadings>(
            x_, P_, y, expected, H, noise_.sensors, samples_, update);
        log_density_.add(update);
        before_ = now;
        ++samples_;
        return x_;
    }

    const ObserverVec& state() const { return x_; }
    const ObserverMat& covariance() const { return P_; }
    double log_likelihood() const { return log_density_.value(); }

  private:
    ObserverModel model_;
    ObserverNoise noise_;
    ObserverStart start_;
    ObserverVec x_;
    ObserverMat P_;
    ObserverInput before_;
    std::size_t samples_ = 0;
    LogDensity log_density_;
};

}  // namespace sysid::lab
