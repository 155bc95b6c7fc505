// Covariances of the filters for any model, and of what they are looked at with.
#include "covariances.hpp"
#include "dense.hpp"
#include "sysid/estimate/filter.hpp"

namespace sysid::test {
namespace {

/// Lowest eigenvalue of the correlations; minus one where a variance is not above zero.
double lowest_correlation(const Eigen::MatrixXd& P) {
    if (!P.allFinite() || !(P.diagonal().minCoeff() > 0.0)) return -1.0;
    const Eigen::VectorXd unit = P.diagonal().cwiseSqrt().cwiseInverse();
    const Eigen::MatrixXd correlation = unit.asDiagonal() * P * unit.asDiagonal();
    return symmetric_eigenvalues(correlation)[0];
}

}  // namespace

bool positive(const Eigen::MatrixXd& P) { return lowest_correlation(P) > -1e-11; }

namespace {

/// Position, speed and acceleration of a point; position and speed are read.
struct Point {
    static constexpr int kStates = 3;
    static constexpr int kMeasured = 2;
    static constexpr int kDirectReadings = 2;
    struct Input {};
    double process_std, sensor_std, dt = 0.01;
    mutable std::mt19937 generator{17};

    std::size_t size() const { return kSteps; }
    template <class S>
    void predict(const Input&, const S* x, S* next) const {
        next[0] = x[0] + dt * x[1] + (0.5 * dt * dt) * x[2];
        next[1] = x[1] + dt * x[2];
        next[2] = 0.999 * x[2];
    }
    template <class S>
    void observe(const Input&, const S* x, S* y) const {
        y[0] = x[0];
        y[1] = x[1];
    }
    Mat<3, 3> process_noise(const Input& = {}) const {
        return Vec<3>(0.0, 0.0, process_std * process_std).asDiagonal();
    }
    Mat<2, 2> measurement_noise(const Input& = {}) const {
        return sensor_std * sensor_std * Mat<2, 2>::Identity();
    }
    // The same as a `System`.
    Vec<3> predict(std::size_t, const Vec<3>& x, Mat<3, 3>& A, Mat<3, 3>& Q) const {
        A << 1.0, dt, 0.5 * dt * dt, 0.0, 1.0, dt, 0.0, 0.0, 0.999;
        Q = process_noise();
        return A * x;
    }
    Vec<2> observe(std::size_t, const Vec<3>& x, Mat<2, 3>& H) const {
        H.setIdentity();
        return x.head<2>();
    }
    Vec<2> measurement(std::size_t k) const {
        std::normal_distribution<double> normal(0.0, sensor_std);
        return Vec<2>(normal(generator), k % 7 == 3 ? std::nan("") : normal(generator));
    }
    Mat<2, 2> measurement_noise(std::size_t) const { return measurement_noise(); }
};

/// Process and sensor noise for a ratio: the larger one is 1, so that both get small.
Point point(double ratio) { return {std::min(1.0, ratio), std::min(1.0, 1.0 / ratio)}; }

template <class Form>
void over_a_record() {
    for (const double ratio : kRatios) {
        SCOPED_TRACE(ratio);
        std::size_t lost = 0;
        extended_kalman_filter<3, 2, Form>(
            point(ratio), Vec<3>::Zero(), Mat<3, 3>::Identity(), [&](std::size_t k, const auto& s) {
                if (worth_a_look(k) && !(positive(s.covariance) && s.mean.allFinite())) ++lost;
            });
        EXPECT_EQ(lost, 0U);
    }
}

TEST(Covariances, OfTheExtendedFilterOverARecord) { over_a_record<Update<3, 2>>(); }
TEST(Covariances, OfTheSequentialFilterOverARecord) { over_a_record<SequentialUpdate<3, 2>>(); }

template <Method method>
void step_by_step() {
    for (const double ratio : kRatios) {
        SCOPED_TRACE(ratio);
        const Point model = point(ratio);
        Filter<Point, method> filter(model, Vec<3>::Zero(), Mat<3, 3>::Identity());
        std::size_t lost = 0;
        for (std::size_t k = 0; k < kSteps; ++k) {
            filter.step({}, model.measurement(k));
            if (worth_a_look(k) && !positive(filter.state().covariance)) ++lost;
        }
        EXPECT_EQ(lost, 0U);
    }
}

TEST(Covariances, OfTheExtendedFilter) { step_by_step<Method::kExtended>(); }
TEST(Covariances, OfTheUnscentedFilter) { step_by_step<Method::kUnscented>(); }
TEST(Covariances, OfTheSquareRootFilter) { step_by_step<Method::kSquareRoot>(); }

TEST(Covariances, LostOnesAreLiftedAndNeverMadeSurer) {
    Mat<3, 3> P;
    P << 4.0, 6.1, 0.0, 6.1, 9.0, 0.0, 0.0, 0.0, 1e-20;
    const Mat<3, 3> before = P;
    EXPECT_LT(lift_correlations<3>(P, 1e-13), -0.01);
    EXPECT_TRUE(positive(P));
    EXPECT_GT(symmetric_eigenvalues(P - before)[0], -1e-12);
    P(1, 2) = P(2, 1) = std::nan("");
    EXPECT_TRUE(std::isnan(lift_correlations<3>(P, 1e-13)));
}

}  // namespace
}  // namespace sysid::test
