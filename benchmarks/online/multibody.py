"""Drives of the four-wheel multi-body car of `commonroad-vehicle-models`, many at once.

The equations are the package's own (M. Althoff, G. Würsching, "CommonRoad: Vehicle Models", 2020:
29 states, sprung and unsprung masses, wheels, Magic Formula with camber and combined slip). They
are written for one car; here their numbers are arrays with one element per drive.
"""

import importlib
import importlib.util
from types import SimpleNamespace
from typing import Any

import numpy as np

AVAILABLE = importlib.util.find_spec("vehiclemodels") is not None
GRAVITY_MPS2 = 9.81  # the package's
# With 5 ms wheels that brake below 15 m/s shake, and accelerations are read twice as large.
_DT_S = 0.002
_STEER_RATE_RADPS = 0.8
_AIR_KGPM3 = 1.225
_SPEED_GAIN, _LEAST_AX, _MOST_AX = 1.0, -7.0, 4.0
_NAMES = {"atan": "arctan", "fabs": "abs", "sin": "sin", "cos": "cos", "tan": "tan", "sqrt": "sqrt"}


class _Lanes(np.ndarray):
    """One element per drive. The package asks whether a car stands still or a wheel turns back; no
    drive does either, so the answer for all is that for every one."""

    def __bool__(self) -> bool:
        return bool(np.asarray(self).all())


def _lanes(values: Any) -> np.ndarray:
    return np.asarray(values, dtype=float).view(_Lanes)


def _equations() -> Any:
    model = importlib.import_module("vehiclemodels.vehicle_dynamics_mb")
    tyre = importlib.import_module("vehiclemodels.utils.tire_model")
    functions = SimpleNamespace(**{name: getattr(np, ours) for name, ours in _NAMES.items()})
    model.math = tyre.math = functions
    tyre.sign = np.sign
    model.steering_constraints = model.acceleration_constraints = lambda _, wanted, __: wanted
    return model.vehicle_dynamics_mb


def base_car(number: int) -> SimpleNamespace:
    """The numbers of one of the package's cars: 1 Ford Escort, 2 BMW 320i, 3 VW Vanagon."""
    parameters = importlib.import_module("vehiclemodels.vehicle_parameters")
    p = parameters.setup_vehicle_parameters(number)
    flat = {k: v for k, v in vars(p).items() if isinstance(v, int | float)}
    flat["drag_area_m2"] = 0.0  # the package's cars have none
    return SimpleNamespace(**flat, tire=SimpleNamespace(**vars(p.tire)))


def _stacked(cars: list[SimpleNamespace]) -> SimpleNamespace:
    out = {k: _lanes([getattr(c, k) for c in cars]) for k in vars(cars[0]) if k != "tire"}
    names = vars(cars[0].tire)
    tyre = {k: _lanes([float(getattr(c.tire, k)) for c in cars]) for k in names}
    return SimpleNamespace(**out, tire=SimpleNamespace(**tyre), steering=None, longitudinal=None)


def _at_rest(p: SimpleNamespace, speed: np.ndarray) -> np.ndarray:
    x = np.zeros((29, len(speed)))
    x[3] = speed
    load_f = p.m_s * GRAVITY_MPS2 * p.b / (p.a + p.b) + p.m_uf * GRAVITY_MPS2
    load_r = p.m_s * GRAVITY_MPS2 * p.a / (p.a + p.b) + p.m_ur * GRAVITY_MPS2
    x[16], x[21] = load_f / (2.0 * p.K_zt), load_r / (2.0 * p.K_zt)
    x[23:27] = speed / p.R_w
    return x


def drive(
    cars: list[SimpleNamespace],
    speed: np.ndarray,
    curvature: np.ndarray,
    understeer: np.ndarray,
) -> dict[str, np.ndarray]:
    """Follow speed [m/s] and path curvature [1/m], shape (n, drives) at 100 Hz.

    The driver steers by the curvature, the understeer gradient [rad s2/m] and feedback from the yaw
    rate. Returns channels of shape (n, drives) without noise; an accelerometer sits in the sprung
    mass, the wheel force is what the torques give less what spins the wheels up, and a drive that
    was lost ends in NaN.
    """
    rhs, p = _equations(), _stacked(cars)
    wheelbase = np.asarray(p.a + p.b)
    brake, engine = np.asarray(p.T_sb), np.asarray(p.T_se)
    x = _at_rest(p, speed[0])
    sums = np.zeros(len(cars))
    pieces = round(0.01 / _DT_S)
    kept: dict[str, list[np.ndarray]] = {}

    def slope(state: np.ndarray, inputs: list[np.ndarray]) -> np.ndarray:
        rate = np.array(rhs([_lanes(row) for row in state], inputs, p))
        rate[3] -= 0.5 * _AIR_KGPM3 * np.asarray(p.drag_area_m2 / p.m) * state[3] ** 2
        return rate

    with np.errstate(all="ignore"):
        for k in range(len(speed)):
            error = speed[k] * curvature[k] - x[5]
            sums = np.clip(sums + 0.01 * error, -0.5, 0.5)
            wanted = (wheelbase + understeer * speed[k] ** 2) * curvature[k]
            wanted = wanted + (0.6 * error + 0.8 * sums) * wheelbase / x[3]
            rate = np.clip((wanted - x[2]) / 0.04, -_STEER_RATE_RADPS, _STEER_RATE_RADPS)
            push = np.clip(_SPEED_GAIN * (speed[k] - x[3]), _LEAST_AX, _MOST_AX)
            # One share for both, because the package asks for the sign of all at once.
            p.T_sb = p.T_se = _lanes(np.where(push > 0.0, engine, brake))
            inputs = [_lanes(rate), _lanes(push)]
            first = slope(x, inputs)
            felt = _felt(x, first)
            spin_up = np.asarray(p.I_y_w / p.R_w) * first[23:27].sum(axis=0)
            felt["fx_n"] = np.asarray(p.m) * push - spin_up
            for name, value in felt.items():
                kept.setdefault(name, []).append(value)
            for piece in range(pieces):
                k1 = first if piece == 0 else slope(x, inputs)
                k2 = slope(x + 0.5 * _DT_S * k1, inputs)
                k3 = slope(x + 0.5 * _DT_S * k2, inputs)
                k4 = slope(x + _DT_S * k3, inputs)
                x = x + (_DT_S / 6.0) * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
            lost = ~(np.abs(x[10]) < 0.5 * np.abs(x[3])) | ~(x[3] > 3.0)
            x[:, lost] = np.nan
    return {name: np.array(values) for name, values in kept.items()}


def _felt(x: np.ndarray, rate: np.ndarray) -> dict[str, np.ndarray]:
    """Channels; specific forces in the axes of the rolled and pitched body."""
    across, down = rate[10] + x[5] * x[3], rate[12]
    along = rate[3] - x[5] * x[10]
    g = GRAVITY_MPS2
    return {
        "vx_mps": x[3].copy(),
        "vy_mps": x[10].copy(),
        "yaw_rate_radps": x[5].copy(),
        "steer_rad": x[2].copy(),
        "ax_mps2": along * np.cos(x[8]) + g * np.sin(x[8]),
        "ay_mps2": across * np.cos(x[6]) - (g - down) * np.sin(x[6]),
    }
