// Extended, unscented and square-root filter over one description of a model.
#include <gtest/gtest.h>

#include <random>

#include "sysid/estimate/filter.hpp"
#include "sysid/estimate/smoother.hpp"

namespace sysid {
namespace {

struct Wagon {  // position and speed; a position and a speed reading
    static constexpr int kStates = 2;
    static constexpr int kMeasured = 2;
    struct Input {
        double dt = 0.1;
    };
    double speed_noise = 0.01;

    template <class S>
    void predict(const Input& u, const S* x, S* next) const {
        next[0] = x[0] + u.dt * x[1];
        next[1] = 0.99 * x[1];
    }
    template <class S>
    void observe(const Input&, const S* x, S* y) const {
        y[0] = x[0];
        y[1] = x[1] - 0.1 * x[0];
    }
    Mat<2, 2> process_noise(const Input& u) const {
        return Vec<2>(1e-4, speed_noise * u.dt).asDiagonal();
    }
    Mat<2, 2> measurement_noise(const Input&) const { return Vec<2>(0.04, 0.09).asDiagonal(); }
};

struct Record {
    std::vector<Vec<2>> truth, y;
};

Record drive(std::size_t n, unsigned seed, double missing = 0.0) {
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    std::uniform_real_distribution<double> uniform;
    const Wagon model;
    Record out;
    Vec<2> x(1.0, 0.5);
    for (std::size_t k = 0; k < n; ++k) {
        if (k > 0) {
            Vec<2> next;
            model.predict({}, x.data(), next.data());
            x = next + Vec<2>(1e-2 * normal(random), std::sqrt(1e-3) * normal(random));
        }
        Vec<2> y;
        model.observe({}, x.data(), y.data());
        y += Vec<2>(0.2 * normal(random), 0.3 * normal(random));
        for (int i = 0; i < 2; ++i)
            if (uniform(random) < missing) y[i] = std::nan("");
        out.truth.push_back(x);
        out.y.push_back(y);
    }
    return out;
}

/// The same model as a `System` of the Kalman filter.
struct WagonSystem {
    const std::vector<Vec<2>>& y;
    Wagon model;

    std::size_t size() const { return y.size(); }
    Vec<2> predict(std::size_t, const Vec<2>& x, Mat<2, 2>& A, Mat<2, 2>& Q) const {
        A << 1.0, 0.1, 0.0, 0.99;
        Q = model.process_noise({});
        return A * x;
    }
    Vec<2> observe(std::size_t, const Vec<2>& x, Mat<2, 2>& H) const {
        H << 1.0, 0.0, -0.1, 1.0;
        return H * x;
    }
    Vec<2> measurement(std::size_t k) const { return y[k]; }
    Mat<2, 2> measurement_noise(std::size_t) const { return model.measurement_noise({}); }
};

const Vec<2> kMean(0.9, 0.4);
const Mat<2, 2> kCovariance = Vec<2>(0.25, 0.25).asDiagonal();

template <Method method>
std::vector<FilterStep<2, 2>> filtered(const Record& record) {
    Filter<Wagon, method> filter(Wagon{}, kMean, kCovariance);
    std::vector<FilterStep<2, 2>> out;
    for (const auto& y : record.y) out.push_back(filter.step({}, y));
    return out;
}

template <Method method>
void expect_kalman_numbers() {
    const Record record = drive(500, 1, 0.2);
    const auto found = filtered<method>(record);
    std::vector<FilterStep<2, 2>> kept;
    extended_kalman_filter<2, 2>(
        WagonSystem{record.y, {}}, kMean, kCovariance,
        [&](std::size_t, const FilterStep<2, 2>& s) { kept.push_back(s); });
    const auto smoothed = smooth(found), expected = smooth(kept);
    for (std::size_t k = 0; k < kept.size(); ++k) {
        ASSERT_LT((found[k].mean - kept[k].mean).norm(), 1e-10) << k;
        ASSERT_LT((found[k].covariance - kept[k].covariance).norm(), 1e-10) << k;
        ASSERT_LT((found[k].update.gain - kept[k].update.gain).norm(), 1e-10) << k;
        ASSERT_NEAR(LogDensity::of(found[k].update), LogDensity::of(kept[k].update), 1e-10) << k;
        ASSERT_LT((smoothed[k].mean - expected[k].mean).norm(), 1e-10) << k;
        ASSERT_LT((smoothed[k].covariance - expected[k].covariance).norm(), 1e-10) << k;
    }
}

TEST(Filter, ExtendedIsTheKalmanFilterOnALinearModel) {
    expect_kalman_numbers<Method::kExtended>();
}
TEST(Filter, UnscentedIsTheKalmanFilterOnALinearModel) {
    expect_kalman_numbers<Method::kUnscented>();
}
TEST(Filter, SquareRootIsTheKalmanFilterOnALinearModel) {
    expect_kalman_numbers<Method::kSquareRoot>();
}

/// Mean and variance of the square of the first of N standard normal states.
template <int N>
Vec<2> square_by(const SigmaWeights& weights) {
    const auto square = [](const Vec<N>& x) { return Vec<1>(x[0] * x[0]); };
    const Mat<N, N> root = Mat<N, N>::Identity();
    const auto t = transform<1, N>(square, Vec<N>(Vec<N>::Zero()), root, weights);
    return {t.mean[0], t.covariance(weights)(0, 0)};
}

TEST(SigmaWeights, PointsNearByOverstateCurvatureLessTheMoreStatesThereAre) {
    constexpr double kTruth = 2.0;  // variance of a chi-square variable
    const Vec<2> near = square_by<13>(SigmaWeights::near(13));
    const Vec<2> even = square_by<13>(SigmaWeights::even(13));
    EXPECT_NEAR(near[0], 1.0, 1e-12);
    EXPECT_NEAR(even[0], 1.0, 1e-12);
    EXPECT_NEAR(near[1], 16.0 / 3.0, 1e-12);
    EXPECT_NEAR(even[1], 13.0, 1e-12);
    EXPECT_GT(near[1], kTruth);
    EXPECT_NEAR(square_by<3>(SigmaWeights::near(3))[1], kTruth, 1e-12);
}

TEST(SigmaWeights, AnyOfThemGivesTheKalmanFilterOnALinearModel) {
    const Record record = drive(100, 5);
    const Vec<2> mean(0.0, 0.0);
    const Mat<2, 2> covariance = Mat<2, 2>::Identity();
    Filter<Wagon> even(Wagon{}, mean, covariance);
    Filter<Wagon> near(Wagon{}, mean, covariance, Gate<2>(), NoiseAdaptation(),
                       SigmaWeights::near(2));
    for (const Vec<2>& y : record.y) {
        const auto& a = even.step({}, y);
        const auto& b = near.step({}, y);
        ASSERT_LT((a.mean - b.mean).norm(), 1e-10);
        ASSERT_LT((a.covariance - b.covariance).norm(), 1e-10);
    }
}

TEST(Filter, ItsCovariancesAreTrueOnMatchedSimulations) {
    double nees = 0.0, nis = 0.0, readings = 0.0;
    constexpr int kRuns = 300;
    std::mt19937 random(7);
    std::normal_distribution<double> normal;
    for (unsigned run = 0; run < kRuns; ++run) {
        const Record record = drive(60, 100 + run);
        const Vec<2> start(1.0 + 0.5 * normal(random), 0.5 + 0.5 * normal(random));
        Filter<Wagon> filter(Wagon{}, start, kCovariance);
        for (const auto& y : record.y) {
            filter.step({}, y);
            nis += filter.nis();
            readings += filter.state().update.observed;
        }
        const Vec<2> e = filter.state().mean - record.truth.back();
        nees += e.dot(filter.state().covariance.llt().solve(e));
    }
    // Chi squared of n degrees, 95 %: n +- 1.96 sqrt(2 n).
    EXPECT_NEAR(nees, 2.0 * kRuns, 1.96 * std::sqrt(4.0 * kRuns));
    EXPECT_NEAR(nis, readings, 1.96 * std::sqrt(2.0 * readings));
}

struct Stiff {  // a state known to a millionth of what the other may be off, read together
    static constexpr int kStates = 3;
    static constexpr int kMeasured = 1;
    struct Input {};
    template <class S>
    void predict(const Input&, const S* x, S* next) const {
        next[0] = x[0] + 1e-3 * x[1];
        next[1] = x[1];
        next[2] = 0.999999 * x[2] + 1e-6 * x[0];
    }
    template <class S>
    void observe(const Input&, const S* x, S* y) const {
        y[0] = x[0] + 1e6 * x[2];
    }
    Mat<3, 3> process_noise(const Input&) const { return Vec<3>(1e-14, 1e-10, 1e-20).asDiagonal(); }
    Mat<1, 1> measurement_noise(const Input&) const { return Mat<1, 1>::Constant(1e-8); }
};

template <Method method>
void expect_positive_definite() {
    Filter<Stiff, method> filter(Stiff{}, Vec<3>::Zero(), Vec<3>(1e6, 1e6, 1e6).asDiagonal());
    Mat<3, 3> lower, inverse;
    for (int k = 0; k < 1000000; ++k) {
        filter.step({}, Vec<1>::Constant(std::sin(1e-3 * k)));
        if (k % 1000 == 0) {
            const Mat<3, 3>& P = filter.state().covariance;
            ASSERT_TRUE(P.allFinite()) << k;
            ASSERT_EQ(P, P.transpose()) << k;
            ASSERT_GT(P.diagonal().minCoeff(), 0.0) << k;
            if (method == Method::kSquareRoot) {
                ASSERT_GT(filter.root().diagonal().minCoeff(), 0.0) << k;
            }
        }
    }
}

TEST(Filter, SquareRootStaysPositiveDefiniteOverAMillionSteps) {
    expect_positive_definite<Method::kSquareRoot>();
}
TEST(Filter, UnscentedStaysPositiveDefiniteOverAMillionSteps) {
    expect_positive_definite<Method::kUnscented>();
}
TEST(Filter, ExtendedStaysPositiveDefiniteOverAMillionSteps) {
    expect_positive_definite<Method::kExtended>();
}

TEST(Filter, AnOutlierIsRefusedAndALastingShiftIsTakenInTheEnd) {
    Record record = drive(200, 3);
    Filter<Wagon> filter(Wagon{}, kMean, kCovariance, Gate<2>(1e-6, 10));
    for (std::size_t k = 0; k < record.y.size(); ++k) {
        Vec<2> y = record.y[k];
        if (k == 50) y[0] += 100.0;
        if (k >= 100) y[0] += 100.0;
        filter.step({}, y);
        if (k == 50) {
            EXPECT_EQ(filter.refusals(), 1);
            EXPECT_TRUE(std::isnan(filter.used()[0]));
            EXPECT_LT(std::abs(filter.state().mean[0] - record.truth[k][0]), 1.0);
        }
        if (k == 109) {
            EXPECT_EQ(filter.refusals(), 1);
        }
    }
    EXPECT_EQ(filter.refusals(), 0);
    EXPECT_GT(filter.state().mean[0], record.truth.back()[0] + 20.0);
}

TEST(Filter, NoiseThatGrowsIsFollowed) {
    Record record = drive(2000, 5);
    std::mt19937 random(9);
    std::normal_distribution<double> normal;
    Filter<Wagon> filter(Wagon{}, kMean, kCovariance, Gate<2>(), {0.01, 0.1, 100.0});
    for (auto& y : record.y) {
        y[0] += 0.8 * normal(random);
        filter.step({}, y);
    }
    // (0.8^2 + 0.2^2) / 0.2^2 = 17
    EXPECT_NEAR(filter.noise_scale()[0], 17.0, 5.0);
    EXPECT_NEAR(filter.noise_scale()[1], 1.0, 0.5);
}

TEST(LateMeasurements, ALateReadingCountsAsIfItHadBeenInTime) {
    const Record record = drive(50, 4);
    Filter<Wagon> in_time(Wagon{}, kMean, kCovariance);
    LateMeasurements<Filter<Wagon>> late(in_time, 5);
    for (std::size_t k = 0; k < record.y.size(); ++k) {
        in_time.step({}, record.y[k]);
        Vec<2> y = record.y[k];
        y[1] = std::nan("");
        late.step({}, y);
        if (k >= 4) late.late(4, 1, record.y[k - 4][1]);
    }
    for (std::size_t delay = 0; delay < 4; ++delay)
        late.late(delay, 1, record.y[record.y.size() - 1 - delay][1]);
    EXPECT_LT((late.filter().state().mean - in_time.state().mean).norm(), 1e-12);
    EXPECT_THROW(late.late(6, 1, 0.0), NumericalFailure);
    EXPECT_THROW(late.late(0, 2, 0.0), std::invalid_argument);
}

TEST(Filter, WhatCannotBeIsRefusedWithTheSample) {
    Mat<2, 2> bad;
    bad << 1.0, 2.0, 2.0, 1.0;
    EXPECT_THROW(Filter<Wagon>(Wagon{}, kMean, bad), NumericalFailure);
    EXPECT_THROW(Filter<Wagon>(Wagon{}, Vec<2>(std::nan(""), 0.0), kCovariance), NumericalFailure);
    EXPECT_THROW(Gate<2>(1.5, 3), std::invalid_argument);
    EXPECT_THROW(Gate<2>(0.1, 0), std::invalid_argument);
    Filter<Wagon> filter(Wagon{}, kMean, kCovariance);
    filter.step({}, Vec<2>(0.0, 0.0));
    try {
        filter.step({}, Vec<2>(HUGE_VAL, 0.0));
        FAIL();
    } catch (const NumericalFailure& e) {
        EXPECT_STREQ(e.what(), "an infinite measurement at sample 1");
    }
    Filter<Wagon> broken(Wagon{std::nan("")}, kMean, kCovariance);
    broken.step({}, Vec<2>(0.0, 0.0));
    EXPECT_THROW(broken.step({}, Vec<2>(0.0, 0.0)), NumericalFailure);
}

}  // namespace
}  // namespace sysid
