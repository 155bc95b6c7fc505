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

    /// Weighted errors of a_y and of the yaw acceleration, two per sample.
    void residuals(const double* p, double* out) const;

    /// Minus the derivatives of the residuals by the parameters `columns`, row-major.
    void sensitivities(const double* p, const std::vector<int>& columns, double* out) const;

    double half_sum_of_squares(const double* p) const;

    /// As in `TyreProblem`.
    double normal_equations(const double* p, const std::vector<int>& columns, double* gradient,
                            double* information) const;

  private:
    struct Row {
        double alpha_f, alpha_r;
        double lateral_f, lateral_r;  // a_y per unit of friction, weighted
        double yaw_f, yaw_r;          // yaw acceleration per unit of friction, weighted
        std::array<double, 3> rest;   // factors of P_1, P_2, P_3, weighted
        double a_y, yaw_acceleration;
    };
    struct Errors {
        double lateral, yaw;
    };
    /// Errors of one sample, given the friction of both axles.
    static Errors errors(const Row& row, double mu_f, double mu_r, const double* p) {
        const double rest = row.rest[0] * p[kP1] + row.rest[1] * p[kP2] + row.rest[2] * p[kP3];
        return {
            row.a_y - row.lateral_f * mu_f - row.lateral_r * mu_r - rest,
            row.yaw_acceleration - row.yaw_f * mu_f - row.yaw_r * mu_r,
        };
    }
    template <class Keep>
    void each(const double* p, Keep&& keep) const {
        const TyreCoefficients<double> front{p[0], p[1], p[2], p[3]};
        const TyreCoefficients<double> rear{p[4], p[5], p[6], p[7]};
        for (const Row& row : rows_)
            keep(errors(row, magic_formula(row.alpha_f, front), magic_formula(row.alpha_r, rear),
                        p));
    }

    GreyBoxCar car_;
    bool projects_steer_;
    std::vector<Row> rows_;
};

}  // namespace sysid::lab
