// Regression of tyre coefficients on a known motion: the published losses, and their joint form.
//
//   a_y = (F_yf + F_yr)/m + P_1 v_x^2 + P_2 v_y + P_3 r,   dr/dt = (l_f F_yf - l_r F_yr)/I_z
//
// The slip angles do not depend on the coefficients and are worked out once. The prediction is
// linear in D and P, so that a search need only move B, C and E (variable projection: Golub &
// Pereyra, SIAM J. Numer. Anal. 10, 1973); `normal_equations` gives all that takes.
#pragma once

#include <cstddef>
#include <vector>

#include "sysid/math/lanes.hpp"
#include "sysid/model/tyre.hpp"
#include "sysid/model/vehicle.hpp"

namespace sysid::lab {

/// Both tyres and the terms of a_y, then what a known motion tells nothing of: factors of mass and
/// yaw inertia, the drag area, the friction ellipse.
enum TyreParameter : int { kP1 = 8, kP2 = 9, kP3 = 10, kTyreParameters = 15 };

/// One sample of a motion that is taken as known, and what the forces must explain.
struct TyreSample {
    double v_x = 0.0, v_y = 0.0, r = 0.0;
    double steer_rad = 0.0;
    double fz_front_n = 0.0, fz_rear_n = 0.0;
    double a_y = 0.0;
    double yaw_acceleration = 0.0;
    double a_y_weight = 1.0;  // one over the standard deviation
    double yaw_weight = 0.0;  // zero: the row does not count
};

class TyreLoss {
  public:
    /// `projects_steer`: the front force acts along its wheel's axle and enters with cos(delta).
    TyreLoss(const VehicleData& car, double yaw_inertia_kgm2, bool projects_steer)
        : car_(car), yaw_inertia_kgm2_(yaw_inertia_kgm2), projects_steer_(projects_steer) {}

    void add(const TyreSample& sample);
    std::size_t samples() const { return samples_; }

    /// Half the sum of squares; with `gradient` G^T e and the lower triangle of G^T G by the first
    /// `wanted` parameters, `kCurveParameters` in a row.
    double squares(const double* p, int wanted, double* gradient, double* information) const {
        return lane_kernels().curve_squares(blocks_.data(), blocks_.size(), p, wanted, gradient,
                                            information);
    }

    /// Calls `keep` with the weighted errors of a_y and of the yaw acceleration of each sample.
    template <class S, class Keep>
    void walk(const S* p, Keep&& keep) const {
        const TyreCoefficients<S> front{p[0], p[1], p[2], p[3]};
        const TyreCoefficients<S> rear{p[4], p[5], p[6], p[7]};
        for (std::size_t k = 0; k < samples_; ++k) {
            const CurveSamples& s = blocks_[k / kLanes];
            const std::size_t i = k % kLanes;
            const S mu_f = magic_formula(s.alpha[0].at[i], front);
            const S mu_r = magic_formula(s.alpha[1].at[i], rear);
            const S rest =
                s.rest[0].at[i] * p[kP1] + s.rest[1].at[i] * p[kP2] + s.rest[2].at[i] * p[kP3];
            keep(std::array<S, 2>{
                s.reading[0].at[i] - s.first[0].at[i] * mu_f - s.first[1].at[i] * mu_r - rest,
                s.reading[1].at[i] - s.second[0].at[i] * mu_f - s.second[1].at[i] * mu_r,
            });
        }
    }

  private:
    VehicleData car_;
    double yaw_inertia_kgm2_;
    bool projects_steer_;
    // Front and rear; a_y and the yaw acceleration, weighted; zero beyond the last sample.
    std::vector<CurveSamples> blocks_;
    std::size_t samples_ = 0;
};

/// As in `identify/prediction_error.hpp`; no filter has a part in it, and nullptr stands for its
/// gains.
void residuals(const TyreLoss& loss, const double* p, std::nullptr_t, double* out);
double half_sum_of_squares(const TyreLoss& loss, const double* p, std::nullptr_t);
void sensitivities(const TyreLoss& loss, const double* p, std::nullptr_t,
                   const std::vector<int>& columns, double* out);
double normal_equations(const TyreLoss& loss, const double* p, std::nullptr_t,
                        const std::vector<int>& columns, double* gradient, double* information);

}  // namespace sysid::lab
