// What every effect of the catalogue must do, whatever its equation.
#include <map>
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
    bool scanned(std::size_t j) const { return info().parameters[j].scan != Scan::kNone; }
};

INSTANTIATE_TEST_SUITE_P(Catalogue, AnyEffect, testing::Range<std::size_t>(0, kEffectCount),
                         [](const auto& it) { return std::string(kEffectInfos[it.param].id); });

TEST_P(AnyEffect, AtItsNullValueIsNotThere) {
    // Alone and among all others: to the last bit.
    const Parameters p = plain_parameters();
    Parameters others = typical_parameters();
    for (std::size_t j = 0; j < info().parameter_count(); ++j) others[first() + j] = p[first() + j];
    std::mt19937 generator(11);
    std::uniform_real_distribution<double> part(-1.0, 1.0);
    for (bool force_known : {true, false}) {
        for (int n = 0; n < 20; ++n) {
            ModelState<double> x{25.0 + 10.0 * part(generator), part(generator),
                                 0.5 * part(generator)};
            for (std::size_t i = kMotionStates; i < kModelStates; ++i) x[i] = 0.1 * part(generator);
            const Input u{0.1 * part(generator), (force_known ? 5000.0 : 4.0) * part(generator),
                          5.0 + part(generator)};
            const std::array<double, kExternals> external{100.0 * part(generator),
                                                          100.0 * part(generator),
                                                          100.0 * part(generator), 0.1, -0.1};
            const auto off = evaluate({saloon(), 0, force_known}, x, u, p, external);
            const auto on = evaluate({saloon(), mask(), force_known}, x, u, p, external);
            EXPECT_EQ(motion_of(on.rate), motion_of(off.rate));
            EXPECT_EQ(on.y, off.y);
            const auto without =
                evaluate({saloon(), kAllEffects & ~mask(), force_known}, x, u, others, external);
            const auto with =
                evaluate({saloon(), kAllEffects, force_known}, x, u, others, external);
            EXPECT_EQ(motion_of(with.rate), motion_of(without.rate));
            EXPECT_EQ(with.y, without.y);
        }
    }
}

TEST_P(AnyEffect, MovesTheChannelsItNames) {
    // Derivative of the readings along a drive, at the null values or, where that derivative does
    // not exist, at typical ones. `matters` sized steps must reach a visible size.
    using D = Dual<kMaxEffectParameters>;
    const EffectMask by = *info().through != 0 ? mask_of({info().through}) : 0;
    const SingleTrack model{saloon(), mask() | by, true};
    const double dt = 0.01;
    // What acts through the friction ellipse needs braking to be seen.
    const auto driven = [&](double time) {
        Input u = lively(time);
        if (by != 0) u.longitudinal *= 4.0;
        return u;
    };
    Parameters values = info().scored_at_typical ? typical_parameters() : plain_parameters();
    if (by != 0) values[parameter_of(info().through)] = 1.0;
    for (std::size_t j = 0; j < info().parameter_count(); ++j)
        if (scanned(j))  // within this short drive
            values[first() + j] = std::max(0.3, info().parameters[j].bounds.low);
    const Parameters bare = values;
    for (std::size_t j = 0; j < info().parameter_count(); ++j) {
        if (scanned(j)) continue;
        std::vector<D> p(values.begin(), values.end());
        p[first() + j].d[j] = 1.0;
        ModelState<D> x{};
        x[0] = D(25.0);
        const std::array<D, kExternals> calm{};
        std::array<double, kChannels> most{};
        for (int k = 0; k < 150; ++k) {
            advance(model, x, calm.data(), driven(k * dt), driven((k + 1) * dt), p.data(), dt, 4);
            const auto y = sense(model, x, calm.data(), driven((k + 1) * dt), p.data());
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
        for (std::size_t j = 0; j < info().parameter_count(); ++j) {
            if (scanned(j)) continue;
            Parameters p = values;
            p[first() + j] = info().parameters[j].typical;
            std::vector<Input> inputs;
            for (int k = 0; k < 150; ++k) inputs.push_back(driven(k * dt));
            const auto with = drive(model, p, inputs, dt, 25.0);
            const auto without = drive({saloon(), by, true}, bare, inputs, dt, 25.0);
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
    ASSERT_GE(info().parameter_count(), 1U);
    ASSERT_LE(info().parameter_count(), kMaxEffectParameters);
    for (std::size_t j = 0; j < info().parameter_count(); ++j) {
        const ParameterInfo& q = info().parameters[j];
        EXPECT_LT(q.bounds.low, q.bounds.high) << q.name;
        EXPECT_GE(q.null_value, q.bounds.low) << q.name;
        EXPECT_LT(q.null_value, q.bounds.high) << q.name;
        EXPECT_GT(q.typical, q.bounds.low) << q.name;
        EXPECT_LT(q.typical, q.bounds.high) << q.name;
        EXPECT_GT(q.matters, 0.0) << q.name;
        EXPECT_TRUE(scanned(j) || std::abs(q.typical - q.null_value) > q.matters) << q.name;
        EXPECT_LT(q.usual.low, q.usual.high) << q.name;
        EXPECT_GE(q.usual.low, q.bounds.low) << q.name;
        EXPECT_LE(q.usual.high, q.bounds.high) << q.name;
        EXPECT_GE(q.typical, q.usual.low) << q.name;
        EXPECT_LE(q.typical, q.usual.high) << q.name;
    }
}

TEST_P(AnyEffect, DescribesItself) {
    for (const char* text : {info().id, info().title, info().equation, info().source,
                             info().excited_by, info().moves, info().needs})
        EXPECT_FALSE(std::string(text).empty());
    for (std::size_t j = 0; j < info().parameter_count(); ++j) {
        EXPECT_FALSE(std::string(info().parameters[j].name).empty());
        EXPECT_FALSE(std::string(info().parameters[j].unit).empty());
    }
}

TEST(Catalogue, WhatNeedsTheForceDoesNothingWithoutIt) {
    // With a measured acceleration in place of the force, neither motion nor readings change; of
    // all other effects, they do.
    const Parameters p = typical_parameters();
    ModelState<double> x{25.0, 0.4, 0.3};
    for (std::size_t n = kMotionStates; n < kModelStates; ++n)
        x[n] = 0.003 * static_cast<double>(n);
    x[state_of("tyre_temperature", 0)] = 2.0;  // [kW]
    for (std::size_t i = 0; i < kEffectCount; ++i) {
        if (i == effect_place<SteerDelay>()) continue;  // it is nothing at one instant
        const auto off = evaluate({saloon(), 0, false}, x, {0.05, 1.5, 20.0}, p);
        const auto on = evaluate({saloon(), EffectMask{1} << i, false}, x, {0.05, 1.5, 20.0}, p);
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
        for (std::size_t j = 0; j < info.parameter_count(); ++j)
            EXPECT_TRUE(
                parameters.insert(std::string(info.id) + "." + info.parameters[j].name).second);
    }
    EXPECT_EQ(parameters.size(), kEffectParameterCount);
}

TEST(Catalogue, TwinsNameEachOther) {
    const auto names = [](const char* list) {
        std::set<std::string> all;
        std::istringstream in(list);
        for (std::string name; std::getline(in, name, ',');)
            all.insert(name.substr(name.find_first_not_of(' ')));
        return all;
    };
    for (const EffectInfo& info : kEffectInfos) {
        for (const std::string& twin : names(info.confounded_with)) {
            EXPECT_NE(twin, info.id);
            EXPECT_EQ(names(kEffectInfos[effect_index(twin)].confounded_with).count(info.id), 1U)
                << info.id << " and " << twin;
        }
        EXPECT_TRUE(*info.through == 0 || effect_index(info.through) < kEffectCount);
    }
}

TEST_P(AnyEffect, InAMirrorOnlyMirroredParametersChangeTheirSign) {
    Parameters p = plain_parameters();
    for (std::size_t j = 0; j < info().parameter_count(); ++j)
        p[first() + j] = info().parameters[j].typical;
    Parameters q = p;
    for (std::size_t j = 0; j < info().parameter_count(); ++j)
        if (info().parameters[j].mirrored) q[first() + j] = -p[first() + j];
    const double dt = 0.01;
    std::vector<Input> left;
    for (int k = 0; k < 100; ++k) left.push_back(lively(k * dt));
    std::vector<Input> right = left;
    for (Input& u : right) u.steer_rad *= -1.0;
    const SingleTrack model{saloon(), mask()};
    const auto y = drive(model, p, left, dt, 22.0);
    const auto z = drive(model, q, right, dt, 22.0);
    const std::array<double, kChannels> sign{1.0, -1.0, -1.0, 1.0, -1.0};
    for (std::size_t k = 0; k < y.size(); ++k)
        for (int i = 0; i < kChannels; ++i)
            ASSERT_NEAR(z[k][i], sign[static_cast<std::size_t>(i)] * y[k][i], 1e-8);
}

TEST(Catalogue, OffsetsFollowEachOther) {
    for (std::size_t i = 0; i + 1 < kEffectCount; ++i)
        EXPECT_EQ(effect_offset(i + 1), effect_offset(i) + kEffectInfos[i].parameter_count());
    EXPECT_EQ(effect_offset(0), 0U);
    EXPECT_EQ(kParameterCount,
              kBaseParameterCount + kEffectParameterCount + kUserEffects * kUserParameters);
}

TEST(Catalogue, StatesOfTheirOwn) {
    for (std::size_t i = 0; i < kEffectCount; ++i) {
        const std::string id = kEffectInfos[i].id;
        const std::size_t own = active_states(EffectMask{1} << i).count;
        const std::map<std::string, std::size_t> expected{{"steer_lag", 1},
                                                          {"tyre_relaxation", 2},
                                                          {"tyre_temperature", 2},
                                                          {"sensor_delay", 5},
                                                          {"front_tyre_relaxation", 1},
                                                          {"rear_tyre_relaxation", 1},
                                                          {"force_lag", 1},
                                                          {"body_roll", 2},
                                                          {"front_roll_steer", 2},
                                                          {"rear_roll_steer", 2}};
        EXPECT_EQ(own, expected.count(id) ? expected.at(id) : 0U) << id;
    }
    EXPECT_EQ(active_states(0).count, 0U);
    EXPECT_EQ(active_states(kAllEffects).count, kCatalogueStates);
}

}  // namespace
}  // namespace sysid::test
