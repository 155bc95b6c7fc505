// What the model writes down of itself is what it calculates.
#include "helpers.hpp"
#include "sysid/dynamics/written_model.hpp"

namespace sysid::test {
namespace {

/// Values of all steps, those of inputs given.
std::vector<double> values_of(const Spelled& calculation, std::vector<double> values) {
    values.resize(calculation.steps.size());
    const auto at = [&](int i) { return values[static_cast<std::size_t>(i)]; };
    for (std::size_t i = 0; i < values.size(); ++i) {
        const SpelledStep& s = calculation.steps[i];
        const auto with = [&](auto result) { values[i] = result; };
        if (s.op == Op::kUniform) with(s.constant);
        if (s.op == Op::kAdd) with(at(s.a) + at(s.b));
        if (s.op == Op::kSubtract) with(at(s.a) - at(s.b));
        if (s.op == Op::kMultiply) with(at(s.a) * at(s.b));
        if (s.op == Op::kDivide) with(at(s.a) / at(s.b));
        if (s.op == Op::kTimes) with(-at(s.a));
        if (s.op == Op::kSin) with(std::sin(at(s.a)));
        if (s.op == Op::kCos) with(std::cos(at(s.a)));
        if (s.op == Op::kAtan) with(std::atan(at(s.a)));
        if (s.op == Op::kDirection) with(std::atan2(at(s.a), at(s.b)));
        if (s.op == Op::kSqrt) with(std::sqrt(at(s.a)));
        if (s.op == Op::kExp) with(std::exp(at(s.a)));
        if (s.op == Op::kAbs) with(std::abs(at(s.a)));
        if (s.op == Op::kIfBelow) with(at(s.a) < s.constant ? at(s.b) : at(s.c));
    }
    return values;
}

struct Driving {
    ModelState<double> x{};
    Input u;
};

/// Rates of all states that the model has, then a_x and a_y.
std::vector<double> calculated(const SingleTrack& model, const Parameters& p, const Driving& d) {
    const std::array<double, kExternals> calm{};
    ModelState<double> rate;
    const auto w = model.evaluate(d.x.data(), calm.data(), d.x.data() + kMotionStates, d.u,
                                  p.data(), rate.data(), rate.data() + kMotionStates);
    std::vector<double> out{rate[0], rate[1], rate[2]};
    for (const std::size_t i : active_states(model.effects)) out.push_back(rate[kMotionStates + i]);
    out.push_back(w.a_x);
    out.push_back(w.a_y);
    return out;
}

std::vector<double> read(const WrittenModel& written, const SingleTrack& model, const Parameters& p,
                         const Driving& d) {
    std::vector<double> given(written.calculation.steps.size(), 0.0);
    const auto give = [&](int step, double value) {
        given[static_cast<std::size_t>(step)] = value;
    };
    for (std::size_t i = 0; i < p.size(); ++i) give(written.parameters[i], p[i]);
    for (const auto& [name, step] : written.car) {
        if (std::string(name) == "mass_kg") give(step, model.car.mass_kg);
        if (std::string(name) == "lf_m") give(step, model.car.lf_m);
        if (std::string(name) == "lr_m") give(step, model.car.lr_m);
        if (std::string(name) == "cg_height_m") give(step, model.car.cg_height_m);
        if (std::string(name) == "drag_area_m2") give(step, model.car.drag_area_m2);
        if (std::string(name) == "air_density_kgpm3") give(step, model.car.air_density_kgpm3);
        if (std::string(name) == "brake_front_share") give(step, model.car.brake_front_share);
        if (std::string(name) == "drive_front_share") give(step, model.car.drive_front_share);
        if (std::string(name) == "gravity_mps2") give(step, model.car.gravity_mps2);
    }
    give(written.steer, d.u.steer_rad);
    give(written.force, d.u.longitudinal);
    const ActiveStates own = active_states(model.effects);
    for (std::size_t n = 0; n < written.states.size(); ++n)
        give(written.states[n].step,
             d.x[n < kMotionStates ? n : kMotionStates + own.place[n - kMotionStates]]);
    const std::vector<double> values = values_of(written.calculation, given);
    std::vector<double> out;
    for (const auto& state : written.states)
        out.push_back(values[static_cast<std::size_t>(state.rate)]);
    out.push_back(values[static_cast<std::size_t>(written.a_x)]);
    out.push_back(values[static_cast<std::size_t>(written.a_y)]);
    return out;
}

// What changes with time or with the rate of the steering reads inputs that stand at zero here.
const EffectMask kWritten = kAllEffects & ~mask_of({"friction_change", "steer_delay"});

TEST(WrittenModel, CalculatesWhatTheModelDoesWithEveryEffect) {
    std::mt19937 generator(11);
    std::uniform_real_distribution<double> part(-1.0, 1.0);
    const Parameters p = typical_parameters();
    SingleTrack model;
    model.car = saloon();
    std::vector<EffectMask> masks{0, kWritten};
    for (std::size_t i = 0; i < kEffectCount; ++i) masks.push_back(kWritten & (EffectMask{1} << i));
    for (const EffectMask mask : masks) {
        model.effects = mask;
        const WrittenModel written = write_model(model, p.data(), 20.0);
        for (int draw = 0; draw < 20; ++draw) {
            Driving d;
            d.x = {25.0 + 20.0 * part(generator), 2.0 * part(generator), 0.7 * part(generator)};
            for (std::size_t i = kMotionStates; i < kModelStates; ++i)
                d.x[i] = 0.1 * part(generator);
            d.u.steer_rad = 0.15 * part(generator);
            d.u.longitudinal = 6000.0 * part(generator);
            const std::vector<double> wanted = calculated(model, p, d);
            const std::vector<double> found = read(written, model, p, d);
            ASSERT_EQ(found.size(), wanted.size());
            for (std::size_t i = 0; i < found.size(); ++i)
                ASSERT_NEAR(found[i], wanted[i], 1e-10 * (1.0 + std::abs(wanted[i])))
                    << "effects " << mask << ", result " << i;
        }
    }
}

TEST(WrittenModel, StatesStartWhereTheySettleStraightAhead) {
    SingleTrack model;
    model.car = saloon();
    model.effects = mask_of({"steer_offset", "steer_lag"});
    const Parameters p = typical_parameters();
    const WrittenModel written = write_model(model, p.data(), 20.0);
    ASSERT_EQ(written.states.size(), 4U);
    EXPECT_DOUBLE_EQ(written.states[0].start, 20.0);
    EXPECT_STREQ(written.states[3].name, "steer_lag");
    EXPECT_STREQ(written.states[3].unit, "rad");
    EXPECT_DOUBLE_EQ(written.states[3].start, p[parameter_of("steer_offset")]);
}

TEST(Recorder, ASpellingOneKeepsConstantsConditionsAndNames) {
    Recorder to{Recorder::Spelling{}};
    const Recorded gravity = to.parameter(9.81, false), x = to.input(false);
    const Recorded p = to.parameter(2.0, false);
    to.stand_for(9.81, gravity);
    begin_part("first", x);
    const Recorded y = named("y", x / 9.81);
    const Recorded chosen = if_below(p, 3.0, y * 0.5, 1.0 - y);
    const Spelled all = to.spelled({chosen, Recorded(1.0) * x + 0.0});
    const auto step = [&](int i) { return all.steps[static_cast<std::size_t>(i)]; };
    EXPECT_EQ(all.outputs[1], all.inputs[1]);
    const SpelledStep last = step(all.outputs[0]);
    EXPECT_EQ(last.op, Op::kIfBelow);
    EXPECT_EQ(last.a, all.inputs[2]);
    const SpelledStep half = step(last.b);
    EXPECT_EQ(half.op, Op::kMultiply);
    EXPECT_EQ(step(half.b).constant, 0.5);
    const SpelledStep divided = step(half.a);
    EXPECT_EQ(divided.op, Op::kDivide);
    EXPECT_EQ(divided.b, all.inputs[0]);
    ASSERT_EQ(all.names.size(), 1U);
    EXPECT_EQ(all.names[0].first, half.a);
    EXPECT_STREQ(all.names[0].second, "y");
    ASSERT_EQ(all.parts.size(), 1U);
    EXPECT_EQ(all.parts[0].first, 3);
}

}  // namespace
}  // namespace sysid::test
