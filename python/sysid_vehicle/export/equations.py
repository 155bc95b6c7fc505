"""The equations of a model as text that Python and C++ both understand.

They repeat `cpp/include/sysid/dynamics/single_track.hpp` and the effects in
`cpp/include/sysid/effects/` for a car that is driven, free of what only its sensors do: assignments
in the order of the stages there. Tests hold them against the compiled model.
"""

from __future__ import annotations

from dataclasses import dataclass

from ..effects import Effect
from ..errors import InvalidInput
from ..model import Model
from ..vehicle import AXLES, GRAVITY_MPS2

_SHORTEST_LAG = 1e-6  # s, as in `lags.hpp`
_RELAXATION = f"relaxation_rate = fmin(fabs(v_x) / p0, {1.0 / _SHORTEST_LAG!r})"

Stages = dict[str, list[str]]

# What effects change at each stage; `p0`, `p1` are their parameters.
_ACTS: dict[str, Stages] = {
    "accelerometer_bias": {},
    "accelerometer_scale": {},
    "aero_downforce": {
        "loads": [
            "fz_f = fz_f + p0 * (0.5 * air_density * v_x * v_x)",
            "fz_r = fz_r + p1 * (0.5 * air_density * v_x * v_x)",
        ]
    },
    "aero_drag": {"vehicle": ["drag = drag + p0"]},
    "aligning_moment": {
        "forces": [
            "turned_f = B_front * alpha_f",
            "turned_r = B_rear * alpha_r",
            "aligning_f = fy_f / (1.0 + turned_f * turned_f)",
            "aligning_r = fy_r / (1.0 + turned_r * turned_r)",
            "moment_z = moment_z - p0 * (aligning_f + aligning_r)",
        ]
    },
    "body_attitude": {},
    "cg_position": {"vehicle": ["l_f = l_f + p0", "l_r = l_r - p0"]},
    "combined_slip": {
        "grip": [
            "used_f = fx_f / (D_front * fz_f)",
            "used_r = fx_r / (D_rear * fz_r)",
            "rest_f = 1.0 - p0 * used_f * used_f",
            "rest_r = 1.0 - p0 * used_r * used_r",
            "grip_f = grip_f * where(rest_f < 0.04, 0.2, sqrt(fmax(rest_f, 0.04)))",
            "grip_r = grip_r * where(rest_r < 0.04, 0.2, sqrt(fmax(rest_r, 0.04)))",
        ]
    },
    "drive_yaw_moment": {"body": ["moment_z = moment_z + fx * (p0 + p1 * (v_x * r / gravity))"]},
    "force_gain": {"input": ["fx = fx * (1.0 + where(fx < 0.0, p1, p0))"]},
    "force_lag": {"drive": ["force_lag_rate = (fx - force_lag) / p0", "fx = force_lag"]},
    "force_split": {
        "vehicle": ["brake_front = brake_front + p0", "drive_front = drive_front + p1"]
    },
    "front_tyre_relaxation": {
        "slip": [
            _RELAXATION,
            "own_slip_front_rate = relaxation_rate * (alpha_f - own_slip_front)",
            "alpha_f = own_slip_front",
        ]
    },
    "gyro_bias": {},
    "gyro_scale": {},
    "head_wind": {
        "body": ["force_x = force_x - 0.5 * air_density * drag * (p0 * (2.0 * v_x + p0))"]
    },
    "imu_lever_arm": {},
    "ins_lever_arm": {},
    "lateral_load_transfer": {
        "grip": [
            "grip_f = grip_f * (1.0 - p0 * (v_x * r / gravity) * (v_x * r / gravity))",
            "grip_r = grip_r * (1.0 - p1 * (v_x * r / gravity) * (v_x * r / gravity))",
        ]
    },
    "limited_slip_differential": {
        "body": ["moment_z = moment_z - p0 * (r / sqrt(r * r + 0.02 * 0.02))"]
    },
    "locked_differential": {"body": ["moment_z = moment_z - p0 * (r / fmax(v_x, 1.0))"]},
    "longitudinal_load_transfer": {"vehicle": ["height = height + p0"]},
    "mass": {"vehicle": ["m = m * (1.0 + p0)"]},
    "rear_toe": {"slip": ["alpha_r = alpha_r + p0"]},
    "rear_tyre_relaxation": {
        "slip": [
            _RELAXATION,
            "own_slip_rear_rate = relaxation_rate * (alpha_r - own_slip_rear)",
            "alpha_r = own_slip_rear",
        ]
    },
    "road_bank": {
        "body": ["gravity_y = gravity_y + gravity * sin(p0)"],
        "loads": [
            "banked = cos(p0) + v_x * r / gravity * sin(p0)",
            "fz_f = fz_f * banked",
            "fz_r = fz_r * banked",
        ],
    },
    "road_grade": {"body": ["gravity_x = gravity_x - gravity * sin(p0)"]},
    "rolling_resistance": {"body": ["force_x = force_x - (p0 + p1 * v_x) * (m * gravity)"]},
    "sensor_delay": {},
    "side_wind": {"body": ["force_y = force_y + p0", "moment_z = moment_z + p1"]},
    "speed_sensor_lever_arm": {},
    "speed_sensor_misalignment": {},
    "steer_compliance": {"steering": ["delta = delta - p0 * (m * l_r / (l_f + l_r) * v_x * r)"]},
    "steer_lag": {"steering": ["steer_lag_rate = (delta - steer_lag) / p0", "delta = steer_lag"]},
    "steer_nonlinearity": {"steering": ["delta = delta * (1.0 + p0 * (delta * delta))"]},
    "steer_offset": {"steering": ["delta = delta + p0"]},
    "steer_ratio": {"steering": ["delta = delta * (1.0 + p0)"]},
    "tyre_load_sensitivity": {
        "grip": [
            "grip_f = grip_f * (1.0 - p0 * (fz_f / fz0_f - 1.0))",
            "grip_r = grip_r * (1.0 - p0 * (fz_r / fz0_r - 1.0))",
        ]
    },
    "tyre_relaxation": {
        "slip": [
            _RELAXATION,
            "slip_front_rate = relaxation_rate * (alpha_f - slip_front)",
            "slip_rear_rate = relaxation_rate * (alpha_r - slip_rear)",
            "alpha_f = slip_front",
            "alpha_r = slip_rear",
        ]
    },
    "wheel_inertia": {
        "forces": [
            "pulled = fx_f * cos(delta) - fy_f * sin(delta) + fx_r + force_x",
            "turning = p0 * m",
            "along_both = 0.5 * (cos(delta) + 1.0)",
            "faster = (pulled + m * (v_y * r + gravity_x)) / (m + turning * along_both)",
            "fx_f = fx_f - 0.5 * turning * faster",
            "fx_r = fx_r - 0.5 * turning * faster",
        ]
    },
    "yaw_inertia": {"vehicle": ["I_z = I_z * (1.0 + p0)"]},
}
_STATES = {  # with their units
    "force_lag": (("force_lag", "N"),),
    "front_tyre_relaxation": (("own_slip_front", "rad"),),
    "rear_tyre_relaxation": (("own_slip_rear", "rad"),),
    "steer_lag": (("steer_lag", "rad"),),
    "tyre_relaxation": (("slip_front", "rad"), ("slip_rear", "rad")),
}


@dataclass(frozen=True)
class Equations:
    """A model as text.

    Attributes
    ----------
    constants : tuple of (name, value, comment)
    states : tuple of (name, comment)
        The motion, then lags.
    lines : tuple of str
        Assignments ``name = expression``, in order; names may be assigned again.
    left_out : tuple of str
        Effects of sensors, which are no part of a car that is driven.
    """

    constants: tuple[tuple[str, float, str], ...]
    states: tuple[tuple[str, str], ...]
    lines: tuple[str, ...]
    left_out: tuple[str, ...]


def equations(model: Model) -> Equations:
    """Write the equations of a model with the wheel force as its input.

    Raises
    ------
    InvalidInput
        If the model has an effect that cannot be exported: one of a user, one with a delay or a
        temperature, or one that changes with time.
    """
    foreign = [e.id for e in model.parts if e.id not in _ACTS or e.acts]
    if foreign:
        raise InvalidInput(
            f"{', '.join(foreign)}: cannot be exported; drop it first: model.drop('{foreign[0]}')"
        )
    parts = sorted(
        (e for e in model.parts if not (_lags(e) and model.value(_full(e, 0)) <= 0.0)),
        key=lambda e: e.index,
    )
    constants = [*_of_car(model), *_of_effects(model, parts)]
    lines = list(_BEGIN)
    for stage, own in _STAGES:
        # Backwards at the input: what was done last to the force is undone first.
        acting = parts[::-1] if stage == "input" else parts
        for e in acting:
            lines += [_named(e, line) for line in _ACTS[e.id].get(stage, [])]
        lines += own
    states = [("v_x", "m/s"), ("v_y", "m/s"), ("r", "rad/s")]
    states += [state for e in parts for state in _STATES.get(e.id, ())]
    silent = tuple(e.id for e in parts if not _ACTS[e.id])
    return Equations(tuple(constants), tuple(states), tuple(lines), silent)


def _lags(e: Effect) -> bool:
    return e.id in _STATES


def _full(e: Effect, k: int) -> str:
    return f"{e.id}.{e.parameters[k].name}"


def _of_car(model: Model) -> list[tuple[str, float, str]]:
    car = model.vehicle
    given = [
        ("gravity", GRAVITY_MPS2, "m/s2"),
        ("mass", car.mass_kg, "kg"),
        ("yaw_inertia", model.value("yaw_inertia_kgm2"), "kg m2"),
        ("front_arm", car.lf_m, "m, centre of gravity to front axle"),
        ("rear_arm", car.lr_m, "m, centre of gravity to rear axle"),
        ("cg_height", car.cg_height_m, "m"),
        ("drag_area", car.drag_area_m2, "m2, drag coefficient times frontal area"),
        ("air_density", car.air_density_kgpm3, "kg/m3"),
        ("brake_share", car.brake_front_share, "of the front axle in brake force"),
        ("drive_share", car.drive_front_share, "of the front axle in drive force"),
    ]
    units = {"B": "1/rad", "C": "1", "D": "1", "E": "1"}
    for axle in AXLES:
        for letter in "BCDE":
            name = f"{letter}_{axle}"
            given.append((name, model.value(name), f"{units[letter]}, Magic Formula"))
    return given


def _of_effects(model: Model, parts: list[Effect]) -> list[tuple[str, float, str]]:
    return [
        (f"{e.id}_{p.name}", model.value(f"{e.id}.{p.name}"), f"{p.unit}, {e.title}")
        for e in parts
        if _ACTS[e.id]
        for p in e.parameters
    ]


def _named(e: Effect, line: str) -> str:
    for k in reversed(range(len(e.parameters))):
        line = line.replace(f"p{k}", f"{e.id}_{e.parameters[k].name}")
    return line


_BEGIN = (
    "m = mass",
    "I_z = yaw_inertia",
    "l_f = front_arm",
    "l_r = rear_arm",
    "height = cg_height",
    "drag = drag_area",
    "brake_front = brake_share",
    "drive_front = drive_share",
    "delta = steer",
    "fx = force",
    "grip_f = 1.0",
    "grip_r = 1.0",
)
_TYRE = (
    "x_{a} = B_{axle} * alpha_{a}",
    "mu_{a} = D_{axle} * sin(C_{axle} * atan(x_{a} - E_{axle} * (x_{a} - atan(x_{a}))))",
)
# What follows on each stage.
_STAGES: tuple[tuple[str, tuple[str, ...]], ...] = (
    ("vehicle", ()),
    ("input", ()),
    ("drive", ()),
    (
        "steering",
        (
            "force_x = -0.5 * air_density * drag * v_x * fabs(v_x)",
            "force_y = 0.0",
            "moment_z = 0.0",
            "gravity_x = 0.0",
            "gravity_y = 0.0",
        ),
    ),
    (
        "body",
        (
            "alpha_f = delta - atan2(v_y + l_f * r, v_x)",
            "alpha_r = -atan2(v_y - l_r * r, v_x)",
        ),
    ),
    (
        "slip",
        (
            *(line.format(a="f", axle="front") for line in _TYRE),
            *(line.format(a="r", axle="rear") for line in _TYRE),
            "fz0_f = m * gravity * l_r / (l_f + l_r)",
            "fz0_r = m * gravity * l_f / (l_f + l_r)",
            "lever = height / (l_f + l_r)",
            "share = where(fx < 0.0, brake_front, drive_front)",
            "fx_f = share * fx",
            "fx_r = (1.0 - share) * fx",
            "along = fx_f * cos(delta) + fx_r + force_x",
            "back = mu_f * sin(delta)",
            "pull = along - back * (fz0_f - lever * along) / (1.0 - lever * back)",
            "fz_f = fz0_f - lever * pull",
            "fz_r = fz0_r + lever * pull",
        ),
    ),
    ("loads", ()),
    ("grip", ("fy_f = fz_f * mu_f * grip_f", "fy_r = fz_r * mu_r * grip_r")),
    (
        "forces",
        (
            "lateral_f = fy_f * cos(delta) + fx_f * sin(delta)",
            "a_x = (fx_f * cos(delta) - fy_f * sin(delta) + fx_r + force_x) / m",
            "a_y = (lateral_f + fy_r + force_y) / m",
            "v_x_rate = a_x + v_y * r + gravity_x",
            "v_y_rate = a_y - v_x * r + gravity_y",
            "r_rate = (l_f * lateral_f - l_r * fy_r + moment_z) / I_z",
        ),
    ),
)
