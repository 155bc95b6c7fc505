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
        const SigmaWeights w = SigmaWeights::scaled(N, 1e-3, 2.0);
        int drawn = 0;
        const auto moved_and_seen = [&](const Vec<N>& point) {
            // The centre, then both points of each column in turn.
            const int column = drawn == 0 ? 0 : (drawn + 1) / 2 + (drawn % 2 == 0 ? N : 0);
            ++drawn;
            Vec<N + M> out;
            out.template head<N>() = f(point, column);
            out.template tail<M>() = h(Vec<N>(out.template head<N>()), column);
            return out;
        };
        const auto t = transform<N + M, N>(moved_and_seen, x, factor_of<N>(P, sample), w);
        const Mat<N + M, N + M> joint = t.covariance(w);
        const Mat<N, M> cross = joint.template topRightCorner<N, M>();
        Mat<M, M> S = joint.template bottomRightCorner<M, M>();
        S += R;
        const Mat<N, M> K = solved_by<M, N>(S, cross.transpose()).transpose();
        x = t.mean.template head<N>() + K * (y - t.mean.template tail<M>());
        P = joint.template topLeftCorner<N, N>();
        P += Q - K * S * K.transpose();
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
