// Recursive least squares on a batch of twins: one twin drives at the estimate, one more per
// parameter a step beside it; the differences of their readings are the sensitivities. Any
// simulator that can be run several times over serves; its equations are never needed.
//
// Ljung, System Identification (2nd ed.), sec. 11.4 to 11.6: the recursive prediction-error method,
// its gradient taken by differences of predictors run side by side. Old data are forgotten at the
// rate n/t, so what was learnt from a twin that was still wrong fades as t^-n while the estimate
// goes on averaging. The scale of each channel's residual is learnt as it goes: a road that the
// twin knows badly widens it by itself.
#pragma once

#include <Eigen/Dense>
#include <cstddef>
#include <vector>

#include "sysid/twin/load.hpp"

namespace sysid {

struct BatchParameter {
    int parameter = kMass;
    double step = 1.0;    // between the twins
    double spread = 1.0;  // standard deviation of the first guess
    double walk = 0.0;    // per root of a second: how far the truth may change
    double lower = 0.0, upper = 0.0;
    // Not estimated but considered: the first guess stays, the others are estimated as if it were
    // exact, and their spreads hold what its uncertainty does to them. At most one.
    bool considered = false;
    // Not a parameter but a state at the start: whoever runs the twins puts the step into that
    // state of the one twin, `parameter` and the limits are not used. A state that forgets slowly
    // keeps what it began with, and what the linear way to each new guess left in it.
    bool start = false;
};

struct BatchChannel {
    std::size_t channel = 0;
    double noise = 1e-3;        // standard deviation of the sensor; the residual's is never less
    double high_pass_hz = 0.0;  // slower differences of the twins are left alone; 0: none are
};

struct BatchSettings {
    double forgetting = 2.0;  // n
    double start_s = 1.0;     // nothing is learnt earlier, and t counts from there
    double residual_s = 5.0;  // averaging time of the residual's scale
    double clip = 4.0;        // residuals count as at most so many of their scales
    // Before this time data count less, by the square of their age: the first steps from a wrong
    // guess are long, and what was learnt along them must not be believed too soon.
    double gentle_s = 20.0;
    // Residuals further apart than this count as independent of one another, see `spread`.
    double block_s = 4.0;
};

class BatchEstimator {
  public:
    /// Throws std::invalid_argument if a parameter, a step, a spread or a time is out of range.
    BatchEstimator(std::vector<BatchParameter> parameters, std::vector<BatchChannel> channels,
                   double dt, BatchSettings settings = {});

    std::size_t twins() const { return parameters_.size() + 1; }

    /// The parameters of twin number `which`; number 0 stands at the estimate.
    Estimates of_twin(std::size_t which, const Estimates& estimate) const;

    /// One step: `car` and, for each twin, `stride` readings, NaN where the car has none. Gives how
    /// far each parameter went, in steps between the twins.
    const Eigen::VectorXd& update(const double* car, const double* twins, std::size_t stride,
                                  Estimates& estimate);

    const Eigen::MatrixXd& covariance() const { return P_; }

    /// Standard deviations in parts of the first spread: of least squares, or, where more, those
    /// that the sums of slope times residual over blocks show (White's and Huber's sandwich
    /// P B P). Residuals that are not white, or that go with the slopes, widen them. The
    /// uncertainty of what is considered comes on top: how the estimates lean on it goes along with
    /// them (Bierman, Factorization Methods for Discrete Sequential Estimation (1977), ch. VIII).
    Eigen::VectorXd spread() const;

    /// How many readings a row must have.
    std::size_t readings() const;

  private:
    void learn(std::size_t channel, double error, double variance, Estimates& estimate);

    std::vector<BatchParameter> parameters_;
    std::vector<BatchChannel> channels_;
    BatchSettings settings_;
    double dt_, time_s_ = 0.0;
    Eigen::MatrixXd P_, slopes_, held_;  // held_: low-pass of the residual and of each sensitivity
    Eigen::VectorXd power_, gain_, learnt_, residual_, moved_;
    Eigen::VectorXd since_s_, heard_;  // of each channel: since its last reading; its readings
    Eigen::RowVectorXd slope_;
    Eigen::VectorXd leaning_;  // of the estimates, per spread of what is considered
    Eigen::MatrixXd scores_;   // B: squares of the blocks' sums
    Eigen::VectorXd score_;    // of the block that runs
    double block_began_s_ = 0.0;
};

}  // namespace sysid
