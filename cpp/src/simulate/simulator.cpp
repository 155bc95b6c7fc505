#include "sysid/simulate/simulator.hpp"

#include <cmath>

#include "sysid/math/interrupt.hpp"

namespace sysid {

namespace {

// More than an estimator takes: a car has no step error. Lags converge by an order less.
constexpr int kSubsteps = 4, kSubstepsWithLags = 8;
constexpr double kLostSideslip = 0.7;  // [rad]

double towards(double from, double to, double step) {
    return from + std::clamp(to - from, -step, step);
}

/// What the driver saw, `reaction_s` ago.
struct Seen {
    double speed_mps;
    double yaw_rate_radps;
    Reference reference;
};

/// Decides the next steering angle and force: what the path ahead needs, mended by what was seen.
class Hands {
  public:
    Hands(const SingleTrack& model, const Driver& driver, double dt)
        : model_(model), driver_(driver), dt_(dt) {}

    Input next(const Input& now, const Reference& ahead, double acceleration, const Seen& seen) {
        return {
            towards(now.steer_rad, steer(now, ahead, seen), driver_.steer_rate_limit_radps * dt_),
            towards(now.longitudinal, force(ahead, acceleration, seen),
                    driver_.force_rate_limit_nps * dt_),
        };
    }

  private:
    double steer(const Input& now, const Reference& ahead, const Seen& seen) {
        double angle = ahead.steer_rad;
        if (driver_.tracks_path) {
            const double wheelbase = model_.car.lf_m + model_.car.lr_m;
            const double v = std::max(seen.speed_mps, kLowestSpeed);
            const double steer_per_curvature = wheelbase + driver_.understeer_radps2pm * v * v;
            const double error = seen.reference.curvature_radpm * v - seen.yaw_rate_radps;
            // Steering that has reached its stop must not wind up the integral.
            const double stop = std::copysign(driver_.steer_limit_rad, error);
            if (std::abs(now.steer_rad - stop) > 1e-9) integral_ += error * dt_;
            const double mending =
                driver_.yaw_rate_gain * error + driver_.yaw_rate_integral_ps * integral_;
            angle += steer_per_curvature * (ahead.curvature_radpm + mending / v);
        }
        return std::clamp(angle, -driver_.steer_limit_rad, driver_.steer_limit_rad);
    }

    double force(const Reference& ahead, double acceleration, const Seen& seen) const {
        const double v = std::max(seen.speed_mps, kLowestSpeed);
        const double drag = 0.5 * model_.car.air_density_kgpm3 * model_.car.drag_area_m2;
        const double error = seen.reference.speed_mps - seen.speed_mps;
        const double pull = model_.car.mass_kg * (acceleration + driver_.speed_gain_ps * error) +
                            drag * ahead.speed_mps * ahead.speed_mps;
        const double most = std::min(driver_.drive_limit_n, driver_.power_limit_w / v);
        return std::clamp(pull, -driver_.brake_limit_n, most);
    }

    const SingleTrack& model_;
    const Driver& driver_;
    double dt_;
    double integral_ = 0.0;
};

}  // namespace

Drive simulate(const SingleTrack& model, const double* p, double dt,
               const std::vector<Reference>& references, const Driver& driver,
               const double* disturbance, const Beginning& beginning) {
    Drive out;
    out.lost_at = references.size();
    Hands hands(model, driver, dt);
    ModelState<double> x{};
    x[0] = beginning.v_x;
    x[1] = beginning.v_y;
    x[2] = beginning.yaw_rate;
    Input u{
        std::clamp(references.front().steer_rad + beginning.steer_rad, -driver.steer_limit_rad,
                   driver.steer_limit_rad),
        0.5 * model.car.air_density_kgpm3 * model.car.drag_area_m2 * beginning.v_x * beginning.v_x,
        beginning.time_s,
    };
    std::array<double, kExternals> external{};
    settle_auxiliary(model, x, external.data(), u, p);
    const std::size_t last = references.size() - 1;
    const auto delay = static_cast<std::size_t>(std::lround(driver.reaction_s / dt));
    // Half of the reaction time is made up for by looking ahead; open-loop steering keeps its time.
    const std::size_t preview = driver.tracks_path ? 1 + delay / 2 : 1;
    const int fewest = active_states(model.effects).count > 0 ? kSubstepsWithLags : kSubsteps;
    for (std::size_t k = 0; k < references.size(); ++k) {
        poll_interrupt(k);
        u.time_s = beginning.time_s + static_cast<double>(k) * dt;
        for (std::size_t i = 0; i < kMotionStates; ++i) external[i] = disturbance[3 * k + i];
        const auto y = sense(model, x, external.data(), u, p);
        out.inputs.insert(out.inputs.end(), {u.steer_rad, u.longitudinal});
        out.states.insert(out.states.end(), x.begin(), x.end());
        out.outputs.insert(out.outputs.end(), y.begin(), y.end());
        // Written so that a state that is not a number counts as lost.
        const bool under_control =
            x[0] >= kLowestSpeed && std::abs(std::atan2(x[1], x[0])) <= kLostSideslip;
        if (!under_control) {
            out.lost_at = k;
            break;
        }
        const std::size_t then = k > delay ? k - delay : 0;
        const double* state = &out.states[then * kModelStates];
        const std::size_t ahead = std::min(k + preview, last);
        const double acceleration =
            ahead > 0 ? (references[ahead].speed_mps - references[ahead - 1].speed_mps) / dt : 0.0;
        Input next =
            hands.next(u, references[ahead], acceleration, {state[0], state[2], references[then]});
        next.time_s = u.time_s + dt;
        const int substeps = std::max(fewest, substeps_for(model, p, x[0], dt));
        advance(model, x, external.data(), u, next, p, dt, substeps);
        u = next;
    }
    return out;
}

}  // namespace sysid
