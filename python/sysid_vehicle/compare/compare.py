"""How well a model predicts driving, channel by channel, and where it fails."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from .._common.arrays import FloatArray
from .._common.style import axes_or_new
from .._common.tables import dataset, frame
from .._common.text import brief, html_list, html_paragraph, html_table, number, text_table
from .._common.typed import typed
from ..estimate import MEASURED, UNITS, Driving, NoiseModel
from ..estimate.noise import TIMES, noise_range
from ..estimate.pieces import traces
from ..identify import Fit, driving_beside, driving_of, explaining
from ..log import Log
from .event import Event
from .failure_map import FailureMap, Region
from .unrelated import incoherent, unrelated

if TYPE_CHECKING:
    from matplotlib.axes import Axes

TRACED = 1 << 16
"""Samples of which all that a filter says is held at once."""


@dataclass(frozen=True)
class ChannelScore:
    """One channel's one-step-ahead error.

    Attributes
    ----------
    rmse, noise_floor : float
        Of the prediction error, in the channel's unit; and what it would be were the model right.
    nrmse : float
        Root mean square of the error over its expected spread; 1 is the noise floor.
    r2 : float
        Share of the channel's variance that is predicted.
    """

    rmse: float
    noise_floor: float
    nrmse: float
    r2: float


@dataclass(frozen=True, eq=False)
class Comparison:
    """A model against driving.

    Attributes
    ----------
    error : float
        Root mean square of the normalised one-step-ahead residual over all channels; 1 is the noise
        floor.
    channels : dict
        Scores by channel.
    regions : tuple of Region
        Where it fails most: ranges of speed and lateral acceleration.
    failure_map : FailureMap
        The error over speed and lateral acceleration.
    time_s, log_number : array, shape (n,)
        Of each sample.
    residual : array, shape (n, 5)
        Normalised one-step-ahead residuals; NaN where nothing was measured.
    log_likelihood : float
        Of the driving under the model and the noise it was fitted with.
    unrelated : dict of str to str
        Channels that contradict the others, which no effect of a car explains, and how.
    event : Event or None
        A moment that holds most of the error, as something outside the model happened there.
    """

    title: str
    error: float
    channels: dict[str, ChannelScore]
    regions: tuple[Region, ...]
    failure_map: FailureMap
    time_s: FloatArray
    log_number: FloatArray
    residual: FloatArray
    log_likelihood: float
    unrelated: dict[str, str] = field(default_factory=dict)
    event: Event | None = None

    _HEAD = ("channel", "rmse", "noise floor", "rmse / floor", "R2", "unit")

    def _rows(self) -> list[list[str]]:
        return [
            [c, number(s.rmse), number(s.noise_floor), f"{s.nrmse:.3f}", f"{s.r2:.4f}", UNITS[c]]
            for c, s in self.channels.items()
        ]

    def _headline(self) -> str:
        return f"{self.title}: error {self.error:.3f} of the noise floor, one step ahead"

    def _events(self) -> tuple[Event, ...]:
        return () if self.event is None else (self.event,)

    __repr__ = brief

    def __str__(self) -> str:
        parts = [self._headline(), text_table(self._HEAD, self._rows())]
        parts += [f"Something else is wrong: {text}" for text in self.unrelated.values()]
        parts += [str(event) for event in self._events()]
        if self.regions:
            parts.append("Where it fails most")
            parts += [f"  {r}" for r in self.regions]
        return "\n".join(parts)

    def _repr_html_(self) -> str:
        return (
            html_paragraph(self._headline())
            + html_table(self._HEAD, self._rows())
            + html_list([*self.unrelated.values(), *self._events(), *self.regions])
        )

    def to_pandas(self) -> Any:
        """A DataFrame of the scores, by channel."""
        scores = list(self.channels.values())
        names = ("rmse", "noise_floor", "nrmse", "r2")
        columns = {name: [getattr(s, name) for s in scores] for name in names}
        units = [UNITS[c] for c in self.channels]
        return frame({"channel": list(self.channels), **columns, "unit": units}, "channel")

    def to_xarray(self) -> Any:
        """An xarray Dataset: residuals by sample and channel, errors by speed and acceleration."""
        m = self.failure_map
        speed, lateral = (0.5 * (e[1:] + e[:-1]) for e in (m.speed_mps, m.lateral_mps2))
        return dataset(
            {
                "residual": (("sample", "channel"), self.residual, ""),
                "time": (("sample",), self.time_s, "s"),
                "log": (("sample",), self.log_number, ""),
                "error": (("speed", "lateral_acceleration"), m.error, ""),
            },
            {
                "channel": (list(MEASURED), ""),
                "speed": (speed, "m/s"),
                "lateral_acceleration": (lateral, "m/s2"),
            },
            self.title,
        )

    def plot(self, ax: Axes | None = None) -> Axes:
        """The map of where the model fails."""
        return self.failure_map.plot(ax)

    def plot_residuals(self, ax: Axes | None = None) -> Axes:
        """Normalised residuals of each channel over the seconds driven, averaged over half one."""
        ax = axes_or_new(ax, 8.0, 3.5)
        driven, step = self._driven_s()
        for i, c in enumerate(MEASURED):
            if c in self.channels:
                width = max(round(0.5 / step), 1)
                smooth = _running_rms(self.residual[:, i], self.log_number, width)
                ax.plot(driven, smooth, label=c, lw=1.0)
        ax.axhline(1.0, color="0.3", lw=0.8, ls="--")
        ax.set(xlabel="seconds driven", ylabel="residual / noise floor (running rms)")
        ax.legend(fontsize="small", ncols=3)
        return ax

    def _driven_s(self) -> tuple[FloatArray, float]:
        """Seconds driven until each sample, without what lies between stretches; the usual step."""
        steps = np.diff(self.time_s)
        inside = (np.diff(self.log_number) == 0) & (steps > 0.0)
        usual = float(np.median(steps[inside])) if inside.any() else 1.0
        steps = np.where(inside & (steps < 2.0 * usual), steps, usual)
        return np.concatenate([[0.0], np.cumsum(steps)]), usual


def _running_rms(e: FloatArray, log_number: FloatArray, width: int) -> FloatArray:
    square = np.where(np.isfinite(e), e, 0.0) ** 2
    count = np.isfinite(e).astype(float)
    box = np.ones(width)
    with np.errstate(invalid="ignore", divide="ignore"):
        out: FloatArray = np.sqrt(
            np.convolve(square, box, "same") / np.convolve(count, box, "same")
        )
    out[np.flatnonzero(np.diff(log_number))] = np.nan  # breaks the line between logs
    return out


def one_step_error(fit: Fit, driving: Driving, noise: NoiseModel, near: Fit | None = None) -> float:
    """The `error` of a comparison alone; the arguments are those of `compare`.

    Offsets of the driving's logs are found from those under a fit that is `near`, if there is one.
    """
    total, number = 0.0, 0
    own = driving_of(fit, driving) if near is None else driving_beside(fit, near, driving)
    for _, squares, count, _ in _told(fit, own, noise.floor()):
        total, number = total + float(squares.sum()), number + int(count.sum())
    return float(np.sqrt(total / number))


def _told(
    fit: Fit, driving: Driving, noise: NoiseModel
) -> Iterator[tuple[slice, FloatArray, FloatArray, dict[str, Any]]]:
    """Samples, sum and number of each one's squared whitened residuals, and the filter's trace."""
    problem = driving.problem(fit.model, longest=TRACED)
    for own, trace in traces(problem, fit.model.vector(), noise.vector()):
        there = np.isfinite(driving.measured[own])
        squares = np.where(there, trace["whitened"] ** 2, 0.0).sum(axis=1)
        yield own, squares, there.sum(axis=1), trace


@typed
@explaining
def compare(
    fit: Fit, logs: Log | Sequence[Log] | Driving, *, noise: NoiseModel | None = None
) -> Comparison:
    """Compare a fitted model with driving, one step ahead.

    Parameters
    ----------
    fit : Fit
    logs : Log, sequence of Log, or Driving
        Driving to compare with; validation data tell most.
    noise : NoiseModel, optional
        Whose sensors and white motion noise are the noise floor; by default the fit's. Models that
        are compared with each other need the same one.
    """
    driving = driving_of(fit, logs)
    floor = (fit.noise if noise is None else noise).floor()
    innovation, spread = (np.empty((driving.samples, len(MEASURED))) for _ in range(2))
    log_likelihood = 0.0
    for own, _, _, trace in _told(fit, driving, fit.noise):
        innovation[own], spread[own] = trace["innovation"], trace["spread"]
        log_likelihood += trace["log_likelihood"]
    wrong = incoherent(driving, fit.model, fit.noise) or unrelated(driving, innovation, spread)
    squares, count = np.empty(driving.samples), np.empty(driving.samples)
    for own, squares[own], count[own], trace in _told(fit, driving, floor):
        innovation[own], spread[own] = trace["innovation"], trace["spread"]
    scores = {}
    for i, c in enumerate(MEASURED):
        there = np.isfinite(innovation[:, i])
        if not there.any():
            continue
        e, expected = innovation[there, i], spread[there, i]
        variance = float(np.var(driving.measured[there, i]))
        scores[c] = ChannelScore(
            float(np.sqrt(np.mean(e**2))),
            # Not the mean: the filter's ignorance at the first samples is no noise of the sensor.
            float(np.median(expected)),
            float(np.sqrt(np.mean((e / expected) ** 2))),
            float(1.0 - np.mean(e**2) / variance) if variance > 0 else float("nan"),
        )
    failures = FailureMap.of(driving, squares, count)
    longest_s = float(noise_range(fit.model.vehicle)[1][TIMES].max())
    innovation /= spread  # long driving has no room for both
    title = f"{', '.join(fit.model.effects) or 'baseline'} on {driving}"
    return Comparison(
        title,
        float(np.sqrt(squares.sum() / count.sum())),
        scores,
        failures.worst(),
        failures,
        driving.channel("time_s"),
        driving.log_number,
        innovation,
        log_likelihood,
        wrong,
        Event.of_driving(driving, squares, count, longest_s),
    )
