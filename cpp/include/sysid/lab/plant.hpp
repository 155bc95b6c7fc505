// The car of the laboratory: the single track with its effects, its place on the ground, and the
// ways in which a simulator may compute it.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <type_traits>
#include <utility>

#include "sysid/dynamics/steer_delay.hpp"
#include "sysid/dynamics/step.hpp"

namespace sysid::lab {

enum PlantIndex : std::size_t {
    kPlaceX = kModelStates,
    kPlaceY,
    kHeading,
    kPlantStates,
};

/// v_x, v_y, r, the auxiliary states, then place [m] and heading [rad] on the ground.
using PlantState = std::array<double, kPlantStates>;

struct PlantOptions {
    // Part of the axle load that the tyre law is given and the load sensors show. 0.5: the load of
    // one of two wheels, while the force is the axle's.
    double load_share = 1.0;
    bool late_loads = false;  // the tyres feel the loads of the sample before
    // Drag and lift from v_x^2 + v_y^2 in place of v_x^2; lift acts on late loads only.
    bool air_speed_of_both = false;
    int steps = 0;           // Runge-Kutta steps per sample; 0: as many as the car needs
    double tolerance = 0.0;  // more than 0: Dormand-Prince with this tolerance instead
};

/// What only the simulator knows, at one instant.
struct PlantTruth {
    double a_x, a_y, yaw_acceleration;
    double slip_front, slip_rear;    // slip angles [rad]
    double force_front, force_rear;  // lateral axle forces [N]
    double load_front, load_rear;    // loads, as the tyre law is given them [N]
};

class Plant {
  public:
    using Parameters = std::array<double, kParameterCount>;
    using Externals = std::array<double, kExternals>;

    Plant(SingleTrack model, const double* p, const PlantOptions& options)
        : model_(std::move(model)), options_(options) {
        std::copy(p, p + kParameterCount, parameters_.begin());
        // The force per load of the law, times the share, is the force per load of the axle.
        parameters_[kDFront] *= options.load_share;
        parameters_[kDRear] *= options.load_share;
        if (options.late_loads) {
            const PlantState origin{};
            const Input still;
            const Externals calm{};
            const Workings<double> w = workings(origin, still, calm);
            loads_ = {w.fz0_f, w.fz0_r};
            model_.loads_known = true;
        }
    }

    const VehicleData& car() const { return model_.car; }
    double yaw_inertia() const { return parameters_[kYawInertia]; }
    double steer_delay_s() const { return steer_delay(model_, parameters_.data()); }

    /// Starts straight on at a speed, at (0, 0) heading along x, with settled auxiliary states.
    PlantState at_rest(double speed_mps) const {
        ModelState<double> motion{};
        motion[0] = speed_mps;
        const Externals calm{};
        const Input still;
        settle_auxiliary(model_, motion, calm.data(), still, parameters_.data());
        PlantState x{};
        std::copy(motion.begin(), motion.end(), x.begin());
        return x;
    }

    PlantTruth look(const PlantState& x, const Input& u, const Externals& external) const {
        const Workings<double> w = workings(x, u, external);
        const double share = options_.load_share;
        return {
            w.a_x,  w.a_y,  w.r_dot,        w.alpha_f,      w.alpha_r,
            w.fy_f, w.fy_r, share * w.fz_f, share * w.fz_r,
        };
    }

    /// What perfect sensors read: v_x, v_y, r, a_x, a_y with the effects that act on sensors.
    std::array<double, kChannels> sensed(const PlantState& x, const Input& u,
                                         const Externals& external) const {
        std::array<double, kChannels> y;
        model_.sense(workings(x, u, external), parameters_.data(), x.data() + kMotionStates,
                     y.data());
        return y;
    }

    /// Moves `x` over one sample, the inputs going evenly from `from` to `to`.
    void advance(PlantState& x, const Input& from, const Input& to, const Externals& external,
                 double dt) {
        Axles<double> next = loads_;
        if (options_.late_loads) {
            const Workings<double> w = workings(x, from, external);
            next = {w.fz_f, w.fz_r};
        }
        const auto rate = [&](double part, const PlantState& at) {
            return derivative(at, between(from, to, part), external);
        };
        if (options_.tolerance > 0.0) {
            dormand_prince(x, dt, options_.tolerance, rate);
        } else {
            const int n = options_.steps > 0 ? options_.steps : steps_for(x, from, external, dt);
            for (int i = 0; i < n; ++i)
                runge_kutta_step(
                    x, dt / n,
                    [&](std::size_t stage, const PlantState& at, PlantState& k) {
                        k = rate((i + kStageAt[stage]) / n, at);
                    },
                    [](auto&& use) {
                        for (std::size_t j = 0; j < kPlantStates; ++j) use(j);
                    });
        }
        loads_ = next;
    }

  private:
    /// As many as keep motion and lags at a fifth of their rates: a car has no step error.
    int steps_for(const PlantState& x, const Input& u, const Externals& external, double dt) const {
        const double speed = std::max(std::abs(x[0]), kLowestSpeed);
        double fastest = model_.fastest_rate(parameters_.data(), speed);
        PlantState rate{};
        LagStep<double> step;
        step.fastest = &fastest;
        model_.evaluate(x.data(), external.data(),
                        Lags<double>(LagStage::kRates, x.data() + kMotionStates,
                                     rate.data() + kMotionStates, step),
                        u, parameters_.data(), rate.data());
        return 4 * whole_within(std::ceil(dt * fastest / 0.8), 1, kMostSubsteps);
    }

    Workings<double> workings(const PlantState& x, const Input& u, Externals external) const {
        PlantState ignored;
        return evaluate(x, u, external, ignored);
    }

    Workings<double> evaluate(const PlantState& x, Input u, Externals external,
                              PlantState& rate) const {
        u.loads_n = loads_;
        const double sideways =
            options_.air_speed_of_both ? 0.5 * model_.car.air_density_kgpm3 * x[1] * x[1] : 0.0;
        external[kForceX] -= sideways * model_.car.drag_area_m2;
        Workings<double> w =
            model_.evaluate(x.data(), external.data(), x.data() + kMotionStates, u,
                            parameters_.data(), rate.data(), rate.data() + kMotionStates);
        for_each_active(model_.effects, parameters_.data() + kBaseParameterCount,
                        [&](auto effect, const double* own, std::size_t /*state*/) {
                            if constexpr (std::is_same_v<decltype(effect), AeroDownforce>) {
                                w.fz_f += sideways * own[0];
                                w.fz_r += sideways * own[1];
                            }
                        });
        return w;
    }

    PlantState derivative(const PlantState& x, const Input& u, const Externals& external) const {
        PlantState rate;
        evaluate(x, u, external, rate);
        const double c = std::cos(x[kHeading]);
        const double s = std::sin(x[kHeading]);
        rate[kPlaceX] = c * x[0] - s * x[1];
        rate[kPlaceY] = s * x[0] + c * x[1];
        rate[kHeading] = x[2];
        return rate;
    }

    SingleTrack model_;
    Parameters parameters_{};
    PlantOptions options_;
    Axles<double> loads_{};  // late ones: those of the sample before
};

}  // namespace sysid::lab
