// The intermediate quantities of one evaluation of the single-track model.
//
// The model fills them stage by stage; each effect changes the ones it is about, at the stage where
// they are complete and not yet used. Symbols follow the equations in `single_track.hpp`.
#pragma once

#include <cstddef>

#include "sysid/math/given.hpp"
#include "sysid/math/recorded.hpp"
#include "sysid/model/tyre.hpp"

namespace sysid {

/// Room for what users' formulas read beyond the model: channels of the log that they name, and
/// states of their own.
constexpr std::size_t kUserChannels = 8;
constexpr std::size_t kUserStates = 4;

template <class S>
struct Workings {
    // the car (stage `vehicle`)
    S m, I_z, l_f, l_r;
    S h;                         // height of the centre of gravity [m]
    Given<S> rho{};              // air density [kg/m3]
    S drag_area;                 // C_d A [m2]
    S brake_front, drive_front;  // shares of the front axle in brake and drive force
    S fz0_f, fz0_r;              // static axle loads [N]
    // motion
    S v_x, v_y, r;
    S v_road;           // lateral, of the axles under the centre of gravity over the road [m/s]
    Given<S> time_s{};  // since the log began
    // inputs (stages `input`, `drive` and `steering`)
    S delta;  // road-wheel angle that acts [rad]
    S cos_delta, sin_delta;
    Given<S> steer_rate{};  // of the logged angle [rad/s]
    bool force_known = true;
    S fx;        // total wheel force [N], or
    S ax_input;  // measured longitudinal specific force [m/s2] that stands in for it
    // forces from outside and gravity in the road plane (stage `body`)
    S force_x, force_y;      // [N]
    S moment_z;              // [N m]
    S gravity_x, gravity_y;  // felt by the motion, not by an accelerometer [m/s2]
    // tyres (stages `slip`, `loads`, `grip`)
    S alpha_f, alpha_r;      // slip angles [rad]
    S fx_f, fx_r;            // longitudinal axle forces [N]
    S fz_f, fz_r;            // axle loads [N]
    S B_f, B_r;              // B of the Magic Formula [1/rad]
    S C_f, E_f;              // its C and E, of the front axle
    S mu_peak_f, mu_peak_r;  // its D
    S grip_f, grip_r;        // factors on the lateral axle forces
    S fy_f, fy_r;            // lateral axle forces [N]
    // results
    S a_x, a_y;  // specific force at the centre of gravity [m/s2]
    S r_dot;     // yaw acceleration [rad/s2]
    // what only formulas of users read
    Given<S> track_f{}, track_r{};       // [m]
    const Given<S>* channels = nullptr;  // `kUserChannels` of the log
    const S* user_states = nullptr;      // `kUserStates`
};

/// Where the model is written as text, what has changed since gets its name there.
template <class S>
void name_workings(const Workings<S>& w) {
    if (!spells(w.v_x)) return;
    named("m", w.m), named("I_z", w.I_z), named("l_f", w.l_f), named("l_r", w.l_r);
    named("height", w.h), named("drag", w.drag_area);
    named("brake_front", w.brake_front), named("drive_front", w.drive_front);
    named("fz0_f", w.fz0_f), named("fz0_r", w.fz0_r);
    named("delta", w.delta), named("cos_delta", w.cos_delta), named("sin_delta", w.sin_delta);
    named("fx", w.fx), named("force_x", w.force_x), named("force_y", w.force_y);
    named("moment_z", w.moment_z);
    named("gravity_x", w.gravity_x), named("gravity_y", w.gravity_y);
    named("v_road", w.v_road);
    named("alpha_f", w.alpha_f), named("alpha_r", w.alpha_r);
    named("fx_f", w.fx_f), named("fx_r", w.fx_r), named("fz_f", w.fz_f), named("fz_r", w.fz_r);
    named("peak_f", w.mu_peak_f), named("peak_r", w.mu_peak_r);
    named("grip_f", w.grip_f), named("grip_r", w.grip_r);
    named("fy_f", w.fy_f), named("fy_r", w.fy_r);
    named("a_x", w.a_x), named("a_y", w.a_y), named("r_dot", w.r_dot);
}

/// Measured channels, in the order of every measurement vector.
enum Channel : int { kVx = 0, kVy = 1, kYawRate = 2, kAx = 3, kAy = 4 };
constexpr int kChannels = 5;

}  // namespace sysid
