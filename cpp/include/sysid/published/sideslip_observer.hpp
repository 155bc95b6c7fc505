// The dual observer as it was published (Cl4y3R, VehicleStateEstimation, 2024), its defects kept:
// linear tyres, a stiffness that hardly moves, sigma points not drawn again after the process
// noise, no rear force in observer B's lateral acceleration. It is there to be compared with.
#pragma once

#include "sysid/estimate/unscented.hpp"
#include "sysid/online/sensor_watch.hpp"
#include "sysid/online/tyre_forces.hpp"

namespace sysid {

template <int N, int M>
struct PublishedUkf {
    Vec<N> x = Vec<N>::Constant(1e-4);
    Mat<N, N> P = Mat<N, N>::Identity();

    template <class Row>
    void remember(Row& row) {
        row(x, P);
    }

    /// Column of the deviations of the sigma points from the mean, in the published order.
    static Vec<N> deviation(const Mat<N, N>& L, double spread, int column) {
        if (column == 0) return Vec<N>::Zero();
        const int i = (column - 1) % N;
        return column <= N ? Vec<N>(spread * L.col(i)) : Vec<N>(-spread * L.col(i));
    }

    /// `f(point, column)` and `h(point, column)` also get the column of the sigma point.
    template <class F, class H>
    void step(F&& f, H&& h, const Mat<N, N>& Q, const Vec<M>& y, const Mat<M, M>& R,
              std::size_t sample) {
        constexpr int n = 2 * N + 1;
        const SigmaWeights w = SigmaWeights::scaled(N, 1e-3, 2.0);
        const Mat<N, N> L = factor_of<N>(P, sample);
        Mat<N, n> moved;
        Mat<M, n> seen;
        for (int i = 0; i < n; ++i) {
            moved.col(i) = f(Vec<N>(x + deviation(L, w.spread, i)), i);
            seen.col(i) = h(Vec<N>(moved.col(i)), i);
        }
        Vec<n> means = Vec<n>::Constant(w.other), squares = means;
        means[0] = w.mean_centre;
        squares[0] = w.covariance_centre;
        const Vec<N> predicted = moved * means;
        const Vec<M> expected = seen * means;
        moved.colwise() -= predicted;
        seen.colwise() -= expected;
        const Mat<N, n> weighed = moved * squares.asDiagonal();
        const Mat<N, N> spread_x = times_transposed<N, n, N>(weighed, moved);
        const Mat<M, n> weighed_seen = seen * squares.asDiagonal();
        Mat<M, M> S = times_transposed<M, n, M>(weighed_seen, seen);
        S += R;
        const Mat<N, M> cross = times_transposed<N, n, M>(weighed, seen);
        const Mat<N, M> K = solved_by<M, N>(S, cross.transpose()).transpose();
        x = predicted + K * (y - expected);
        P = spread_x + Q - K * S * K.transpose();
        if (!x.allFinite()) throw NumericalFailure("the state is not finite", sample);
    }
};

class PublishedDual {
  public:
    PublishedDual(const ObservedCar& car, double cf_npr, double cr_npr)
        : car_(car), cf_(cf_npr), cr_(cr_npr) {}

    /// Uses one sample; no element may be missing, or beyond what a car does. Throws where the
    /// published filter has diverged.
    const SideslipEstimate& step(double dt, const SensorSample& sample);
    std::size_t samples() const { return index_; }

    template <class Row>
    void remember(Row& row) {
        row(car_, cf_, cr_, forces_, tyres_, out_, index_);
    }

  private:
    ObservedCar car_;
    double cf_, cr_;
    PublishedUkf<5, 4> forces_;
    PublishedUkf<3, 3> tyres_;
    SideslipEstimate out_;
    std::size_t index_ = 0;
};

}  // namespace sysid
