// Kernels on objects that several threads share and none of them changes: the same numbers as in
// one thread, and under the thread sanitizer no race. Part of the ordinary tests, and a program of
// its own for that sanitizer, under which all of the tests would take too long.
#include <thread>

#include "helpers.hpp"
#include "sysid/identify/prediction_error.hpp"
#include "sysid/math/interrupt.hpp"
#include "sysid/online/sideslip_dual.hpp"
#include "sysid/simulate/simulator.hpp"

namespace sysid::test {
namespace {

/// The results of the same work in four threads that begin together.
template <class Work>
auto side_by_side(const Work& work) {
    std::vector<decltype(work())> found(4);
    std::vector<std::thread> threads;
    for (auto& result : found) threads.emplace_back([&] { result = work(); });
    for (std::thread& t : threads) t.join();
    return found;
}

template <class Work>
void expect_the_same(const Work& work) {
    const auto alone = work();
    for (const auto& found : side_by_side(work)) EXPECT_EQ(found, alone);
}

class SharedProblem : public testing::Test {
  protected:
    SharedProblem() {
        problem_.model = {saloon(), mask_of({"tyre_relaxation", "tyre_load_sensitivity"})};
        problem_.runs.push_back(noisy_run(problem_.model, p_, 200, 0.02, 3));
        problem_.runs.push_back(noisy_run(problem_.model, p_, 150, 0.02, 4));
    }
    Parameters p_ = typical_parameters();
    Noise noise_ = ordinary_noise();
    Problem problem_;
};

TEST_F(SharedProblem, Filter) {
    expect_the_same([&] { return freeze(problem_, p_.data(), noise_).log_likelihood; });
    expect_the_same([&] { return trace(problem_, p_.data(), noise_, true).whitened; });
}

TEST_F(SharedProblem, ResidualsAndSensitivitiesOfOneFilter) {
    const FrozenFilter filter = freeze(problem_, p_.data(), noise_);
    const std::vector<int> columns{0, 1, 2, 3, 4, 5, 6, 7, 8};
    expect_the_same([&] {
        std::vector<double> out(problem_.samples() * kChannels * columns.size());
        sensitivities(problem_, p_.data(), filter, columns, out.data());
        return out;
    });
}

TEST_F(SharedProblem, Score) {
    expect_the_same([&] {
        std::vector<double> out(kNoiseParameters * (1 + kNoiseParameters));
        noise_score(problem_, p_.data(), noise_, out.data(), out.data() + kNoiseParameters);
        return out;
    });
}

TEST_F(SharedProblem, Simulation) {
    const std::vector<Reference> references(300, Reference{20.0, 0.01, 0.02});
    const std::vector<double> calm(kPushes * references.size());
    const Driver driver{};
    expect_the_same([&] {
        return simulate(problem_.model, p_.data(), 0.01, references, driver, calm.data(), {})
            .states;
    });
}

TEST(Threads, ObserversOfOneCar) {
    ObservedCar car;
    car.data = saloon();
    car.yaw_inertia_kgm2 = 2500.0;
    car.front = car.rear = {10.0, 1.4, 1.0, 0.0};
    expect_the_same([&] {
        SideslipDual observer(car, {});
        std::vector<double> beta;
        for (int k = 0; k < 200; ++k) {
            const double swing = std::sin(0.05 * k);
            beta.push_back(
                observer.step(0.01, {0.02 * swing, 20.0, 0.1 * swing, 0.0, 2.0 * swing}).beta_rad);
        }
        return beta;
    });
}

TEST(Threads, GuardsAreOfTheirThread) {
    // Each thread is interrupted by its own guard, the one without goes on.
    struct Enough {};
    expect_the_same([] {
        const InterruptGuard guard([] { throw Enough{}; });
        try {
            for (;;) poll_interrupt();
        } catch (const Enough&) {
            return 1;
        }
    });
    poll_interrupt();
}

}  // namespace
}  // namespace sysid::test
