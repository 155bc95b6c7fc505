// Recursive least squares for the cornering stiffness of both axles with exponential forgetting,
// from lateral and yaw acceleration where the slip angles are known:
//   a_y   = (C_f alpha_f + C_r alpha_r) / m
//   r_dot = (l_f C_f alpha_f - l_r C_r alpha_r) / I_z
#pragma once

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "sysid/estimate/kalman.hpp"

namespace sysid {

struct CorneringRlsSettings {
    double mass_kg, yaw_inertia_kgm2, lf_m, lr_m;
    double forgetting = 0.998;
    double prior_std_npr = 1e5;
    double ay_std_mps2 = 0.1, yaw_acceleration_std_radps2 = 0.1;
    double most_slip_rad = 0.035;   // beyond it the tyre is not linear: the sample is left out
    double least_slip_rad = 0.004;  // below it the sample tells nothing and forgets nothing
};

class CorneringRls {
  public:
    CorneringRls(const CorneringRlsSettings& settings, double cf_npr, double cr_npr)
        : settings_(settings), theta_(cf_npr, cr_npr) {
        const auto& s = settings;
        if (std::isnan(s.forgetting) || s.forgetting < 0.98 || s.forgetting > 1.0)
            throw std::invalid_argument("forgetting: expected 0.98 to 1");
        for (const double v : {
                 s.mass_kg,
                 s.yaw_inertia_kgm2,
                 s.lf_m,
                 s.lr_m,
                 s.prior_std_npr,
                 s.ay_std_mps2,
                 s.yaw_acceleration_std_radps2,
             })
            if (!(v > 0.0) || !std::isfinite(v))
                throw std::invalid_argument("a setting is not above 0");
        reset();
    }

    /// Forgets what the covariance knows, not the estimate: for a change of road or tyres.
    void reset() { P_ = Mat<2, 2>::Identity() * settings_.prior_std_npr * settings_.prior_std_npr; }

    /// Uses one sample; a NaN element is left out. Returns whether the sample was used: it must
    /// hold enough slip to tell something, and little enough for the tyre to be linear.
    bool step(double alpha_f, double alpha_r, double ay, double yaw_acceleration) {
        const std::size_t sample = index_++;
        for (const double v : {alpha_f, alpha_r, ay, yaw_acceleration})
            if (std::isinf(v))
                throw NumericalFailure("an input is infinite (NaN marks a missing value)", sample);
        if (std::isnan(alpha_f) || std::isnan(alpha_r)) return false;
        const double most = std::max(std::abs(alpha_f), std::abs(alpha_r));
        if (most > settings_.most_slip_rad || most < settings_.least_slip_rad) return false;
        const auto& s = settings_;
        Mat<2, 2> A;
        A << alpha_f / s.mass_kg, alpha_r / s.mass_kg,  //
            s.lf_m * alpha_f / s.yaw_inertia_kgm2, -s.lr_m * alpha_r / s.yaw_inertia_kgm2;
        const Vec<2> y(ay, yaw_acceleration);
        if (y.array().isNaN().all()) return false;
        const Vec<2> std(s.ay_std_mps2, s.yaw_acceleration_std_radps2);
        // Forgetting is a prior that is less sure; what follows is the update of every filter.
        P_ /= s.forgetting;
        Update<2, 2> update;
        measurement_update<2, 2>(theta_, P_, y, A * theta_, A, std.cwiseAbs2().asDiagonal(), sample,
                                 update);
        // What no sample tells anything about must not be forgotten beyond the prior (wind-up).
        const double ceiling = s.prior_std_npr * s.prior_std_npr;
        for (int i = 0; i < 2; ++i) {
            if (P_(i, i) <= ceiling) continue;
            const double shrink = std::sqrt(ceiling / P_(i, i));
            P_.row(i) *= shrink;
            P_.col(i) *= shrink;
        }
        ++used_;
        return true;
    }

    const Vec<2>& stiffness_npr() const { return theta_; }
    const Mat<2, 2>& covariance() const { return P_; }
    std::size_t samples() const { return index_; }
    std::size_t used() const { return used_; }

    template <class Row>
    void remember(Row& row) {
        row(settings_, theta_, P_, index_, used_);
    }

  private:
    CorneringRlsSettings settings_;
    Vec<2> theta_;
    Mat<2, 2> P_;
    std::size_t index_ = 0, used_ = 0;
};

}  // namespace sysid
