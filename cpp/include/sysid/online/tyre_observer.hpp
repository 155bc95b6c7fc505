// Observer B of the dual sideslip observer: the car on tyres that are known only roughly.
//
// State: beta, r, both slip angles behind their relaxation length, and what is uncertain of the
// tyres: stiffness, grip, an error of the force for each axle, and the relaxation length; of what
// was told of the car: how late the wheels turn, where the accelerometer sits, the yaw inertia, and
// offsets of the sensors; of the road, of forces from outside, of body roll, and of the yaw moment
// by drive and brakes (a locking differential makes one as large as a tenth of the tyres'). It
// reads r and a_y.
#pragma once

#include "sysid/estimate/filter.hpp"
#include "sysid/online/sensor_watch.hpp"
#include "sysid/online/tyre_forces.hpp"

namespace sysid {

struct TyreModel {  // observer B
    static constexpr double kSteerLagS = 0.1;
    static constexpr bool kSmoothed = false;
    // Stiffness and grip are logarithms of what the tyre of the vehicle file is multiplied by;
    // errors are in units of their standard deviation.
    enum State {
        kBeta,
        kYawRate,
        kSlipF,
        kSlipR,
        kStiffF,
        kStiffR,
        kGripF,
        kGripR,
        kRelax,     // logarithm of what the relaxation length is multiplied by
        kLate,      // time by which the wheels turn after the steering angle that is read [s]
        kAhead,     // how far ahead of the centre of gravity the accelerometer sits [m]
        kInertia,   // logarithm of what the yaw inertia is multiplied by
        kSteerOff,  // what the steering angle that is read, or held, lacks [rad]
        kAyBias,    // what the accelerometer reads too much [m/s2]
        kGyroBias,  // what the gyro reads too much [rad/s]
        kRoll,  // share of `kLean` that the accelerometer feels too much, by gravity in body roll
        kRoad,  // lateral acceleration that moves the car and that no accelerometer feels
        kPush,  // lateral acceleration by forces from outside, as wind, that the accelerometer
                // feels
        kTurn,  // yaw acceleration by these [rad/s2]
        kErrorF,
        kErrorR,
        kDrive,  // yaw moment of wheels that drive or brake unlike left and right
        kLean,   // lateral acceleration that the body has rolled with by now
    };
    static constexpr int kStates = 23;
    // What is learnt of the car and outlives a stop.
    static constexpr int kLearnt = kStiffF, kLearntStates = kRoll - kStiffF + 1;
    static constexpr int kMeasured = 2;  // r, a_y
    /// What is left, at the next sample, of states that fade in some time.
    struct Keeps {
        double friction = 1.0, road = 1.0, push = 1.0, error = 1.0, roll = 1.0;
    };
    struct Input {
        double dt = 0.0;
        double steer = 0.0, steer_before = 0.0;            // now and at the sample before
        double steer_slow = 0.0, steer_slow_before = 0.0;  // behind a lag of `kSteerLagS`
        double vx = 1.0, vx_before = 1.0;
        double ax = 0.0, ax_before = 0.0;
        AxleForces loads{};
        double error_f_n = 0.0, error_r_n = 0.0;  // standard deviation of the tyre model's error
        double drive_nm = 0.0;                    // standard deviation of that yaw moment
        double stiffness_walk_f = 0.0, stiffness_walk_r = 0.0;  // [1/sqrt(s)]
        double slip_f_walk = 0.0;  // of an angle that is held between two readings [rad/sqrt(s)]
        double steer_walk = 0.0;  // of an angle that is not read, away from that held [rad/sqrt(s)]
        Keeps keeps{};
    };

    struct Forces {
        AxleForceAgain front, rear;
    };

    ObservedCar car;
    ObserverSettings settings;
    // Forces at either end of a prediction and of a reading, asked for at all sigma points in turn.
    // Whoever steps an observer has it for himself.
    mutable Forces before{}, after{}, read{};

    void forces(const Input& u, const double* x, Forces& asked, double& front, double& rear) const;
    void predict(const Input& u, const double* x, double* next) const;
    void observe(const Input& u, const double* x, double* y) const;
    Mat<kStates, kStates> process_noise(const Input& u) const;
    Mat<2, 2> measurement_noise(const Input& u) const;
};

/// One observer B: a filter, and what it makes of its innovations.
class TyreObserver {
  public:
    TyreObserver(const ObservedCar& car, const ObserverSettings& settings);

    /// Begins from a steady corner; what was learnt of the tyres stays, unless the readings refute
    /// it. `common` holds the inputs at this sample.
    void start(double dt, const SensorSample& s, const TyreModel::Input& common);
    /// Uses one sample; `common` holds the inputs that do not depend on the tyres.
    void step(const TyreModel::Input& common, const SensorSample& s);
    /// The steering angle is no longer read: what that which is held lacks walks away from its
    /// offset.
    void steer_lost();
    /// It is read again: its offset is what it was.
    void steer_found();
    bool lost() const;
    /// Goes on with the estimate of another.
    void adopt(const TyreObserver& other);
    /// Log density of the last sample; a refused reading counts as one at the bound of the gate.
    double log_likelihood() const { return log_likelihood_; }
    const Filter<TyreModel>& filter() const { return filter_; }
    const TyreModel::Input& input() const { return input_; }
    void forces(double& front, double& rear) const;
    /// Variance of the sideslip, with that of the error of the tyre curve.
    double sideslip_variance() const;

    template <class Row>
    void remember(Row& row) {
        row(filter_, input_, contradiction_, log_likelihood_, offset_, offset_variance_);
    }

  private:
    bool refuted() const;
    void learn_less(double use_f, double use_r);

    ObservedCar car_;
    ObserverSettings settings_;
    Filter<TyreModel> filter_;
    TyreModel::Input input_;
    double contradiction_ = 1.0;  // squared innovations over their variance, of the last while
    double log_likelihood_ = 0.0;
    double refusal_ = 0.0;                         // what a refused reading takes from it
    double offset_ = 0.0, offset_variance_ = 0.0;  // of the steering, before it was lost
};

}  // namespace sysid
