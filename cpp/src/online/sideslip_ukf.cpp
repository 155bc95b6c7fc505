#include "sysid/online/sideslip_ukf.hpp"

namespace sysid {

namespace {

constexpr double kSharingTime_s = 0.1;
constexpr double kBlindBraking_mps2 = 5.0;  // how fast a speed may change that is not measured
constexpr double kBlindSteering_s = 0.1;    // for how long an angle that is not read errs alike

}  // namespace

template <class S>
void SideslipModel::lateral(double steer, double vx, double r, const Input& u, const S* x, S& front,
                            S& rear) const {
    const VehicleData& c = car.data;
    using std::sin;
    using std::sqrt;
    const S tangent = sin(x[0]) / sqrt(1.0 - sin(x[0]) * sin(x[0]));
    const Axles<S> alpha = slip_angles(S(1.0), tangent, S(r / vx), c.lf_m, c.lr_m, steer);
    if (linear) {
        const Axles<double> rest = static_loads(c.mass_kg * kGravity, c.lf_m, c.lr_m);
        front = car.front.slope() * rest.front * alpha.front;
        rear = car.rear.slope() * rest.rear * alpha.rear;
        return;
    }
    const S one = S(1.0);
    front = axle_force<S>(alpha.front, u.fz_f, value_of(x[1]), car.front, one, one);
    rear = axle_force<S>(alpha.rear, u.fz_r, value_of(x[2]), car.rear, one, one);
}

template <class S>
S SideslipModel::beta_rate(double steer, double vx, double r, const Input& u, const S* x) const {
    using std::cos;
    using std::sin;
    S front, rear;
    lateral(steer, vx, r, u, x, front, rear);
    const S across =
        x[1] * sin(steer - x[0]) + front * cos(steer - x[0]) + rear * cos(x[0]) - x[2] * sin(x[0]);
    return across * cos(x[0]) / (car.data.mass_kg * vx) - r;
}

template <class S>
void SideslipModel::predict(const Input& u, const S* x, S* next) const {
    // Heun's rule: at low speed the tyres answer within a few samples.
    const S first = beta_rate(u.steer_before, u.vx_before, u.yaw_rate_before, u, x);
    const S trial[3] = {x[0] + u.dt * first, x[1], x[2]};
    const S second = beta_rate(u.steer, u.vx, u.yaw_rate, u, trial);
    next[0] = x[0] + 0.5 * u.dt * (first + second);
    // a_x tells the sum of the longitudinal forces alone: how they are shared is taken from the
    // car.
    const S total = x[1] + x[2];
    const double share =
        value_of(total) < 0.0 ? car.data.brake_front_share : car.data.drive_front_share;
    const double keep = std::exp(-u.dt / kSharingTime_s);
    next[1] = share * total + keep * (x[1] - share * total);
    next[2] = (1.0 - share) * total + keep * (x[2] - (1.0 - share) * total);
}

template <class S>
void SideslipModel::observe(const Input& u, const S* x, S* y) const {
    S front, rear;
    lateral(u.steer, u.vx, u.yaw_rate, u, x, front, rear);
    const double sine = std::sin(u.steer), cosine = std::cos(u.steer);
    y[0] = (x[1] * cosine - front * sine + x[2]) / car.data.mass_kg;
    y[1] = (front * cosine + rear + x[1] * sine) / car.data.mass_kg;
}

Mat<3, 3> SideslipModel::process_noise(const Input& u) const {
    const double beta = settings.beta_walk_radps, rate = u.yaw_rate_std;
    const double fx = settings.fx_walk * car.data.mass_kg * kGravity;
    const Axles<double> rest = static_loads(kGravity, car.data.lf_m, car.data.lr_m);  // per mass
    const double by_steer = car.front.slope() * rest.front / u.vx * u.steer_std;
    const double lasting = 2.0 * kBlindSteering_s * u.dt;
    return Vec<3>(u.dt * beta * beta + u.dt * u.dt * rate * rate + lasting * by_steer * by_steer,
                  u.dt * fx * fx, u.dt * fx * fx)
        .asDiagonal();
}

Mat<2, 2> SideslipModel::measurement_noise(const Input& u) const {
    const Axles<double> rest = static_loads(kGravity, car.data.lf_m, car.data.lr_m);  // per mass
    const double c_f = car.front.slope() * rest.front;
    const double c_r = car.rear.slope() * rest.rear;
    const double by_rate = (c_f * car.data.lf_m - c_r * car.data.lr_m) / u.vx * u.yaw_rate_std;
    const double by_steer = c_f * u.steer_std;
    const double ay = settings.ay_mps2, model = settings.model_ay_mps2;
    return Vec<2>(u.ax_std * u.ax_std,
                  ay * ay + model * model + by_rate * by_rate + by_steer * by_steer)
        .asDiagonal();
}

template <Method method>
SideslipUkf<method>::SideslipUkf(const ObservedCar& car, const ObserverSettings& settings,
                                 bool linear)
    : car_(car),
      settings_(settings),
      watch_(settings),
      filter_(SideslipModel{car, settings, linear}, Vec<3>::Zero(), Mat<3, 3>::Identity(),
              Gate<2>(settings.gate_probability, 1)),
      linear_(linear) {}

template <Method method>
const SideslipEstimate& SideslipUkf<method>::step(double dt, const SensorSample& sample) {
    const SensorSample s = watch_.look(dt, sample, index_);
    ++index_;
    if (!watch_.fast_enough(std::isnan(s.vx_mps) && started_ ? input_.vx : s.vx_mps)) {
        started_ = false;
        out_ = rolling_without_slip(car_.data.lf_m, car_.data.lr_m, s);
        return out_;
    }
    rate_gap_s_ = std::isnan(s.yaw_rate_radps) ? rate_gap_s_ + dt : 0.0;
    const bool speed_before = speed_gap_s_ == 0.0;
    speed_gap_s_ = std::isnan(s.vx_mps) ? speed_gap_s_ + dt : 0.0;
    const bool fresh = !started_ || dt > kForgottenAfterS;
    if (fresh) start(s);
    // What is known at the ends of a long step is taken to change evenly between them.
    SensorSample now = s;
    if (speed_gap_s_ > 0.0) now.vx_mps = fresh ? input_.vx : blind_speed(dt, s);
    now.vx_mps = std::max(now.vx_mps, kSlowestMps);
    if (rate_gap_s_ > 0.0)
        now.yaw_rate_radps =
            std::isnan(s.ay_mps2) ? input_.yaw_rate : s.ay_mps2 / now.vx_mps;  // a steady corner
    const SideslipModel::Input before = input_;
    input_.ax_std = settings_.ax_mps2;
    if (std::isnan(s.ax_mps2) && speed_before && speed_gap_s_ == 0.0 && !fresh) {
        now.ax_mps2 = slowing(dt, now);
        input_.ax_std = std::hypot(input_.ax_std, std::sqrt(2.0) * settings_.vx_mps / dt);
    }
    in_short_steps(fresh ? std::min(dt, kLongestStepS) : dt, [&](double part, double share) {
        SensorSample at = now;
        if (share < 1.0) {
            at.steer_rad = before.steer + share * (now.steer_rad - before.steer);
            at.vx_mps = before.vx + share * (now.vx_mps - before.vx);
            at.yaw_rate_radps = before.yaw_rate + share * (now.yaw_rate_radps - before.yaw_rate);
            at.ax_mps2 = at.ay_mps2 = std::nan("");
        }
        run(part, at);
    });
    const bool again = lost();
    if (again) start(s);
    report(sample);
    if (again || watch_.refused()) out_.mode = ObserverMode::kCoasting;
    return out_;
}

/// The speed where it is not read, by the accelerometer or, without it, by the wheel force.
template <Method method>
double SideslipUkf<method>::blind_speed(double dt, const SensorSample& s) const {
    const Vec<3>& x = filter_.state().mean;
    const double ax = std::isnan(s.ax_mps2) ? (x[1] + x[2]) / car_.data.mass_kg : s.ax_mps2;
    return input_.vx + dt * (ax + input_.vx * std::tan(x[0]) * input_.yaw_rate);
}

/// What an accelerometer along the car would read by the speeds. Without any reading the wheel
/// force walks to where it takes all grip.
template <Method method>
double SideslipUkf<method>::slowing(double dt, const SensorSample& now) const {
    const double across = now.vx_mps * std::tan(filter_.state().mean[0]);
    return (now.vx_mps - input_.vx) / dt - across * now.yaw_rate_radps;
}

template <Method method>
bool SideslipUkf<method>::lost() const {
    const auto& now = filter_.state();
    return !(std::abs(now.mean[0]) < kMostSideslipRad &&
             now.covariance(0, 0) < kMostSideslipRad * kMostSideslipRad);
}

template <Method method>
void SideslipUkf<method>::run(double dt, const SensorSample& s) {
    SideslipModel::Input& u = input_;
    u.dt = dt;
    u.steer_before = u.steer;
    u.vx_before = u.vx;
    u.yaw_rate_before = u.yaw_rate;
    u.steer = s.steer_rad;
    u.steer_std = std::min(watch_.steer_gap_s(), 0.1);
    u.vx = s.vx_mps;
    u.yaw_rate = s.yaw_rate_radps;
    const double sensor = rate_gap_s_ == 0.0 ? settings_.yaw_rate_radps : 0.2;
    const double by_speed = u.yaw_rate * std::min(kBlindBraking_mps2 * speed_gap_s_ / u.vx, 1.0);
    u.yaw_rate_std = std::hypot(sensor, by_speed);
    const Vec<3>& x = filter_.state().mean;
    const AxleForces loads = axle_forces(car_, (x[1] + x[2]) / car_.data.mass_kg, 0.0);
    u.fz_f = loads.fz_f;
    u.fz_r = loads.fz_r;
    filter_.step(u, Vec<2>(s.ax_mps2, s.ay_mps2));
}

template <Method method>
void SideslipUkf<method>::start(const SensorSample& s) {
    const double vx = std::max(std::isnan(s.vx_mps) ? kSlowestMps : s.vx_mps, kSlowestMps);
    const double r = std::isnan(s.yaw_rate_radps) ? 0.0 : s.yaw_rate_radps;
    const double ax = std::isnan(s.ax_mps2) ? 0.0 : s.ax_mps2;
    const AxleForces loads = axle_forces(car_, ax, 0.0);
    const double slip_r = vx * r / (kGravity * car_.rear.slope());
    const double beta = std::clamp(car_.data.lr_m * r / vx - slip_r, -0.5, 0.5);
    const double deviation = std::isnan(s.yaw_rate_radps) ? 0.1
                                                          : std::max(0.03, 0.5 * std::abs(slip_r)) +
                                                                may_slide(car_.wheelbase_m(), s);
    const double weight = car_.data.mass_kg * kGravity;
    filter_.restart(Vec<3>(beta, loads.fx_f, loads.fx_r),
                    Vec<3>(deviation, 0.2 * weight, 0.2 * weight).cwiseAbs2().asDiagonal());
    input_ = {};
    input_.steer = s.steer_rad;
    input_.vx = vx;
    input_.yaw_rate = r;
    started_ = true;
}

template <Method method>
void SideslipUkf<method>::report(const SensorSample& s) {
    const auto& now = filter_.state();
    const VehicleData& c = car_.data;
    const Axles<double> rest = static_loads(c.mass_kg * kGravity, c.lf_m, c.lr_m);
    out_ = {};
    out_.beta_rad = now.mean[0];
    out_.beta_std_rad = std::sqrt(now.covariance(0, 0));
    out_.vx_mps = input_.vx;
    out_.yaw_rate_radps = input_.yaw_rate;
    out_.fx_n = now.mean[1] + now.mean[2];
    const double tangent = std::tan(out_.beta_rad);
    const Axles<double> alpha =
        slip_angles(1.0, tangent, input_.yaw_rate / input_.vx, c.lf_m, c.lr_m, input_.steer);
    out_.fyf_n = axle_force<double>(alpha.front, input_.fz_f, now.mean[1], car_.front, 1.0, 1.0);
    out_.fyr_n = axle_force<double>(alpha.rear, input_.fz_r, now.mean[2], car_.rear, 1.0, 1.0);
    out_.cf_npr = car_.front.slope() * rest.front;
    out_.cr_npr = car_.rear.slope() * rest.rear;
    out_.mu_f = car_.front.D;
    out_.mu_r = car_.rear.D;
    out_.nis = filter_.nis();
    out_.observed = now.update.observed;
    out_.log_likelihood = LogDensity::of(now.update);
    const bool whole = now.update.observed == 2 && rate_gap_s_ == 0.0 &&
                       !std::isnan(s.steer_rad + s.vx_mps + s.ax_mps2);
    out_.mode = whole ? ObserverMode::kRunning : ObserverMode::kCoasting;
}

template class SideslipUkf<Method::kExtended>;
template class SideslipUkf<Method::kUnscented>;
template class SideslipUkf<Method::kSquareRoot>;

}  // namespace sysid
