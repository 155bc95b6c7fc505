// Covariances of the filters that likelihoods are made of.
#include "covariances.hpp"
#include "sysid/identify/run_system.hpp"
#include "sysid/lab/lab_em.hpp"

namespace sysid::test {
namespace {

TEST(Covariances, OfTheGreyBoxOfTheMainJob) {
    const SingleTrack model{saloon(), mask_of({"tyre_relaxation", "steer_lag"})};
    const Parameters p = typical_parameters();
    const sysid::Run run = noisy_run(model, p, 20'000, 0.01, 3);
    for (const double ratio : kRatios) {
        SCOPED_TRACE(ratio);
        Noise noise = ordinary_noise();
        for (double& s : noise.sensor) s *= std::min(1.0, 1.0 / ratio);
        for (double& s : noise.motion) s *= std::min(1.0, ratio);
        for (double& s : noise.disturbance) s *= std::min(1.0, ratio);
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

}  // namespace
}  // namespace sysid::test
