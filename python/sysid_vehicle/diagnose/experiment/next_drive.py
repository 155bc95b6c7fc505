"""Which drive would tell two effects apart, and by how many standard errors.

Every manoeuvre of a menu within the limits is driven in simulation, at the fit. Its information is
added to that of the driving at hand (`information.py`); the two effects are as far apart as the
nearer of them stands out from the other (T-optimality, linearised: Atkinson & Fedorov, Biometrika
1975).
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ... import manoeuvres
from ..._common.arguments import check_positive
from ..._common.printed import Part, Printed, Table
from ..._common.progress import with_progress
from ..._common.text import brief
from ...effects import Effect, length_beyond
from ...errors import InvalidInput, NumericalError
from ...estimate import MEASURED, Driving
from ...estimate.inputs import white_noise_std
from ...identify import Fit, explaining, refine
from ...log import Log
from ...manoeuvres import Manoeuvre
from ...model import Model
from ...simulate import Drive, SensorNoise, drive_truth
from ...vehicle import Vehicle
from .information import Information, information_of
from .suggestion import Suggestion, ground_m

_ENOUGH = 5.0  # standard errors


@dataclass(frozen=True)
class DriveLimits:
    """What can be driven.

    Parameters
    ----------
    speed_mps : float
        Highest speed.
    lateral_mps2 : float
        Highest lateral acceleration, either side.
    area_m : tuple of 2 floats, optional
        Longer and shorter side of the ground there is.
    duration_s : float
        Longest drive.
    """

    speed_mps: float = 36.0
    lateral_mps2: float = 8.5
    area_m: tuple[float, float] | None = None
    duration_s: float = 120.0

    def __post_init__(self) -> None:
        limits = {"speed_mps": self.speed_mps, "lateral_mps2": self.lateral_mps2}
        check_positive("DriveLimits", **limits, duration_s=self.duration_s)
        if self.area_m is not None and not min(self.area_m) > 0.0:
            raise InvalidInput(f"area_m is {self.area_m}; give two positive lengths")

    @classmethod
    def usual(cls, vehicle: Vehicle, **others: Any) -> DriveLimits:
        """Limits that a car may have: its top speed goes as the root of its length.

        Parameters
        ----------
        vehicle : Vehicle
            An ordinary one drives up to 36 m/s.
        **others
            Limits that are known.
        """
        length = length_beyond(vehicle.wheelbase_m)
        return cls(**{"speed_mps": length**0.5 * cls.speed_mps, **others})

    def hold(self, drive: Drive) -> bool:
        """Whether a drive stayed within them."""
        speed, lateral = drive.states[:, 0], drive.outputs[:, 4]
        inside = (
            speed.max() <= 1.02 * self.speed_mps
            and np.abs(lateral).max() <= 1.05 * self.lateral_mps2
            and drive.log.duration_s <= self.duration_s
        )
        if self.area_m is None or not inside:
            return bool(inside)
        long, short = ground_m(drive)
        return long <= max(self.area_m) and short <= min(self.area_m)


@dataclass(frozen=True, eq=False)
class NextDrive(Printed):
    """Drives that tell two effects apart.

    Attributes
    ----------
    first, second : Effect
    now : float
        Standard errors between them, of the size asked for, with the driving at hand.
    suggestions : tuple of Suggestion
        The cheapest that is enough first; the others by standard errors.
    refused : int
        Manoeuvres of the menu beyond the limits, or that the car did not survive.
    """

    first: Effect
    second: Effect
    now: float
    suggestions: tuple[Suggestion, ...]
    refused: int

    @property
    def best(self) -> Suggestion:
        """The cheapest drive that separates the two by five standard errors, or the most telling.

        Raises
        ------
        InvalidInput
            No manoeuvre is within the limits.
        """
        if not self.suggestions:
            raise InvalidInput("no manoeuvre of the library is within the limits; widen them")
        return self.suggestions[0]

    _HEAD = ("manoeuvre", "standard errors", "time [s]", "m/s", "a_y [m/s2]", "ground [m]")

    def _rows(self) -> list[list[str]]:
        return [
            [
                s.manoeuvre.name,
                f"{s.sigmas:.1f}",
                f"{s.duration_s:.0f}",
                "{:.0f} to {:.0f}".format(*s.speed_mps),
                f"{s.lateral_mps2:.1f}",
                "{:.0f} x {:.0f}".format(*s.ground_m),
            ]
            for s in self.suggestions[:8]
        ]

    def _first(self) -> list[str]:
        return [f"The first: {s.instructions()}" for s in self.suggestions[:1]]

    def _headline(self) -> str:
        pair = f"{self.first.id} and {self.second.id}"
        return f"{pair} are {self.now:.1f} standard errors apart; after"

    __repr__ = brief

    def _parts(self) -> list[Part]:
        return [self._headline(), Table(self._HEAD, self._rows()), *self._first()]

    def to_dict(self) -> dict[str, Any]:
        """Everything for a JSON file."""
        return {
            "between": [self.first.id, self.second.id],
            "standard_errors_now": self.now,
            "refused": self.refused,
            "suggestions": [s.to_dict() for s in self.suggestions],
        }


def separations(
    fit: Fit, effects: Sequence[Effect | str], *, information: Information | None = None
) -> dict[tuple[str, str], float]:
    """Standard errors between every two effects of typical size, with the driving at hand.

    Returns
    -------
    dict of (effect, effect) to float
        The nearer of both directions.
    """
    several = tuple(fit.model.effect(e) for e in effects)
    known = information if information is not None else information_of(fit, fit.driving, several)
    shown = [e for e in several if any(e.id == k.id for k in known.effects)]
    return {
        (a.id, b.id): _apart(known, a, b, None) for i, a in enumerate(shown) for b in shown[i + 1 :]
    }


@explaining
def suggest_manoeuvre(
    fit: Fit,
    first: Effect | str,
    second: Effect | str,
    *,
    size: Sequence[float] | None = None,
    limits: DriveLimits | None = None,
    enough: float = _ENOUGH,
    seed: int = 0,
    progress: bool | None = None,
) -> NextDrive:
    """Suggest the cheapest drive that tells two effects apart.

    Parameters
    ----------
    fit : Fit
        Without either effect.
    first, second : Effect or str
        The likelier one first.
    size : sequence of float, optional
        Size of the first, as distance from its null values; by default a typical one.
    limits : DriveLimits, optional
        What can be driven; by default `DriveLimits.usual`.
    enough : float
        Standard errors that are wanted.
    seed : int
        Of the simulated drives.
    progress : bool, optional
        Show a progress bar; by default in a terminal or a notebook, after two seconds.

    Returns
    -------
    NextDrive

    Raises
    ------
    InvalidInput
        The model has one of the effects already, or the driving cannot show it.
    """
    a, b = fit.model.effect(first), fit.model.effect(second)
    for e in (a, b):
        if e.id in fit.model.effects:
            raise InvalidInput(f"the model has '{e.id}' already; give a fit without it")
    car = fit.model.vehicle
    bounds = limits if limits is not None else DriveLimits.usual(car)
    psi = None if size is None else tuple(size)
    fit = _with_noise_beside(fit, a, psi)
    here = information_of(fit, fit.driving, (a, b))
    now = _apart(here, a, b, psi)
    menu = _menu(bounds, length_beyond(car.wheelbase_m))
    truth = fit.model.add(a).with_values(_values(a, psi))
    found, refused = [], 0
    for manoeuvre in with_progress(menu, "manoeuvres", shown=progress):
        drive = _driven(truth, manoeuvre, fit, bounds, seed)
        if drive is None:
            refused += 1
            continue
        log = _as_logged(drive, fit)
        there = information_of(fit, Driving.of(log), (a, b))
        apart = _apart(here + there, a, b, psi)
        found.append(Suggestion(manoeuvre, log.duration_s, apart, drive))
    found.sort(key=lambda s: (s.sigmas < enough, s.duration_s if s.sigmas >= enough else -s.sigmas))
    return NextDrive(a, b, now, tuple(found), refused)


def _with_noise_beside(fit: Fit, first: Effect, size: tuple[float, ...] | None) -> Fit:
    """The fit with the noise that is left where the first effect acts.

    Without it what it does counts as a disturbance, in which hardly anything would be told apart.
    """
    model = fit.model.add(first)
    found = []
    for begin in (model, model.with_values(_values(first, size))):
        with suppress(NumericalError, np.linalg.LinAlgError):
            found.append(refine(begin, fit.driving, fit.noise))
    best = max(found, key=lambda f: f.log_likelihood, default=fit)
    return replace(fit, noise=best.noise) if best.log_likelihood > fit.log_likelihood else fit


def _apart(
    known: Information,
    a: Effect,
    b: Effect,
    size_a: tuple[float, ...] | None,
) -> float:
    return min(
        known.separation(a.id, _size(a, size_a), b.id),
        known.separation(b.id, _size(b, None), a.id),
    )


def _size(e: Effect, given: tuple[float, ...] | None) -> tuple[float, ...]:
    return given if given is not None else tuple(p.typical - p.null_value for p in e.parameters)


def _values(e: Effect, size: tuple[float, ...] | None) -> dict[str, float]:
    return {
        name: float(np.clip(p.null_value + s, p.lower, p.upper))
        for (name, p), s in zip(e.named.items(), _size(e, size), strict=True)
    }


def _menu(limits: DriveLimits, length: float) -> list[Manoeuvre]:
    """Manoeuvres of the library at several speeds and strengths within the limits.

    Circles and rows of cones are as many times those of ordinary cars as the car is.
    """
    top, lateral = limits.speed_mps, limits.lateral_mps2
    slow, fast = 0.5 * top, 0.8 * top
    menu = [
        manoeuvres.sine_sweep(speed_mps=v, lateral_mps2=share * lateral, duration_s=t)
        for v in (slow, fast)
        for share in (0.35, 0.6)
        for t in (20.0, 40.0)
    ]
    menu += [
        manoeuvres.step_steer((0.45 * top, 0.65 * top, 0.85 * top), (0.3 * lateral, 0.6 * lateral)),
        manoeuvres.step_steer((0.45 * top,), (0.4 * lateral, 0.7 * lateral)),
        manoeuvres.step_steer((0.85 * top,), (0.4 * lateral, 0.7 * lateral)),
        manoeuvres.ramp_steer((slow,), 0.95 * lateral),
        manoeuvres.ramp_steer((slow, fast), 0.95 * lateral),
        manoeuvres.sine_with_dwell(0.6 * top, (0.3 * lateral, 0.5 * lateral, 0.7 * lateral)),
        manoeuvres.slalom(speed_mps=slow, lateral_mps2=0.65 * lateral, spacing_m=30.0 * length),
        manoeuvres.brake_in_turn(100.0 * length, 0.6 * lateral),
        manoeuvres.straight_acceleration(top_speed_mps=top, low_speed_mps=0.3 * top),
        manoeuvres.lap(lateral_mps2=0.95 * lateral, top_speed_mps=0.95 * top),
        manoeuvres.handling_course(lateral_mps2=0.95 * lateral, top_speed_mps=0.95 * top),
    ]
    menu += [
        manoeuvres.constant_radius(radius, 0.95 * lateral, 40.0)
        for radius in (30.0 * length, 60.0 * length, 100.0 * length)
        if radius * 0.95 * lateral < top**2
    ]
    return menu


def _driven(
    truth: Model, manoeuvre: Manoeuvre, fit: Fit, limits: DriveLimits, seed: int
) -> Drive | None:
    """The drive with the user's own sensors; None where the limits or the car do not hold."""
    sensor = dict(zip(MEASURED, fit.noise.sensor, strict=True))
    steer = max(white_noise_std(log["steer_rad"]) for log in fit.driving.logs)
    noise = SensorNoise(**{n: float(s) for n, s in sensor.items()}, steer_rad=steer)
    rate = max(fit.driving.logs, key=lambda log: log.duration_s).rate_hz
    try:
        drive = drive_truth(truth, manoeuvre, seed=seed, noise=noise, rate_hz=rate)
    except (NumericalError, InvalidInput):
        return None
    return drive if limits.hold(drive) else None


def _as_logged(drive: Drive, fit: Fit) -> Log:
    """What the user's logger would write of it."""
    there = {c for log in fit.driving.logs for c in log.channels}
    columns = {c: drive.log[c] for c in drive.log.channels if c in there or c == "time_s"}
    return Log.from_arrays(columns, name=drive.log.name, check=False)
