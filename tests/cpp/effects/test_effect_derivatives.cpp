// The derivatives that fitting and scoring rest on, against differences: every effect, by its own
// parameters, at random places of car, driving and parameters.
#include "helpers.hpp"
#include "sysid/identify/prediction_error.hpp"

namespace sysid::test {
namespace {

constexpr int kOutputs = kModelStates + kChannels;
using Outputs = Eigen::Matrix<double, kOutputs, 1>;

struct Place {
    ModelState<double> x{};
    Input u;
    std::array<double, kExternals> external{};
    Parameters p{};
    bool force_known = true;
    EffectMask others = 0;
};

/// Rates of all states and readings, one after the other.
template <class S>
std::array<S, kOutputs> outputs(const SingleTrack& model, const Place& at, const S* p) {
    ModelState<S> x;
    std::copy(at.x.begin(), at.x.end(), x.begin());
    std::array<S, kExternals> external;
    std::copy(at.external.begin(), at.external.end(), external.begin());
    std::array<S, kOutputs> out;
    const auto w = model.evaluate(x.data(), external.data(), x.data() + kMotionStates, at.u, p,
                                  out.data(), out.data() + kMotionStates);
    model.sense(w, p, x.data() + kMotionStates, out.data() + kModelStates);
    return out;
}

Place random_place(std::mt19937& generator, std::size_t effect) {
    std::uniform_real_distribution<double> part(-1.0, 1.0), share(0.02, 0.98);
    Place at;
    at.force_known = part(generator) > 0.0;
    at.others = part(generator) > 0.0 ? kAllEffects : 0;
    at.p = at.others != 0 ? typical_parameters() : plain_parameters();
    for (std::size_t j = 0; j < kBaseParameterCount; ++j) at.p[j] *= 1.0 + 0.3 * part(generator);
    const EffectInfo& info = kEffectInfos[effect];
    for (std::size_t j = 0; j < info.parameter_count(); ++j) {
        const ParameterInfo& q = info.parameters[j];
        // In the first half of the draws around typical sizes, else anywhere between the bounds.
        const double where = share(generator);
        at.p[kBaseParameterCount + effect_offset(effect) + j] =
            part(generator) > 0.0 ? q.usual.low + where * (q.usual.high - q.usual.low)
                                  : q.bounds.low + where * (q.bounds.high - q.bounds.low);
    }
    at.x = {25.0 + 20.0 * part(generator), 2.0 * part(generator), 0.7 * part(generator)};
    for (std::size_t i = kMotionStates; i < kModelStates; ++i) at.x[i] = 0.1 * part(generator);
    at.u = {0.15 * part(generator), (at.force_known ? 5000.0 : 5.0) * part(generator),
            10.0 + 10.0 * part(generator)};
    at.external = {200.0 * part(generator), 200.0 * part(generator), 200.0 * part(generator),
                   0.3 * part(generator), 0.3 * part(generator)};
    return at;
}

class Derivatives : public testing::TestWithParam<std::size_t> {};

INSTANTIATE_TEST_SUITE_P(Catalogue, Derivatives, testing::Range<std::size_t>(0, kEffectCount),
                         [](const auto& it) { return std::string(kEffectInfos[it.param].id); });

TEST_P(Derivatives, AgreeWithDifferencesAnywhere) {
    using D = Dual<kMaxEffectParameters>;
    const std::size_t effect = GetParam();
    const EffectInfo& info = kEffectInfos[effect];
    const std::size_t first = kBaseParameterCount + effect_offset(effect);
    std::mt19937 generator(7919 + static_cast<unsigned>(effect));
    int kinks = 0;
    constexpr int kPlaces = 200;
    for (int n = 0; n < kPlaces; ++n) {
        const Place at = random_place(generator, effect);
        const SingleTrack model{saloon(), at.others | EffectMask{1} << effect, at.force_known};
        std::vector<D> wide(at.p.begin(), at.p.end());
        for (std::size_t j = 0; j < info.parameter_count(); ++j) wide[first + j].d[j] = 1.0;
        const auto exact = outputs<D>(model, at, wide.data());
        for (std::size_t j = 0; j < info.parameter_count(); ++j) {
            const auto f = [&](double value) {
                Parameters p = at.p;
                p[first + j] = value;
                const auto out = outputs<double>(model, at, p.data());
                return Outputs(Eigen::Map<const Outputs>(out.data()));
            };
            const double here = at.p[first + j];
            const double step = 1e-4 * std::max(std::abs(here), info.parameters[j].matters);
            // At a kink, where a clamp begins, one side says something else than the other.
            const Outputs before = (f(here) - f(here - step)) / step;
            const Outputs after = (f(here + step) - f(here)) / step;
            const Outputs middle = central_difference(f, here, step);
            // What forces of 10 kN lose by rounding shows in how much other steps differ.
            const Outputs shorter = central_difference(f, here, 0.7 * step);
            const Outputs longer = central_difference(f, here, 1.4 * step);
            const Outputs rounding =
                (shorter - middle).cwiseAbs().cwiseMax((longer - middle).cwiseAbs());
            for (int i = 0; i < kOutputs; ++i) {
                const double scale =
                    std::abs(middle[i]) + (1.0 + std::abs(f(here)[i])) * 1e-9 / step;
                if (std::abs(after[i] - before[i]) > 0.05 * scale) {
                    ++kinks;
                    continue;
                }
                EXPECT_NEAR(exact[static_cast<std::size_t>(i)].d[j], middle[i],
                            1e-5 * scale + rounding[i])
                    << info.parameters[j].name << " = " << here << ", output " << i << ", place "
                    << n << (at.others != 0 ? ", among all others" : ", alone");
            }
        }
    }
    EXPECT_LE(kinks, kPlaces * kOutputs / 100) << "differences tell nothing there";
}

// A stiffness says how many parts an interval needs. Were they counted anew for each value,
// residuals would jump, and no derivative would tell of it.
TEST(Residuals, DoNotJumpWhereAnIntervalNeedsOnePartMore) {
    const SingleTrack model{saloon(), mask_of({"tyre_relaxation"})};
    Parameters p = typical_parameters();
    Problem problem{model, {}};
    problem.runs.push_back(noisy_run(model, p, 200, 0.1, 5));
    const std::size_t relaxation = parameter_of("tyre_relaxation");
    for (const std::size_t column : {std::size_t{kBFront}, std::size_t{kYawInertia}, relaxation}) {
        const double usual = p[column];
        for (int n = 0; n < 40; ++n) {
            p[column] = usual * (0.8 + 0.01 * n);
            const FrozenFilter filter = freeze(problem, p.data(), ordinary_noise());
            Eigen::VectorXd exact(static_cast<Eigen::Index>(problem.samples() * kChannels));
            sensitivities(problem, p.data(), filter, {static_cast<int>(column)}, exact.data());
            const auto f = [&](double value) {
                Parameters q = p;
                q[column] = value;
                Eigen::VectorXd out(exact.size());
                residuals(problem, q.data(), filter, out.data());
                return out;
            };
            const Eigen::VectorXd differences = central_difference(f, p[column], 1e-3 * p[column]);
            EXPECT_LT((exact + differences).norm(), 1e-4 * exact.norm()) << column << ", " << n;
        }
        p[column] = usual;
    }
}

}  // namespace
}  // namespace sysid::test
