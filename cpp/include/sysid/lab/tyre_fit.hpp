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

#include "sysid/lab/grey_box.hpp"

namespace sysid::lab {

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
    TyreLoss(const GreyBoxCar& car, bool projects_steer)
        : car_(car), projects_steer_(projects_steer) {}

    void add(const TyreSample& sample);
    std::size_t samples() const { return rows_.size(); }

    /// Weighted errors of a_y and of the yaw acceleration of each sample, as
    /// `identify/least_squares.hpp` takes them.
    template <class S, class Keep>
    void walk(const S* p, Keep&& keep) const {
        const TyreCoefficients<S> front{p[0], p[1], p[2], p[3]};
        const TyreCoefficients<S> rear{p[4], p[5], p[6], p[7]};
        for (const Row& row : rows_) {
            const S mu_f = magic_formula(row.alpha.front, front);
            const S mu_r = magic_formula(row.alpha.rear, rear);
            const S rest = row.rest[0] * p[kP1] + row.rest[1] * p[kP2] + row.rest[2] * p[kP3];
            keep(std::array<S, 2>{
                row.a_y - row.lateral.front * mu_f - row.lateral.rear * mu_r - rest,
                row.yaw_acceleration - row.yaw.front * mu_f - row.yaw.rear * mu_r,
            });
        }
    }

  private:
    struct Row {
        Axles<double> alpha;
        Axles<double> lateral;       // a_y per unit of friction, weighted
        Axles<double> yaw;           // yaw acceleration per unit of friction, weighted
        std::array<double, 3> rest;  // factors of P_1, P_2, P_3, weighted
        double a_y, yaw_acceleration;
    };

    GreyBoxCar car_;
    bool projects_steer_;
    std::vector<Row> rows_;
};

/// As in `tyre_likelihood.hpp`; no filter has a part in it, and nullptr stands for its gains.
void residuals(const TyreLoss& loss, const double* p, std::nullptr_t, double* out);
double half_sum_of_squares(const TyreLoss& loss, const double* p, std::nullptr_t);
void sensitivities(const TyreLoss& loss, const double* p, std::nullptr_t,
                   const std::vector<int>& columns, double* out);
double normal_equations(const TyreLoss& loss, const double* p, std::nullptr_t,
                        const std::vector<int>& columns, double* gradient, double* information);

}  // namespace sysid::lab
