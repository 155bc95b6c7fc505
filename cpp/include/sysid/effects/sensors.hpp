// What sensors do to readings: delays, lever arms, tilt, scales, biases.
#pragma once

#include "sysid/effects/effect.hpp"
#include "sysid/model/kinematics.hpp"

namespace sysid {

/// How far ahead of the centre of gravity a sensor is.
constexpr ParameterInfo arm_forward(double typical, double matters, double usual_most) {
    return {.name = "forward_m",
            .unit = "m",
            .typical = typical,
            .matters = matters,
            .bounds = {-4.0, 4.0},
            .usual = {0.1, usual_most}};
}
/// How far to the left.
constexpr ParameterInfo arm_left(double typical, double matters, double usual_most) {
    return {.name = "left_m",
            .unit = "m",
            .typical = typical,
            .matters = matters,
            .bounds = {-2.0, 2.0},
            .usual = {0.1, usual_most},
            .mirrored = true};
}

/// Sensors write late: the speeds (satellite or optical receiver) and the inertial unit each by a
/// time of their own. Every channel is an all-pass lag of what the motion is; other errors of the
/// sensors come on top and are not delayed.
struct SensorDelay : Effect {
    static constexpr EffectInfo info{
        .id = "sensor_delay",
        .title = "readings that come late",
        .equation = "y'(t) = y(t - T), (1 - s T/2) / (1 + s T/2)",
        .source =
            "Klein & Morelli, Aircraft System Identification, ch. 10; Pade approximation of first "
            "order",
        .excited_by = "sweeps of the steering, steps of the drive torque",
        .moves = "yaw_rate_radps, ay_mps2, vy_mps",
        .needs = "steer_rad, vx_mps, yaw_rate_radps",
        .confounded_with = "steer_lag, steer_delay, front_tyre_relaxation, force_lag",
        .parameters = {{.name = "speeds_s",
                        .unit = "s",
                        .typical = 0.06,
                        .matters = 0.01,
                        .bounds = {0.0, 0.5},
                        .usual = {0.02, 0.15}},
                       {.name = "inertial_s",
                        .unit = "s",
                        .typical = 0.02,
                        .matters = 0.004,
                        .bounds = {0.0, 0.5},
                        .usual = {0.005, 0.03}}},
        .states = {{"late_v_x", "m/s"},
                   {"late_v_y", "m/s"},
                   {"late_r", "rad/s"},
                   {"late_a_x", "m/s2"},
                   {"late_a_y", "m/s2"}},
        .scored_at_typical = true,
        .breaks = Breaks::kReadingsLate,
    };
    static constexpr double state_spread = 0.3;

    template <class T, class S>
    static void follow(const T* p, const Workings<S>& w, Lags<S> lags) {
        const S now[kChannels] = {w.v_x, w.v_y, w.r, w.a_x, w.a_y};
        for (int i = 0; i < kChannels; ++i) {
            const T& delay = of(p, i);
            if (value_of(delay) > 0.0)
                lags.follow(static_cast<std::size_t>(i), now[i], S(lag_rate(T(0.5 * delay))));
        }
    }
    template <class T, class S>
    static void sensors(const T* p, const Workings<S>& /*w*/, const S* state, S* y) {
        for (int i = 0; i < kChannels; ++i)
            if (value_of(of(p, i)) > 0.0) y[i] = 2.0 * state[i] - y[i];
    }

    template <class T>
    static const T& of(const T* p, int channel) {
        return p[channel < kYawRate ? 0 : 1];
    }
};

/// The speed sensor is not at the centre of gravity of the vehicle file.
struct SpeedSensorLeverArm : Effect {
    static constexpr EffectInfo info{
        .id = "speed_sensor_lever_arm",
        .title = "speed sensor away from the centre of gravity",
        .equation = "v_x' = v_x - l_y r, v_y' = v_y + l_x r",
        .source = "Klein & Morelli, Aircraft System Identification, ch. 10",
        .excited_by = "tight circles in both directions, sweeps",
        .moves = "vy_mps, vx_mps",
        .needs = "steer_rad, vx_mps, yaw_rate_radps, vy_mps",
        .confounded_with = "cg_position, ins_lever_arm",
        .parameters = {arm_forward(0.8, 0.1, 1.5), arm_left(0.4, 0.1, 0.8)},
        .breaks = Breaks::kReadingsElsewhere,
        .same_in_all_logs = true,
    };

    template <class T, class S>
    static void sensors(const T* p, const Workings<S>& w, const S* /*state*/, S* y) {
        y[kVx] = y[kVx] - p[1] * w.r;
        y[kVy] += p[0] * w.r;
    }
};

/// The optical or satellite speed sensor is mounted turned to the right.
struct SpeedSensorMisalignment : Effect {
    static constexpr EffectInfo info{
        .id = "speed_sensor_misalignment",
        .title = "speed sensor turned about the vertical",
        .equation = "v_x' = v_x cos(e) - v_y sin(e), v_y' = v_y cos(e) + v_x sin(e)",
        .source = "Klein & Morelli, Aircraft System Identification, ch. 10",
        .excited_by = "straight driving at several speeds",
        .moves = "vy_mps",
        .needs = "steer_rad, vx_mps, yaw_rate_radps, vy_mps",
        .confounded_with = "steer_offset, rear_toe, side_wind",
        .parameters = {{.name = "angle_rad",
                        .unit = "rad",
                        .typical = 0.008,
                        .matters = 0.0015,
                        .bounds = {-0.3, 0.3},
                        .usual = {0.003, 0.017},
                        .mirrored = true}},
    };

    template <class T, class S>
    static void sensors(const T* p, const Workings<S>& /*w*/, const S* /*state*/, S* y) {
        using std::cos;
        using std::sin;
        const S forward = y[kVx];
        y[kVx] = forward * cos(p[0]) - y[kVy] * sin(p[0]);
        y[kVy] = y[kVy] * cos(p[0]) + forward * sin(p[0]);
    }
};

/// The accelerometer is not at the centre of gravity of the vehicle file.
struct ImuLeverArm : Effect {
    static constexpr EffectInfo info{
        .id = "imu_lever_arm",
        .title = "accelerometer away from the centre of gravity",
        .equation = "a_x -= l_x r^2 + l_y dr/dt, a_y += l_x dr/dt - l_y r^2",
        .source = "Klein & Morelli, Aircraft System Identification, ch. 10",
        .excited_by = "sweeps and tight circles",
        .moves = "ay_mps2, ax_mps2",
        .needs = "ay_mps2, yaw_rate_radps",
        .confounded_with = "cg_position, ins_lever_arm",
        .parameters = {arm_forward(0.5, 0.05, 0.8), arm_left(0.3, 0.05, 0.5)},
        .breaks = Breaks::kReadingsElsewhere,
        .same_in_all_logs = true,
    };

    static constexpr bool reads_yaw_acceleration = true;

    template <class T, class S>
    static void input(const T* p, Workings<S>& w) {
        w.ax_input += p[0] * (w.r * w.r) + p[1] * w.r_dot;
    }
    template <class T, class S>
    static void sensors(const T* p, const Workings<S>& w, const S* /*state*/, S* y) {
        y[kAx] = y[kAx] - (p[0] * (w.r * w.r) + p[1] * w.r_dot);
        y[kAy] += p[0] * w.r_dot - p[1] * (w.r * w.r);
    }
};

/// An inertial navigation system reports all motion of one point, its own or one it was told, which
/// is not the centre of gravity. Its speeds and accelerations agree with each other, so that
/// kinematics cannot tell where it is.
struct InsLeverArm : Effect {
    static constexpr EffectInfo info{
        .id = "ins_lever_arm",
        .title = "all motion measured away from the centre of gravity",
        .equation =
            "v_x' = v_x - l_y r, v_y' = v_y + l_x r, a_x -= l_x r^2 + l_y dr/dt, "
            "a_y += l_x dr/dt - l_y r^2",
        .source = "Klein & Morelli, Aircraft System Identification, ch. 10",
        .excited_by = "sweeps and tight circles",
        .moves = "vy_mps, ay_mps2",
        .needs = "steer_rad, vx_mps, yaw_rate_radps, vy_mps, ay_mps2",
        .confounded_with = "cg_position, speed_sensor_lever_arm, imu_lever_arm",
        .parameters = {SpeedSensorLeverArm::info.parameters[0],
                       SpeedSensorLeverArm::info.parameters[1]},
        .same_in_all_logs = true,
    };

    static constexpr bool reads_yaw_acceleration = true;

    template <class T, class S>
    static void input(const T* p, Workings<S>& w) {
        ImuLeverArm::input(p, w);
    }
    template <class T, class S>
    static void sensors(const T* p, const Workings<S>& w, const S* state, S* y) {
        SpeedSensorLeverArm::sensors(p, w, state, y);
        ImuLeverArm::sensors(p, w, state, y);
    }
};

/// The body leans out of corners and squats, and the accelerometer leans with it: it feels a part
/// of gravity, and of the acceleration only what lies along its own axis. Both signs follow from a
/// body that gives way.
struct BodyAttitude : Effect {
    static constexpr EffectInfo info{
        .id = "body_attitude",
        .title = "accelerometer tilted by roll and pitch of the body",
        .equation =
            "a_x' = a_x cos(theta) + g sin(theta), theta = K_pitch a_x/g; a_y the same with K_roll",
        .source = "Ryu & Gerdes, ACC 2004; Gillespie, Fundamentals of Vehicle Dynamics, ch. 6",
        .excited_by = "a ramp to the limit, hard braking",
        .moves = "ay_mps2, ax_mps2",
        .needs = "ax_mps2, ay_mps2",
        .confounded_with = "accelerometer_scale, gyro_scale, body_roll",
        .parameters = {{.name = "pitch_per_g_rad",
                        .unit = "rad",
                        .typical = 0.04,
                        .matters = 0.01,
                        .bounds = {0.0, 0.4},
                        .usual = {0.02, 0.06}},
                       {.name = "roll_per_g_rad",
                        .unit = "rad",
                        .typical = 0.06,
                        .matters = 0.01,
                        .bounds = {0.0, 0.4},
                        .usual = {0.03, 0.09}}},
    };

    template <class T, class S>
    static void input(const T* p, Workings<S>& w) {
        // Newton's method for what was felt before the tilt was added.
        const S felt = w.ax_input;
        S own = felt / (1.0 + p[0]);
        for (int i = 0; i < 3; ++i) {
            using std::cos;
            using std::sin;
            const S angle = p[0] * own / kGravity;
            const S slope = (1.0 + p[0]) * cos(angle) - angle * sin(angle);
            own = own - (tilted(p[0], own) - felt) / slope;
        }
        w.ax_input = own;
    }
    template <class T, class S>
    static void sensors(const T* p, const Workings<S>& /*w*/, const S* /*state*/, S* y) {
        y[kAx] = tilted(p[0], y[kAx]);
        y[kAy] = tilted(p[1], y[kAy]);
    }

    template <class T, class S>
    static S tilted(const T& gradient, const S& a) {
        using std::cos;
        using std::sin;
        const S angle = gradient * a / kGravity;
        return a * cos(angle) + kGravity * sin(angle);
    }
};

/// Constant error of the accelerometer.
struct AccelerometerBias : Effect {
    static constexpr EffectInfo info{
        .id = "accelerometer_bias",
        .title = "bias of the accelerometer",
        .equation = "a_x += b_x, a_y += b_y",
        .source = "Klein & Morelli, Aircraft System Identification, ch. 10",
        .excited_by = "standstill on level ground, or both directions of the same road",
        .moves = "ax_mps2, ay_mps2",
        .needs = "ax_mps2, ay_mps2",
        .confounded_with = "side_wind, road_bank, road_grade",
        .parameters = {{.name = "ax_mps2",
                        .unit = "m/s2",
                        .typical = 0.15,
                        .matters = 0.03,
                        .bounds = {-5.0, 5.0},
                        .usual = {0.05, 0.2}},
                       {.name = "ay_mps2",
                        .unit = "m/s2",
                        .typical = 0.25,
                        .matters = 0.03,
                        .bounds = {-5.0, 5.0},
                        .usual = {0.05, 0.3},
                        .mirrored = true}},
    };

    template <class T, class S>
    static void input(const T* p, Workings<S>& w) {
        w.ax_input = w.ax_input - p[0];
    }
    template <class T, class S>
    static void sensors(const T* p, const Workings<S>& /*w*/, const S* /*state*/, S* y) {
        y[kAx] += p[0];
        y[kAy] += p[1];
    }
};

/// Scale error of the accelerometer; body roll and pitch act like one.
struct AccelerometerScale : Effect {
    static constexpr EffectInfo info{
        .id = "accelerometer_scale",
        .title = "scale error of the accelerometer, or body roll and pitch",
        .equation = "a_x *= 1 + s_x, a_y *= 1 + s_y",
        .source = "Klein & Morelli, Aircraft System Identification, ch. 10",
        .excited_by = "a ramp to the limit, hard braking",
        .moves = "ay_mps2, ax_mps2",
        .needs = "ax_mps2, ay_mps2",
        .confounded_with = "body_attitude, gyro_scale, body_roll",
        .parameters = {{.name = "ax_error",
                        .unit = "1",
                        .typical = 0.05,
                        .matters = 0.01,
                        .bounds = {-0.5, 0.5},
                        .usual = {0.01, 0.05}},
                       {.name = "ay_error",
                        .unit = "1",
                        .typical = 0.05,
                        .matters = 0.01,
                        .bounds = {-0.5, 0.5},
                        .usual = {0.01, 0.05}}},
    };

    template <class T, class S>
    static void input(const T* p, Workings<S>& w) {
        w.ax_input = w.ax_input / (1.0 + p[0]);
    }
    template <class T, class S>
    static void sensors(const T* p, const Workings<S>& /*w*/, const S* /*state*/, S* y) {
        y[kAx] *= 1.0 + p[0];
        y[kAy] *= 1.0 + p[1];
    }
};

/// Constant error of the yaw-rate sensor.
struct GyroBias : Effect {
    static constexpr EffectInfo info{
        .id = "gyro_bias",
        .title = "bias of the yaw-rate sensor",
        .equation = "r += b_r",
        .source = "Klein & Morelli, Aircraft System Identification, ch. 10",
        .excited_by = "standstill, straight driving",
        .moves = "yaw_rate_radps",
        .needs = "steer_rad, vx_mps, yaw_rate_radps",
        .confounded_with = "road_bank",
        .parameters = {{.name = "bias_radps",
                        .unit = "rad/s",
                        .typical = 0.006,
                        .matters = 0.001,
                        .bounds = {-0.5, 0.5},
                        .usual = {0.002, 0.01},
                        .mirrored = true}},
    };

    template <class T, class S>
    static void sensors(const T* p, const Workings<S>& /*w*/, const S* /*state*/, S* y) {
        y[kYawRate] += p[0];
    }
};

/// Scale error of the yaw-rate sensor.
struct GyroScale : Effect {
    static constexpr EffectInfo info{
        .id = "gyro_scale",
        .title = "scale error of the yaw-rate sensor",
        .equation = "r *= 1 + s",
        .source = "Klein & Morelli, Aircraft System Identification, ch. 10",
        .excited_by = "full turns against a heading that is known",
        .moves = "yaw_rate_radps",
        .needs = "steer_rad, vx_mps, yaw_rate_radps, ay_mps2",
        .confounded_with = "body_attitude, accelerometer_scale",
        .parameters = {{.name = "scale_error",
                        .unit = "1",
                        .typical = 0.015,
                        .matters = 0.004,
                        .bounds = {-0.3, 0.3},
                        .usual = {0.005, 0.02}}},
    };

    template <class T, class S>
    static void sensors(const T* p, const Workings<S>& /*w*/, const S* /*state*/, S* y) {
        y[kYawRate] *= 1.0 + p[0];
    }
};

}  // namespace sysid
