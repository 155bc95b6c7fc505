// Observer with tyres that were identified beforehand: state (beta, F_xf, F_xr), measured
// (a_x, a_y), inputs steering angle, yaw rate and speed.
#pragma once

#include "sysid/estimate/filter.hpp"
#include "sysid/online/sensor_watch.hpp"
#include "sysid/online/tyre_forces.hpp"

namespace sysid {

struct SideslipModel {
    static constexpr int kStates = 3;
    static constexpr int kMeasured = 2;
    struct Input {
        double dt = 0.0, steer = 0.0, vx = 1.0, yaw_rate = 0.0;
        double steer_before = 0.0, vx_before = 1.0, yaw_rate_before = 0.0;
        double fz_f = 0.0, fz_r = 0.0;
        double yaw_rate_std = 0.0, steer_std = 0.0, ax_std = 0.0;
    };

    ObservedCar car;
    ObserverSettings settings;
    bool linear = false;  // tyres without saturation, loads of a car at rest

    template <class S>
    void predict(const Input& u, const S* x, S* next) const;
    template <class S>
    void observe(const Input& u, const S* x, S* y) const;
    Mat<3, 3> process_noise(const Input& u) const;
    Mat<2, 2> measurement_noise(const Input& u) const;

  private:
    template <class S>
    void lateral(double steer, double vx, double r, const Input& u, const S* x, S& front,
                 S& rear) const;
    template <class S>
    S beta_rate(double steer, double vx, double r, const Input& u, const S* x) const;
};

template <Method method>
class SideslipUkf {
  public:
    SideslipUkf(const ObservedCar& car, const ObserverSettings& settings, bool linear);

    /// Uses one sample, `dt` seconds after the one before.
    const SideslipEstimate& step(double dt, const SensorSample& sample);
    std::size_t samples() const { return index_; }

    template <class Row>
    void remember(Row& row) {
        row(car_, settings_, linear_);
        if constexpr (Row::kReads) *this = SideslipUkf(car_, settings_, linear_);
        row(watch_, filter_, input_, out_, index_, rate_gap_s_, speed_gap_s_, started_);
    }

  private:
    void start(const SensorSample& s);
    void run(double dt, const SensorSample& s);
    double blind_speed(double dt, const SensorSample& s) const;
    double slowing(double dt, const SensorSample& now) const;
    bool lost() const;
    void report(const SensorSample& s);

    ObservedCar car_;
    ObserverSettings settings_;
    SensorWatch watch_;
    Filter<SideslipModel, method> filter_;
    SideslipModel::Input input_;
    SideslipEstimate out_;
    std::size_t index_ = 0;
    double rate_gap_s_ = 0.0, speed_gap_s_ = 0.0;
    bool started_ = false, linear_ = false;
};

}  // namespace sysid
