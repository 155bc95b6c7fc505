#include "sysid/published/sideslip_observer.hpp"

#include <cstdio>

namespace sysid {

namespace {

std::string shown(double v) {
    std::array<char, 32> text{};
    std::snprintf(text.data(), text.size(), "%.4g", v);
    return text.data();
}

}  // namespace

const SideslipEstimate& PublishedDual::step(double dt, const SensorSample& s) {
    check_sample(dt, s, index_);
    if (dt > kForgottenAfterS)
        throw NumericalFailure(
            "the published observer cannot bridge " + shown(dt) + " s: begin another one", index_);
    const auto readings = readings_of(s);
    for (std::size_t i = 0; i < readings.size(); ++i) {
        const SensorRange& range = kSensorRanges[i];
        if (std::isnan(readings[i]))
            throw NumericalFailure(
                std::string("the published observer needs every sensor, and ") + range.channel +
                    " is missing: leave the sample out, or take the dual observer",
                index_);
        if (std::abs(readings[i]) > range.most)
            throw NumericalFailure(std::string(range.channel) + " = " + shown(readings[i]) +
                                       " is beyond what a car does (" + shown(range.most) +
                                       "): leave the sample out, or give the range in SI units",
                                   index_);
    }
    if (index_++ == 0) {  // the first call only sets up
        out_.beta_rad = tyres_.x[0];
        return out_;
    }
    const std::size_t at = index_ - 1;
    const VehicleData& c = car_.data;
    const double m = c.mass_kg, inertia = car_.yaw_inertia_kgm2, d = s.steer_rad;
    const double beta = tyres_.x[0];
    const Mat<5, 5> drawn = factor_of<5>(forces_.P, at);
    const Vec<5> drawn_about = forces_.x;
    const double spread = SigmaWeights::scaled(5, 1e-3, 2.0).spread;

    forces_.step(
        [&](const Vec<5>& x, int) {
            Vec<5> next = x;
            next[0] +=
                dt / m *
                (x[4] * std::cos(beta - d) + x[2] * std::sin(beta - d) + x[3] * std::sin(beta));
            next[1] +=
                dt / inertia * (c.lf_m * (x[2] * std::cos(d) + x[4] * std::sin(d)) - c.lr_m * x[3]);
            return next;
        },
        [&](const Vec<5>& x, int) {
            return Vec<4>(x[0], x[1], (x[4] * std::cos(d) - x[2] * std::sin(d)) / m,
                          (x[2] * std::cos(d) + x[3] + x[4] * std::sin(d)) / m);
        },
        (Vec<5>() << 1e-5, 1e-6, 1e3, 1e3, 1e3).finished().asDiagonal(),
        Vec<4>(s.vx_mps, s.yaw_rate_radps, s.ax_mps2, s.ay_mps2),
        Vec<4>(1e-4, 1e-2, 1e-3, 1e-3).asDiagonal(), at);

    // The published B takes for its k-th sigma point the F_x of the k-th sigma point that A drew.
    const auto fx = [&](int column) {
        return drawn_about[4] + PublishedUkf<5, 4>::deviation(drawn, spread, column)[4];
    };
    const double r = s.yaw_rate_radps, vx = s.vx_mps;
    const auto slip = [&](const Vec<3>& x) {
        return small_slip_angles(x[0], r / vx, c.lf_m, c.lr_m, d);
    };
    tyres_.step(
        [&](const Vec<3>& x, int column) {
            Vec<3> next = x;
            const Axles<double> alpha = slip(x);
            const double across = fx(column) * std::sin(d - x[0]) +
                                  (cf_ + x[1]) * alpha.front * std::cos(d - x[0]) +
                                  (cr_ + x[2]) * alpha.rear * std::cos(x[0]);
            next[0] += dt * (across / (m * vx) - r);
            return next;
        },
        [&](const Vec<3>& x, int column) {
            const Axles<double> alpha = slip(x);
            const double front = (cf_ + x[1]) * alpha.front, rear = (cr_ + x[2]) * alpha.rear;
            return Vec<3>(front, rear, (front * std::cos(d) + fx(column) * std::sin(d)) / m);
        },
        Vec<3>(1e-13, 1e-10, 1e-10).asDiagonal(), Vec<3>(forces_.x[2], forces_.x[3], s.ay_mps2),
        Vec<3>(1e3, 1e3, 1e-1).asDiagonal(), at);

    if (!(std::abs(tyres_.x[0]) < kMostSideslipRad))
        throw NumericalFailure("the published observer has diverged: begin another one", at);
    out_.beta_rad = tyres_.x[0];
    out_.beta_std_rad = std::sqrt(std::max(tyres_.P(0, 0), 0.0));
    out_.vx_mps = forces_.x[0];
    out_.yaw_rate_radps = forces_.x[1];
    out_.fyf_n = forces_.x[2];
    out_.fyr_n = forces_.x[3];
    out_.fx_n = forces_.x[4];
    out_.cf_npr = cf_ + tyres_.x[1];
    out_.cr_npr = cr_ + tyres_.x[2];
    out_.cf_std_npr = std::sqrt(std::max(tyres_.P(1, 1), 0.0));
    out_.cr_std_npr = std::sqrt(std::max(tyres_.P(2, 2), 0.0));
    out_.mu_f = out_.mu_r = out_.mu_f_std = out_.mu_r_std = std::nan("");
    out_.nis = out_.log_likelihood = std::nan("");
    out_.observed = 3.0;
    return out_;
}

}  // namespace sysid
