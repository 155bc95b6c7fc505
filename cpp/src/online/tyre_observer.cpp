#include "sysid/online/tyre_observer.hpp"

namespace sysid {

namespace {

constexpr int kN = TyreModel::kStates;
constexpr double kFullUse = 0.3;  // lateral force over load at which tyres tell all they can
constexpr double kMostStiffness = 1.6, kMostFriction = 0.8, kMostRelaxation = 3.0;  // logarithms
constexpr double kRelaxationWalk = 0.01;                                            // [1/sqrt(s)]
constexpr double kContradictionTimeS = 1.0, kTolerated = 1.5;  // of the innovations
constexpr double kContradicted =
    0.3;  // random walk of the stiffness for each sigma above [1/sqrt(s)]
constexpr double kBlindSideslip = 0.1, kBlindYawRate = 0.5;  // std of a start without sensors
constexpr double kLeastSlope =
    0.3;  // of the tyre curve over its secant, where kinematics take over
// A slide that the readings contradict is one of tyres that were learnt wrong.
constexpr double kSlideRad = 0.12, kRefuted = 1.5;
constexpr double kSlipStep = 5e-4;  // [rad]

double share_of(double dt, double time_s) { return std::exp(-dt / time_s); }

}  // namespace

void TyreModel::forces(const Input& u, const double* x, Forces& asked, double& front,
                       double& rear) const {
    front = asked.front(x[kSlipF], u.loads.fz_f, u.loads.fx_f, car.front, x[kStiffF], x[kGripF]) +
            u.error_f_n * x[kErrorF];
    rear = asked.rear(x[kSlipR], u.loads.fz_r, u.loads.fx_r, car.rear, x[kStiffR], x[kGripR]) +
           u.error_r_n * x[kErrorR];
}

void TyreModel::predict(const Input& u, const double* x, double* next) const {
    const VehicleData& c = car.data;
    const double vx = 0.5 * (u.vx + u.vx_before), ax = 0.5 * (u.ax + u.ax_before);
    const double steer = 0.5 * (u.steer + u.steer_before);
    // Late wheels stand where the angle was; what is taken off is linear in the time.
    const double gone = steer - 0.5 * (u.steer_slow + u.steer_slow_before);
    const double turned = steer + x[kSteerOff] - (gone / kSteerLagS) * x[kLate];
    const double cosine = std::cos(steer), side = u.loads.fx_f * std::sin(steer);
    const double inverse_inertia = std::exp(-1.0 * x[kInertia]) / car.yaw_inertia_kgm2;
    double felt = 0.0;
    const auto rates = [&](const double* at, Forces& asked, double& beta_rate,
                           double& yaw_acceleration) {
        double front = 0.0, rear = 0.0;
        forces(u, at, asked, front, rear);
        const double front_across = cosine * front + side;
        felt = (front_across + rear) / c.mass_kg + at[kPush];
        const double ay = felt + at[kRoad];
        const double along = std::cos(at[kBeta]);
        beta_rate = (ay * along - ax * std::sin(at[kBeta])) * along / vx - at[kYawRate];
        yaw_acceleration =
            (c.lf_m * front_across - c.lr_m * rear + u.drive_nm * at[kDrive]) * inverse_inertia +
            at[kTurn];
    };
    const double keep = std::exp((-vx * u.dt / settings.relaxation_m) * std::exp(-1.0 * x[kRelax]));
    const auto relax = [&](double beta, double r, double* to) {
        const double tangent = std::sin(beta) / std::cos(beta);
        const Axles<double> slip =
            slip_angles(1.0, tangent, (1.0 / vx) * r, c.lf_m, c.lr_m, turned);
        to[kSlipF] = slip.front + keep * (x[kSlipF] - slip.front);
        to[kSlipR] = slip.rear + keep * (x[kSlipR] - slip.rear);
    };
    for (int i = 0; i < kStates; ++i) next[i] = x[i];
    next[kGripF] = x[kGripF] * u.keeps.friction;
    next[kGripR] = x[kGripR] * u.keeps.friction;
    next[kRoad] = x[kRoad] * u.keeps.road;
    next[kPush] = x[kPush] * u.keeps.push;
    next[kTurn] = x[kTurn] * u.keeps.push;
    next[kErrorF] = x[kErrorF] * u.keeps.error;
    next[kErrorR] = x[kErrorR] * u.keeps.error;
    next[kDrive] = x[kDrive] * u.keeps.error;
    // Heun's rule: at low speed the tyres answer within a few samples.
    double first_beta = 0.0, first_yaw = 0.0, second_beta = 0.0, second_yaw = 0.0;
    rates(x, before, first_beta, first_yaw);
    next[kBeta] = x[kBeta] + u.dt * first_beta;
    next[kYawRate] = x[kYawRate] + u.dt * first_yaw;
    relax(0.5 * (x[kBeta] + next[kBeta]), 0.5 * (x[kYawRate] + next[kYawRate]), next);
    rates(next, after, second_beta, second_yaw);
    next[kBeta] = x[kBeta] + 0.5 * u.dt * (first_beta + second_beta);
    next[kYawRate] = x[kYawRate] + 0.5 * u.dt * (first_yaw + second_yaw);
    relax(0.5 * (x[kBeta] + next[kBeta]), 0.5 * (x[kYawRate] + next[kYawRate]), next);
    next[kLean] = felt + u.keeps.roll * (x[kLean] - felt);
}

void TyreModel::observe(const Input& u, const double* x, double* y) const {
    double front = 0.0, rear = 0.0;
    forces(u, x, read, front, rear);
    y[0] = x[kYawRate] + x[kGyroBias];
    const VehicleData& c = car.data;
    const double across = std::cos(u.steer) * front + std::sin(u.steer) * u.loads.fx_f;
    const double turn = (c.lf_m * across - c.lr_m * rear + u.drive_nm * x[kDrive]) *
                            std::exp(-1.0 * x[kInertia]) / car.yaw_inertia_kgm2 +
                        x[kTurn];
    y[1] = (across + rear) / c.mass_kg + x[kPush] + x[kAhead] * turn + x[kRoll] * x[kLean] +
           x[kAyBias];
}

Mat<TyreModel::kStates, TyreModel::kStates> TyreModel::process_noise(const Input& u) const {
    const ObserverSettings& s = settings;
    const auto fresh = [&](double time_s) { return 1.0 - squared(share_of(u.dt, time_s)); };
    Vec<kN> q;
    q[kBeta] = u.dt * squared(s.sideslip_walk_rad);
    q[kYawRate] = u.dt * squared(s.yaw_walk_radps);
    q[kSlipF] = u.dt * squared(u.slip_f_walk) + 1e-12;
    q[kSlipR] = 1e-12;
    q[kStiffF] = u.dt * squared(u.stiffness_walk_f);
    q[kStiffR] = u.dt * squared(u.stiffness_walk_r);
    q[kRelax] = u.dt * squared(kRelaxationWalk);
    q[kGripF] = q[kGripR] = squared(s.friction_prior) * fresh(s.friction_time_s);
    q[kRoad] = squared(s.road_mps2) * fresh(s.road_time_s);
    q[kPush] = squared(s.push_mps2) * fresh(s.push_time_s);
    q[kTurn] = squared(s.turn_radps2) * fresh(s.push_time_s);
    q[kSteerOff] = u.dt * squared(u.steer_walk) + 1e-16;
    q[kAyBias] = q[kGyroBias] = 1e-16;
    q[kLate] = q[kAhead] = q[kInertia] = q[kRoll] = 1e-16;  // properties of the car and its sensors
    q[kErrorF] = q[kErrorR] = q[kDrive] = fresh(s.error_time_s);
    q[kLean] = 1e-10;  // it follows from the forces
    return q.asDiagonal();
}

Mat<2, 2> TyreModel::measurement_noise(const Input&) const {
    return Vec<2>(squared(settings.yaw_rate_radps), squared(settings.ay_mps2)).asDiagonal();
}

TyreObserver::TyreObserver(const ObservedCar& car, const ObserverSettings& settings)
    : car_(car),
      settings_(settings),
      filter_(TyreModel{car, settings}, Vec<kN>::Zero(), Mat<kN, kN>::Identity(), Gate<2>(),
              NoiseAdaptation(), SigmaWeights::near(TyreModel::kStates)),
      refusal_(0.5 * squared(gaussian_bound(settings.gate_probability))) {}

bool TyreObserver::lost() const {
    const auto& b = filter_.state();
    const bool known = std::abs(b.mean[TyreModel::kBeta]) < kMostSideslipRad &&
                       b.covariance(TyreModel::kBeta, TyreModel::kBeta) < squared(kMostSideslipRad);
    return !known || refuted();
}

bool TyreObserver::refuted() const {
    return std::abs(filter_.state().mean[TyreModel::kBeta]) > kSlideRad &&
           contradiction_ > kRefuted;
}

void TyreObserver::start(double dt, const SensorSample& s, const TyreModel::Input& common) {
    const auto or_zero = [](double v) { return std::isnan(v) ? 0.0 : v; };
    const VehicleData& c = car_.data;
    const double r = or_zero(s.yaw_rate_radps), ay = or_zero(s.ay_mps2);
    const double share = c.lr_m / car_.wheelbase_m();
    input_ = common;
    const double slip_f = share * c.mass_kg * ay / (car_.front.slope() * input_.loads.fz_f);
    const double slip_r = (1.0 - share) * c.mass_kg * ay / (car_.rear.slope() * input_.loads.fz_r);
    const bool first = filter_.samples() == 0 || refuted();
    Vec<kN> b = filter_.state().mean, deviation;
    if (first) b.setZero();
    constexpr int at = TyreModel::kLearnt, learnt = TyreModel::kLearntStates;
    const Mat<learnt, learnt> known = filter_.state().covariance.block<learnt, learnt>(at, at);
    if (first) b[TyreModel::kRoll] = settings_.roll_expected;
    b[TyreModel::kBeta] = c.lr_m * r / input_.vx - slip_r;
    b[TyreModel::kYawRate] = r;
    b[TyreModel::kSlipF] = slip_f;
    b[TyreModel::kSlipR] = slip_r;
    for (const int i : {TyreModel::kRoad, TyreModel::kPush, TyreModel::kTurn, TyreModel::kErrorF,
                        TyreModel::kErrorR, TyreModel::kDrive})
        b[i] = 0.0;
    b[TyreModel::kLean] = ay / (1.0 + b[TyreModel::kRoll]);
    const double stiff = settings_.stiffness_prior, grip = settings_.friction_prior;
    const bool blind = std::isnan(s.yaw_rate_radps) || std::isnan(s.ay_mps2);
    const double unseen = blind ? kBlindSideslip : may_slide(car_.wheelbase_m(), s);
    deviation << 0.01 + std::abs(slip_r) + unseen, blind ? kBlindYawRate : 0.1,
        0.005 + std::abs(slip_f), 0.005 + std::abs(slip_r), stiff, stiff, grip, grip,
        settings_.relaxation_std, settings_.steer_late_s, settings_.ahead_m,
        settings_.inertia_prior, settings_.steer_offset_rad, settings_.ay_bias_mps2,
        settings_.yaw_rate_bias_radps, settings_.roll_share, settings_.road_mps2,
        settings_.push_mps2, settings_.turn_radps2, 1.0, 1.0, 1.0, 0.5;
    Mat<kN, kN> P = deviation.cwiseAbs2().asDiagonal();
    if (!first) P.block<learnt, learnt>(at, at) = known;
    // An error of beta is one of both slip angles, which have errors of their own as well.
    const double shared = squared(deviation[TyreModel::kBeta]);
    for (const int i : {TyreModel::kSlipF, TyreModel::kSlipR}) {
        P(i, TyreModel::kBeta) = P(TyreModel::kBeta, i) = -shared;
        P(i, i) += shared;
    }
    P(TyreModel::kSlipF, TyreModel::kSlipR) = P(TyreModel::kSlipR, TyreModel::kSlipF) = shared;
    filter_.restart(b, P);
    contradiction_ = 1.0;
    filter_.set_gate(Gate<2>(settings_.gate_probability,
                             whole_within(settings_.gate_patience_s / dt, 1, kMostPieces)));
}

void TyreObserver::adopt(const TyreObserver& other) {
    filter_.restart(other.filter_.state().mean, Mat<kN, kN>(other.filter_.state().covariance));
    contradiction_ = 1.0;
    offset_ = other.offset_;
    offset_variance_ = other.offset_variance_;
}

void TyreObserver::steer_lost() {
    const auto& now = filter_.state();
    offset_ = now.mean[TyreModel::kSteerOff];
    offset_variance_ = now.covariance(TyreModel::kSteerOff, TyreModel::kSteerOff);
}

void TyreObserver::steer_found() {
    Vec<kN> mean = filter_.state().mean;
    Mat<kN, kN> P = filter_.state().covariance;
    constexpr int i = TyreModel::kSteerOff;
    mean[i] = offset_;
    P.row(i).setZero();
    P.col(i).setZero();
    P(i, i) = offset_variance_;
    filter_.restart(mean, P);
}

void TyreObserver::forces(double& front, double& rear) const {
    const TyreModel& model = filter_.model();
    model.forces(input_, filter_.state().mean.data(), model.read, front, rear);
}

void TyreObserver::step(const TyreModel::Input& common, const SensorSample& s) {
    TyreModel::Input& u = input_;
    u = common;
    const auto left_after = [&](double time_s) { return share_of(u.dt, time_s); };
    u.keeps = {left_after(settings_.friction_time_s), left_after(settings_.road_time_s),
               left_after(settings_.push_time_s), left_after(settings_.error_time_s),
               left_after(settings_.roll_time_s)};
    double front = 0.0, rear = 0.0;
    forces(front, rear);
    const auto error = [&](double fz, double fx, double force, double mu) {
        return settings_.error_load * fz + settings_.error_lateral * std::abs(force) +
               settings_.error_braking * mu * fz * (1.0 - grip_left(fx, fz, mu));
    };
    u.error_f_n = error(u.loads.fz_f, u.loads.fx_f, front, car_.front.D);
    u.error_r_n = error(u.loads.fz_r, u.loads.fx_r, rear, car_.rear.D);
    u.drive_nm =
        settings_.error_drive * std::abs(u.loads.fx_f + u.loads.fx_r) * 0.5 * car_.wheelbase_m();
    // The stiffness is uncertain again where readings are farther off than the model allows.
    const double walk = settings_.stiffness_walk +
                        kContradicted * std::max(std::sqrt(contradiction_) - kTolerated, 0.0);
    const double use_f = std::abs(front) / u.loads.fz_f, use_r = std::abs(rear) / u.loads.fz_r;
    u.stiffness_walk_f = walk * std::min(use_f / kFullUse, 1.0);
    u.stiffness_walk_r = walk * std::min(use_r / kFullUse, 1.0);
    filter_.step(u, Vec<2>(s.yaw_rate_radps, s.ay_mps2));
    const auto& update = filter_.state().update;
    const int observed = update.observed;
    log_likelihood_ = observed > 0 ? LogDensity::of(update) : 0.0;
    log_likelihood_ -= filter_.refusals() * refusal_;
    if (observed > 0) {
        const double keep = share_of(u.dt, kContradictionTimeS);
        contradiction_ = keep * contradiction_ + (1.0 - keep) * filter_.nis() / observed;
    }

    learn_less(use_f, use_r);
}

void TyreObserver::learn_less(double use_f, double use_r) {
    const auto& now = filter_.state();
    Vec<kN> mean = now.mean;
    Mat<kN, kN> P = now.covariance;
    // Partial update (Brink, J. Guid. Control Dyn. 40, 2017): little slip is as much one of
    // compliance and body motion, and the stiffness takes in only a share of what it says.
    Vec<kN> left = Vec<kN>::Zero();
    left[TyreModel::kStiffF] = std::max(1.0 - use_f / settings_.learning_use, 0.0);
    left[TyreModel::kStiffR] = std::max(1.0 - use_r / settings_.learning_use, 0.0);
    for (const int i : {TyreModel::kStiffF, TyreModel::kStiffR}) {
        mean[i] += left[i] * (now.predicted_mean[i] - mean[i]);
        for (const int j : {TyreModel::kStiffF, TyreModel::kStiffR})
            P(i, j) += left[i] * left[j] * (now.predicted_covariance(i, j) - now.covariance(i, j));
    }

    // Logarithms that ran away would not come back by themselves.
    const auto limit = [&](int i, double bound) {
        mean[i] = std::min(std::max(mean[i], -bound), bound);
    };
    limit(TyreModel::kStiffF, kMostStiffness);
    limit(TyreModel::kStiffR, kMostStiffness);
    limit(TyreModel::kGripF, kMostFriction);
    limit(TyreModel::kGripR, kMostFriction);
    limit(TyreModel::kRelax, kMostRelaxation);
    if (mean != now.mean || P != now.covariance) filter_.restart(mean, P);
}

double TyreObserver::sideslip_variance() const {
    const auto& b = filter_.state();
    const double slip = b.mean[TyreModel::kSlipR];
    const auto force = [&](double alpha) {
        return axle_force<double>(alpha, input_.loads.fz_r, input_.loads.fx_r, car_.rear,
                                  std::exp(b.mean[TyreModel::kStiffR]),
                                  std::exp(b.mean[TyreModel::kGripR]));
    };
    // A force that is wrong by a share makes the slip wrong by that share of secant over slope.
    const double at = force(slip);
    const double slope_here =
        (force(slip + kSlipStep) - force(slip - kSlipStep)) / (2.0 * kSlipStep);
    const double bent = std::abs(slip) < kSlipStep ? 1.0 : slope_here * slip / at;
    return b.covariance(TyreModel::kBeta, TyreModel::kBeta) +
           squared(settings_.error_curve * slip / std::max(bent, kLeastSlope)) +
           squared(settings_.error_slip_rad);
}

}  // namespace sysid
