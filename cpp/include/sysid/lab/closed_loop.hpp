// Plant, sensors, observer, controller and actuators in one loop.
//
// The observer is any type with
//   void step(double force_n, double steer_rad, const Axles<double>&, const Vec<4>& y)
//       moves on to the present sample and uses its reading, v_x, v_y, r, a_y or NaN
//   const Estimate& state() const   after the last step, or at the start
//   Estimate ahead() const          one sample later, if the inputs stay
// Nothing but readings of sensors reaches it or the controller.
#pragma once

#include <cstdint>
#include <initializer_list>
#include <utility>
#include <vector>

#include "sysid/lab/adrc.hpp"
#include "sysid/lab/loop_observer.hpp"
#include "sysid/lab/plant.hpp"
#include "sysid/lab/sensors.hpp"
#include "sysid/lab/track.hpp"
#include "sysid/math/interrupt.hpp"

namespace sysid::lab {

enum class SteerBy { kHeading, kTrack, kAngle };

struct LoopData {
    NominalCar car;
    AdrcData controller;
    Actuator force, steer;
    std::array<SensorData, kSensorCount> sensors{};
    SteerBy steer_by = SteerBy::kHeading;
    Track track;
    double dt = 0.01;
    double first_speed_mps = 5.0;
    double first_x_m = 0.0, first_y_m = 0.0;
    // Share of a heading or place reading's difference that corrects the reckoning.
    double pose_gain = 1.0;
    bool load_sensors = false;  // loads from sensors, not from the car's own numbers
    // The order of a simulator without prediction: the command rests on the estimate and the loads
    // of the sample before, and the observer moves on with the input of its own sample.
    bool late_feedback = false;
    // The actuators move evenly from a sample to the next, as decided for it. Otherwise they jump
    // and hold, which late feedback always does.
    bool inputs_linear = false;
    double first_late_load_n = 0.0;
    double slowest_mps = 0.3;        // the drive ends below this speed
    double most_sideslip_rad = 0.7;  // and beyond this sideslip angle
};

/// Samples of a finished drive; every row of numbers holds the columns named here.
struct LoopRecord {
    static constexpr int kTruths = 15, kReferences = 4, kInputs = 4;
    std::vector<double> truth;      // v_x, v_y, r, x, y, heading, then `PlantTruth`
    std::vector<double> sensed;     // `Sensor`
    std::vector<double> estimate;   // `Estimated`
    std::vector<double> reference;  // speed, heading, yaw rate, distance left of the track
    std::vector<double> inputs;     // force and angle that act, force and angle commanded
    std::vector<std::uint32_t> limits;
    std::size_t lost_at = 0;  // sample at which the car spun or stopped; samples if it did not
};

/// Where the car is believed to be: reckoned from the estimate, corrected by readings.
struct Reckoning {
    double x_m = 0.0, y_m = 0.0, heading_rad = 0.0;

    void move(const Estimate& e, double dt) {
        const double middle = heading_rad + 0.5 * dt * e[kEstYawRate];
        x_m += dt * (std::cos(middle) * e[kEstVx] - std::sin(middle) * e[kEstVy]);
        y_m += dt * (std::sin(middle) * e[kEstVx] + std::cos(middle) * e[kEstVy]);
        heading_rad += dt * e[kEstYawRate];
    }
    void correct(const Readings& y, double gain) {
        const auto towards = [gain](double& value, double reading) {
            if (std::isnan(reading)) return;
            value = gain == 1.0 ? reading : value + gain * (reading - value);
        };
        towards(x_m, y[kSensePlaceX]);
        towards(y_m, y[kSensePlaceY]);
        towards(heading_rad, y[kSenseHeading]);
    }
};

/// One run of the loop; `normal` holds kSensorCount, `external` three numbers (F_x, F_y, M_z) a
/// sample.
template <class Observer>
class ClosedLoop {
  public:
    ClosedLoop(const LoopData& data, Plant plant, Observer observer)
        : data_(data),
          plant_(std::move(plant)),
          observer_(std::move(observer)),
          controller_(data.controller, data.car),
          sensors_(data.sensors, data.dt),
          driver_(data.track) {}

    LoopRecord run(const std::vector<Wanted>& wanted, const double* normal,
                   const double* external) {
        PlantState x = plant_.at_rest(data_.first_speed_mps);
        x[kPlaceX] = data_.first_x_m;
        x[kPlaceY] = data_.first_y_m;
        place_ = {data_.first_x_m, data_.first_y_m, 0.0};
        loads_ = data_.late_feedback
                     ? Axles<double>{data_.first_late_load_n, data_.first_late_load_n}
                     : data_.car.loads(0.0);
        LoopRecord out;
        out.lost_at = wanted.size();
        for (std::size_t k = 0; k < wanted.size(); ++k) {
            poll_interrupt(k);
            Plant::Externals outside{};
            std::copy(external + 3 * k, external + 3 * k + 3, outside.begin());
            perfect_.push_back(readings(x, outside));
            if (data_.late_feedback) {
                place_.correct(sensors_.read(perfect_, normal + k * kSensorCount), 1.0);
                believed_ = observer_.state();
            }
            if (data_.late_feedback || k == 0) decide(wanted[k], k);
            const Input acts = felt();
            measure(x, outside, normal + k * kSensorCount, k, out);
            if (lost(x)) {
                out.lost_at = k;
                break;
            }
            if (!data_.late_feedback && k + 1 < wanted.size()) decide(wanted[k + 1], k + 1);
            try {
                plant_.advance(x, acts, data_.inputs_linear ? felt() : acts, outside, data_.dt);
            } catch (const NumericalFailure&) {
                out.lost_at = k;
                break;
            }
        }
        return out;
    }

  private:
    /// What is done at a sample, and why.
    struct Decision {
        Wanted wanted;
        double yaw_rate_radps = 0.0, left_of_track_m = 0.0;
        Input commanded, acts;
        std::uint32_t limits = 0;
    };

    /// Decides on sample `k`, from readings of earlier samples alone unless feedback is late.
    void decide(Wanted wanted, std::size_t k) {
        if (!data_.late_feedback && k > 0) {
            place_.move(observer_.state(), data_.dt);
            believed_ = observer_.ahead();
        }
        const Input before = next_.acts;
        next_ = {};
        next_.acts = before;
        next_.acts.time_s = static_cast<double>(k) * data_.dt;
        if (data_.steer_by == SteerBy::kTrack) {
            const TrackDriver::Sight sight =
                driver_.look(place_.x_m, place_.y_m, place_.heading_rad, wanted.speed_mps);
            wanted.heading_rad = sight.heading_rad;
            next_.left_of_track_m = sight.left_of_track_m;
        }
        next_.wanted = wanted;
        next_.yaw_rate_radps = wanted.yaw_rate_radps;
        // Without a prediction there is nothing to act on before the first reading.
        if (k > 0 || data_.late_feedback) command(next_);
        steered_.push_back(next_.acts.steer_rad);
    }

    /// What acts on the car: its steering after the dead time of the plant.
    Input felt() const {
        Input u = next_.acts;
        if (!steered_.empty()) u.steer_rad = earlier(steered_, plant_.steer_delay_s() / data_.dt);
        return u;
    }

    void command(Decision& d) {
        const Estimate& e = believed_;
        d.commanded.steer_rad = d.wanted.steer_rad;
        if (data_.steer_by != SteerBy::kAngle) {
            d.yaw_rate_radps =
                controller_.yaw_rate(d.wanted, place_.heading_rad, e[kEstVx], data_.dt, d.limits);
            d.yaw_rate_radps =
                controller_.guarded(d.yaw_rate_radps, e, d.acts.steer_rad, loads_, d.limits);
            d.commanded.steer_rad = controller_.steer(d.yaw_rate_radps, e, loads_, d.limits);
        }
        d.commanded.longitudinal = controller_.force(d.wanted, e, d.limits);
        d.acts.longitudinal = follow(data_.force, d.acts.longitudinal, d.commanded.longitudinal,
                                     data_.dt, kForceLimits, d.limits);
        d.acts.steer_rad = follow(data_.steer, d.acts.steer_rad, d.commanded.steer_rad, data_.dt,
                                  kSteerLimits, d.limits);
    }

    void measure(const PlantState& x, const Plant::Externals& external, const double* normal,
                 std::size_t k, LoopRecord& out) {
        perfect_.back() = readings(x, external);  // now with the input that acts
        const Readings y = sensors_.read(perfect_, normal);
        if (!std::isnan(y[kSenseForce])) known_.longitudinal = y[kSenseForce];
        if (!std::isnan(y[kSenseSteer])) known_.steer_rad = y[kSenseSteer];
        const Vec<4> measured{y[kSenseVx], y[kSenseVy], y[kSenseYawRate], y[kSenseAy]};
        if (!data_.late_feedback) next_loads(y);
        observer_.step(known_.longitudinal, known_.steer_rad, loads_, measured);
        if (data_.late_feedback) {
            next_loads(y);
        } else {
            place_.correct(y, k > 0 ? data_.pose_gain : 1.0);
        }
        record(x, external, y, out);
    }

    void next_loads(const Readings& y) {
        if (!data_.load_sensors) {
            loads_ = data_.car.loads(known_.longitudinal);
            return;
        }
        if (!std::isnan(y[kSenseLoadFront])) loads_.front = y[kSenseLoadFront];
        if (!std::isnan(y[kSenseLoadRear])) loads_.rear = y[kSenseLoadRear];
    }

    Readings readings(const PlantState& x, const Plant::Externals& external) const {
        const Input& u = next_.acts;
        const auto y = plant_.sensed(x, felt(), external);
        const PlantTruth t = plant_.look(x, felt(), external);
        return {
            y[kVx],     y[kVy],     y[kYawRate],  y[kAx],      y[kAy],         x[kHeading],
            x[kPlaceX], x[kPlaceY], t.load_front, t.load_rear, u.longitudinal, u.steer_rad,
        };
    }

    void record(const PlantState& x, const Plant::Externals& external, const Readings& y,
                LoopRecord& out) const {
        const Decision& d = next_;
        const PlantTruth t = plant_.look(x, felt(), external);
        const auto add = [](std::vector<double>& to, std::initializer_list<double> values) {
            to.insert(to.end(), values);
        };
        add(out.truth, {x[0], x[1], x[2], x[kPlaceX], x[kPlaceY], x[kHeading]});
        add(out.truth, {t.a_x, t.a_y, t.yaw_acceleration, t.slip_front, t.slip_rear});
        add(out.truth, {t.force_front, t.force_rear, t.load_front, t.load_rear});
        out.sensed.insert(out.sensed.end(), y.begin(), y.end());
        const Estimate& e = observer_.state();
        out.estimate.insert(out.estimate.end(), e.data(), e.data() + kEstimated);
        add(out.reference,
            {d.wanted.speed_mps, d.wanted.heading_rad, d.yaw_rate_radps, d.left_of_track_m});
        add(out.inputs, {d.acts.longitudinal, d.acts.steer_rad});
        add(out.inputs, {d.commanded.longitudinal, d.commanded.steer_rad});
        out.limits.push_back(d.limits);
    }

    // Written so that a state that is not a number counts as lost.
    bool lost(const PlantState& x) const {
        const bool held = x[0] >= data_.slowest_mps &&
                          std::abs(std::atan2(x[1], x[0])) <= data_.most_sideslip_rad;
        return !held;
    }

    LoopData data_;
    Plant plant_;
    Observer observer_;
    Adrc controller_;
    Sensors sensors_;
    TrackDriver driver_;
    std::vector<Readings> perfect_;
    Reckoning place_;
    Estimate believed_ = Estimate::Zero();
    Axles<double> loads_;
    Decision next_;
    Input known_;
    std::vector<double> steered_;  // by the actuator, since the loop began
};

/// The loop around the extended-state observer.
LoopRecord run_closed_loop(const LoopData& data, const Plant& plant,
                           const LoopObserverData& observer, const std::vector<Wanted>& wanted,
                           const double* normal, const double* external);

}  // namespace sysid::lab
