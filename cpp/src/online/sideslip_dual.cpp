#include "sysid/online/sideslip_dual.hpp"

namespace sysid {

namespace {

constexpr double kSlowestMps = 1.0;  // keeps what divides by speed finite
constexpr double kFullUse = 0.3;     // lateral force over load at which tyres tell all they can
constexpr double kMostStiffness = 1.6, kMostFriction = 0.8, kMostRelaxation = 3.0;  // logarithms
constexpr double kRelaxationWalk = 0.01;                                            // [1/sqrt(s)]
constexpr double kContradictionTimeS = 1.0, kTolerated = 1.5;  // of the innovations
constexpr double kContradicted =
    0.3;  // random walk of the stiffness for each sigma above [1/sqrt(s)]
constexpr double kSteerUnknown = 0.15;  // random walk of its angle [rad/sqrt(s)]
constexpr double kBlindSideslip = 0.1, kBlindYawRate = 0.5;  // doubt of a start without sensors

double share_of(double dt, double time_s) { return std::exp(-dt / time_s); }

double squared(double v) { return v * v; }

double slope(const TyreCoefficients<double>& t) { return t.B * t.C * t.D; }

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

template <class S>
void TyreModel::forces(const Input& u, const S* x, S& front, S& rear) const {
    using std::exp;
    front = axle_force<S>(x[kSlipF], u.loads.fz_f, u.loads.fx_f, car.front, exp(x[kStiffF]),
                          exp(x[kGripF])) +
            u.error_f_n * x[kErrorF];
    rear = axle_force<S>(x[kSlipR], u.loads.fz_r, u.loads.fx_r, car.rear, exp(x[kStiffR]),
                         exp(x[kGripR])) +
           u.error_r_n * x[kErrorR];
}

template <class S>
void TyreModel::predict(const Input& u, const S* x, S* next) const {
    using std::cos;
    using std::exp;
    using std::sin;
    const VehicleData& c = car.data;
    const double vx = 0.5 * (u.vx + u.vx_before), ax = 0.5 * (u.ax + u.ax_before);
    const double steer = 0.5 * (u.steer + u.steer_before);
    const double cosine = std::cos(steer), side = u.loads.fx_f * std::sin(steer);
    S felt;
    const auto rates = [&](const S* at, S& beta_rate, S& yaw_acceleration) {
        S front, rear;
        forces(u, at, front, rear);
        const S front_across = cosine * front + side;
        felt = (front_across + rear) / c.mass_kg;
        const S ay = felt + at[kRoad];
        const S along = cos(at[kBeta]);
        beta_rate = (ay * along - ax * sin(at[kBeta])) * along / vx - at[kYawRate];
        yaw_acceleration = (c.lf_m * front_across - c.lr_m * rear + u.drive_nm * at[kDrive]) /
                           car.yaw_inertia_kgm2;
    };
    const S keep = exp((-vx * u.dt / settings.relaxation_m) * exp(-1.0 * x[kRelax]));
    const auto relax = [&](const S& beta, const S& r, S* to) {
        const S tangent = sin(beta) / cos(beta);
        const Axles<S> slip =
            slip_angles(S(1.0), tangent, S((1.0 / vx) * r), c.lf_m, c.lr_m, steer);
        to[kSlipF] = slip.front + keep * (x[kSlipF] - slip.front);
        to[kSlipR] = slip.rear + keep * (x[kSlipR] - slip.rear);
    };
    for (int i = 0; i < kStates; ++i) next[i] = x[i];
    next[kGripF] = x[kGripF] * share_of(u.dt, settings.friction_time_s);
    next[kGripR] = x[kGripR] * share_of(u.dt, settings.friction_time_s);
    next[kRoad] = x[kRoad] * share_of(u.dt, settings.road_time_s);
    next[kErrorF] = x[kErrorF] * share_of(u.dt, settings.error_time_s);
    next[kErrorR] = x[kErrorR] * share_of(u.dt, settings.error_time_s);
    next[kDrive] = x[kDrive] * share_of(u.dt, settings.error_time_s);
    // Heun's rule: at low speed the tyres answer within a few samples.
    S first_beta, first_yaw, second_beta, second_yaw;
    rates(x, first_beta, first_yaw);
    next[kBeta] = x[kBeta] + u.dt * first_beta;
    next[kYawRate] = x[kYawRate] + u.dt * first_yaw;
    relax(0.5 * (x[kBeta] + next[kBeta]), 0.5 * (x[kYawRate] + next[kYawRate]), next);
    rates(next, second_beta, second_yaw);
    next[kBeta] = x[kBeta] + 0.5 * u.dt * (first_beta + second_beta);
    next[kYawRate] = x[kYawRate] + 0.5 * u.dt * (first_yaw + second_yaw);
    relax(0.5 * (x[kBeta] + next[kBeta]), 0.5 * (x[kYawRate] + next[kYawRate]), next);
    next[kLean] = felt + share_of(u.dt, settings.roll_time_s) * (x[kLean] - felt);
}

template <class S>
void TyreModel::observe(const Input& u, const S* x, S* y) const {
    S front, rear;
    forces(u, x, front, rear);
    y[0] = x[kYawRate];
    y[1] =
        (std::cos(u.steer) * front + std::sin(u.steer) * u.loads.fx_f + rear) / car.data.mass_kg +
        x[kRoll] * x[kLean];
}

Mat<15, 15> TyreModel::process_noise(const Input& u) const {
    const ObserverSettings& s = settings;
    const auto fresh = [&](double time_s) { return 1.0 - squared(share_of(u.dt, time_s)); };
    Vec<15> q;
    q[kBeta] = u.dt * squared(s.sideslip_walk_rad);
    q[kYawRate] = u.dt * squared(s.yaw_walk_radps);
    q[kSlipF] = u.dt * squared(u.slip_f_walk) + 1e-12;
    q[kSlipR] = 1e-12;
    q[kStiffF] = u.dt * squared(u.stiffness_walk_f);
    q[kStiffR] = u.dt * squared(u.stiffness_walk_r);
    q[kRelax] = u.dt * squared(kRelaxationWalk);
    q[kGripF] = q[kGripR] = squared(s.friction_prior) * fresh(s.friction_time_s);
    q[kRoad] = squared(s.road_mps2) * fresh(s.road_time_s);
    q[kRoll] = 1e-16;  // a property of the car
    q[kErrorF] = q[kErrorR] = q[kDrive] = fresh(s.error_time_s);
    q[kLean] = 1e-10;  // it follows from the forces
    return q.asDiagonal();
}

Mat<2, 2> TyreModel::measurement_noise(const Input&) const {
    return Vec<2>(squared(settings.yaw_rate_radps), squared(settings.ay_mps2)).asDiagonal();
}

SideslipDual::SideslipDual(const ObservedCar& car, const ObserverSettings& settings)
    : car_(car),
      settings_(settings),
      watch_(settings),
      forces_(ForceModel{car, settings}, Vec<5>::Zero(), Mat<5, 5>::Identity()),
      tyres_(TyreModel{car, settings}, Vec<15>::Zero(), Mat<15, 15>::Identity(), Gate<2>(),
             NoiseAdaptation(), SigmaWeights::near(TyreModel::kStates)) {}

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
        const bool again = lost();
        if (again) start(dt, s);
        report();
        if (again || watch_.refused()) out_.mode = ObserverMode::kCoasting;
    }
    ++index_;
    return out_;
}

void SideslipDual::run(double dt, const SensorSample& s) {
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

bool SideslipDual::lost() const {
    const auto& b = tyres_.state();
    const bool known = std::abs(b.mean[TyreModel::kBeta]) < kMostSideslipRad &&
                       b.covariance(TyreModel::kBeta, TyreModel::kBeta) < squared(kMostSideslipRad);
    return !known;
}

void SideslipDual::start(double dt, const SensorSample& s) {
    const auto or_zero = [](double v) { return std::isnan(v) ? 0.0 : v; };
    const VehicleData& c = car_.data;
    const double speed = std::max(or_zero(s.vx_mps), kSlowestMps);
    const double r = or_zero(s.yaw_rate_radps), ay = or_zero(s.ay_mps2), ax = or_zero(s.ax_mps2);
    const double share = c.lr_m / car_.wheelbase_m(), weight = c.mass_kg * kGravity;
    Vec<5> a, a_doubt;
    a << speed, r, share * c.mass_kg * ay, (1.0 - share) * c.mass_kg * ay, c.mass_kg * ax;
    a_doubt << 0.5, 0.1, 0.3 * weight, 0.3 * weight, 0.3 * weight;
    forces_.restart(a, a_doubt.cwiseAbs2().asDiagonal());

    input_ = {};
    input_.loads = axle_forces(car_, ax, speed);
    input_.steer = s.steer_rad;
    input_.vx = speed;
    input_.ax = ax;
    // A steady corner: each tyre carries its share.
    const double slip_f = a[ForceModel::kFyf] / (slope(car_.front) * input_.loads.fz_f);
    const double slip_r = a[ForceModel::kFyr] / (slope(car_.rear) * input_.loads.fz_r);
    const bool first = tyres_.samples() == 0;
    Vec<15> b = tyres_.state().mean, doubt;
    constexpr int at = TyreModel::kLearnt, learnt = TyreModel::kLearntStates;
    const Mat<learnt, learnt> known = tyres_.state().covariance.block<learnt, learnt>(at, at);
    if (first) b[TyreModel::kRoll] = settings_.roll_expected;
    b[TyreModel::kBeta] = c.lr_m * r / speed - slip_r;
    b[TyreModel::kYawRate] = r;
    b[TyreModel::kSlipF] = slip_f;
    b[TyreModel::kSlipR] = slip_r;
    for (const int i :
         {TyreModel::kRoad, TyreModel::kErrorF, TyreModel::kErrorR, TyreModel::kDrive})
        b[i] = 0.0;
    b[TyreModel::kLean] = ay / (1.0 + b[TyreModel::kRoll]);
    const double stiff = settings_.stiffness_prior, grip = settings_.friction_prior;
    const bool blind = std::isnan(s.yaw_rate_radps) || std::isnan(s.ay_mps2);
    const double unseen = blind ? kBlindSideslip : 0.0;
    doubt << 0.01 + std::abs(slip_r) + unseen, blind ? kBlindYawRate : 0.1,
        0.005 + std::abs(slip_f), 0.005 + std::abs(slip_r), stiff, stiff, grip, grip,
        settings_.relaxation_std, settings_.roll_share, settings_.road_mps2, 1.0, 1.0, 1.0, 0.5;
    Mat<15, 15> P = doubt.cwiseAbs2().asDiagonal();
    if (!first) P.block<learnt, learnt>(at, at) = known;
    // An error of beta is one of both slip angles, which are doubtful by themselves as well.
    const double shared = squared(doubt[TyreModel::kBeta]);
    for (const int i : {TyreModel::kSlipF, TyreModel::kSlipR}) {
        P(i, TyreModel::kBeta) = P(TyreModel::kBeta, i) = -shared;
        P(i, i) += shared;
    }
    P(TyreModel::kSlipF, TyreModel::kSlipR) = P(TyreModel::kSlipR, TyreModel::kSlipF) = shared;
    tyres_.restart(b, P);
    tyres_.set_gate(Gate<2>(settings_.gate_probability,
                            whole_within(settings_.gate_patience_s / dt, 1, kMostPieces)));
    started_ = true;
}

void SideslipDual::run_tyres(double dt, const SensorSample& s) {
    const Vec<5>& a = forces_.state().mean;
    const Vec<15>& b = tyres_.state().mean;
    TyreModel::Input& u = input_;
    u.dt = dt;
    u.steer_before = u.steer;
    u.vx_before = u.vx;
    u.ax_before = u.ax;
    u.steer = s.steer_rad;
    // Not the raw reading: its vibration would take grip, and always take it.
    u.ax = (a[ForceModel::kFx] - std::sin(u.steer) * a[ForceModel::kFyf]) / car_.data.mass_kg;
    u.vx = std::max(std::isnan(s.vx_mps) ? u.vx_before + dt * u.ax : s.vx_mps, kSlowestMps);
    u.loads = axle_forces(car_, u.ax, u.vx);
    double front = 0.0, rear = 0.0;
    tyres_.model().forces(u, b.data(), front, rear);
    const auto error = [&](double fz, double fx, double force, double mu) {
        return settings_.error_load * fz + settings_.error_lateral * std::abs(force) +
               settings_.error_braking * mu * fz * (1.0 - grip_left(fx, fz, mu));
    };
    u.error_f_n = error(u.loads.fz_f, u.loads.fx_f, front, car_.front.D);
    u.error_r_n = error(u.loads.fz_r, u.loads.fx_r, rear, car_.rear.D);
    u.drive_nm =
        settings_.error_drive * std::abs(u.loads.fx_f + u.loads.fx_r) * 0.5 * car_.wheelbase_m();
    // Stiffness is doubted anew where readings are farther off than the model allows.
    const double walk = settings_.stiffness_walk +
                        kContradicted * std::max(std::sqrt(contradiction_) - kTolerated, 0.0);
    u.stiffness_walk_f = walk * std::min(std::abs(front) / (kFullUse * u.loads.fz_f), 1.0);
    u.stiffness_walk_r = walk * std::min(std::abs(rear) / (kFullUse * u.loads.fz_r), 1.0);
    u.slip_f_walk = watch_.steer_gap_s() > 0.0 ? kSteerUnknown : 0.0;
    tyres_.step(u, Vec<2>(s.yaw_rate_radps, s.ay_mps2));
    const int observed = tyres_.state().update.observed;
    if (observed > 0) {
        const double keep = share_of(dt, kContradictionTimeS);
        contradiction_ = keep * contradiction_ + (1.0 - keep) * tyres_.nis() / observed;
    }

    // Logarithms that ran away would not come back by themselves.
    Vec<15> mean = b;
    const auto limit = [&](int i, double most) {
        mean[i] = std::min(std::max(mean[i], -most), most);
    };
    limit(TyreModel::kStiffF, kMostStiffness);
    limit(TyreModel::kStiffR, kMostStiffness);
    limit(TyreModel::kGripF, kMostFriction);
    limit(TyreModel::kGripR, kMostFriction);
    limit(TyreModel::kRelax, kMostRelaxation);
    if (mean != b) tyres_.restart(mean, Mat<15, 15>(tyres_.state().covariance));
}

void SideslipDual::run_forces(double dt, const SensorSample& s) {
    const Vec<15>& b = tyres_.state().mean;
    const Vec<2>& used = tyres_.used();
    if (used.hasNaN()) {
        // Nobody feels the forces: they are what the tyre model makes of the driving.
        double front = 0.0, rear = 0.0;
        tyres_.model().forces(input_, b.data(), front, rear);
        Vec<5> x = forces_.state().mean;
        Mat<5, 5> P = forces_.state().covariance;
        x[ForceModel::kFyf] = front;
        x[ForceModel::kFyr] = rear;
        P.middleRows<2>(ForceModel::kFyf).setZero();
        P.middleCols<2>(ForceModel::kFyf).setZero();
        P(ForceModel::kFyf, ForceModel::kFyf) = squared(input_.error_f_n + 0.1 * std::abs(front));
        P(ForceModel::kFyr, ForceModel::kFyr) = squared(input_.error_r_n + 0.1 * std::abs(rear));
        x[ForceModel::kYawRate] = b[TyreModel::kYawRate];
        forces_.restart(x, P);
    }
    const ForceModel::Input u{
        dt, s.steer_rad, std::tan(b[TyreModel::kBeta]), input_.loads.fz_f, input_.loads.fz_r,
    };
    forces_.step(u, Vec<4>(s.vx_mps, used[0], s.ax_mps2, used[1]));
}

void SideslipDual::report() {
    const auto& a = forces_.state();
    const auto& b = tyres_.state();
    const auto std_of = [&](int i) { return std::sqrt(b.covariance(i, i)); };
    const double weight = car_.data.mass_kg * kGravity / car_.wheelbase_m();
    out_.beta_rad = b.mean[TyreModel::kBeta];
    out_.beta_std_rad = std_of(TyreModel::kBeta);
    out_.vx_mps = a.mean[ForceModel::kVx];
    out_.yaw_rate_radps = b.mean[TyreModel::kYawRate];
    out_.fyf_n = a.mean[ForceModel::kFyf];
    out_.fyr_n = a.mean[ForceModel::kFyr];
    out_.fx_n = a.mean[ForceModel::kFx];
    out_.cf_npr =
        slope(car_.front) * weight * car_.data.lr_m * std::exp(b.mean[TyreModel::kStiffF]);
    out_.cr_npr = slope(car_.rear) * weight * car_.data.lf_m * std::exp(b.mean[TyreModel::kStiffR]);
    out_.cf_std_npr = out_.cf_npr * std_of(TyreModel::kStiffF);
    out_.cr_std_npr = out_.cr_npr * std_of(TyreModel::kStiffR);
    out_.mu_f = car_.front.D * std::exp(b.mean[TyreModel::kGripF]);
    out_.mu_r = car_.rear.D * std::exp(b.mean[TyreModel::kGripR]);
    out_.nis = tyres_.nis();
    out_.observed = b.update.observed;
    out_.log_likelihood = LogDensity::of(b.update);
    out_.mode = tyres_.used().hasNaN() ? ObserverMode::kCoasting : ObserverMode::kRunning;
}

}  // namespace sysid
