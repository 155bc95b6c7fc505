#include "sysid/simulate/simulator.hpp"

#include <algorithm>
#include <cmath>

#include "sysid/dynamics/steer_delay.hpp"
#include "sysid/math/interrupt.hpp"

namespace sysid {

namespace {

// More than an estimator takes: a car has no step error. Lags converge by an order less.
constexpr int kSubsteps = 4, kSubstepsWithLags = 8;
constexpr double kLostSideslip = 0.7;  // [rad]

// Where the car is, from its first sample on.
class Place {
  public:
    void go(const ModelState<double>& x, double dt) {
        heading_ += x[2] * dt;
        const double c = std::cos(heading_), s = std::sin(heading_);
        ahead_ += (x[0] * c - x[1] * s) * dt;
        left_ += (x[0] * s + x[1] * c) * dt;
    }

    double away() const { return std::hypot(ahead_, left_); }

  private:
    double heading_ = 0.0, ahead_ = 0.0, left_ = 0.0;
};

}  // namespace

Drive simulate(const SingleTrack& model, const double* p, double dt,
               const std::vector<Reference>& references, const Driver& driver,
               const double* disturbance, const Beginning& beginning, const Logged& logged,
               double farthest_m) {
    Drive out;
    out.lost_at = references.size();
    const VehicleData& car = model.car;
    const DrivenCar known{car.mass_kg, car.lf_m + car.lr_m, car.air_density_kgpm3,
                          car.drag_area_m2};
    Hands hands(known, driver, dt);
    ModelState<double> x{};
    x[0] = beginning.v_x;
    x[1] = beginning.v_y;
    x[2] = beginning.yaw_rate;
    Input u{
        std::clamp(references.front().steer_rad + beginning.steer_rad, -driver.steer_limit_rad,
                   driver.steer_limit_rad),
        known.resistance(beginning.v_x),
        beginning.time_s,
    };
    const auto read_channels = [&](std::size_t k, Input& at) {
        at.channels.fill(std::nan(""));
        for (std::size_t i = 0; i < logged.width; ++i)
            at.channels[i] = logged.values[k * logged.width + i];
    };
    read_channels(0, u);
    // What acts is the command of a while ago, or what is logged is.
    const double late = steer_delay(model, p) / dt;
    std::vector<double> commanded{u.steer_rad};
    Input acting = u;
    std::array<double, kExternals> external{};
    settle_auxiliary(model, x, external.data(), u, p);
    const std::size_t last = references.size() - 1;
    const std::size_t delay = hands.delay(), preview = hands.preview();
    const bool bounded = std::isfinite(farthest_m);
    Place place;
    const int fewest = active_states(model.effects).count > 0 ? kSubstepsWithLags : kSubsteps;
    for (std::size_t k = 0; k < references.size(); ++k) {
        poll_interrupt(k);
        u.time_s = acting.time_s = beginning.time_s + static_cast<double>(k) * dt;
        for (std::size_t i = 0; i < kPushes; ++i) external[i] = disturbance[kPushes * k + i];
        const auto y = sense(model, x, external.data(), acting, p);
        const double written = earlier(commanded, std::max(-late, 0.0));
        out.inputs.insert(out.inputs.end(), {written, u.longitudinal});
        out.states.insert(out.states.end(), x.begin(), x.end());
        out.outputs.insert(out.outputs.end(), y.begin(), y.end());
        // Written so that a state that is not a number counts as lost.
        const bool under_control =
            x[0] >= kLowestSpeed && std::abs(std::atan2(x[1], x[0])) <= kLostSideslip;
        if (bounded && k > 0) place.go(x, dt);
        if (!under_control || place.away() > farthest_m) {
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
        read_channels(std::min(k + 1, last), next);
        const int substeps = std::max(fewest, substeps_for(model, p, x[0], dt));
        commanded.push_back(next.steer_rad);
        Input then_acting = next;
        then_acting.steer_rad = earlier(commanded, std::max(late, 0.0));
        advance(model, x, external.data(), acting, then_acting, p, dt, substeps);
        u = next;
        acting = then_acting;
    }
    return out;
}

}  // namespace sysid
