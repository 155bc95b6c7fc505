// Dual unscented observer for sideslip and tyres.
//
// Observer A turns the sensors into forces: state (v_x, r, F_yf, F_yr, F_x), measured
// (v_x, r, a_x, a_y); the forces walk freely, no tyre is assumed. Observer B knows tyres: state
// beta, r, both slip angles behind their relaxation length, and what is uncertain of the tyres:
// stiffness, grip, an error of the force for each axle, and the relaxation length; of the road, of
// body roll, and of the yaw moment by drive and brakes (a locking differential makes one as large
// as a tenth of the tyres'). It reads r and a_y. Both run beside each other: A gives B the speed
// and the longitudinal force that share the grip and shift the load, B gives A the sideslip, and
// the forces where a sensor fails.
//
// B reads the sensors and not, as was published, the forces that A made of them: A's errors last
// for several samples, and B would believe the same noise several times. The error states let the
// forces be what the sensors say, so that beta follows the measured acceleration at once (which is
// true of any tyre, but drifts) and the tyre model in the long run.
#pragma once

#include "sysid/estimate/filter.hpp"
#include "sysid/online/sensor_watch.hpp"
#include "sysid/online/tyre_forces.hpp"

namespace sysid {

struct ForceModel {  // observer A
    enum State { kVx, kYawRate, kFyf, kFyr, kFx };
    static constexpr int kStates = 5;
    static constexpr int kMeasured = 4;
    struct Input {
        double dt = 0.0, steer = 0.0, tan_beta = 0.0;
        double fz_f = 0.0, fz_r = 0.0;
    };

    ObservedCar car;
    ObserverSettings settings;

    template <class S>
    void predict(const Input& u, const S* x, S* next) const;
    template <class S>
    void observe(const Input& u, const S* x, S* y) const;
    Mat<5, 5> process_noise(const Input& u) const;
    Mat<4, 4> measurement_noise(const Input& u) const;
};

struct TyreModel {  // observer B
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
        kRelax,  // logarithm of what the relaxation length is multiplied by
        kRoll,   // share of `kLean` that the accelerometer feels too much, by gravity in body roll
        kRoad,   // lateral acceleration that moves the car and that no accelerometer feels
        kErrorF,
        kErrorR,
        kDrive,  // yaw moment of wheels that drive or brake unlike left and right
        kLean,   // lateral acceleration that the body has rolled with by now
    };
    static constexpr int kStates = 15;
    // What is learnt of the car and outlives a stop.
    static constexpr int kLearnt = kStiffF, kLearntStates = kRoll - kStiffF + 1;
    static constexpr int kMeasured = 2;  // r, a_y
    struct Input {
        double dt = 0.0;
        double steer = 0.0, steer_before = 0.0;  // now and at the sample before
        double vx = 1.0, vx_before = 1.0;
        double ax = 0.0, ax_before = 0.0;
        AxleForces loads{};
        double error_f_n = 0.0, error_r_n = 0.0;  // standard deviation of the tyre model's error
        double drive_nm = 0.0;                    // standard deviation of that yaw moment
        double stiffness_walk_f = 0.0, stiffness_walk_r = 0.0;  // [1/sqrt(s)]
        double slip_f_walk = 0.0;  // of an unknown steering angle [rad/sqrt(s)]
    };

    ObservedCar car;
    ObserverSettings settings;

    template <class S>
    void forces(const Input& u, const S* x, S& front, S& rear) const;
    template <class S>
    void predict(const Input& u, const S* x, S* next) const;
    template <class S>
    void observe(const Input& u, const S* x, S* y) const;
    Mat<15, 15> process_noise(const Input& u) const;
    Mat<2, 2> measurement_noise(const Input& u) const;
};

class SideslipDual {
  public:
    SideslipDual(const ObservedCar& car, const ObserverSettings& settings);

    /// Uses one sample, `dt` seconds after the one before.
    const SideslipEstimate& step(double dt, const SensorSample& sample);
    std::size_t samples() const { return index_; }

    template <class Row>
    void remember(Row& row) {
        row(car_, settings_);
        if constexpr (Row::kReads) *this = SideslipDual(car_, settings_);
        row(watch_, forces_, tyres_, input_, out_, index_, contradiction_, started_);
    }

  private:
    void start(double dt, const SensorSample& s);
    void run(double dt, const SensorSample& s);
    bool lost() const;
    void run_tyres(double dt, const SensorSample& s);
    void run_forces(double dt, const SensorSample& s);
    void report();

    ObservedCar car_;
    ObserverSettings settings_;
    SensorWatch watch_;
    Filter<ForceModel> forces_;
    Filter<TyreModel> tyres_;
    TyreModel::Input input_;
    SideslipEstimate out_;
    std::size_t index_ = 0;
    double contradiction_ = 1.0;  // squared innovations over their variance, of the last while
    bool started_ = false;
};

}  // namespace sysid
