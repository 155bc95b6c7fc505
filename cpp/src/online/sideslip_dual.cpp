#include "sysid/online/sideslip_dual.hpp"

#include <algorithm>
#include <utility>

namespace sysid {

namespace {

constexpr double kSteerUnknown = 0.15;  // random walk of its angle [rad/sqrt(s)]
constexpr double kAtOrigin = 1.5;  // error of the curve's slope there over that at larger slips
/// What a tyre filter expects, each over the settings: errors of the tyre model, bank of the road
/// and how long it lasts, change of the friction, errors of what is told of the car, offsets of
/// sensors with forces from outside, and slip without force. How large offsets are has nothing to
/// do with how well tyres are known, and no reading tells slip without force: but for a car that is
/// all as told, the filters have these in full. Banks act like offsets where they last: where one
/// filter takes readings for the one and another for the others, the band is wide. `doubt` is the
/// logarithm by which it is less likely before any reading.
struct Departures {
    double model, road, road_lasts, grip, car, offsets, slip, doubt;
};
constexpr std::array<Departures, 6> kDepartures = {{
    {0.12, 0.12, 1.0, 1.0, 0.02, 0.02, 0.12, 0.0},
    {0.12, 0.12, 1.0, 1.0, 0.02, 1.0, 1.0, 0.0},
    {0.45, 0.45, 1.0, 1.0, 0.02, 1.0, 1.0, 0.0},
    {2.0, 2.0, 1.0, 1.0, 0.02, 1.0, 1.0, 0.0},
    // Banks: slow, as quick ones are the body that rolls; with the friction of the others, as a
    // bank and less friction together explain a slide that there is not.
    {0.2, 40.0, 10.0, 1.0, 0.05, 0.02, 1.0, 5.0},
    {0.45, 0.45, 1.0, 5.0, 1.0, 1.0, 1.0, 0.0},  // other tyres or inertia than was told
}};
constexpr double kWeightTimeS = 5.0;  // of readings that decide between them
// Errors of the model make innovations that follow each other: one tells less than its likelihood.
constexpr double kCounts = 0.2;
constexpr double kGivesUpAfterS = 3.0;  // longer than most faults of a sensor
constexpr double kAgainstAfterwards = 5.0;
constexpr double kMostAgainst = 10.0;  // of the log weights, so that none is lost for good

/// The same, with other errors of model and road.
ObserverSettings expecting(ObserverSettings s, const Departures& d) {
    for (double* error :
         {&s.error_load, &s.error_lateral, &s.error_drive, &s.yaw_walk_radps, &s.sideslip_walk_rad})
        *error *= d.model;
    s.error_slip_rad *= d.slip;
    s.road_mps2 *= d.road;
    s.road_time_s *= d.road_lasts;
    s.friction_prior *= d.grip;
    for (double* told : {&s.inertia_prior, &s.ahead_m, &s.steer_late_s}) *told *= d.car;
    for (double* offset : {&s.steer_offset_rad, &s.ay_bias_mps2, &s.yaw_rate_bias_radps,
                           &s.push_mps2, &s.turn_radps2})
        *offset *= d.offsets;
    return s;
}

template <std::size_t... i>
std::array<TyreObserver, sizeof...(i)> observers(const ObservedCar& car,
                                                 const ObserverSettings& settings,
                                                 std::index_sequence<i...>) {
    static_assert(sizeof...(i) == kDepartures.size());
    return {TyreObserver(car, expecting(settings, kDepartures[i]))...};
}

}  // namespace

template <class S>
void ForceModel::predict(const Input& u, const S* x, S* next) const {
    const double sine = std::sin(u.steer), cosine = std::cos(u.steer);
    const VehicleData& c = car.data;
    for (int i = 0; i < kStates; ++i) next[i] = x[i];
    next[kVx] += u.dt * ((x[kFx] - sine * x[kFyf]) / c.mass_kg + x[kVx] * x[kYawRate] * u.tan_beta);
    next[kYawRate] +=
        (u.dt / car.yaw_inertia_kgm2) * (c.lf_m * cosine * x[kFyf] - c.lr_m * x[kFyr]);
}

template <class S>
void ForceModel::observe(const Input& u, const S* x, S* y) const {
    const double sine = std::sin(u.steer), cosine = std::cos(u.steer);
    y[0] = x[kVx];
    y[1] = x[kYawRate];
    y[2] = (x[kFx] - sine * x[kFyf]) / car.data.mass_kg;
    y[3] = (cosine * x[kFyf] + x[kFyr]) / car.data.mass_kg;
}

Mat<5, 5> ForceModel::process_noise(const Input& u) const {
    const VehicleData& c = car.data;
    const double root = settings.force_walk * std::sqrt(u.dt);
    const double weight = c.mass_kg * kGravity;
    // A force that has changed by the end of the interval has acted with half the change.
    Mat<5, 3> G = Mat<5, 3>::Zero();
    G(kFyf, 0) = root * u.fz_f;
    G(kFyr, 1) = root * u.fz_r;
    G(kFx, 2) = settings.fx_walk * std::sqrt(u.dt) * weight;
    const double half = 0.5 * u.dt;
    G(kYawRate, 0) = half * c.lf_m / car.yaw_inertia_kgm2 * G(kFyf, 0);
    G(kYawRate, 1) = -half * c.lr_m / car.yaw_inertia_kgm2 * G(kFyr, 1);
    G(kVx, 2) = half / c.mass_kg * G(kFx, 2);
    Mat<5, 5> Q = G * G.transpose();
    Q(kVx, kVx) += 1e-10;
    Q(kYawRate, kYawRate) += 1e-14;
    return Q;
}

Mat<4, 4> ForceModel::measurement_noise(const Input&) const {
    const ObserverSettings& s = settings;
    return Vec<4>(s.vx_mps * s.vx_mps, s.yaw_rate_radps * s.yaw_rate_radps, s.ax_mps2 * s.ax_mps2,
                  s.ay_mps2 * s.ay_mps2)
        .asDiagonal();
}

SideslipDual::SideslipDual(const ObservedCar& car, const ObserverSettings& settings)
    : car_(car),
      settings_(settings),
      watch_(settings),
      forces_(ForceModel{car, settings}, Vec<5>::Zero(), Mat<5, 5>::Identity()),
      tyres_{observers(car, settings, std::make_index_sequence<kMembers>())} {
    log_weights_.fill(0.0);
    weigh();
}

const SideslipEstimate& SideslipDual::step(double dt, const SensorSample& sample) {
    const SensorSample s = watch_.look(dt, sample, index_);
    const double speed =
        std::isnan(s.vx_mps) && started_ ? forces_.state().mean[ForceModel::kVx] : s.vx_mps;
    if (!watch_.fast_enough(speed)) {
        started_ = false;
        out_ = rolling_without_slip(car_.data.lf_m, car_.data.lr_m, s);
    } else {
        const bool fresh = !started_ || dt > kForgottenAfterS;
        if (fresh) start(dt, s);
        run(fresh ? std::min(dt, kLongestStepS) : dt, s);
        const bool again = tyres_[likeliest()].lost();
        if (again) {
            start(dt, s);
        } else {
            for (TyreObserver& one : tyres_)
                if (one.lost()) one.start(dt, s, input_);
        }
        report(sample);
        if (again || watch_.refused()) out_.mode = ObserverMode::kCoasting;
    }
    ++index_;
    return out_;
}

void SideslipDual::run(double dt, const SensorSample& s) {
    if (watch_.steer_lost() != steer_lost_) {
        steer_lost_ = !steer_lost_;
        for (TyreObserver& one : tyres_) steer_lost_ ? one.steer_lost() : one.steer_found();
        if (!steer_lost_) input_.steer = input_.steer_slow = s.steer_rad;  // turned meanwhile
    }
    const double steer = input_.steer, vx = input_.vx;
    in_short_steps(dt, [&](double part, double share) {
        if (share < 1.0) {
            const double speed = vx + share * (s.vx_mps - vx), none = std::nan("");
            const SensorSample between{
                steer + share * (s.steer_rad - steer), speed, none, none, none,
            };
            run_tyres(part, between);
            run_forces(part, between);
        } else {
            run_tyres(part, s);
            run_forces(part, s);
        }
    });
}

void SideslipDual::start(double dt, const SensorSample& s) {
    const auto or_zero = [](double v) { return std::isnan(v) ? 0.0 : v; };
    const VehicleData& c = car_.data;
    const double speed = std::max(or_zero(s.vx_mps), kSlowestMps);
    const double r = or_zero(s.yaw_rate_radps), ay = or_zero(s.ay_mps2), ax = or_zero(s.ax_mps2);
    const double share = c.lr_m / car_.wheelbase_m(), weight = c.mass_kg * kGravity;
    Vec<5> a, deviation;
    a << speed, r, share * c.mass_kg * ay, (1.0 - share) * c.mass_kg * ay, c.mass_kg * ax;
    deviation << 0.5, 0.1, 0.3 * weight, 0.3 * weight, 0.3 * weight;
    forces_.restart(a, deviation.cwiseAbs2().asDiagonal());
    input_ = {};
    input_.loads = axle_forces(car_, ax, speed);
    input_.steer = input_.steer_slow = s.steer_rad;
    input_.vx = speed;
    input_.ax = ax;
    for (TyreObserver& one : tyres_) one.start(dt, s, input_);
    started_ = true;
}

void SideslipDual::run_tyres(double dt, const SensorSample& s) {
    const Vec<5>& a = forces_.state().mean;
    TyreModel::Input& u = input_;
    u.dt = dt;
    u.steer_before = u.steer;
    u.vx_before = u.vx;
    u.ax_before = u.ax;
    u.steer = s.steer_rad;
    u.steer_slow_before = u.steer_slow;
    u.steer_slow = u.steer + std::exp(-dt / TyreModel::kSteerLagS) * (u.steer_slow - u.steer);
    // Not the raw reading: its vibration would take grip, and always take it.
    u.ax = (a[ForceModel::kFx] - std::sin(u.steer) * a[ForceModel::kFyf]) / car_.data.mass_kg;
    u.vx = std::max(std::isnan(s.vx_mps) ? u.vx_before + dt * u.ax : s.vx_mps, kSlowestMps);
    u.loads = axle_forces(car_, u.ax, u.vx);
    u.slip_f_walk = watch_.steer_gap_s() > 0.0 && !steer_lost_ ? kSteerUnknown : 0.0;
    u.steer_walk = steer_lost_ ? kSteerUnknown : 0.0;
    const double keep = std::exp(-dt / kWeightTimeS);
    for (std::size_t i = 0; i < kMembers; ++i) {
        tyres_[i].step(u, s);
        log_weights_[i] = keep * log_weights_[i] + kCounts * tyres_[i].log_likelihood();
    }
    weigh();
    // One that trusts the model and was refuted goes on from where a more cautious one stands, as
    // models interact in Blom & Bar-Shalom (IEEE Trans. Autom. Control 33, 1988).
    const std::size_t best = likeliest();
    for (std::size_t i = 0; i < kMembers; ++i) {
        refuted_s_[i] = log_weights_[i] > -kMostAgainst ? 0.0 : refuted_s_[i] + dt;
        if (i < best && refuted_s_[i] > kGivesUpAfterS) {
            tyres_[i].adopt(tyres_[best]);
            log_weights_[i] = -kAgainstAfterwards;
            refuted_s_[i] = 0.0;
        }
    }
}

void SideslipDual::weigh() {
    const double most = *std::max_element(log_weights_.begin(), log_weights_.end());
    double sum = 0.0;
    for (std::size_t i = 0; i < kMembers; ++i) {
        log_weights_[i] = std::max(log_weights_[i] - most, -kMostAgainst);
        weights_[i] = std::exp(log_weights_[i] - kDepartures[i].doubt);
        sum += weights_[i];
    }
    for (double& w : weights_) w /= sum;
}

std::size_t SideslipDual::likeliest() const {
    std::size_t best = 0;
    for (std::size_t i = 1; i < kMembers; ++i)
        if (weights_[i] > weights_[best]) best = i;
    return best;
}

double SideslipDual::mean_of(int state) const {
    double mean = 0.0;
    for (std::size_t i = 0; i < kMembers; ++i)
        mean += weights_[i] * tyres_[i].filter().state().mean[state];
    return mean;
}

double SideslipDual::std_of(int state) const {
    const double mean = mean_of(state);
    double variance = 0.0;
    for (std::size_t i = 0; i < kMembers; ++i) {
        const auto& b = tyres_[i].filter().state();
        const double own =
            state == TyreModel::kBeta ? tyres_[i].sideslip_variance() : b.covariance(state, state);
        variance += weights_[i] * (own + squared(b.mean[state] - mean));
    }
    return std::sqrt(variance);
}

void SideslipDual::run_forces(double dt, const SensorSample& s) {
    const TyreObserver& b = tyres_[likeliest()];
    const Vec<2>& used = b.filter().used();
    if (used.hasNaN()) {
        // Nobody feels the forces: they are what the tyre model makes of the driving.
        double front = 0.0, rear = 0.0;
        b.forces(front, rear);
        Vec<5> x = forces_.state().mean;
        Mat<5, 5> P = forces_.state().covariance;
        x[ForceModel::kFyf] = front;
        x[ForceModel::kFyr] = rear;
        P.middleRows<2>(ForceModel::kFyf).setZero();
        P.middleCols<2>(ForceModel::kFyf).setZero();
        P(ForceModel::kFyf, ForceModel::kFyf) =
            squared(b.input().error_f_n + 0.1 * std::abs(front));
        P(ForceModel::kFyr, ForceModel::kFyr) = squared(b.input().error_r_n + 0.1 * std::abs(rear));
        x[ForceModel::kYawRate] = mean_of(TyreModel::kYawRate);
        forces_.restart(x, P);
    }
    const ForceModel::Input u{
        dt, s.steer_rad, std::tan(mean_of(TyreModel::kBeta)), input_.loads.fz_f, input_.loads.fz_r,
    };
    forces_.step(u, Vec<4>(s.vx_mps, used[0], s.ax_mps2, used[1]));
}

void SideslipDual::report(const SensorSample& s) {
    const auto& a = forces_.state();
    const Filter<TyreModel>& b = tyres_[likeliest()].filter();
    const double weight = car_.data.mass_kg * kGravity / car_.wheelbase_m();
    out_.beta_rad = mean_of(TyreModel::kBeta);
    out_.beta_std_rad = std_of(TyreModel::kBeta);
    out_.vx_mps = a.mean[ForceModel::kVx];
    out_.yaw_rate_radps = mean_of(TyreModel::kYawRate);
    out_.fyf_n = a.mean[ForceModel::kFyf];
    out_.fyr_n = a.mean[ForceModel::kFyr];
    out_.fx_n = a.mean[ForceModel::kFx];
    out_.cf_npr =
        car_.front.slope() * weight * car_.data.lr_m * std::exp(mean_of(TyreModel::kStiffF));
    out_.cr_npr =
        car_.rear.slope() * weight * car_.data.lf_m * std::exp(mean_of(TyreModel::kStiffR));
    out_.cf_std_npr =
        out_.cf_npr * std::hypot(std_of(TyreModel::kStiffF), kAtOrigin * settings_.error_curve);
    out_.cr_std_npr =
        out_.cr_npr * std::hypot(std_of(TyreModel::kStiffR), kAtOrigin * settings_.error_curve);
    out_.mu_f = car_.front.D * std::exp(mean_of(TyreModel::kGripF));
    out_.mu_r = car_.rear.D * std::exp(mean_of(TyreModel::kGripR));
    out_.mu_f_std = out_.mu_f * std_of(TyreModel::kGripF);
    out_.mu_r_std = out_.mu_r * std_of(TyreModel::kGripR);
    out_.nis = b.nis();
    out_.observed = b.state().update.observed;
    out_.log_likelihood = LogDensity::of(b.state().update);
    const bool whole = !b.used().hasNaN() && !std::isnan(s.steer_rad + s.vx_mps + s.ax_mps2);
    out_.mode = whole ? ObserverMode::kRunning : ObserverMode::kCoasting;
}

}  // namespace sysid
