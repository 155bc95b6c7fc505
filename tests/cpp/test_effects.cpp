// What every effect of the catalogue must do, whatever its equation.
#include <set>
#include <sstream>

#include "helpers.hpp"

namespace sysid::test {
namespace {

const std::array<std::string, kChannels> kChannelNames{"vx_mps", "vy_mps", "yaw_rate_radps",
                                                       "ax_mps2", "ay_mps2"};

class AnyEffect : public testing::TestWithParam<std::size_t> {
  protected:
    std::size_t index() const { return GetParam(); }
    const EffectInfo& info() const { return kEffectInfos[index()]; }
    EffectMask mask() const { return EffectMask{1} << index(); }
    std::size_t first() const { return kBaseParameterCount + effect_offset(index()); }
};

INSTANTIATE_TEST_SUITE_P(Catalogue, AnyEffect, testing::Range<std::size_t>(0, kEffectCount),
                         [](const auto& it) { return std::string(kEffectInfos[it.param].id); });

TEST_P(AnyEffect, AtItsNullValueIsNotThere) {
    // Alone and among all others: to the last bit.
    const Parameters p = plain_parameters();
    Parameters others = typical_parameters();
    for (std::size_t j = 0; j < info().parameter_count; ++j) others[first() + j] = p[first() + j];
    std::mt19937 generator(11);
    std::uniform_real_distribution<double> part(-1.0, 1.0);
    for (bool force_known : {true, false}) {
        for (int n = 0; n < 20; ++n) {
            const ModelState<double> x{25.0 + 10.0 * part(generator), part(generator),
                                       0.5 * part(generator),         0.1 * part(generator),
                                       0.1 * part(generator),         0.1 * part(generator)};
            const Input u{0.1 * part(generator), (force_known ? 5000.0 : 4.0) * part(generator)};
            const std::array<double, kPushes> push{100.0 * part(generator), 100.0 * part(generator),
                                                   100.0 * part(generator), 0.1, -0.1};
            const auto off = evaluate({saloon(), 0, force_known}, x, u, p, push);
            const auto on = evaluate({saloon(), mask(), force_known}, x, u, p, push);
            EXPECT_EQ(on.rate, off.rate);
            EXPECT_EQ(on.y, off.y);
            const auto without =
                evaluate({saloon(), kAllEffects & ~mask(), force_known}, x, u, others, push);
            const auto with = evaluate({saloon(), kAllEffects, force_known}, x, u, others, push);
            EXPECT_EQ(with.rate, without.rate);
            EXPECT_EQ(with.y, without.y);
        }
    }
}

TEST_P(AnyEffect, MovesTheChannelsItNames) {
    // Derivative of the readings along a drive, at the null values or, where that derivative does
    // not exist, at typical ones. `matters` sized steps must reach a visible size.
    using D = Dual<kMaxEffectParameters>;
    const SingleTrack model{saloon(), mask(), true};
    const double dt = 0.01;
    const Parameters values = info().scored_at_typical ? typical_parameters() : plain_parameters();
    for (std::size_t j = 0; j < info().parameter_count; ++j) {
        std::vector<D> p(values.begin(), values.end());
        p[first() + j].d[j] = 1.0;
        ModelState<D> x{};
        x[0] = D(25.0);
        const std::array<D, kPushes> calm{};
        std::array<double, kChannels> most{};
        for (int k = 0; k < 150; ++k) {
            advance(model, x, calm.data(), lively(k * dt), lively((k + 1) * dt), p.data(), dt, 4);
            const auto y = sense(model, x, calm.data(), lively((k + 1) * dt), p.data());
            for (std::size_t i = 0; i < kChannels; ++i)
                most[i] = std::max(most[i], std::abs(y[i].d[j]));
        }
        double visible = 0.0;
        const std::array<double, kChannels> spread{0.05, 0.03, 0.003, 0.1, 0.1};
        for (std::size_t i = 0; i < kChannels; ++i)
            visible = std::max(visible, most[i] * info().parameters[j].matters / spread[i]);
        EXPECT_GT(visible, 0.05) << info().parameters[j].name;
    }
    std::istringstream named(info().moves);
    std::string channel;
    int channels = 0;
    while (std::getline(named, channel, ',')) {
        channel.erase(0, channel.find_first_not_of(' '));
        const auto* const found = std::find(kChannelNames.begin(), kChannelNames.end(), channel);
        ASSERT_NE(found, kChannelNames.end()) << channel;
        const auto i = static_cast<std::size_t>(found - kChannelNames.begin());
        double most = 0.0;
        for (std::size_t j = 0; j < info().parameter_count; ++j) {
            Parameters p = values;
            p[first() + j] = info().parameters[j].typical;
            std::vector<Input> inputs;
            for (int k = 0; k < 150; ++k) inputs.push_back(lively(k * dt));
            const auto with = drive(model, p, inputs, dt, 25.0);
            const auto without = drive({saloon(), 0, true}, plain_parameters(), inputs, dt, 25.0);
            for (std::size_t k = 0; k < with.size(); ++k)
                most = std::max(
                    most, std::abs(with[k][static_cast<int>(i)] - without[k][static_cast<int>(i)]));
        }
        EXPECT_GT(most, 1e-3) << channel;
        ++channels;
    }
    EXPECT_GE(channels, 1);
}

TEST_P(AnyEffect, BoundsHoldNullAndTypical) {
    ASSERT_GE(info().parameter_count, 1U);
    ASSERT_LE(info().parameter_count, kMaxEffectParameters);
    for (std::size_t j = 0; j < info().parameter_count; ++j) {
        const ParameterInfo& q = info().parameters[j];
        EXPECT_LT(q.lower, q.upper) << q.name;
        EXPECT_GE(q.null_value, q.lower) << q.name;
        EXPECT_LT(q.null_value, q.upper) << q.name;
        EXPECT_GT(q.typical, q.lower) << q.name;
        EXPECT_LT(q.typical, q.upper) << q.name;
        EXPECT_GT(q.matters, 0.0) << q.name;
        EXPECT_GT(std::abs(q.typical - q.null_value), q.matters) << q.name;
    }
}

TEST_P(AnyEffect, DescribesItself) {
    for (const char* text :
         {info().id, info().title, info().equation, info().source, info().excited_by})
        EXPECT_FALSE(std::string(text).empty());
    for (std::size_t j = 0; j < info().parameter_count; ++j) {
        EXPECT_FALSE(std::string(info().parameters[j].name).empty());
        EXPECT_FALSE(std::string(info().parameters[j].unit).empty());
    }
}

TEST(Catalogue, WhatNeedsTheForceDoesNothingWithoutIt) {
    // With a measured acceleration in place of the force, neither motion nor readings change; of
    // all other effects, they do.
    const Parameters p = typical_parameters();
    ModelState<double> x{25.0, 0.4, 0.3};
    for (std::size_t i = 0; i < kEffectCount; ++i) {
        const auto off = evaluate({saloon(), 0, false}, x, {0.05, 1.5}, p);
        const auto on = evaluate({saloon(), EffectMask{1} << i, false}, x, {0.05, 1.5}, p);
        double change = 0.0;
        for (std::size_t n = 0; n < kMotionStates; ++n)
            change = std::max(change, std::abs(on.rate[n] - off.rate[n]));
        for (std::size_t n = 0; n < kChannels; ++n)
            change = std::max(change, std::abs(on.y[n] - off.y[n]));
        if (kEffectInfos[i].needs_force) {
            EXPECT_LT(change, 1e-12) << kEffectInfos[i].id;
        } else {
            EXPECT_GT(change, 1e-4) << kEffectInfos[i].id;
        }
    }
}

TEST(Catalogue, NamesAreUnique) {
    std::set<std::string> ids;
    std::set<std::string> parameters;
    for (const EffectInfo& info : kEffectInfos) {
        EXPECT_TRUE(ids.insert(info.id).second) << info.id;
        for (std::size_t j = 0; j < info.parameter_count; ++j)
            EXPECT_TRUE(
                parameters.insert(std::string(info.id) + "." + info.parameters[j].name).second);
    }
    EXPECT_EQ(parameters.size(), kEffectParameterCount);
}

TEST(Catalogue, OffsetsFollowEachOther) {
    for (std::size_t i = 0; i + 1 < kEffectCount; ++i)
        EXPECT_EQ(effect_offset(i + 1), effect_offset(i) + kEffectInfos[i].parameter_count);
    EXPECT_EQ(effect_offset(0), 0U);
    EXPECT_EQ(kParameterCount, kBaseParameterCount + kEffectParameterCount);
}

TEST(Catalogue, StatesOfTheirOwn) {
    for (std::size_t i = 0; i < kEffectCount; ++i) {
        const std::string id = kEffectInfos[i].id;
        EXPECT_EQ(has_own_states(EffectMask{1} << i), id == "steer_lag" || id == "tyre_relaxation")
            << id;
    }
    EXPECT_FALSE(has_own_states(0));
    EXPECT_TRUE(has_own_states(kAllEffects));
}

}  // namespace
}  // namespace sysid::test
