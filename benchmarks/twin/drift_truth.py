"""Does the diagnosis name what is physically in the single-track drift model of another package?

python benchmarks/twin/drift_truth.py [HIDDEN ...] [--driving SET ...] [--seeds 1] [--first 0]
    [--keep FILE]

The car is one of `commonroad-vehicle-models` (nine states; M. Althoff, G. Wuersching, "CommonRoad:
Vehicle Models", 2020), another one by seed, driven in closed loop; claims are counted as in
`diagnosis_truth.py`. The wheel force that is logged is that of engine and brakes, which spins the
wheels up too. Its tyres have neither load sensitivity nor camber here, and no side force waits.
"""

import importlib
from types import SimpleNamespace

import numpy as np
from diagnosis_truth import Truth, run
from multibody_truth import CARS, Other, logged, multibody, workshop

import sysid_vehicle as sv
from sysid_vehicle import manoeuvres
from sysid_vehicle.manoeuvres import Manoeuvre

ALWAYS = {
    "wheel_inertia": "two wheels of 1.7 kg m2: 2 to 3 % of the mass along the car",
    "combined_slip": "Magic Formula with combined slip, r_bx1 to r_vy6",
    "drive_yaw_moment": "a driven or braked tyre pushes sideways, r_vy1 r_vy5 r_vy6",
    "longitudinal_load_transfer": "by the acceleration that is asked for, not the one that comes",
}
CASES = {
    "nothing": Other(set()),
    "mass": Other({"mass"}, factors={"m": 1.12}),
    "yaw inertia": Other({"yaw_inertia"}, factors={"I_z": 1.25}),
    "steering ratio": Other({"steer_ratio"}, ratio=1.08),
    "steering lag": Other({"steer_lag"}, lag_s=0.06),
}
_LAP, _COURSE = manoeuvres.lap(60.0, 6.0), manoeuvres.handling_course(50.0, 6.0)
SETS = {"lap, course": ((_LAP,), (_COURSE,))}
_DT_S, _PIECES = 0.001, 10
_STEER_RATE_RADPS, _UNDERSTEER = 0.4, 0.0025
_MOST_SLIP_RAD = 0.1


def drive(p: SimpleNamespace, manoeuvre: Manoeuvre, share: float) -> dict[str, np.ndarray]:
    """Channels of a drive at a share of its lateral acceleration, without noise, at 100 Hz.

    Raises
    ------
    RuntimeError
        The car was lost: what it does in a spin is no test of names.
    """
    rhs = importlib.import_module("vehiclemodels.vehicle_dynamics_std").vehicle_dynamics_std
    time_s = np.arange(round(manoeuvre.duration_s / _DT_S)) * _DT_S
    speed, lateral = manoeuvre.speed_mps(time_s), share * manoeuvre.lateral_mps2(time_s)
    push = np.gradient(speed, _DT_S)
    v = float(speed[0])
    x = np.array([0.0, 0.0, 0.0, v, 0.0, 0.0, 0.0, v / p.R_w, v / p.R_w])
    kept: dict[str, list[float]] = {}

    def slope(state: np.ndarray, inputs: tuple[float, float]) -> np.ndarray:
        return np.array(rhs(state.tolist(), list(inputs), p))

    for k in range(len(time_s)):
        curvature = lateral[k] / speed[k] ** 2
        wanted = (p.a + p.b) * curvature + _UNDERSTEER * lateral[k]
        wanted += 0.25 * (curvature * x[3] - x[5])
        rate = float(np.clip((wanted - x[2]) / 0.05, -_STEER_RATE_RADPS, _STEER_RATE_RADPS))
        inputs = rate, float(push[k] + 1.5 * (speed[k] - x[3]))
        k1 = slope(x, inputs)
        if k % _PIECES == 0:
            for name, value in _felt(x, k1).items():
                kept.setdefault(name, []).append(value)
            kept.setdefault("fx_n", []).append(p.m * inputs[1])
        k2 = slope(x + 0.5 * _DT_S * k1, inputs)
        k3 = slope(x + 0.5 * _DT_S * k2, inputs)
        x = x + _DT_S / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + slope(x + _DT_S * k3, inputs))
        if not abs(x[6]) < _MOST_SLIP_RAD:
            raise RuntimeError(f"the car was lost: {manoeuvre.name}, {time_s[k]:.1f} s")
    return {name: np.array(values) for name, values in kept.items()}


def _felt(x: np.ndarray, rate: np.ndarray) -> dict[str, float]:
    v, slip, r = x[3], x[6], x[5]
    along, across = v * np.cos(slip), v * np.sin(slip)
    return {
        "vx_mps": along,
        "vy_mps": across,
        "yaw_rate_radps": r,
        "ax_mps2": rate[3] * np.cos(slip) - across * rate[6] - across * r,
        "ay_mps2": rate[3] * np.sin(slip) + along * rate[6] + along * r,
        "steer_rad": x[2],
    }


def improved(name: str, which: str, seed: int) -> sv.Study:
    """Improve the single track on the drives of a set that are fitted; the others judge."""
    case, number = CASES[name], list(CARS)[seed % len(CARS)]
    fitted, judging = SETS[which]
    p = multibody.base_car(number)
    package = importlib.import_module("vehiclemodels.vehicle_parameters")
    whole = package.setup_vehicle_parameters(number)
    p.steering, p.longitudinal = whole.steering, whole.longitudinal
    for value, factor in case.factors.items():
        setattr(p, value, factor * getattr(p, value))
    logs = [
        logged(case, drive(p, m, CARS[number]), m.name, np.random.default_rng([seed, i]))
        for i, m in enumerate((*fitted, *judging))
    ]
    train, test = logs[: len(fitted)], logs[len(fitted) :]
    return sv.improve(sv.Model(workshop(number)), train, test, seed=seed)


if __name__ == "__main__":
    run(Truth(ALWAYS, CASES, tuple(SETS), improved), __doc__)
