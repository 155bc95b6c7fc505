// Dual unscented observer for sideslip and tyres.
//
// Observer A turns the sensors into forces: state (v_x, r, F_yf, F_yr, F_x), measured
// (v_x, r, a_x, a_y); the forces walk freely, no tyre is assumed. Observers B know tyres
// (`TyreObserver`). They run beside each other: A gives B the speed and the longitudinal force that
// share the grip and shift the load, B gives A the sideslip, and the forces where a sensor fails.
//
// B reads the sensors and not, as was published, the forces that A made of them: A's errors last
// for several samples, and B would believe the same noise several times. The error states let the
// forces be what the sensors say, so that beta follows the measured acceleration at once (which is
// true of any tyre, but drifts) and the tyre model in the long run.
//
// How far a car and its road depart from the model differs by more than ten times from car to car,
// and so does in what. There are six B, which expect a car with sensors that are as told, small,
// middling and large departures, banked roads, and a car or tyres that are not as told; each counts
// by the likelihood of its last readings (Raftery, Karny & Ettler, Technometrics 52, 2010),
// tempered, as a wrong model makes errors that last (Grunwald & van Ommen, Bayesian Analysis 12,
// 2017): those that explain the readings about as well stay, and where they disagree the band is
// wide.
#pragma once

#include <array>

#include "sysid/online/tyre_observer.hpp"

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
        row(watch_, forces_, input_, out_, index_, started_, steer_lost_);
        for (TyreObserver& one : tyres_) row(one);
        for (std::size_t i = 0; i < kMembers; ++i) row(log_weights_[i], weights_[i], refuted_s_[i]);
    }

  private:
    static constexpr std::size_t kMembers = 6;

    void start(double dt, const SensorSample& s);
    void run(double dt, const SensorSample& s);
    void run_tyres(double dt, const SensorSample& s);
    void run_forces(double dt, const SensorSample& s);
    void weigh();
    std::size_t likeliest() const;
    double mean_of(int state) const;
    double std_of(int state) const;
    void report(const SensorSample& s);  // `s`: as it was given

    ObservedCar car_;
    ObserverSettings settings_;
    SensorWatch watch_;
    Filter<ForceModel> forces_;
    std::array<TyreObserver, kMembers> tyres_;
    std::array<double, kMembers> log_weights_{}, weights_{};
    std::array<double, kMembers> refuted_s_{};  // for how long nothing has spoken for it
    TyreModel::Input input_;
    SideslipEstimate out_;
    std::size_t index_ = 0;
    bool started_ = false, steer_lost_ = false;
};

}  // namespace sysid
