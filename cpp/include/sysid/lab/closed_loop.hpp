// Plant, sensors, observer, controller and actuators in one loop.
//
// The observer is any type with
//   void step(double force_n, double steer_rad, const AxleLoads&, const Vec<4>& y)
//       moves on to the present sample and uses its reading, v_x, v_y, r, a_y or NaN
//   const Estimate& state() const   after the last step, or at the start
//   Estimate ahead() const          one sample later, if the inputs stay
// Nothing but readings of sensors reaches it or the controller.
#pragma once

#include <cstdint>
#include <vector>

#include "sysid/lab/adrc.hpp"
#include "sysid/lab/loop_observer.hpp"
#include "sysid/lab/plant.hpp"
#include "sysid/lab/sensors.hpp"
#include "sysid/lab/track.hpp"

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
        const auto mend = [gain](double& value, double reading) {
            if (std::isnan(reading)) return;
            value = gain == 1.0 ? reading : value + gain * (reading - value);
        };
        mend(x_m, y[kSensePlaceX]);
        mend(y_m, y[kSensePlaceY]);
        mend(heading_rad, y[kSenseHeading]);
    }
};

/// One run of the loop; `normal` holds kSensorCount, `push` three numbers (F_x, F_y, M_z) a sample.
template <class Observer>
class ClosedLoop {
  public:
    ClosedLoop(const LoopData& data, const Plant& plant, Observer observer)
        : data_(data),
          plant_(plant),
          observer_(std::move(observer)),
          controller_(data.controller, data.car),
          sensors_(data.sensors, data.dt),
          driver_(data.track) {}

    LoopRecord run(const std::vector<Wanted>& wanted, const double* normal, const double* push) {
        PlantState x = plant_.at_rest(data_.first_speed_mps);
        x[kPlaceX] = data_.first_x_m;
        x[kPlaceY] = data_.first_y_m;
        place_ = {data_.first_x_m, data_.first_y_m, 0.0};
        loads_ = data_.late_feedback ? AxleLoads{data_.first_late_load_n, data_.first_late_load_n}
                                     : data_.car.loads(0.0);
        LoopRecord out;
        out.lost_at = wanted.size();
        for (std::size_t k = 0; k < wanted.size(); ++k) {
            Plant::Pushes outside{};
            std::copy(push + 3 * k, push + 3 * k + 3, outside.begin());
            step(wanted[k], x, outside, normal + k * kSensorCount, k, out);
            if (lost(x)) {
                out.lost_at = k;
                break;
            }
            try {
                plant_.advance(x, input_, outside, data_.dt);
            } catch (const NumericalFailure&) {
                out.lost_at = k;
                break;
            }
        }
        return out;
    }

  private:
    void step(Wanted wanted, const PlantState& x, const Plant::Pushes& push, const double* normal,
              std::size_t k, LoopRecord& out) {
        perfect_.push_back(readings(x, push));
        if (data_.late_feedback) {
            place_.correct(sensors_.read(perfect_, normal), 1.0);
            believed_ = observer_.state();
        } else if (k > 0) {
            place_.move(observer_.state(), data_.dt);
            believed_ = observer_.ahead();
        }
        std::uint32_t limits = 0;
        double beside = 0.0;
        if (data_.steer_by == SteerBy::kTrack) {
            const TrackDriver::Sight sight =
                driver_.look(place_.x_m, place_.y_m, place_.heading_rad, wanted.speed_mps);
            wanted.heading_rad = sight.heading_rad;
            beside = sight.left_of_track_m;
        }
        // Without a prediction there is nothing to act on before the first reading.
        const double yaw_rate =
            k > 0 || data_.late_feedback ? command(wanted, limits) : wanted.yaw_rate_radps;
        perfect_.back() = readings(x, push);  // now with the input that acts
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
        record(wanted, x, push, y, {yaw_rate, beside}, limits, out);
    }

    /// Sets `input_` and `commanded_`; returns the yaw rate that is wanted.
    double command(const Wanted& wanted, std::uint32_t& limits) {
        const Estimate& e = believed_;
        double yaw_rate = wanted.yaw_rate_radps;
        commanded_.steer_rad = wanted.steer_rad;
        if (data_.steer_by != SteerBy::kAngle) {
            yaw_rate =
                controller_.yaw_rate(wanted, place_.heading_rad, e[kEstVx], data_.dt, limits);
            commanded_.steer_rad = controller_.steer(yaw_rate, e, loads_, limits);
        }
        commanded_.longitudinal = controller_.force(wanted, e, limits);
        input_.longitudinal = follow(data_.force, input_.longitudinal, commanded_.longitudinal,
                                     data_.dt, kForceLimits, limits);
        input_.steer_rad = follow(data_.steer, input_.steer_rad, commanded_.steer_rad, data_.dt,
                                  kSteerLimits, limits);
        return yaw_rate;
    }

    void next_loads(const Readings& y) {
        if (!data_.load_sensors) {
            loads_ = data_.car.loads(known_.longitudinal);
            return;
        }
        if (!std::isnan(y[kSenseLoadFront])) loads_.front_n = y[kSenseLoadFront];
        if (!std::isnan(y[kSenseLoadRear])) loads_.rear_n = y[kSenseLoadRear];
    }

    Readings readings(const PlantState& x, const Plant::Pushes& push) const {
        const auto y = plant_.sensed(x, input_, push);
        const PlantTruth t = plant_.look(x, input_, push);
        return {
            y[kVx],       y[kVy],      y[kYawRate],         y[kAx],
            y[kAy],       x[kHeading], x[kPlaceX],          x[kPlaceY],
            t.load_front, t.load_rear, input_.longitudinal, input_.steer_rad,
        };
    }

    void record(const Wanted& wanted, const PlantState& x, const Plant::Pushes& push,
                const Readings& y, const std::array<double, 2>& reference, std::uint32_t limits,
                LoopRecord& out) const {
        const PlantTruth t = plant_.look(x, input_, push);
        out.truth.insert(out.truth.end(), {
                                              x[0],
                                              x[1],
                                              x[2],
                                              x[kPlaceX],
                                              x[kPlaceY],
                                              x[kHeading],
                                              t.a_x,
                                              t.a_y,
                                              t.yaw_acceleration,
                                              t.slip_front,
                                              t.slip_rear,
                                              t.force_front,
                                              t.force_rear,
                                              t.load_front,
                                              t.load_rear,
                                          });
        out.sensed.insert(out.sensed.end(), y.begin(), y.end());
        const Estimate& e = observer_.state();
        out.estimate.insert(out.estimate.end(), e.data(), e.data() + kEstimated);
        out.reference.insert(out.reference.end(),
                             {wanted.speed_mps, wanted.heading_rad, reference[0], reference[1]});
        out.inputs.insert(out.inputs.end(), {
                                                input_.longitudinal,
                                                input_.steer_rad,
                                                commanded_.longitudinal,
                                                commanded_.steer_rad,
                                            });
        out.limits.push_back(limits);
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
    AxleLoads loads_;
    Input input_, commanded_, known_;
};

/// The loop around the extended-state observer.
LoopRecord run_closed_loop(const LoopData& data, const Plant& plant,
                           const LoopObserverData& observer, const std::vector<Wanted>& wanted,
                           const double* normal, const double* push);

}  // namespace sysid::lab
