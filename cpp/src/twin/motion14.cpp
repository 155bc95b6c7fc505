// How the car moves: its steps, and its state of rest.
#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "sysid/math/integrate.hpp"
#include "sysid/math/interrupt.hpp"
#include "sysid/math/linear.hpp"
#include "sysid/twin/vehicle14.hpp"

namespace sysid {

namespace {

using namespace state14;

constexpr double kStable = 2.0;  // rate times step that the Runge-Kutta method takes with ease
constexpr double kMostParts = 1000.0;

}  // namespace

int Vehicle14::parts(const State14& x, const Input14& u, double dt) const {
    const double speed = std::max(std::abs(x[Vx]), kSlowest);
    double fastest = speed * fastest_relaxation_;
    for (std::size_t i = 0; i < kWheels; ++i) {
        double pace = slip_pace_[i / 2] / speed;
        if (std::abs(x[kWheelSpeed + i]) < 5.0 * kStandingWheel)
            pace += u.brake_nm[i] / kStandingWheel * w_.per_inertia[i];
        fastest = std::max(fastest, pace);
    }
    const double wanted = std::ceil(fastest * dt / kStable);
    // Asked so that a state that is no number takes one part; the caller sees where it leads.
    if (!(wanted > 1.0)) return 1;
    return wanted < kMostParts ? static_cast<int>(wanted) : static_cast<int>(kMostParts);
}

void Vehicle14::step(State14& x, const Input14& u, double dt) const {
    travel_along(x, u, Steered(u), dt, nullptr);
}

void Vehicle14::step(State14& x, const Input14& u, const Steered& steered, double dt) const {
    travel_along(x, u, steered, dt, nullptr);
}

void Vehicle14::read_and_step(State14& x, const Input14& u, double dt, Output14& out) const {
    const Steered steered(u);
    State14 first;
    rates(x, u, steered, first, &out);
    travel_along(x, u, steered, dt, &first);
}

void Vehicle14::travel_along(State14& x, const Input14& u, const Steered& steered, double dt,
                             const State14* first) const {
    const int n = parts(x, u, dt);
    const double part = dt / n;
    for (int m = 0; m < n; ++m) {
        // Within one step the heading hardly turns, so the series of its change is exact.
        const double yaw = x[Yaw], c0 = std::cos(yaw), s0 = std::sin(yaw);
        const auto stage = [&](std::size_t number, const State14& at, State14& k) {
            if (number == 0 && m == 0 && first != nullptr)
                k = *first;
            else
                rates(at, u, steered, k, nullptr);
            const double d = at[Yaw] - yaw;
            const double cd = 1.0 - 0.5 * d * d, sd = d * (1.0 - d * d / 6.0);
            const double c = c0 * cd - s0 * sd, s = s0 * cd + c0 * sd;
            k[X] = c * at[Vx] - s * at[Vy];
            k[Y] = s * at[Vx] + c * at[Vy];
        };
        runge_kutta_step(x, part, stage, [&](auto&& use) {
            for (std::size_t i = 0; i < states_; ++i) use(i);
        });
    }
}

State14 Vehicle14::rest(double vx) const {
    State14 x{};
    x[Vx] = vx;
    for (std::size_t i = 0; i < kWheels; ++i) x[kWheelSpeed + i] = vx / w_.radius[i];
    // Height, roll, pitch and four wheels, such that nothing accelerates: Newton's method.
    constexpr std::array<std::size_t, 7> at{Z, Roll, Pitch, 12, 13, 14, 15};
    constexpr std::array<std::size_t, 7> must{Vz, P, Q, 16, 17, 18, 19};
    const Input14 u;
    State14 rate;
    for (int iteration = 0; iteration < 12; ++iteration) {
        evaluate(x, u, rate, nullptr);
        Vec<7> miss;
        Mat<7, 7> slope;
        for (int j = 0; j < 7; ++j) miss[j] = rate[must[static_cast<std::size_t>(j)]];
        if (miss.norm() < 1e-9) return x;
        const double step = 1e-6;
        for (int j = 0; j < 7; ++j) {
            State14 near = x;
            near[at[static_cast<std::size_t>(j)]] += step;
            evaluate(near, u, rate, nullptr);
            for (int i = 0; i < 7; ++i)
                slope(i, j) = (rate[must[static_cast<std::size_t>(i)]] - miss[i]) / step;
        }
        const Vec<7> change = slope.partialPivLu().solve(miss);
        for (int j = 0; j < 7; ++j) x[at[static_cast<std::size_t>(j)]] -= change[j];
    }
    evaluate(x, u, rate, nullptr);
    for (const std::size_t i : must)
        if (!(std::abs(rate[i]) < 1e-6))
            throw std::invalid_argument(
                "the car finds no rest: check its masses, springs and centre of mass");
    return x;
}

void simulate14(const Vehicle14& car, State14& x, const Input14* inputs, std::size_t n, double dt,
                double* states, double* outputs) {
    Output14 y;
    for (std::size_t k = 0; k < n; ++k) {
        poll_interrupt(k);
        states = std::copy_n(x.begin(), kTwinStates, states);
        car.read_and_step(x, inputs[k], dt, y);
        outputs = std::copy(y.begin(), y.end(), outputs);
    }
}

}  // namespace sysid
