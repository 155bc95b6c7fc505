// Air: downforce, drag, wind.
#pragma once

#include "sysid/effects/effect.hpp"

namespace sysid {

/// Vertical aerodynamic load on each axle.
struct AeroDownforce : Effect {
    static constexpr EffectInfo info{
        .id = "aero_downforce",
        .title = "aerodynamic downforce on the front and rear axle",
        .equation = "F_z,i += 1/2 rho C_lA,i v_x^2",
        .source = "Milliken & Milliken, Race Car Vehicle Dynamics, ch. 15",
        .excited_by = "the same lateral acceleration at three or more speeds",
        .moves = "ay_mps2, yaw_rate_radps",
        .needs = "steer_rad, vx_mps, yaw_rate_radps",
        .confounded_with =
            "friction_change, tyre_temperature, tyre_load_sensitivity, locked_differential",
        .parameters = {{.name = "cl_a_front_m2",
                        .unit = "m2",
                        .typical = 0.9,
                        .matters = 0.1,
                        .bounds = {-3.0, 6.0},
                        .usual = {0.0, 1.5}},
                       {.name = "cl_a_rear_m2",
                        .unit = "m2",
                        .typical = 1.3,
                        .matters = 0.1,
                        .bounds = {-3.0, 6.0},
                        .usual = {0.0, 2.5}}},
    };

    template <class T, class S>
    static void loads(const T* p, Workings<S>& w) {
        const S dynamic_pressure = named("dynamic_pressure", 0.5 * w.rho * w.v_x * w.v_x);
        w.fz_f += p[0] * dynamic_pressure;
        w.fz_r += p[1] * dynamic_pressure;
    }
};

/// Drag area that the vehicle file does not know of.
struct AeroDrag : Effect {
    static constexpr EffectInfo info{
        .id = "aero_drag",
        .title = "drag area beyond the vehicle file",
        .equation = "F_x -= 1/2 rho Delta(C_dA) v_x^2",
        .source = "Rajamani, Vehicle Dynamics and Control, eq. (4.2)",
        .excited_by = "coasting and full throttle over a wide range of speed",
        .moves = "vx_mps, ax_mps2",
        .needs = "fx_n, vx_mps",
        .confounded_with = "rolling_resistance, road_grade, head_wind, force_gain",
        .parameters = {{.name = "drag_area_m2",
                        .unit = "m2",
                        .typical = 0.45,
                        .matters = 0.05,
                        .bounds = {-2.0, 4.0},
                        .usual = {-0.3, 0.6}}},
        .needs_force = true,
    };

    template <class T, class S>
    static void vehicle(const T* p, Workings<S>& w) {
        w.drag_area = w.drag_area + p[0];
    }
};

/// Wind along the road; positive against the car.
struct HeadWind : Effect {
    static constexpr EffectInfo info{
        .id = "head_wind",
        .title = "steady head wind",
        .equation = "F_x -= 1/2 rho C_dA ((v_x + w)^2 - v_x^2)",
        .source = "Gillespie, Fundamentals of Vehicle Dynamics, ch. 4",
        .excited_by = "the same road out and back, at several speeds",
        .moves = "vx_mps, ax_mps2",
        .needs = "fx_n, vx_mps",
        .confounded_with = "aero_drag, rolling_resistance, road_grade, force_gain",
        .parameters = {{.name = "speed_mps",
                        .unit = "m/s",
                        .typical = 6.0,
                        .matters = 1.0,
                        .bounds = {-40.0, 40.0},
                        .usual = {2.0, 10.0}}},
        .needs_force = true,
    };

    template <class T, class S>
    static void body(const T* p, Workings<S>& w) {
        w.force_x = w.force_x - 0.5 * w.rho * (w.drag_area * (p[0] * (2.0 * w.v_x + p[0])));
    }
};

/// A steady lateral force and yaw moment from outside.
struct SideWind : Effect {
    static constexpr EffectInfo info{
        .id = "side_wind",
        .title = "steady side wind: lateral force and yaw moment",
        .equation = "F_y += F_w, M_z += M_w",
        .source = "Gillespie, Fundamentals of Vehicle Dynamics, ch. 4",
        .excited_by = "the same road out and back, at several speeds",
        .moves = "ay_mps2, yaw_rate_radps",
        .needs = "steer_rad, vx_mps, yaw_rate_radps, ay_mps2",
        .confounded_with =
            "steer_offset, rear_toe, speed_sensor_misalignment, road_bank, accelerometer_bias",
        .parameters = {{.name = "side_force_n",
                        .unit = "N",
                        .typical = 450.0,
                        .matters = 60.0,
                        .bounds = {-1.0e4, 1.0e4},
                        .usual = {150.0, 900.0},
                        .mirrored = true},
                       {.name = "yaw_moment_nm",
                        .unit = "N m",
                        .typical = 250.0,
                        .matters = 50.0,
                        .bounds = {-1.0e4, 1.0e4},
                        .usual = {50.0, 500.0},
                        .mirrored = true}},
    };

    template <class T, class S>
    static void body(const T* p, Workings<S>& w) {
        w.force_y += p[0];
        w.moment_z += p[1];
    }
};

}  // namespace sysid
