"""The paper's experiments on mass and inertia: another load in the car than in its twin.

Dettu et al. (2023), sec. 4. Where the paper is silent: the drives of `drives.py`; noise as a ratio
of amplitudes; a wrong mass or centre of mass is that of the unloaded car, a mass from stage 1 is
what the mass experiment finds with the same law and the same noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from .._common.printed import Told
from ..errors import InvalidInput
from ..twin.car import LOAD_NAMES, LOADED_SUV, NOMINAL_SUV, Load, TwinCar
from ..twin.drives import INPUTS, Drive14, rough_road, swept_steer, urban_cycle
from ..twin.laws import ParameterLaw, SideBySide, Unknown, inertia_law, mass_law, unknowns
from ..twin.observer import Observation, Observer, observe
from ..twin.readings import Readings, measure, noisy_road

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Law = Literal["side_by_side", "published", "gradient"]
Mass = Literal["known", "stage_1", "wrong"]

_TORQUES = [i for i, name in enumerate(INPUTS) if name.startswith(("drive_", "brake_"))]
# A sensor is never believed to be better than this.
_NOISE_FLOOR = {
    "ax_mps2": 2e-3,
    "ay_mps2": 2e-3,
    "az_mps2": 2e-3,
    "roll_rate_radps": 2e-4,
    "pitch_rate_radps": 2e-4,
    "yaw_rate_radps": 2e-4,
}


@dataclass(frozen=True, eq=False, repr=False)
class LoadExperiment(Told):
    """A load that was looked for, and what was found.

    Attributes
    ----------
    name : str
        What was done.
    drive : Drive14
        What was driven, with the true load.
    readings : Readings
        What was measured.
    found : Observation
        Estimates over time.
    names : tuple of str
        What was looked for; other parameters may have been estimated beside.
    true, nominal : Load
        The load in the car, and without what was added.
    """

    name: str
    drive: Drive14
    readings: Readings
    found: Observation
    names: tuple[str, ...]
    true: Load
    nominal: Load

    def error_percent(self, name: str) -> float:
        """Root mean square error over the last second, in % of the true change."""
        true = getattr(self.true, name)
        return self.found.error_percent(name, true, true - getattr(self.nominal, name))

    def to_dict(self) -> dict[str, Any]:
        """All figures, for a file."""
        return {
            "experiment": self.name,
            "parameters": {
                n: {
                    "true": getattr(self.true, n, None),
                    "nominal": getattr(self.nominal, n, None),
                    "first": float(self.found.parameters[n][0]),
                    "found": self.found.last(n),
                    "spread": self.found.spread.get(n),
                    "error_percent_of_change": self.error_percent(n) if n in self.names else None,
                }
                for n in dict.fromkeys((*self.names, *self.found.moved()))
            },
            "contradictions": list(self.found.contradictions),
        }

    def plot(self, name: str, *, ax: Axes | None = None) -> Axes:
        """Draw an estimate over time."""
        return self.found.plot(name, truth=getattr(self.true, name), ax=ax)

    def __str__(self) -> str:
        lines = [f"{self.name}: {self.drive}"]
        for n in dict.fromkeys((*self.names, *self.found.moved())):
            error = f"{self.error_percent(n):8.2f} % of the change" if n in self.names else ""
            true = f", true {getattr(self.true, n):10.5g}" if hasattr(self.true, n) else ""
            wide = f" +- {self.found.spread[n]:<8.3g}" if n in self.found.spread else ""
            lines.append(
                f"  {n:11s} {self.found.parameters[n][0]:10.5g} -> {self.found.last(n):10.5g}"
                f"{wide}{true} {error}"
            )
        return "\n".join(lines)


@lru_cache(maxsize=4)
def _town(duration_s: float) -> Drive14:
    return urban_cycle(TwinCar(), LOADED_SUV, duration_s=duration_s)


@lru_cache(maxsize=4)
def _sweep(repeats: int) -> Drive14:
    return swept_steer(TwinCar(), LOADED_SUV, repeats=repeats)


@lru_cache(maxsize=4)
def _road(seed: int, duration_s: float) -> Drive14:
    return rough_road(TwinCar(), LOADED_SUV, seed=seed, duration_s=duration_s)


def drive_of(name: str, seed: int, part: float = 1.0) -> Drive14:
    """The town, the sweep or the road with the loaded car, for a part of the customary time."""
    if name == "town":
        return _town(180.0 * part)
    if name == "sweep":
        return _sweep(max(1, round(4 * part)))
    return _road(seed, 120.0 * part)


_GAINS = {
    "jxx_kgm2": (60.0, 15.0, 8.0),
    "jzz_kgm2": (900.0, 200.0, 80.0),
    "jyy_kgm2": (300.0, 60.0, 40.0),
}


def _first(names: Sequence[str], errors: Sequence[float] | None) -> dict[str, float]:
    """Values to begin with: off by `errors` in parts of the true change, -1 for the nominal."""
    off = [-1.0] * len(names) if errors is None else list(errors)
    if len(off) != len(names):
        raise InvalidInput(f"first_error has {len(off)} numbers; give {len(names)}: {names}")
    out = {}
    for name, e in zip(names, off, strict=True):
        true = getattr(LOADED_SUV, name)
        out[name] = true + e * (true - getattr(NOMINAL_SUV, name))
    return out


def experiment(
    name: str,
    drive: Drive14,
    first: Load,
    names: tuple[str, ...],
    looked_for: Sequence[Unknown],
    channels: Sequence[str],
    *,
    law: Law,
    snr: float,
    seed: int | np.random.Generator,
    road_noise: float = 0.0,
    torque_error: float = 0.0,
    torque_std: float = 0.0,
) -> LoadExperiment:
    """Measure a drive and look for `names`, twins side by side for all of `looked_for`.

    By default the torques are exact, as the paper's twin has them.
    """
    rng = np.random.default_rng(seed)
    readings = measure(drive, channels, snr=snr, seed=rng)
    told = noisy_road(drive.inputs, road_noise, seed=rng) if road_noise > 0.0 else drive.inputs
    if torque_error != 0.0:
        told = told.copy()
        told[:, _TORQUES] *= 1.0 + torque_error
    if law == "side_by_side":
        noise = {c: max(readings.noise[c], _NOISE_FLOOR[c]) for c in channels}
        # The twin starts exactly where the car does.
        batch = SideBySide(looked_for, noise, input_std=torque_std, start_std=0.0)
        observer = Observer(batch=batch)
    else:
        observer = Observer(laws=[_law(law, snr, n) for n in names])
    speed = float(drive["vx_mps"][0])
    found = observe(TwinCar(), first, told, readings, observer, speed_mps=speed)
    return LoadExperiment(name, drive, readings, found, names, LOADED_SUV, NOMINAL_SUV)


def estimate_mass(
    *,
    snr: float = 10.0,
    wrong_cg: bool = False,
    law: Law = "side_by_side",
    seed: int = 0,
    first_error: Sequence[float] | None = None,
    duration_s: float = 180.0,
    torque_error: float = 0.0,
    torque_std: float = 0.0,
) -> LoadExperiment:
    """Estimate the mass in town: table 4, figures 4 and 5.

    Parameters
    ----------
    snr : float
        Amplitude ratio of signal to noise, infinite for none.
    wrong_cg : bool
        The twin keeps the centre of mass of the unloaded car.
    law : {"side_by_side", "published", "gradient"}
        Which law. Twins side by side look for the centre of mass too: how far the car pitches
        changes what its accelerometer feels of gravity.
    seed : int
        Of the noise.
    first_error : sequence of float, optional
        First error of the mass in parts of the change; -1, the unloaded car's, by default.
    duration_s : float
        Length of the drive.
    torque_error : float
        The twin is told torques that are larger by this part.
    torque_std : float
        Standard deviation of such an error, which twins side by side then consider.

    Raises
    ------
    InvalidInput
        If the error or the standard deviation of the torques is no part of one.
    """
    if not (abs(torque_error) < 1.0 and 0.0 <= torque_std < 1.0):
        raise InvalidInput(
            f"torque_error = {torque_error!r}, torque_std = {torque_std!r}; give parts of one"
        )
    drive = _town(duration_s)
    first = LOADED_SUV.replace(**_first(["mass_kg"], first_error), **_centre(wrong_cg))
    return experiment(
        "mass",
        drive,
        first,
        ("mass_kg",),
        unknowns("mass_kg", "cg_x_m", "cg_z_m"),
        ["ax_mps2", "pitch_rate_radps"] if law == "side_by_side" else ["ax_mps2"],
        law=law,
        snr=snr,
        seed=seed,
        torque_error=torque_error,
        torque_std=torque_std,
    )


def estimate_roll_yaw(
    *,
    snr: float = 10.0,
    mass: Mass = "known",
    wrong_cg: bool = False,
    law: Law = "side_by_side",
    seed: int = 0,
    first_error: Sequence[float] | None = None,
    repeats: int = 4,
) -> LoadExperiment:
    """Estimate roll and yaw inertia in a swept steer: table 5, figures 6 to 8.

    Parameters
    ----------
    snr, wrong_cg, law, seed : float, bool, str, int
        As in `estimate_mass`. What is not known is looked for too by twins side by side.
    mass : {"known", "stage_1", "wrong"}
        What the twin has: the true mass, what `estimate_mass` finds, the unloaded car's.
    first_error : sequence of two floats, optional
        First errors of roll and yaw inertia in parts of the change.
    repeats : int
        Number of sweeps.
    """
    names = ("jxx_kgm2", "jzz_kgm2")
    drive = _sweep(repeats)
    first = LOADED_SUV.replace(
        **_first(names, first_error), **_centre(wrong_cg), mass_kg=_mass(mass, snr, law, seed)
    )
    channels = ["roll_rate_radps", "yaw_rate_radps"]
    looked_for = [*names, *_unsure(mass, wrong_cg)]
    if wrong_cg:
        looked_for += ["jxy_kgm2", "jxz_kgm2", "jyz_kgm2"]
    if law == "side_by_side" and len(looked_for) > 2:
        channels.append("ay_mps2")
    what, unknown = "roll and yaw inertia", unknowns(*looked_for)
    return experiment(what, drive, first, names, unknown, channels, law=law, snr=snr, seed=seed)


def estimate_pitch(
    *,
    snr: float = 10.0,
    road_noise: float = 0.0,
    mass: Mass = "known",
    wrong_cg: bool = False,
    law: Law = "side_by_side",
    seed: int = 0,
    first_error: Sequence[float] | None = None,
    duration_s: float = 120.0,
) -> LoadExperiment:
    """Estimate the pitch inertia on a rough road: table 6, figures 9 to 11.

    Parameters
    ----------
    snr, wrong_cg, law : float, bool, str
        As in `estimate_mass`.
    road_noise : float
        Relative noise of the road that the twin is told, eq. (17).
    mass : {"known", "stage_1", "wrong"}
        As in `estimate_roll_yaw`.
    seed : int
        Of the noise and of the road.
    first_error : sequence of one float, optional
        First error of the pitch inertia in parts of the change.
    duration_s : float
        Length of the drive.
    """
    names = ("jyy_kgm2",)
    drive = _road(seed, duration_s)
    first = LOADED_SUV.replace(
        **_first(names, first_error), **_centre(wrong_cg), mass_kg=_mass(mass, snr, law, seed)
    )
    channels = ["pitch_rate_radps"]
    looked_for = [*names, *(n for n in _unsure(mass, wrong_cg) if n != "cg_y_m")]
    if law == "side_by_side" and len(looked_for) > 1:
        channels += ["ax_mps2", "az_mps2"]
    return experiment(
        "pitch inertia",
        drive,
        first,
        names,
        unknowns(*looked_for),
        channels,
        law=law,
        snr=snr,
        seed=np.random.default_rng([seed, 1]),
        road_noise=road_noise,
    )


def _law(law: Law, snr: float, name: str) -> ParameterLaw:
    """Gains of the order of the paper's; those of inertia begin high and fall if there is noise."""
    kind: Literal["sign", "gradient"] = "sign" if law == "published" else "gradient"
    if name == "mass_kg":
        gain = 150.0 if law == "published" else 400.0
        return mass_law(gain, kind=kind, yaw_rate_below_radps=np.inf)
    high, low, time_s = _GAINS[name]
    final = high if np.isinf(snr) else low
    return inertia_law(name, final, first_gain=high, first_gain_s=time_s, kind=kind, floor=0.05)


def _centre(wrong: bool) -> dict[str, float]:
    load = NOMINAL_SUV if wrong else LOADED_SUV
    return {name: getattr(load, name) for name in LOAD_NAMES[4:]}


@lru_cache(maxsize=64)
def _stage_1(snr: float, law: Law, seed: int) -> float:
    return estimate_mass(snr=snr, law=law, seed=seed).found.last("mass_kg")


def _mass(mass: Mass, snr: float, law: Law, seed: int) -> float:
    if mass == "stage_1":
        return _stage_1(snr, law, seed)
    return (NOMINAL_SUV if mass == "wrong" else LOADED_SUV).mass_kg


def _unsure(mass: Mass, wrong_cg: bool) -> list[str]:
    return [
        *(["mass_kg"] if mass == "wrong" or wrong_cg else []),
        *(["cg_x_m", "cg_y_m", "cg_z_m"] if mass == "wrong" or wrong_cg else []),
    ]
