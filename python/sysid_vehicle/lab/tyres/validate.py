"""Identified tyres on validation data: one step, one second and a whole drive ahead."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..._common.arrays import FloatArray, as_float64
from ..._common.files import read_json
from ..._common.kinds import TYRES
from ..._common.printed import Part, Printed, Table
from ..._common.progress import doing
from ..._common.style import AFTER, BEFORE, TRUTH, axes_or_new, tidy
from ..._common.text import number
from ..._common.typed import typed, typed_fields
from ...errors import InvalidInput
from ..observer.observed import READINGS
from .data import GreyBoxVehicle, TyreLog
from .fit import ELLIPSE, NOISES, PARAMETERS, TyreFit
from .problem import TyreProblem, tyre_problem

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@dataclass(frozen=True, eq=False)
class IdentifiedCar:
    """What of an identification is needed to predict driving.

    Parameters
    ----------
    vehicle : GreyBoxVehicle
    parameters : array, shape (15,)
        In the order of `lab.tyre_fit.PARAMETERS`; the friction ellipse may be left out.
    noise : array, shape (7,)
        In the order of `lab.tyre_fit.NOISES`.
    """

    vehicle: GreyBoxVehicle
    parameters: FloatArray
    noise: FloatArray

    @typed_fields
    def __post_init__(self) -> None:
        known = as_float64(self.parameters)
        if known.shape == (len(PARAMETERS) - 1,):  # from before there was an ellipse
            object.__setattr__(self, "parameters", as_float64(np.append(known, 0.0)))

    @classmethod
    @typed
    def of(cls, fit: TyreFit) -> IdentifiedCar:
        """Take it from a fit."""
        return cls(fit.vehicle, fit.parameters, fit.noise)

    @classmethod
    @typed
    def from_json(cls, path: str | Path) -> IdentifiedCar:
        """Read what `TyreFit.to_dict` was written to.

        Raises
        ------
        InvalidInput
            The file is not such a one.
        """
        told = read_json(path, TYRES)
        try:
            return cls(
                GreyBoxVehicle(**told["vehicle"]),
                as_float64(
                    [told["parameters"][name] for name in PARAMETERS[:-1]]
                    + [told["parameters"].get(ELLIPSE, 0.0)]
                ),
                as_float64([told["noise"][name] for name in NOISES]),
            )
        except (KeyError, TypeError, ValueError) as error:
            raise InvalidInput(
                f"{path} does not hold identified tyres ({type(error).__name__}: {error}); write "
                "it with `sysid-vehicle lab identify LOG --json FILE`"
            ) from None


@dataclass(frozen=True, eq=False)
class Validation(Printed):
    """Prediction errors of one drive.

    Attributes
    ----------
    log : TyreLog
    horizons : tuple of str
        How far ahead was predicted; the last one is the whole drive from its first sample.
    predicted : array, shape (horizons, n, 4)
        v_x, v_y [m/s], yaw rate [rad/s], a_y [m/s2]; NaN before the horizon.
    noise : array, shape (4,)
        Standard deviations of the readings' own noise, below which no rms error can be.
    """

    log: TyreLog
    horizons: tuple[str, ...]
    predicted: FloatArray
    noise: FloatArray

    @property
    def rms(self) -> FloatArray:
        """Rms error by horizon and reading, shape (horizons, 4); NaN where nothing is measured.

        Infinite where the simulated car was lost.
        """
        there = np.isfinite(self.log.measurements)
        with np.errstate(invalid="ignore", over="ignore"):
            square = (self.log.measurements - self.predicted) ** 2
        out = np.full((len(self.horizons), len(READINGS)), np.nan)
        for h, begin in enumerate(self._begins):
            for c in range(len(READINGS)):
                seen = there[begin:, c]
                if seen.any():
                    of = square[h, begin:, c][seen]
                    out[h, c] = np.sqrt(np.mean(of)) if np.isfinite(of).all() else np.inf
        return out

    @property
    def _begins(self) -> tuple[int, ...]:
        """First sample that each horizon reaches."""
        ahead = [int(np.argmax(np.isfinite(p[:, 0]))) for p in self.predicted]
        return tuple(ahead)

    def _rows(self) -> list[list[str]]:
        rows = [
            [horizon, *(number(float(v), 3) for v in row)]
            for horizon, row in zip(self.horizons, self.rms, strict=True)
        ]
        return [*rows, ["noise of the reading", *(number(float(v), 3) for v in self.noise)]]

    def _title(self) -> str:
        return f"Rms prediction errors on {self.log}"

    def _parts(self) -> list[Part]:
        return [self._title(), Table(("ahead", *READINGS), self._rows())]

    def to_dict(self) -> dict[str, Any]:
        """All figures, ready for JSON."""
        return {
            "log": str(self.log),
            "rms": {
                horizon: dict(zip(READINGS, map(float, row), strict=True))
                for horizon, row in zip(self.horizons, self.rms, strict=True)
            },
            "noise": dict(zip(READINGS, map(float, self.noise), strict=True)),
        }

    @typed
    def plot(self, ax: Axes | None = None, *, reading: str = "vy_mps") -> Axes:
        """Draw a reading, and what was predicted of it.

        Parameters
        ----------
        ax : matplotlib Axes, optional
            Where to draw; a new figure is made without it.
        reading : str
            One of `READINGS`.

        Raises
        ------
        InvalidInput
            An unknown reading.
        """
        if reading not in READINGS:
            raise InvalidInput(f"no reading {reading!r}; there are {', '.join(READINGS)}")
        c = READINGS.index(reading)
        axes = axes_or_new(ax, 7.0, 3.0)
        t = self.log.time_s
        axes.plot(t, self.log.measurements[:, c], color=TRUTH, lw=0.8, label="measured")
        for h, colour in ((-2, AFTER), (-1, BEFORE)):
            label = f"predicted, {self.horizons[h]}"
            axes.plot(t, self.predicted[h, :, c], color=colour, lw=1.0, label=label)
        tidy(axes, xlabel="time [s]", ylabel=reading, title=self.log.name)
        axes.legend(loc="upper right", ncols=3, fontsize="small")
        return axes


@doing("validation of the tyres")
def validate_tyres(
    car: TyreFit | IdentifiedCar, logs: TyreLog | Sequence[TyreLog], *, horizon_s: float = 1.0
) -> tuple[Validation, ...]:
    """Predict drives with identified tyres: one sample, `horizon_s` and the whole drive ahead.

    Parameters
    ----------
    car : TyreFit or IdentifiedCar
    logs : TyreLog or sequence of TyreLog
        Validation data: other drives of the car.
    horizon_s : float

    Returns
    -------
    tuple of Validation
        One for each log.

    Raises
    ------
    InvalidInput
        No log, or one shorter than the horizon.
    """
    several = (logs,) if isinstance(logs, TyreLog) else tuple(logs)
    if not several:
        raise InvalidInput("no log was given; pass one TyreLog or a list of them")
    known = IdentifiedCar.of(car) if isinstance(car, TyreFit) else car
    return tuple(_validation(known, log, horizon_s) for log in several)


def _validation(car: IdentifiedCar, log: TyreLog, horizon_s: float) -> Validation:
    ahead = round(horizon_s / log.step_s) if np.isfinite(horizon_s) else 0
    if not 1 < ahead < log.n:
        raise InvalidInput(
            f"{log.name}: {horizon_s:g} s ahead in a drive of {log.n * log.step_s:g} s, sampled "
            f"every {log.step_s:g} s; choose a horizon in between"
        )
    problem = _problem(car, log)
    near = [problem.predicted(car.parameters, car.noise, n) for n in (1, ahead)]
    whole = problem.free_run(car.parameters)
    whole[0] = np.nan  # it begins with these readings, and with their noise
    predicted = np.stack([*near, whole])
    horizons = ("one sample", f"{horizon_s:g} s", "the whole drive")
    return Validation(log, horizons, predicted, as_float64(car.noise[: len(READINGS)]))


def _problem(car: IdentifiedCar, log: TyreLog) -> TyreProblem:
    """The log's likelihood; where inputs may be held or not, the larger one of both."""
    kinds = (True, False) if log.inputs_held is None else (log.inputs_held,)
    terms = bool(np.any(car.parameters[8:11]))
    problems = [
        tyre_problem(car.vehicle, [replace(log, inputs_held=held)], residual_terms=terms)
        for held in kinds
    ]
    if len(problems) == 1:
        return problems[0]
    p = car.parameters[None, :]
    return max(problems, key=lambda one: float(one.log_likelihoods(p, car.noise)[0]))
