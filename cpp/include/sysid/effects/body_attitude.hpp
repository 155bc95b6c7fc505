#pragma once

#include "sysid/effects/effect.hpp"
#include "sysid/model/kinematics.hpp"

namespace sysid {

/// The body leans out of corners and squats, and the accelerometer leans with it: it feels a part
/// of gravity, and of the acceleration only what lies along its own axis. Both signs follow from a
/// body that gives way.
struct BodyAttitude : Effect {
    static constexpr EffectInfo info{
        "body_attitude",
        "accelerometer tilted by roll and pitch of the body",
        "a_x' = a_x cos(theta) + g sin(theta), theta = K_pitch a_x/g; a_y the same with K_roll",
        "Ryu & Gerdes, ACC 2004; Gillespie, Fundamentals of Vehicle Dynamics, ch. 6",
        "a ramp to the limit, hard braking",
        "ay_mps2, ax_mps2",
        "ax_mps2, ay_mps2",
        "accelerometer_scale, gyro_scale",
        2,
        {
            {"pitch_per_g_rad", "rad", 0.0, 0.04, 0.01, 0.0, 0.4, 0.02, 0.06},
            {"roll_per_g_rad", "rad", 0.0, 0.06, 0.01, 0.0, 0.4, 0.03, 0.09},
        },
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

}  // namespace sysid
