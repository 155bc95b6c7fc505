// What every sideslip observer takes and gives at a sample, and what it assumes about sensors, road
// and tyre model.
#pragma once

#include <array>
#include <cmath>

namespace sysid {

/// One sample of the sensors; NaN is missing. SI units, ISO 8855 axes.
struct SensorSample {
    double steer_rad, vx_mps, yaw_rate_radps, ax_mps2, ay_mps2;
};

enum class ObserverMode : int {
    kRunning = 0,
    kHolding = 1,   // too slow: sideslip of a car that rolls without slip
    kCoasting = 2,  // a sensor is missing or refused: the tyre model stands in
};

struct SideslipEstimate {
    double beta_rad = 0.0, beta_std_rad = 0.0;
    double vx_mps = 0.0, yaw_rate_radps = 0.0;
    double fyf_n = 0.0, fyr_n = 0.0, fx_n = 0.0;
    double cf_npr = 0.0, cr_npr = 0.0;  // cornering stiffness at the static load [N/rad]
    double cf_std_npr = 0.0, cr_std_npr = 0.0;
    double mu_f = 0.0, mu_r = 0.0;  // friction at the peak [-]
    double nis = 0.0;               // squared whitened innovation
    double observed = 0.0;          // readings that it is made of
    double log_likelihood = 0.0;
    ObserverMode mode = ObserverMode::kRunning;

    template <class Row>
    void remember(Row& row) {
        row(beta_rad, beta_std_rad, vx_mps, yaw_rate_radps, fyf_n, fyr_n, fx_n, cf_npr, cr_npr,
            cf_std_npr, cr_std_npr, mu_f, mu_r, nis, observed, log_likelihood, mode);
    }
};
constexpr std::size_t kEstimateColumns = 17;

inline std::array<double, kEstimateColumns> columns_of(const SideslipEstimate& e) {
    return {
        e.beta_rad,
        e.beta_std_rad,
        e.vx_mps,
        e.yaw_rate_radps,
        e.fyf_n,
        e.fyr_n,
        e.fx_n,
        e.cf_npr,
        e.cr_npr,
        e.cf_std_npr,
        e.cr_std_npr,
        e.mu_f,
        e.mu_r,
        e.nis,
        e.observed,
        e.log_likelihood,
        static_cast<double>(e.mode),
    };
}

/// A car too slow for slip to be seen; for the rest of the estimate there is nothing to say.
inline SideslipEstimate rolling_without_slip(double lf_m, double lr_m, const SensorSample& s) {
    SideslipEstimate out;
    out.beta_rad = std::atan(lr_m * std::tan(s.steer_rad) / (lf_m + lr_m));
    out.beta_std_rad = 0.01 + 0.2 * std::abs(out.beta_rad);
    out.vx_mps = s.vx_mps;
    out.yaw_rate_radps = s.yaw_rate_radps;
    out.fyf_n = out.fyr_n = out.fx_n = std::nan("");
    out.cf_npr = out.cr_npr = out.cf_std_npr = out.cr_std_npr = std::nan("");
    out.mu_f = out.mu_r = out.nis = std::nan("");
    out.mode = ObserverMode::kHolding;
    return out;
}

/// Standard deviations; those of things that walk are per root second. The defaults were chosen
/// on random cars in three simulators (benchmarks/online/choose_noise.py).
struct ObserverSettings {
    // white noise of the sensors
    double vx_mps = 0.05, yaw_rate_radps = 0.005, ax_mps2 = 0.1, ay_mps2 = 0.1;
    // lateral acceleration that moves the car but that no accelerometer feels (road bank), and the
    // share of it that it feels too much, by gravity in body roll: expected, standard deviation,
    // delay
    double road_mps2 = 0.02, road_time_s = 10.0;
    double roll_expected = 0.045, roll_share = 0.05, roll_time_s = 0.1;
    // lateral axle forces as observer A lets them change, as a share of the load
    double force_walk = 1.0;
    // error of the tyre model, as a share of load, lateral force, and grip lost to braking
    double error_load = 0.003, error_lateral = 0.05, error_braking = 0.15, error_time_s = 0.25;
    // yaw moment by drive and brakes: share of their force, at half the wheelbase
    double error_drive = 0.05;
    // what neither tyres nor road explain of yaw rate and sideslip
    double yaw_walk_radps = 0.02, sideslip_walk_rad = 0.0003;
    // logarithm of the tyre's numbers: stiffness is uncertain at first and changes in hard driving,
    // friction changes with the road and comes back
    double stiffness_prior = 0.4, stiffness_walk = 0.0003;
    double friction_prior = 0.1, friction_time_s = 50.0;
    double relaxation_m = 0.3, relaxation_std = 0.6;  // of both axles, and of its logarithm
    // what the observer cannot learn of the tyres: error of their curve, share of the slip, and of
    // the slip without force; lateral force over load up to which slip tells less of the stiffness
    double error_curve = 0.06, error_slip_rad = 0.0004, learning_use = 0.2;
    // gate, frozen sensors, low speed
    double gate_probability = 1e-6, gate_patience_s = 3.0, frozen_after_s = 0.2;
    double stop_below_mps = 3.0, go_above_mps = 4.0;
    // longitudinal force as the observers let it change, as a share of the weight
    double fx_walk = 0.3;
    // the three-state observer: errors of the sideslip rate and of the lateral acceleration
    double beta_walk_radps = 0.004, model_ay_mps2 = 0.3;
};

}  // namespace sysid
