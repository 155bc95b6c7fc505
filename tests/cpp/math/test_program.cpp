// Programs that recorded numbers write down, and the kernels that run them.
#include <limits>
#include <random>

#include "helpers.hpp"
#include "kernels.hpp"
#include "sysid/identify/prediction_error.hpp"
#include "sysid/math/recorder.hpp"

namespace sysid::test {
namespace {

class Kernels : public OfEachProcessor {};
INSTANTIATE_TEST_SUITE_P(All, Kernels, testing::ValuesIn(all_lane_kernels()), kernels_name);

constexpr std::size_t kAsked = 21;

/// Every step that a program may have, on three numbers and a parameter.
template <class S>
std::array<S, kAsked> everything(const S& x, const S& y, const S& z, const S& p) {
    using std::abs;
    using std::atan;
    using std::cos;
    using std::exp;
    using std::log;
    using std::sin;
    using std::sqrt;
    using std::tanh;
    const LagWeights<S> small(S(0.1 * z)), large(S(3.0 + z));
    const auto gentle = phi_weights(S(0.1 * x)), quick = phi_weights(S(0.6 + z));
    return {x,
            S(7.0),
            x + y * p,
            x - y,
            x / (2.0 + z) + 1.0 / z,
            2.0 - x * x,
            sin(x) * cos(y),
            S(cos(30.0 * x)),
            S(sin(1e6 * x)),
            atan(x) + atan(5.0 * y) - atan(0.1 * x),
            direction(x, z) + direction(y, S(-z)),
            sqrt(z) * p * p,
            exp(-x) + exp(S(710.0 * p - 720.0)),
            log(z) + tanh(x),
            abs(x) * y,
            if_below(x, 0.2, S(y * y), S(x * p)),
            small.kept * small.J0 + small.J1 - 2.0 * small.J2,
            large.kept * large.J0 + large.J1 - 2.0 * large.J2,
            S(sqrt(p) + exp(p) - 3.0 / p),
            S(lag_rate(p) * x),
            gentle[1] - gentle[2] * gentle[3] + quick[1] + 2.0 * quick[2] - quick[3]};
}

TEST_P(Kernels, GiveValuesAndDerivativesOfEveryStep) {
    constexpr double kParameter = 1.3;
    using D = Dual<4>;
    Recorder to;
    std::array<Recorded, 3> in;
    for (Recorded& x : in) x = to.input(true);
    const auto outputs = everything(in[0], in[1], in[2], to.parameter(kParameter, true));
    const Program program = to.program({outputs.begin(), outputs.end()});

    std::vector<LaneRow> rows(static_cast<std::size_t>(program.rows));
    for (const auto& [row, value] : program.uniform)
        std::fill_n(rows[static_cast<std::size_t>(row)].at, kLanes, value);
    std::mt19937 generator(4);
    std::uniform_real_distribution<double> any(-3.0, 3.0);
    for (std::size_t i = 0; i < 3; ++i)
        for (double& x : rows[static_cast<std::size_t>(program.inputs[i])].at)
            x = i < 2 ? any(generator) : 0.1 + std::abs(any(generator));
    lane_kernels().forward(program.steps.data(), program.steps.size(), rows.data());

    std::array<std::array<D, kAsked>, kLanes> expected;
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
        const auto seeded = [&](std::size_t i) {
            const double v =
                i < 3 ? rows[static_cast<std::size_t>(program.inputs[i])].at[lane] : kParameter;
            return D::seeded(v, static_cast<int>(i));
        };
        expected[lane] = everything(seeded(0), seeded(1), seeded(2), seeded(3));
        for (std::size_t o = 0; o < kAsked; ++o) {
            const double value = rows[static_cast<std::size_t>(program.outputs[o])].at[lane];
            EXPECT_NEAR(value, expected[lane][o].v, 1e-13 * (1.0 + std::abs(value))) << o;
        }
    }
    EXPECT_EQ(program.same_as[0], 0);
    std::size_t swept = 0;
    for (const Sweep& s : program.sweeps) {
        const std::size_t wide = s.outputs.size();
        std::vector<LaneRow> adjoints(static_cast<std::size_t>(s.slots) * wide);
        for (LaneRow& row : adjoints) std::fill_n(row.at, kLanes, std::nan(""));
        const auto slot = [&](std::int32_t i) {
            return adjoints.data() + static_cast<std::size_t>(i) * wide;
        };
        for (const std::int32_t i : s.seeds)
            for (std::size_t m = 0; m < wide; ++m) std::fill_n(slot(i)[m].at, kLanes, 0.0);
        for (std::size_t m = 0; m < wide; ++m) std::fill_n(slot(s.seeds[m])[m].at, kLanes, 1.0);
        lane_kernels().backward(s.steps.data(), s.steps.size(), static_cast<int>(wide), rows.data(),
                                adjoints.data());
        swept += wide;
        for (std::size_t m = 0; m < wide; ++m)
            for (std::size_t i = 0; i < 4; ++i)
                for (std::size_t lane = 0; lane < kLanes; ++lane) {
                    const double slope = s.inputs[i] < 0 ? 0.0 : slot(s.inputs[i])[m].at[lane];
                    const double wanted =
                        expected[lane][static_cast<std::size_t>(s.outputs[m])].d[i];
                    EXPECT_NEAR(slope, wanted, 1e-12 * (1.0 + std::abs(wanted)))
                        << "output " << s.outputs[m] << " by " << i;
                }
    }
    EXPECT_EQ(swept, kAsked - 2);  // one is an input, one a constant
}

/// Of lags that go to nothing, in some lanes or in all.
TEST_P(Kernels, TakeExponentialsThatUnderflowForNothing) {
    for (const double least : {0.0, 800.0}) {
        Recorder to;
        const Recorded x = to.input(true);
        const Program program = to.program({exp(-x)});
        std::vector<LaneRow> rows(static_cast<std::size_t>(program.rows));
        LaneRow& given = rows[static_cast<std::size_t>(program.inputs[0])];
        for (std::size_t lane = 0; lane < kLanes; ++lane)
            given.at[lane] = least + 90.0 * static_cast<double>(lane);
        given.at[kLanes - 1] = std::numeric_limits<double>::infinity();
        const LaneRow before = given;
        lane_kernels().forward(program.steps.data(), program.steps.size(), rows.data());
        for (std::size_t lane = 0; lane < kLanes; ++lane) {
            const double value = rows[static_cast<std::size_t>(program.outputs[0])].at[lane];
            const double wanted = std::exp(-before.at[lane]);
            EXPECT_NEAR(value, wanted, 1e-13 * wanted + 1e-300) << "x " << before.at[lane];
        }
    }
}

TEST_P(Kernels, AgreeOnAllEffects) {
    const Parameters p = typical_parameters();
    Problem problem{{saloon(), kAllEffects}, {}};
    problem.runs.push_back(noisy_run({saloon(), kAllEffects}, p, 50, 0.01, 1));
    problem.runs.push_back(noisy_run({saloon(), kAllEffects}, p, 30, 0.07, 2));  // several parts
    const FrozenFilter filter = freeze(problem, p.data(), ordinary_noise());
    const std::vector<int> columns{0, 3, 8, 9, 20, 25, 40, 60};
    const auto equations = [&] {
        Eigen::VectorXd all(8 * 9);
        normal_equations(problem, p.data(), filter, columns, all.data(), all.data() + 8);
        return all;
    };
    const Eigen::VectorXd here = equations();
    use_lane_kernels(*all_lane_kernels().front());
    const Eigen::VectorXd plain = equations();
    ASSERT_TRUE(here.allFinite());
    for (int i = 0; i < here.size(); ++i)
        EXPECT_NEAR(here[i], plain[i], 1e-11 * plain.cwiseAbs().maxCoeff());
    for (int i = 0; i < 8; ++i) {
        const double own = plain[8 + 9 * i];
        EXPECT_NEAR(here[8 + 9 * i], own, 1e-11 * own) << "parameter " << i;
    }
}

TEST(Recorded, InputsWithoutDerivativesHaveNone) {
    Recorder to;
    const Recorded given = to.input(false), x = to.input(true);
    const Program program = to.program({given, x, given * given, x * given});
    EXPECT_EQ(program.same_as, (std::vector<int>{-1, 1, -1, -1}));
    ASSERT_EQ(program.sweeps.size(), 1U);
    EXPECT_EQ(program.sweeps[0].outputs, std::vector<int>{3});
    EXPECT_EQ(program.sweeps[0].inputs[0], -1);
}

TEST(Recorded, ConditionsAreAskedOnlyOfWhatIsTheSameForAll) {
    Recorder to;
    const Recorded x = to.input(true), p = to.parameter(2.0, true);
    EXPECT_EQ(value_of(p * p + 1.0), 5.0);
    EXPECT_THROW(value_of(x * p), std::logic_error);
}

}  // namespace
}  // namespace sysid::test
