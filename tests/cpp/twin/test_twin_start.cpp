// A start that twins side by side look for beside the parameters.
#include <gtest/gtest.h>

#include <cmath>
#include <utility>
#include <vector>

#include "sysid/twin/batch.hpp"

using namespace sysid;

namespace {

constexpr double kDt = 1e-3;

Estimates start() { return to_estimates(Load{}); }

/// A reading of one over the mass, by a car of 2000 kg.
double read(double mass, double t) { return 4000.0 * std::sin(t) / mass; }

}  // namespace

TEST(TwinBatch, AStartIsLookedForBesideTheParametersAndMovesNone) {
    // The twin reads too much by an offset, which the step to its second twin shows.
    const auto found = [](bool known) {
        std::vector<BatchParameter> looked_for{{kMass, 20.0, 300.0, 0.0, 1000.0, 3000.0}};
        if (known) {
            looked_for.push_back({kMass, 0.01, 1.0});
            looked_for.back().start = true;
        }
        BatchEstimator batch(looked_for, {{0, 0.05, 0.0}}, kDt);
        Estimates estimate = start();
        double offset = 0.5;
        for (int k = 0; k < 20000; ++k) {
            const double t = k * kDt;
            const double car = read(2000.0, t);
            std::vector<double> twins;
            for (std::size_t j = 0; j < batch.twins(); ++j)
                twins.push_back(read(batch.of_twin(j, estimate)[kMass], t) + offset +
                                (j == 2 ? 0.01 : 0.0));
            const Eigen::VectorXd moved = batch.update(&car, twins.data(), 1, estimate);
            if (known) offset += 0.01 * moved[1];
        }
        EXPECT_EQ(estimate[kCgZ], start()[kCgZ]);
        return std::pair{estimate[kMass], offset};
    };
    EXPECT_GT(std::abs(found(false).first - 2000.0), 1.0);
    EXPECT_NEAR(found(true).first, 2000.0, 0.1);
    EXPECT_NEAR(found(true).second, 0.0, 1e-3);
}
