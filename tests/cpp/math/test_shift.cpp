// Signals between their samples, and logged steering at the time at which it acts.
#include "helpers.hpp"
#include "sysid/dynamics/steer_delay.hpp"
#include "sysid/identify/prediction_error.hpp"
#include "sysid/math/shift.hpp"

namespace sysid::test {
namespace {

struct Shifted {
    std::vector<double> value, slope;
    Shifted(const std::vector<double>& u, double late) : value(u.size()), slope(u.size()) {
        shift_in_time(u.data(), u.size(), late, value.data(), slope.data());
    }
};

std::vector<double> noise(std::size_t count) {
    std::mt19937 generator(3);
    std::normal_distribution<double> normal;
    std::vector<double> u(count);
    for (double& x : u) x = normal(generator);
    return u;
}

TEST(Shift, ASineIsTheSineAtThatTime) {
    const double omega = 0.4;  // per sample: 6 Hz of 100
    std::vector<double> u;
    for (int k = 0; k < 200; ++k) u.push_back(3.0 + std::sin(omega * k));
    for (const double late : {0.0, 4.0, -4.0, 1.37, -2.5, -0.003}) {
        const Shifted out(u, late);
        for (std::size_t k = 15; k < 185; ++k) {
            const double at = omega * (static_cast<double>(k) - late);
            EXPECT_NEAR(out.value[k], 3.0 + std::sin(at), 1e-3) << late;
            EXPECT_NEAR(out.slope[k], omega * std::cos(at), 2e-3) << late;
        }
        // Beyond the ends it goes on with the value and the slope that it had there.
        for (const std::size_t k : {std::size_t{0}, std::size_t{199}}) {
            const double end = k == 0 ? std::max(late, 0.0) : std::max(-late, 0.0);
            const double at = omega * (static_cast<double>(k) - late);
            EXPECT_NEAR(out.value[k], 3.0 + std::sin(at), 2e-2 + omega * omega * end * end) << late;
        }
    }
}

TEST(Shift, ByWholeSamplesGivesTheSamples) {
    const std::vector<double> u = noise(40);
    EXPECT_EQ(Shifted(u, 0.0).value, u);
    const std::vector<double> late = Shifted(u, 3.0).value, early = Shifted(u, -3.0).value;
    for (std::size_t k = 3; k < u.size(); ++k) {
        EXPECT_EQ(late[k], u[k - 3]);
        EXPECT_EQ(early[k - 3], u[k]);
    }
}

TEST(Shift, SlopesAreDerivativesOfTheValuesAndGoOnOverWholeSamples) {
    const std::vector<double> u = noise(60);
    for (const double late : {-2.6, -1.0, 0.0, 0.4, 3.0}) {
        const Shifted out(u, late);
        for (std::size_t k = 0; k < u.size(); ++k) {
            const double slope =
                central_difference([&](double x) { return Shifted(u, x).value[k]; }, late, 1e-3);
            EXPECT_NEAR(out.slope[k], -slope, 1e-5) << late << " " << k;
        }
    }
}

TEST(Shift, NoiseStaysAsLarge) {
    const std::vector<double> u = noise(4000);
    const Shifted out(u, 0.5);
    double before = 0.0, after = 0.0;
    for (std::size_t k = 0; k < u.size(); ++k) {
        before += u[k] * u[k];
        after += out.value[k] * out.value[k];
    }
    EXPECT_GT(after / before, 0.85);  // on straight lines it would be 0.5
}

TEST(SteerDelay, IsAShiftOfTheLogInEitherDirection) {
    // Residuals of a log whose steering was written at other times, and of the log as it was.
    const SingleTrack plain{saloon()}, late{saloon(), mask_of({"steer_delay"})};
    Parameters p = plain_parameters();
    const Problem whole{plain, {noisy_run(plain, p, 300, 0.01, 5)}};
    for (const int samples : {4, -3}) {
        Problem moved{late, whole.runs};
        auto& run = moved.runs[0];
        for (int i = 12; i > 0; --i) {  // what is known around the run makes its ends exact
            run.steer_before.push_back(lively(0.01 * (samples - i)).steer_rad);
            run.steer_after.push_back(lively(0.01 * (300 + samples + 12 - i)).steer_rad);
        }
        for (std::size_t k = 0; k < 300; ++k) {
            const double at = 0.01 * (static_cast<double>(k) + samples);
            run.inputs[k].steer_rad = lively(at).steer_rad;
        }
        p[parameter_of("steer_delay")] = 0.01 * samples;
        const Noise noise = ordinary_noise();
        std::vector<double> a(1500), b(1500);
        residuals(whole, p.data(), freeze(whole, p.data(), noise), a.data());
        residuals(moved, p.data(), freeze(moved, p.data(), noise), b.data());
        for (std::size_t i = 0; i < 1500; ++i) EXPECT_NEAR(a[i], b[i], 1e-9) << i / 5;
        // Without it they are guessed, and the middle of the run does not know.
        run.steer_before.clear();
        run.steer_after.clear();
        residuals(moved, p.data(), freeze(moved, p.data(), noise), b.data());
        for (std::size_t i = 0; i < 1500; ++i) EXPECT_NEAR(a[i], b[i], 1.0) << i / 5;
        for (std::size_t i = 750; i < 1400; ++i) EXPECT_NEAR(a[i], b[i], 1e-6) << i / 5;
    }
}

TEST(SteerDelay, ManySetsOfParametersAreWorkedOutAsOneIs) {
    const SingleTrack model{saloon(), mask_of({"steer_delay"})};
    const Problem problem{model, {noisy_run(model, plain_parameters(), 300, 0.01, 6)}};
    const Noise noise = ordinary_noise();
    for (const bool alike : {true, false}) {
        std::vector<Parameters> sets(5, plain_parameters());
        std::vector<const double*> all;
        for (std::size_t i = 0; i < sets.size(); ++i) {
            const auto size = static_cast<double>(i);
            sets[i][kDFront] += 0.01 * size;
            sets[i][parameter_of("steer_delay")] = alike ? 0.013 : -0.02 + 0.011 * size;
            all.push_back(sets[i].data());
        }
        std::vector<double> together(sets.size());
        log_likelihoods(problem, all, noise, together.data());
        for (std::size_t i = 0; i < sets.size(); ++i) {
            const double alone = freeze(problem, all[i], noise).log_likelihood;
            EXPECT_NEAR(together[i], alone, 1e-6 * std::abs(alone));
        }
    }
}

}  // namespace
}  // namespace sysid::test
