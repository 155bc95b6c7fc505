// The extended-state observer as the closed loop calls it.
#pragma once

#include <optional>

#include "sysid/lab/adrc.hpp"
#include "sysid/lab/observer.hpp"

namespace sysid::lab {

struct LoopObserverData {
    ObserverForm form;
    ObserverNoise noise;
    bool certain_start = false;  // begin at `first_speed_mps`, certain; else from the first reading
    double first_speed_mps = 5.0;
};

class LoopObserver {
  public:
    LoopObserver(const LoopObserverData& data, const NominalCar& car, double dt)
        : data_(data), car_(car), model_(car, data.form, dt) {
        if (!data.certain_start) return;
        const ObserverStart start = ObserverStart::certain(data.first_speed_mps);
        observer_.emplace(model_, data_.noise, start);
        state_ = start.mean;
    }

    void step(double force_n, double steer_rad, const Axles<double>& loads, const Vec<4>& y) {
        const double front = car_.stiffness_front * loads.front;
        last_ = {force_n, steer_rad, front, car_.stiffness_rear * loads.rear};
        if (!observer_)
            observer_.emplace(model_, data_.noise,
                              ObserverStart::from_reading(y, data_.noise, car_));
        state_ = observer_->step(last_, y);
    }

    /// After the last step; before it the certain start, if there is one.
    const Estimate& state() const { return state_; }

    Estimate ahead() const {
        ObserverMat ignored;
        return model_.predict(state_, last_, last_, ignored);
    }

  private:
    LoopObserverData data_;
    NominalCar car_;
    ObserverModel model_;
    std::optional<Observer> observer_;
    ObserverInput last_;
    Estimate state_ = Estimate::Zero();
};

}  // namespace sysid::lab
