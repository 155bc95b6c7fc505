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
    double mu_f_std = 0.0, mu_r_std = 0.0;
    double nis = 0.0;       // squared whitened innovation
    double observed = 0.0;  // readings that it is made of
    double log_likelihood = 0.0;
    ObserverMode mode = ObserverMode::kRunning;

    template <class Row>
    void remember(Row& row) {
        row(beta_rad, beta_std_rad, vx_mps, yaw_rate_radps, fyf_n, fyr_n, fx_n, cf_npr, cr_npr,
            cf_std_npr, cr_std_npr, mu_f, mu_r, nis, observed, log_likelihood, mode, mu_f_std,
            mu_r_std);
    }
};
constexpr std::size_t kEstimateColumns = 19;

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
        e.mu_f_std,
        e.mu_r_std,
    };
}

/// How far a car may point from where it rolls [rad], as far as the yaw rate and the steering tell:
/// without slip it turns at v tan(delta) / l, and what it turns otherwise is slip of an axle.
inline double may_slide(double wheelbase_m, const SensorSample& s) {
    const double told = wheelbase_m * s.yaw_rate_radps - s.vx_mps * std::tan(s.steer_rad);
    return std::isnan(told) ? 0.0 : std::atan(std::abs(told) / std::max(std::abs(s.vx_mps), 1.0));
}

/// A car too slow for slip to be seen; for the rest of the estimate there is nothing to say.
inline SideslipEstimate rolling_without_slip(double lf_m, double lr_m, const SensorSample& s) {
    SideslipEstimate out;
    out.beta_rad = std::atan(lr_m * std::tan(s.steer_rad) / (lf_m + lr_m));
    out.beta_std_rad = std::hypot(0.01 + 0.2 * std::abs(out.beta_rad), may_slide(lf_m + lr_m, s));
    out.vx_mps = s.vx_mps;
    out.yaw_rate_radps = s.yaw_rate_radps;
    out.fyf_n = out.fyr_n = out.fx_n = std::nan("");
    out.cf_npr = out.cr_npr = out.cf_std_npr = out.cr_std_npr = std::nan("");
    out.mu_f = out.mu_r = out.mu_f_std = out.mu_r_std = out.nis = std::nan("");
    out.mode = ObserverMode::kHolding;
    return out;
}

/// Standard deviations; those of things that walk are per root second. The defaults were chosen
/// on random cars in three simulators (benchmarks/online/choose_noise.py).
struct ObserverSettings {
    double vx_mps = 0.05, yaw_rate_radps = 0.005, ax_mps2 = 0.1, ay_mps2 = 0.1;
    double road_mps2 = 0.02, road_time_s = 10.0;
    double roll_expected = 0.045, roll_share = 0.05, roll_time_s = 0.1;
    double force_walk = 1.0;
    double error_load = 0.003, error_lateral = 0.05, error_braking = 0.15, error_time_s = 0.25;
    double error_drive = 0.05;
    double yaw_walk_radps = 0.02, sideslip_walk_rad = 0.0003;
    double stiffness_prior = 0.4, stiffness_walk = 0.0003;
    double friction_prior = 0.1, friction_time_s = 50.0;
    double relaxation_m = 0.3, relaxation_std = 0.6;
    double steer_late_s = 0.03, ahead_m = 0.3, inertia_prior = 0.1;
    // Half the typical sizes of the catalogue's effects; of forces a fifth, as with more of them no
    // other departure of a car that goes straight is seen. They last: what changed within a drive
    // would be told from an offset of the steering by waiting, which a steady wind is not.
    double steer_offset_rad = 0.003, ay_bias_mps2 = 0.125, yaw_rate_bias_radps = 0.003;
    double push_mps2 = 0.05, turn_radps2 = 0.02, push_time_s = 600.0;
    double error_curve = 0.06, error_slip_rad = 0.0004, learning_use = 0.2;
    double gate_probability = 1e-6, gate_patience_s = 3.0, frozen_after_s = 0.2;
    double stop_below_mps = 3.0, go_above_mps = 4.0;
    double fx_walk = 0.3;
    double beta_walk_radps = 0.004, model_ay_mps2 = 0.3;
};

struct ObserverSetting {
    const char* name;
    double ObserverSettings::* value;
    const char* meaning;
};

/// What they mean.
inline constexpr ObserverSetting kObserverSettings[] = {
    {"vx_mps", &ObserverSettings::vx_mps, "noise of the speed [m/s]"},
    {"yaw_rate_radps", &ObserverSettings::yaw_rate_radps, "noise of the yaw rate [rad/s]"},
    {"ax_mps2", &ObserverSettings::ax_mps2, "noise of the longitudinal acceleration [m/s2]"},
    {"ay_mps2", &ObserverSettings::ay_mps2, "noise of the lateral acceleration [m/s2]"},
    {"road_mps2", &ObserverSettings::road_mps2,
     "bank of the road as a lateral acceleration [m/s2]"},
    {"roll_expected", &ObserverSettings::roll_expected,
     "gravity felt through body roll, share of a_y"},
    {"roll_share", &ObserverSettings::roll_share, "standard deviation of that share"},
    {"roll_time_s", &ObserverSettings::roll_time_s, "time that the body takes to roll [s]"},
    {"road_time_s", &ObserverSettings::road_time_s, "time over which the bank changes [s]"},
    {"force_walk", &ObserverSettings::force_walk,
     "change of a lateral axle force, share of the load [1/sqrt(s)]"},
    {"error_load", &ObserverSettings::error_load, "error of the tyre model, share of the load"},
    {"error_lateral", &ObserverSettings::error_lateral,
     "error of the tyre model, share of the lateral force"},
    {"error_braking", &ObserverSettings::error_braking,
     "error of the tyre model, share of the grip that braking takes"},
    {"error_drive", &ObserverSettings::error_drive,
     "yaw moment by drive and brakes, share of their force at half the wheelbase"},
    {"error_time_s", &ObserverSettings::error_time_s, "time over which these errors change [s]"},
    {"yaw_walk_radps", &ObserverSettings::yaw_walk_radps,
     "unexplained change of the yaw rate [rad/s/sqrt(s)]"},
    {"sideslip_walk_rad", &ObserverSettings::sideslip_walk_rad,
     "unexplained change of the sideslip [rad/sqrt(s)]"},
    {"stiffness_prior", &ObserverSettings::stiffness_prior,
     "standard deviation of the stiffness at first (of its logarithm)"},
    {"friction_prior", &ObserverSettings::friction_prior,
     "change of the friction with the road (of its logarithm)"},
    {"stiffness_walk", &ObserverSettings::stiffness_walk,
     "change of the stiffness in hard driving [1/sqrt(s)]"},
    {"friction_time_s", &ObserverSettings::friction_time_s, "time over which friction changes [s]"},
    {"relaxation_m", &ObserverSettings::relaxation_m, "relaxation length of the tyres [m]"},
    {"relaxation_std", &ObserverSettings::relaxation_std,
     "standard deviation of that length (of its logarithm)"},
    {"steer_late_s", &ObserverSettings::steer_late_s,
     "standard deviation of the time by which the wheels turn late [s]"},
    {"ahead_m", &ObserverSettings::ahead_m,
     "standard deviation of the accelerometer's place ahead of the centre of gravity [m]"},
    {"inertia_prior", &ObserverSettings::inertia_prior,
     "standard deviation of the yaw inertia (of its logarithm)"},
    {"steer_offset_rad", &ObserverSettings::steer_offset_rad,
     "standard deviation of a constant error of the steering angle [rad]"},
    {"ay_bias_mps2", &ObserverSettings::ay_bias_mps2,
     "standard deviation of a bias of the lateral acceleration [m/s2]"},
    {"yaw_rate_bias_radps", &ObserverSettings::yaw_rate_bias_radps,
     "standard deviation of a bias of the yaw rate [rad/s]"},
    {"push_mps2", &ObserverSettings::push_mps2,
     "lateral acceleration by forces from outside, as wind [m/s2]"},
    {"turn_radps2", &ObserverSettings::turn_radps2, "yaw acceleration by these [rad/s2]"},
    {"push_time_s", &ObserverSettings::push_time_s, "time over which these change [s]"},
    {"learning_use", &ObserverSettings::learning_use,
     "lateral force over load up to which slip tells less of the stiffness"},
    {"error_slip_rad", &ObserverSettings::error_slip_rad,
     "slip angle without force, by toe, camber and compliance [rad]"},
    {"error_curve", &ObserverSettings::error_curve,
     "error of the tyre curve that is never learnt, share of the slip"},
    {"gate_probability", &ObserverSettings::gate_probability,
     "readings less probable than this are refused"},
    {"gate_patience_s", &ObserverSettings::gate_patience_s,
     "after so long they are taken again [s]"},
    {"frozen_after_s", &ObserverSettings::frozen_after_s,
     "a sensor that stands still for longer is left out [s]"},
    {"stop_below_mps", &ObserverSettings::stop_below_mps,
     "below this speed the car is taken to roll without slip [m/s]"},
    {"go_above_mps", &ObserverSettings::go_above_mps,
     "above this speed the observer begins again [m/s]"},
    {"fx_walk", &ObserverSettings::fx_walk,
     "change of the longitudinal force, share of the weight [1/sqrt(s)]"},
    {"beta_walk_radps", &ObserverSettings::beta_walk_radps,
     "three-state observer: unexplained change of the sideslip [rad/sqrt(s)]"},
    {"model_ay_mps2", &ObserverSettings::model_ay_mps2,
     "three-state observer: error of the modelled lateral acceleration [m/s2]"},
};

}  // namespace sysid
