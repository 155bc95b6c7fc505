// Learning Q and R: moments against derivatives of the likelihood, maximisation against trials.
#include "dense.hpp"
#include "helpers.hpp"
#include "sysid/estimate/em.hpp"

namespace sysid::test {
namespace {

using SmallNoise = NoisePair<3, 2>;
using SmallExpectation = FilteredExpectation<3, 2, Small>;

EmRecord<Small, 3> record_of(const Small& s, bool predict_first = false) {
    return {&s, kSmallMean, small_covariance(), predict_first};
}

/// A record that the system itself made.
Small made(std::size_t samples, unsigned seed) {
    Small s = small_system(samples);
    std::mt19937 generator(seed);
    std::normal_distribution<double> normal;
    const Mat<3, 3> root_Q = s.Q.llt().matrixL();
    const Mat<2, 2> root_R = s.R.llt().matrixL();
    const auto draw = [&] { return normal(generator); };
    Vec<3> x = kSmallMean;
    for (std::size_t k = 0; k < samples; ++k) {
        s.b[k] = Vec<3>(0.1, -0.2, 0.05);
        if (k > 0) x = (s.A * x + s.b[k] + root_Q * Vec<3>::NullaryExpr(draw)).eval();
        const Vec<2> y = s.H * x + s.d[k] + root_R * Vec<2>::NullaryExpr(draw);
        for (int i = 0; i < 2; ++i)
            if (!std::isnan(s.y[k][i])) s.y[k][i] = y[i];
    }
    return s;
}

/// Derivative of the log-likelihood by an element (and its mirror image), by differences.
template <int N>
Mat<N, N> slopes(SmallExpectation& e, const SmallNoise& at, Mat<N, N> SmallNoise::* which) {
    Mat<N, N> out;
    for (int i = 0; i < N; ++i)
        for (int j = 0; j < N; ++j)
            out(i, j) = central_difference(
                [&](double d) {
                    SmallNoise noise = at;
                    (noise.*which)(i, j) += 0.5 * d;
                    (noise.*which)(j, i) += 0.5 * d;
                    return e.log_likelihood(noise);
                },
                0.0, 1e-3);
    return out;
}

template <int N>
Mat<N, N> slopes_from(const SquareSum<N>& squares, const Mat<N, N>& noise) {
    const Mat<N, N> inverse = noise.inverse();
    return 0.5 * inverse * (squares.sum - squares.samples * noise) * inverse;
}

TEST(Em, MomentsAreTheSlopesOfTheLogLikelihood) {
    // Fisher's identity; missing readings and correlated noise included.
    for (const bool predict_first : {false, true}) {
        const Small s = made(40, 3);
        SmallExpectation e({record_of(s, predict_first)});
        const SmallNoise at{s.Q, s.R};
        e.log_likelihood(at);
        const auto moments = e.moments();
        EXPECT_EQ(moments.process.samples, predict_first ? 40.0 : 39.0);
        EXPECT_EQ(moments.sensors.samples, 40.0);
        EXPECT_EQ(moments.sensors.count, Vec<2>(31.0, 39.0));
        const Mat<3, 3> by_Q = slopes(e, at, &SmallNoise::process);
        const Mat<2, 2> by_R = slopes(e, at, &SmallNoise::sensors);
        EXPECT_LT((slopes_from(moments.process, at.process) - by_Q).norm(), 1e-6 * by_Q.norm());
        EXPECT_LT((slopes_from(moments.sensors, at.sensors) - by_R).norm(), 1e-6 * by_R.norm());
    }
}

TEST(Em, BothExpectationsAgreeOnALinearModel) {
    Small s = made(60, 4);
    s.R = Vec<2>(0.1, 0.2).asDiagonal();
    const Small second = made(30, 5);
    SmallExpectation e({record_of(s), record_of(second)});
    e.log_likelihood({s.Q, s.R});
    const auto adjoint = e.moments();
    NoiseMoments<3, 2> smoothed;
    for (Small each : {s, second}) {
        each.R = s.R;
        std::vector<FilterStep<3, 2>> steps;
        extended_kalman_filter<3, 2>(each, kSmallMean, small_covariance(),
                                     [&](std::size_t, const auto& step) { steps.push_back(step); });
        add_smoothed_moments<3, 2>(each, smooth(steps), smoothed);
    }
    EXPECT_LT((adjoint.process.sum - smoothed.process.sum).norm(), 1e-10);
    EXPECT_LT((adjoint.sensors.sum - smoothed.sensors.sum).norm(), 1e-10);
    EXPECT_EQ(adjoint.process.count, smoothed.process.count);
    EXPECT_EQ(adjoint.sensors.count, smoothed.sensors.count);
    EXPECT_EQ(adjoint.sensors.samples, smoothed.sensors.samples);
}

TEST(Em, MomentsAreTheSameOneReadingAfterTheOther) {
    using System = Uncorrelated;
    const System s(made(40, 6));
    const std::vector<EmRecord<System, 3>> records{{&s, kSmallMean, small_covariance(), true}};
    FilteredExpectation<3, 2, System> together(records);
    FilteredExpectation<3, 2, System, SequentialUpdate<3, 2>> sequential(records);
    EXPECT_NEAR(sequential.log_likelihood({s.Q, s.R}), together.log_likelihood({s.Q, s.R}), 1e-10);
    const auto joint = together.moments();
    const auto one_by_one = sequential.moments();
    EXPECT_EQ(one_by_one.sensors.count, joint.sensors.count);
    EXPECT_LT((one_by_one.process.sum - joint.process.sum).norm(), 1e-10);
    EXPECT_LT((one_by_one.sensors.sum - joint.sensors.sum).diagonal().norm(), 1e-10);
}

TEST(Em, NeverFallsWhateverTheStructure) {
    const Small s = made(300, 6);
    const SmallNoise start{Vec<3>(1.0, 0.001, 0.3).asDiagonal(), Vec<2>(0.01, 2.0).asDiagonal()};
    auto tied = NoiseStructure<3>::diagonal();
    tied.scale = {0, 0, kFixedNoise};
    auto pair = NoiseStructure<3>::diagonal();
    pair.block = {0, 0, 2};
    for (const auto& process :
         {NoiseStructure<3>::diagonal(), NoiseStructure<3>::full(), tied, pair}) {
        for (const auto& sensors : {NoiseStructure<2>::diagonal(), NoiseStructure<2>::full()}) {
            SmallExpectation e({record_of(s)});
            const auto out = learn_noise<3, 2>(e, start, process, sensors, {60, 0.0, false, false});
            EXPECT_EQ(out.fell, 0);
            ASSERT_EQ(out.log_likelihood.size(), 61U);
            for (std::size_t i = 1; i < 61; ++i)
                EXPECT_GE(out.log_likelihood[i], out.log_likelihood[i - 1] - 1e-9);
            EXPECT_GT(out.log_likelihood.back(), out.log_likelihood.front() + 50.0);
            EXPECT_NEAR(e.log_likelihood(out.noise), out.log_likelihood.back(), 1e-9);
            for (int i = 0; i < 3; ++i)
                for (int j = 0; j < 3; ++j)
                    if (process.block[i] != process.block[j]) {
                        EXPECT_EQ(out.noise.process(i, j), 0.0);
                    }
        }
    }
}

TEST(Em, FixedStaysAndTiedKeepTheirRatio) {
    const Small s = made(200, 7);
    const SmallNoise start{Vec<3>(0.5, 0.1, 0.02).asDiagonal(), Vec<2>(0.3, 0.3).asDiagonal()};
    auto process = NoiseStructure<3>::diagonal();
    process.scale = {0, 0, kFixedNoise};
    SmallExpectation e({record_of(s)});
    const auto out =
        learn_noise<3, 2>(e, start, process, NoiseStructure<2>::diagonal(), {20, 0.0, true, false});
    EXPECT_EQ(out.noise.process(2, 2), 0.02);
    EXPECT_NEAR(out.noise.process(0, 0) / out.noise.process(1, 1), 5.0, 1e-12);
    EXPECT_GT(std::abs(out.noise.process(0, 0) - 0.5), 0.1);
}

TEST(Em, FindsTheNoiseOfSeveralLogs) {
    const Small a = made(6000, 8);
    const Small b = made(9000, 9);
    SmallExpectation e({record_of(a), record_of(b)});
    const SmallNoise start{0.5 * Mat<3, 3>::Identity(), 0.02 * Mat<2, 2>::Identity()};
    auto process = NoiseStructure<3>::full();
    const auto out =
        learn_noise<3, 2>(e, start, process, NoiseStructure<2>::full(), {400, 0.01, true, true});
    EXPECT_TRUE(out.converged);
    // Likelier than the truth, by no more than nine free numbers gain by chance (99.9 %).
    const double gained = 2.0 * (out.log_likelihood.back() - e.log_likelihood({a.Q, a.R}));
    EXPECT_GT(gained, 0.0);
    EXPECT_LT(gained, 27.9);
}

TEST(Em, LeapsReachTheSameSummitSooner) {
    const Small s = made(500, 11);
    const SmallNoise start{0.1 * Mat<3, 3>::Identity(), 0.1 * Mat<2, 2>::Identity()};
    auto pair = NoiseStructure<3>::diagonal();
    pair.block = {0, 0, 2};
    auto tied = NoiseStructure<3>::diagonal();
    tied.scale = {0, 0, kFixedNoise};
    for (const auto& process : {NoiseStructure<3>::diagonal(), pair, tied}) {
        SmallExpectation e({record_of(s)});
        const auto sensors = NoiseStructure<2>::diagonal();
        const auto plain = learn_noise<3, 2>(e, start, process, sensors, {4000, 1e-3, true, false});
        const auto leapt = learn_noise<3, 2>(e, start, process, sensors, {4000, 1e-3, true, true});
        EXPECT_TRUE(leapt.converged);
        EXPECT_GT(leapt.leaps, 0);
        EXPECT_EQ(plain.leaps, 0);
        EXPECT_LT(leapt.log_likelihood.size(), plain.log_likelihood.size());
        EXPECT_GT(leapt.log_likelihood.back(), plain.log_likelihood.back() - 0.01);
        for (std::size_t i = 1; i < leapt.log_likelihood.size(); ++i)
            EXPECT_GE(leapt.log_likelihood[i], leapt.log_likelihood[i - 1]);
        EXPECT_NEAR(e.log_likelihood(leapt.noise), leapt.log_likelihood.back(), 1e-9);
        if (process.scale[2] == kFixedNoise) {
            EXPECT_EQ(leapt.noise.process(2, 2), 0.1);
            EXPECT_NEAR(leapt.noise.process(0, 0) / leapt.noise.process(1, 1), 1.0, 1e-12);
        }
    }
}

TEST(Em, AStartBelowTheFloorIsLifted) {
    const Small s = made(100, 12);
    auto process = NoiseStructure<3>::diagonal();
    process.scale = {0, 0, kFixedNoise};
    process.floor = Vec<3>(1e-12, 0.5, 7.0);
    const SmallNoise start{Vec<3>(0.4, 0.1, 0.02).asDiagonal(), Vec<2>(0.3, 0.3).asDiagonal()};
    SmallExpectation e({record_of(s)});
    const auto out = learn_noise<3, 2>(e, start, process, NoiseStructure<2>::diagonal(), {});
    EXPECT_GE(out.noise.process(1, 1), 0.5);
    EXPECT_NEAR(out.noise.process(0, 0) / out.noise.process(1, 1), 4.0, 1e-12);
    EXPECT_EQ(out.noise.process(2, 2), 0.02);
}

TEST(Em, StopsWhenLittleIsToCome) {
    const Small s = made(500, 10);
    const SmallNoise start{0.1 * Mat<3, 3>::Identity(), 0.1 * Mat<2, 2>::Identity()};
    const auto form = NoiseStructure<3>::diagonal();
    const auto sensors = NoiseStructure<2>::diagonal();
    SmallExpectation e({record_of(s)});
    const auto stopped = learn_noise<3, 2>(e, start, form, sensors, {2000, 0.1, true, false});
    EXPECT_TRUE(stopped.converged);
    EXPECT_LT(stopped.log_likelihood.size(), 1000U);
    const auto on = learn_noise<3, 2>(e, stopped.noise, form, sensors, {1000, 0.0, true, false});
    EXPECT_LT(on.log_likelihood.back() - stopped.log_likelihood.back(), 0.5);
    const auto hurried = learn_noise<3, 2>(e, start, form, sensors, {2, 0.0, true, false});
    EXPECT_FALSE(hurried.converged);
}

/// A likelihood with its peak at R = 2.5, and moments that always ask for R = 9.
struct Overshooting {
    double log_likelihood(const NoisePair<1, 1>& n) const {
        return -(n.sensors(0, 0) - 2.5) * (n.sensors(0, 0) - 2.5);
    }
    static NoiseMoments<1, 1> moments() {
        NoiseMoments<1, 1> m;
        m.process.sum << 1.0;
        m.sensors.sum << 9.0;
        m.process.add_count();
        m.sensors.add_count();
        return m;
    }
};

TEST(Em, ShortensAStepThatFallsOrReportsIt) {
    Overshooting e;
    const auto one = NoiseStructure<1>::diagonal();
    const auto guarded = learn_noise<1, 1>(e, {}, one, one, {50, 0.0, true, false});
    EXPECT_GT(guarded.shortened, 0);
    EXPECT_EQ(guarded.fell, 0);
    EXPECT_TRUE(guarded.converged);
    for (std::size_t i = 1; i < guarded.log_likelihood.size(); ++i)
        EXPECT_GE(guarded.log_likelihood[i], guarded.log_likelihood[i - 1]);
    EXPECT_NEAR(guarded.noise.sensors(0, 0), 2.5, 0.6);
    const auto plain = learn_noise<1, 1>(e, {}, one, one, {3, 0.0, false, false});
    EXPECT_EQ(plain.fell, 1);
    EXPECT_EQ(plain.noise.sensors(0, 0), 9.0);
}

TEST(NoiseStructure, BestIsBetterThanItsNeighbours) {
    SquareSum<3> squares;
    squares.sum << 8.0, 3.0, 0.1, 3.0, 2.0, 0.02, 0.1, 0.02, 0.004;
    squares.samples = 4.0;
    squares.count.setConstant(4.0);
    auto form = NoiseStructure<3>::full();
    form.floor = Vec<3>(0.1, 0.5, 0.02);
    const Mat<3, 3> floor = form.floor.asDiagonal();
    const Mat<3, 3> best = form.best(squares, Mat<3, 3>::Identity());
    const auto value = [&](const Mat<3, 3>& C) {
        return -squares.samples * std::log(C.determinant()) - (C.inverse() * squares.sum).trace();
    };
    const auto above_floor = [&](const Mat<3, 3>& C) {
        return symmetric_eigenvalues(C - floor)[0] > -1e-9;
    };
    EXPECT_TRUE(above_floor(best));
    std::mt19937 generator(2);
    std::normal_distribution<double> normal(0.0, 0.02);
    int tried = 0;
    for (int i = 0; i < 2000; ++i) {
        Mat<3, 3> nudge = Mat<3, 3>::NullaryExpr([&] { return normal(generator); });
        nudge = (nudge + nudge.transpose()).eval();
        if (!above_floor(best + nudge)) continue;
        ++tried;
        EXPECT_LE(value(best + nudge), value(best) + 1e-9);
    }
    EXPECT_GT(tried, 50);
}

TEST(NoiseStructure, ChannelsThatWereNeverReadKeepTheirVariance) {
    SquareSum<2> squares;
    squares.sum = Vec<2>(10.0 * 3.0, 10.0 * 0.7).asDiagonal();
    squares.samples = 10.0;
    squares.count = Vec<2>(10.0, 0.0);
    const auto out =
        NoiseStructure<2>::diagonal().best(squares, Vec<2>(1.0, 0.7).asDiagonal().toDenseMatrix());
    EXPECT_DOUBLE_EQ(out(0, 0), 3.0);
    EXPECT_DOUBLE_EQ(out(1, 1), 0.7);
}

}  // namespace
}  // namespace sysid::test
