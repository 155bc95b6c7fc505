// Covariances stay positive definite, whatever the noise and however long the record. Every filter
// runs with its process noise from 1e-12 to 1e6 times its measurement noise (of standard
// deviations), all ratios together over a million steps.
#include "helpers.hpp"
#include "sysid/estimate/filter.hpp"
#include "sysid/identify/run_system.hpp"
#include "sysid/lab/lab_em.hpp"
#include "sysid/lab/tyre_likelihood.hpp"
#include "sysid/online/cornering_rls.hpp"
#include "sysid/online/mu_slip.hpp"
#include "sysid/online/sideslip_dual.hpp"
#include "sysid/online/sideslip_ukf.hpp"
#include "sysid/twin/batch.hpp"

namespace sysid::test {
namespace {

constexpr std::array<double, 7> kRatios{1e-12, 1e-9, 1e-6, 1e-3, 1.0, 1e3, 1e6};
constexpr std::size_t kSteps = 150'000;

/// Lowest eigenvalue of the correlations; minus one where a variance is not above zero.
double lowest_correlation(const Eigen::MatrixXd& P) {
    if (!P.allFinite() || !(P.diagonal().minCoeff() > 0.0)) return -1.0;
    const Eigen::VectorXd unit = P.diagonal().cwiseSqrt().cwiseInverse();
    const Eigen::MatrixXd correlation = unit.asDiagonal() * P * unit.asDiagonal();
    return Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(correlation, Eigen::EigenvaluesOnly)
        .eigenvalues()[0];
}

/// Not below zero by more than the digits of its elements can tell.
bool positive(const Eigen::MatrixXd& P) { return lowest_correlation(P) > -1e-11; }

bool worth_a_look(std::size_t k) { return k < 200 || k % 1000 == 0; }

/// Position, speed and acceleration of a point; position and speed are read.
struct Point {
    static constexpr int kStates = 3;
    static constexpr int kMeasured = 2;
    static constexpr int kDirectReadings = 2;
    struct Input {};
    double process_std, sensor_std, dt = 0.01;
    mutable std::mt19937 generator{17};

    std::size_t size() const { return kSteps; }
    template <class S>
    void predict(const Input&, const S* x, S* next) const {
        next[0] = x[0] + dt * x[1] + (0.5 * dt * dt) * x[2];
        next[1] = x[1] + dt * x[2];
        next[2] = 0.999 * x[2];
    }
    template <class S>
    void observe(const Input&, const S* x, S* y) const {
        y[0] = x[0];
        y[1] = x[1];
    }
    Mat<3, 3> process_noise(const Input& = {}) const {
        return Vec<3>(0.0, 0.0, process_std * process_std).asDiagonal();
    }
    Mat<2, 2> measurement_noise(const Input& = {}) const {
        return sensor_std * sensor_std * Mat<2, 2>::Identity();
    }
    // The same as a `System`.
    Vec<3> predict(std::size_t, const Vec<3>& x, Mat<3, 3>& A, Mat<3, 3>& Q) const {
        A << 1.0, dt, 0.5 * dt * dt, 0.0, 1.0, dt, 0.0, 0.0, 0.999;
        Q = process_noise();
        return A * x;
    }
    Vec<2> observe(std::size_t, const Vec<3>& x, Mat<2, 3>& H) const {
        H.setIdentity();
        return x.head<2>();
    }
    Vec<2> measurement(std::size_t k) const {
        std::normal_distribution<double> normal(0.0, sensor_std);
        return Vec<2>(normal(generator), k % 7 == 3 ? std::nan("") : normal(generator));
    }
    Mat<2, 2> measurement_noise(std::size_t) const { return measurement_noise(); }
};

/// Process and sensor noise for a ratio: the larger one is 1, so that both get small.
Point point(double ratio) { return {std::min(1.0, ratio), std::min(1.0, 1.0 / ratio)}; }

template <class Form>
void over_a_record() {
    for (const double ratio : kRatios) {
        SCOPED_TRACE(ratio);
        std::size_t lost = 0;
        extended_kalman_filter<3, 2, Form>(
            point(ratio), Vec<3>::Zero(), Mat<3, 3>::Identity(), [&](std::size_t k, const auto& s) {
                if (worth_a_look(k) && !(positive(s.covariance) && s.mean.allFinite())) ++lost;
            });
        EXPECT_EQ(lost, 0U);
    }
}

TEST(Covariances, OfTheExtendedFilterOverARecord) { over_a_record<Update<3, 2>>(); }
TEST(Covariances, OfTheSequentialFilterOverARecord) { over_a_record<SequentialUpdate<3, 2>>(); }

template <Method method>
void step_by_step() {
    for (const double ratio : kRatios) {
        SCOPED_TRACE(ratio);
        const Point model = point(ratio);
        Filter<Point, method> filter(model, Vec<3>::Zero(), Mat<3, 3>::Identity());
        std::size_t lost = 0;
        for (std::size_t k = 0; k < kSteps; ++k) {
            filter.step({}, model.measurement(k));
            if (worth_a_look(k) && !positive(filter.state().covariance)) ++lost;
        }
        EXPECT_EQ(lost, 0U);
    }
}

TEST(Covariances, OfTheExtendedFilter) { step_by_step<Method::kExtended>(); }
TEST(Covariances, OfTheUnscentedFilter) { step_by_step<Method::kUnscented>(); }
TEST(Covariances, OfTheSquareRootFilter) { step_by_step<Method::kSquareRoot>(); }

TEST(Covariances, OfTheGreyBoxOfTheMainJob) {
    const SingleTrack model{saloon(), mask_of({"tyre_relaxation", "steer_lag"})};
    const Parameters p = typical_parameters();
    const sysid::Run run = noisy_run(model, p, 20'000, 0.01, 3);
    for (const double ratio : kRatios) {
        SCOPED_TRACE(ratio);
        Noise noise = ordinary_noise();
        for (double& s : noise.sensor) s *= std::min(1.0, 1.0 / ratio);
        for (double& s : noise.motion) s *= std::min(1.0, ratio);
        for (double& s : noise.wander) s *= std::min(1.0, ratio);
        std::size_t lost = 0;
        const auto used = kStatesPlain + static_cast<int>(active_states(model.effects).count);
        filter_run<kStatesFew>(RunSystem<kStatesFew>(model, run, p.data(), noise),
                               [&](std::size_t k, const auto& s) {
                                   const Eigen::MatrixXd P = s.covariance.topLeftCorner(used, used);
                                   if (worth_a_look(k) && !positive(P)) ++lost;
                               });
        EXPECT_EQ(lost, 0U);
    }
}

TEST(Covariances, OfTheLaboratoryObserver) {
    const lab::ObserverCar car{1500.0, 2500.0, 1.2, 1.4, 40.0};
    for (const double ratio : kRatios) {
        SCOPED_TRACE(ratio);
        lab::ObserverNoise noise;
        const double force = 300.0 * std::min(1.0, ratio), sensor = std::min(1.0, 1.0 / ratio);
        noise.process = Vec<6>(1e-3, 1e-3, 1e-4, force, force, force).cwiseAbs2().asDiagonal();
        noise.process.topLeftCorner<3, 3>() *= std::min(1.0, ratio * ratio);
        noise.sensors = (sensor * Vec<4>(0.05, 0.05, 0.005, 0.1)).cwiseAbs2().asDiagonal();
        std::mt19937 generator(3);
        std::normal_distribution<double> normal;
        lab::ObserverLog log{lab::ObserverModel(car, {}, 0.01), {}, {}, {}};
        for (std::size_t k = 0; k < kSteps; ++k) {
            const double t = 0.01 * static_cast<double>(k);
            log.inputs.push_back({200.0 * std::cos(t), 0.02 * std::sin(t), 8e4, 9e4});
            lab::ObserverReading y(20.0 + std::sin(0.1 * t), 0.1 * std::sin(t), 0.2 * std::sin(t),
                                   4.0 * std::sin(t));
            for (int i = 0; i < 4; ++i) y[i] += std::sqrt(noise.sensors(i, i)) * normal(generator);
            log.readings.push_back(y);
        }
        log.start = lab::ObserverStart::from_reading(log.readings[0], noise, car);
        const auto found = lab::trace(log, noise, false);
        std::size_t lost = 0;
        for (std::size_t k = 0; k < kSteps; ++k)
            if (worth_a_look(k) &&
                !positive(Eigen::Map<const Mat<6, 6>>(found.covariance.data() + 36 * k)))
                ++lost;
        EXPECT_EQ(lost, 0U);
    }
}

TEST(Covariances, OfTheLaboratorysGreyBox) {
    // The filter keeps no covariance to look at: where it is lost, variances of innovations are no
    // numbers any more.
    const lab::GreyBoxCar car{1500.0, 2500.0, 1.2, 1.4};
    lab::TyreRun run;
    std::mt19937 generator(5);
    std::normal_distribution<double> normal;
    for (std::size_t k = 0; k < kSteps; ++k) {
        const double t = 0.01 * static_cast<double>(k);
        lab::GreyBoxInput u{};
        u.steer_rad = 0.02 * std::sin(t);
        u.sin_steer = std::sin(u.steer_rad);
        u.cos_steer = std::cos(u.steer_rad);
        u.fz_front_n = u.fz_rear_n = 7000.0;
        run.inputs.push_back(u);
        run.measurements.push_back({20.0 + 0.05 * normal(generator), 0.05 * normal(generator),
                                    0.15 * std::sin(t), 3.0 * std::sin(t)});
    }
    lab::TyreProblem problem(car);
    problem.add_run(run);
    // Tyres, what the drag is made of, then factors of mass and inertia.
    const std::array<double, lab::kTyreParameters> p{10.0, 1.4, 1.0, 0.0, 11.0, 1.4, 1.0,
                                                     0.0,  0.0, 0.0, 0.0, 1.0,  1.0, 1.0};
    for (const double ratio : kRatios) {
        SCOPED_TRACE(ratio);
        std::array<double, lab::kGreyNoises> noise{0.05, 0.05, 0.005, 0.1, 0.5, 0.5, 0.1};
        for (std::size_t i = 0; i < noise.size(); ++i)
            noise[i] *= i < lab::kGreyChannels ? std::min(1.0, 1.0 / ratio) : std::min(1.0, ratio);
        const auto gains = problem.freeze(p.data(), noise.data());
        std::size_t lost = 0;
        for (const auto& g : gains.runs[0])
            for (std::size_t c = 0; c < lab::kGreyChannels; ++c)
                // No innovation is surer than its sensor.
                if (!(g.per_std[c] > 0.0 && g.per_std[c] <= (1.0 + 1e-9) / noise[c])) ++lost;
        EXPECT_EQ(lost, 0U);
    }
}

template <class Curve>
void of_a_curve() {
    for (const double noise_std : {1e-12, 1e-6, 1.0, 1e6}) {
        for (const double drift : {0.0, 1e-12, 1e-3}) {
            SCOPED_TRACE(testing::Message() << noise_std << ", " << drift);
            CurvePrior<Curve> prior;
            for (int i = 0; i < Curve::kParameters; ++i) {
                const auto at = static_cast<std::size_t>(i);
                prior.mean[i] = 0.5 * (Curve::kLower[at] + std::min(Curve::kUpper[at], 10.0));
            }
            prior.covariance = prior.mean.cwiseAbs2().asDiagonal();
            CurveFilterSettings<Curve> settings;
            settings.noise_std = noise_std;
            settings.drift_std.setConstant(drift);
            const CurveVec<Curve> truth = 0.9 * prior.mean;
            CurveReadings readings;
            for (std::size_t k = 0; k < kSteps / 2; ++k) {
                readings.slip.push_back(0.005 + 0.2 * static_cast<double>(k % 40) / 40.0);
                readings.mu.push_back(Curve::mu(readings.slip.back(), truth.data()));
            }
            std::size_t lost = 0, k = 0;
            for (const auto& step : filter_curve<Curve>(readings, prior, settings))
                if (worth_a_look(k++) && !positive(step.filter.covariance)) ++lost;
            EXPECT_EQ(lost, 0U);
        }
    }
}

TEST(Covariances, OfTheMuSlipFilters) {
    of_a_curve<TwoParameterCurve>();
    of_a_curve<MagicFormulaCurve>();
}

TEST(Covariances, OfRecursiveLeastSquares) {
    for (const double ratio : kRatios) {
        SCOPED_TRACE(ratio);
        CorneringRlsSettings settings{1500.0, 2500.0, 1.2, 1.4};
        settings.ay_std_mps2 = settings.yaw_acceleration_std_radps2 = 0.1 / ratio;
        CorneringRls rls(settings, 8e4, 9e4);
        std::mt19937 generator(3);
        std::normal_distribution<double> normal;
        std::size_t lost = 0;
        for (std::size_t k = 0; k < kSteps; ++k) {
            const double alpha = 0.02 * std::sin(0.01 * static_cast<double>(k));
            // In most samples both axles tell of one direction only.
            rls.step(alpha, k % 100 == 0 ? 0.5 * alpha : alpha, 110.0 * alpha + normal(generator),
                     -10.0 * alpha);
            if (worth_a_look(k) && !positive(rls.covariance())) ++lost;
        }
        EXPECT_EQ(lost, 0U);
    }
}

TEST(Covariances, OfTwinsSideBySide) {
    for (const double ratio : kRatios) {
        SCOPED_TRACE(ratio);
        BatchEstimator batch({{kMass, 10.0, 100.0, 0.0, 0.0, 1e4}, {1, 0.01, 0.1, 0.0, -1.0, 1.0}},
                             {{0, std::min(1.0, 1.0 / ratio)}, {1, std::min(1.0, 1.0 / ratio)}},
                             0.01);
        Estimates estimate{};
        estimate[kMass] = 1000.0;
        std::mt19937 generator(3);
        std::normal_distribution<double> normal;
        std::size_t lost = 0;
        for (std::size_t k = 0; k < kSteps; ++k) {
            const double e = std::min(1.0, 1.0 / ratio) * normal(generator);
            const double s = std::sin(0.01 * static_cast<double>(k));
            // Both parameters move both readings nearly alike.
            const std::array<double, 2> car{e, e};
            const std::array<double, 6> twins{0.0, 0.0, s, s, s, s * (1.0 + 1e-7)};
            batch.update(car.data(), twins.data(), 2, estimate);
            if (worth_a_look(k) && !positive(batch.covariance())) ++lost;
        }
        EXPECT_EQ(lost, 0U);
    }
}

ObservedCar observed_car() {
    ObservedCar out;
    out.data = saloon();
    out.yaw_inertia_kgm2 = 2500.0;
    out.front = out.rear = {10.0, 1.4, 1.0, 0.0};
    return out;
}

ObserverSettings scaled_settings(double ratio) {
    const double sensor = std::min(1.0, 1.0 / ratio), process = std::min(1.0, ratio);
    ObserverSettings s;
    for (double* v : {&s.vx_mps, &s.yaw_rate_radps, &s.ax_mps2, &s.ay_mps2, &s.model_ay_mps2})
        *v *= sensor;
    for (double* v : {&s.force_wander, &s.yaw_wander_radps, &s.sideslip_wander_rad,
                      &s.stiffness_wander, &s.fx_wander, &s.beta_wander_radps})
        *v *= process;
    return s;
}

template <class Observer>
void of_an_observer(Observer&& observer, std::size_t steps) {
    std::mt19937 generator(3);
    std::normal_distribution<double> normal;
    std::size_t lost = 0;
    for (std::size_t k = 0; k < steps; ++k) {
        const double swing = std::sin(0.01 * static_cast<double>(k));
        const auto e =
            observer.step(0.01, {0.03 * swing, 20.0 + 0.05 * normal(generator),
                                 0.2 * swing + 0.003 * normal(generator), 0.1 * normal(generator),
                                 4.0 * swing + 0.1 * normal(generator)});
        if (!(e.beta_std_rad > 0.0 && std::isfinite(e.beta_rad))) ++lost;
    }
    EXPECT_EQ(lost, 0U);
}

TEST(Covariances, OfTheSideslipObservers) {
    for (const double ratio : kRatios) {
        SCOPED_TRACE(ratio);
        const ObserverSettings s = scaled_settings(ratio);
        of_an_observer(SideslipUkf<Method::kExtended>(observed_car(), s, false), kSteps / 5);
        of_an_observer(SideslipUkf<Method::kUnscented>(observed_car(), s, false), kSteps / 5);
        of_an_observer(SideslipUkf<Method::kSquareRoot>(observed_car(), s, false), kSteps / 5);
        of_an_observer(SideslipDual(observed_car(), s), kSteps / 15);
    }
}

TEST(Covariances, LostOnesAreLiftedAndNeverMadeSurer) {
    Mat<3, 3> P;
    P << 4.0, 6.1, 0.0, 6.1, 9.0, 0.0, 0.0, 0.0, 1e-20;
    const Mat<3, 3> before = P;
    EXPECT_LT(lift_correlations<3>(P, 1e-13), -0.01);
    EXPECT_TRUE(positive(P));
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> added(Eigen::MatrixXd(P - before));
    EXPECT_GT(added.eigenvalues()[0], -1e-12);
    P(1, 2) = P(2, 1) = std::nan("");
    EXPECT_TRUE(std::isnan(lift_correlations<3>(P, 1e-13)));
}

}  // namespace
}  // namespace sysid::test
