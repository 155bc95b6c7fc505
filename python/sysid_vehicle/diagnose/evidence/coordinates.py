"""What the car was doing at each sample: the axes of maps and the variables of formulas."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ..._common.arrays import FloatArray, as_float64
from ...estimate import Driving
from ...identify import Fit
from ...vehicle import slip_angles
from .evidence import FORCES


@dataclass(frozen=True)
class Coordinate:
    """A quantity over which something is drawn.

    Attributes
    ----------
    scale : float
        Factor from SI to the unit of the axis.
    """

    name: str
    label: str
    unit: str
    scale: float = 1.0

    @property
    def axis(self) -> str:
        """Label of an axis."""
        return f"{self.label} [{self.unit}]"


COORDINATES = {
    c.name: c
    for c in (
        Coordinate("vx_mps", "speed", "m/s"),
        Coordinate("ay_mps2", "lateral acceleration", "m/s2"),
        Coordinate("ax_mps2", "longitudinal acceleration", "m/s2"),
        Coordinate("slip_front_rad", "front slip angle", "deg", float(np.degrees(1.0))),
        Coordinate("slip_rear_rad", "rear slip angle", "deg", float(np.degrees(1.0))),
        Coordinate("steer_rad", "steering angle", "deg", float(np.degrees(1.0))),
        Coordinate("yaw_rate_radps", "yaw rate", "rad/s"),
        Coordinate("time_s", "time driven", "s"),
    )
}


def coordinates(fit: Fit, driving: Driving, state: FloatArray) -> dict[str, FloatArray]:
    """Coordinates of every sample, from a filter's or a smoother's states.

    Lateral acceleration is v_x r, longitudinal that of the wheel forces (measured where the force
    is not known). Time runs on through all stretches.
    """
    car = fit.model.vehicle
    v, side, r = state[:, 0], state[:, 1], state[:, 2]
    steer = driving.channel("steer_rad")
    pull = (
        driving.channel("fx_n") / car.mass_kg if driving.force_known else driving.channel("ax_mps2")
    )
    front, rear = slip_angles(car.lf_m, car.lr_m, steer, v, side, r)
    return {
        "vx_mps": v,
        "ay_mps2": v * r,
        "ax_mps2": pull,
        "slip_front_rad": front,
        "slip_rear_rad": rear,
        "steer_rad": steer,
        "yaw_rate_radps": r,
        "time_s": running_time(driving),
    }


_MOVED = 3.0  # times what the smoother could miss: less is the noise that the forces follow too


def that_moved(fit: Fit, driving: Driving, state: FloatArray, std: FloatArray) -> frozenset[str]:
    """Names of the coordinates that moved beyond what a smoother could miss of them.

    Forces are smoothed from the same readings: within that both follow one noise. A constant wheel
    force is compared with the missing one, a measured acceleration with the noise of its sensor.

    Parameters
    ----------
    fit : Fit
    driving : Driving
    state, std : array, shape (samples, n)
        Smoothed states, and their standard deviations.
    """
    car = fit.model.vehicle
    v, r = state[:, 0], state[:, 2]
    v_std, side_std, r_std = std[:, 0], std[:, 1], std[:, 2]
    along = FORCES["F_x"] + 3
    missed = {
        "vx_mps": v_std,
        "ay_mps2": np.hypot(v * r_std, r * v_std),
        "ax_mps2": std[:, along] / car.mass_kg if driving.force_known else fit.noise.reading[3],
        "slip_front_rad": np.hypot(side_std, car.lf_m * r_std) / v,
        "slip_rear_rad": np.hypot(side_std, car.lr_m * r_std) / v,
        "yaw_rate_radps": r_std,
        "time_s": 0.0,
    }
    at = coordinates(fit, driving, state)
    return frozenset(
        name for name, e in missed.items() if np.std(at[name]) > _MOVED * np.sqrt(np.mean(e**2))
    )


def running_time(driving: Driving) -> FloatArray:
    """Seconds driven until each sample, without what lies between stretches."""
    return as_float64(np.cumsum(1.0 / driving.sample_rate_hz))


BLOCK_S = 5.0
"""Blocks of driving that are taken as independent, and left out in turns."""


def blocks(driving: Driving, seconds: float) -> npt.NDArray[np.intp]:
    """First samples of blocks of so many seconds driven, whatever the rates of the logs."""
    middle = running_time(driving) - 0.5 / driving.sample_rate_hz
    block = np.floor(middle / seconds)
    return np.concatenate([[0], np.flatnonzero(np.diff(block)) + 1])


def begins(driving: Driving) -> npt.NDArray[np.intp]:
    """First samples of the stretches."""
    return np.array([span.first for span in driving.spans])


def late(
    signal: FloatArray, begins: npt.NDArray[np.intp], first: float | FloatArray = 0.0
) -> FloatArray:
    """The signal one sample later: noise of a measurement must not enter its own prediction.

    The first sample of a stretch, of which nothing was known, gets `first`.
    """
    out = np.concatenate([signal[:1], signal[:-1]])
    out[begins] = first
    return as_float64(out)
