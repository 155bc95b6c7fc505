"""Errors some seconds ahead, in the units of the channels, block by block.

Medians over blocks of the driving: one spin decides nothing. Where two models are compared, block
is held against block. Lateral errors count where the car turns, and blocks hold equal times of
that: on a straight every model predicts that nothing happens.

Where noise has learned a road of varying slope, predictions know the slope to come, as each model's
smoother tells it from all of the data. Whoever drives answers slopes, and by a model whose force or
steering does too little that answer moves the car less: not to know the slope would make the true
car err more than that model.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from ... import _core
from ..._common.arrays import NORMAL_MAD, FloatArray, as_float64, median_of_known
from ..._common.memo import remembered
from ..._common.text import html_table, number, text_table
from ...effects import Effect
from ...errors import NumericalError
from ...estimate import MEASURED, UNITS, Driving, NoiseModel, turning, turning_blocks
from ...identify import Fit
from ...identify.ahead.ahead import of_few
from ...rules import ErrorChange
from .fitted_range import Bools
from .road import held_together
from .waterfall import all_ahead

ALONG = ("vx_mps", "ax_mps2")
LATERAL = ("vy_mps", "yaw_rate_radps", "ay_mps2")
PREDICTED = (*ALONG, *LATERAL)
_LATERAL = [PREDICTED.index(c) for c in LATERAL]
AHEAD = (0.5, 1.0, 2.0, 5.0)
_FEWEST = 5  # blocks that show a change
_APART = 0.1  # of the horizon, between predictions
LOST = 10.0  # logarithm of the ratio, where one of two models lost the car
_OF_MEDIAN = float(np.sqrt(0.5 * np.pi))  # its standard error over that of a mean


@dataclass(frozen=True, eq=False)
class Horizons:
    """Prediction errors of several models, in the units of the channels.

    Attributes
    ----------
    steps : tuple of str
        A word for each model.
    horizons_s : tuple of float
        How far ahead.
    channels : tuple of str
        Those that were measured.
    error : array, shape (steps, horizons, channels)
        Median over blocks of about 5 s of their root mean square errors, lateral ones where the
        car turns (`sysid_vehicle.estimate.turning`); NaN where the driving is too short, infinite
        where a model lost the car in most blocks.
    low, high : array, shape (steps, horizons, channels)
        First and last decile over the blocks.
    noise : array, shape (channels,)
        Standard deviation of the sensors, below which nothing can be predicted.
    """

    steps: tuple[str, ...]
    horizons_s: tuple[float, ...]
    channels: tuple[str, ...]
    error: FloatArray
    low: FloatArray
    high: FloatArray
    noise: FloatArray

    _HEAD = ("error ahead by", "channel", "before", "after", "noise", "unit")

    def _rows(self) -> list[list[str]]:
        return [
            [
                f"{h:g} s",
                c,
                number(float(self.error[0, i, j]), 3),
                number(float(self.error[-1, i, j]), 3),
                number(float(self.noise[j]), 2),
                UNITS[c],
            ]
            for i, h in enumerate(self.horizons_s)
            for j, c in enumerate(self.channels)
        ]

    def __str__(self) -> str:
        return text_table(self._HEAD, self._rows())

    def _repr_html_(self) -> str:
        return html_table(self._HEAD, self._rows())

    def gains(self, step: int) -> dict[str, list[float | None]]:
        """By channel, the error of the step before less that of a step, at each horizon."""
        with np.errstate(invalid="ignore"):  # of two that lose the car
            fall = self.error[step - 1] - self.error[step]
        return {c: _finite(fall[None, :, j])[0] for j, c in enumerate(self.channels)}

    def to_dict(self) -> dict[str, Any]:
        """All figures, ready for JSON; None where there are none."""
        return {
            "steps": list(self.steps),
            "horizons_s": list(self.horizons_s),
            "channels": {
                c: {
                    "unit": UNITS[c],
                    "sensor_noise": float(self.noise[j]),
                    "median": _finite(self.error[:, :, j]),
                    "first_decile": _finite(self.low[:, :, j]),
                    "last_decile": _finite(self.high[:, :, j]),
                }
                for j, c in enumerate(self.channels)
            },
        }


def explainable(driving: Driving) -> tuple[str, ...]:
    """Channels whose errors ahead effects can explain.

    Where the wheel force is not known the speed ahead is the integral of the measured acceleration,
    and errs by that sensor alone.
    """
    return PREDICTED if driving.force_known else LATERAL


def moving_with(channels: Collection[str]) -> frozenset[str]:
    """Predicted channels of the motions, along the car and lateral, that some channels are of.

    What moves the yaw rate moves v_y and a_y within a second, and the speed hardly at all.
    """
    motions = (m for m in (ALONG, LATERAL) if not set(m).isdisjoint(channels))
    return frozenset(c for motion in motions for c in motion)


def moved_by(effect: Effect) -> frozenset[str]:
    """Predicted channels whose errors an effect can take away, or make.

    Those of the motions that it moves (`moving_with`). What the accelerometer alone feels leaves
    the motion as it is.
    """
    return effect.moved if effect.felt_alone else moving_with(effect.moved)


def _finite(figures: FloatArray) -> list[list[float | None]]:
    return [[float(v) if np.isfinite(v) else None for v in row] for row in figures]


def horizons(
    fits: Sequence[Fit],
    steps: Sequence[str],
    driving: Driving,
    horizons_s: Sequence[float] = AHEAD,
) -> Horizons:
    """Work out the errors of several models some seconds ahead.

    Parameters
    ----------
    fits : sequence of Fit
        The last one's noise starts every prediction.
    steps : sequence of str
        A word for each.
    driving : Driving
    horizons_s : sequence of float
    """
    noise = fits[-1].noise.floor()
    channels = tuple(c for c in explainable(driving) if c in driving.present)
    columns = [PREDICTED.index(c) for c in channels]
    ahead, between = tuple(horizons_s), (fits[0], fits[-1])
    by_block = np.stack(
        [block_errors(f, noise, driving, ahead, between)[:, :, columns] for f in fits]
    )
    with np.errstate(invalid="ignore"):
        low, middle, high = (_quantile(by_block, q) for q in (0.1, 0.5, 0.9))
    sensor = np.array([noise.reading[MEASURED.index(c)] for c in channels])
    return Horizons(
        tuple(steps), tuple(horizons_s), channels, middle, low, high, as_float64(sensor)
    )


def _quantile(by_block: FloatArray, q: float) -> FloatArray:
    """Over the blocks, (models, blocks, horizons, channels), that have a prediction."""
    out = np.full((by_block.shape[0], *by_block.shape[2:]), np.nan)
    for at in np.ndindex(out.shape):
        few = by_block[at[0], :, at[1], at[2]]
        few = np.sort(few[~np.isnan(few)])
        if len(few):
            # Of the sorted blocks themselves: between a finite and an infinite one lies nothing.
            out[at] = few[round(q * (len(few) - 1))]
    return as_float64(out)


def block_errors(
    fit: Fit,
    noise: NoiseModel,
    driving: Driving,
    horizons_s: tuple[float, ...],
    between: tuple[Fit, ...] = (),
) -> FloatArray:
    """Root mean square errors of the predicted channels, block by block.

    Parameters
    ----------
    fit : Fit
    noise : NoiseModel
        Of the filter that starts the predictions.
    driving : Driving
    horizons_s : tuple of float
    between : tuple of Fit
        As for `all_ahead`.

    Returns
    -------
    array, shape (blocks, horizons, 5)
        NaN where nothing is predicted, infinite where the model lost the car.
    """
    held = held_together(between, noise)
    return _block_errors_remembered(fit, noise, driving, horizons_s, held)


# On a level road the poorer model of all candidates of a step is asked the same.
@remembered(64)
def _block_errors_remembered(
    fit: Fit,
    noise: NoiseModel,
    driving: Driving,
    horizons_s: tuple[float, ...],
    held: tuple[Fit, ...],
) -> FloatArray:
    return _by_block(errors_ahead(fit, noise, driving, horizons_s, held), driving)


def squares_ahead(
    fits: Sequence[Fit],
    driving: Driving,
    horizons_s: Sequence[float],
    counted: Bools | None = None,
) -> tuple[FloatArray, FloatArray, npt.NDArray[np.bool_]]:
    """Squares of errors, noise of the sensors, and which horizons and channels are seen.

    The squares have shape (models, blocks, horizons, channels). The last model's noise starts every
    prediction. Of these some may be counted alone, (horizons, samples), by where they end.
    """
    noise, ahead, between = fits[-1].noise.floor(), tuple(horizons_s), (fits[0], fits[-1])
    sensor = np.array([noise.reading[MEASURED.index(c)] for c in PREDICTED])
    errors = [_errors_of(f, noise, driving, ahead, counted, between) for f in fits]
    squares = np.stack(errors) ** 2
    seen = np.isfinite(squares).any(axis=(0, 1))
    seen &= np.isin(PREDICTED, explainable(driving))
    return lost_as_large(as_float64(squares)), as_float64(sensor), seen


def lost_as_large(squares: FloatArray) -> FloatArray:
    """Squares of errors, (models, blocks, horizons, channels), with a number for a lost car.

    It is as wrong as anything that was seen, and much more.
    """
    most = np.max(squares, axis=(0, 1), initial=0.0, where=np.isfinite(squares))
    return as_float64(np.where(np.isinf(squares), LOST**2 * most, squares))


def errors_ahead(
    fit: Fit,
    noise: NoiseModel,
    driving: Driving,
    horizons_s: tuple[float, ...],
    between: tuple[Fit, ...] = (),
) -> FloatArray:
    """Errors of the predicted channels, (horizons, samples, 5), infinite where the model fails.

    NaN where no prediction ends, or nothing was measured. Of short driving the last few are
    remembered: a final model is held against that without each of its effects in turn.
    """
    kept = driving.samples <= _core.TOLD_SAMPLES
    work_out = _errors_remembered if kept else _errors_worked_out
    return work_out(fit, noise, driving, horizons_s, held_together(between, noise))


def _errors_worked_out(
    fit: Fit,
    noise: NoiseModel,
    driving: Driving,
    horizons_s: tuple[float, ...],
    between: tuple[Fit, ...],
) -> FloatArray:
    columns = [MEASURED.index(c) for c in PREDICTED]
    try:
        e = all_ahead(fit, noise, driving, horizons_s, apart=_APART, between=between)
        e = e[:, :, columns]
    except NumericalError:
        return np.full((len(horizons_s), driving.samples, len(PREDICTED)), np.inf)
    return as_float64(np.where(np.isfinite(driving.measured[:, columns]), e, np.nan))


_errors_remembered = remembered(8)(_errors_worked_out)


def _by_block(e: FloatArray, driving: Driving) -> FloatArray:
    """Root mean squares, shape (blocks, horizons, channels); lateral ones where the car turns."""
    starts = turning_blocks(driving)
    there = ~np.isnan(e)
    there[..., _LATERAL] &= turning(driving)[:, None]
    squares = np.add.reduceat(np.where(there, e, 0.0) ** 2, starts, axis=1)
    count = np.add.reduceat(there.astype(float), starts, axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        return as_float64(np.where(count > 0.0, np.sqrt(squares / count), np.nan).swapaxes(0, 1))


def _errors_of(
    fit: Fit,
    noise: NoiseModel,
    driving: Driving,
    horizons_s: tuple[float, ...],
    counted: Bools | None,
    between: tuple[Fit, ...],
) -> FloatArray:
    """As `block_errors`, of the predictions that count."""
    if counted is None or counted.all():
        return block_errors(fit, noise, driving, horizons_s, between)
    errors = errors_ahead(fit, noise, driving, horizons_s, between)
    return _by_block(as_float64(np.where(counted[..., None], errors, np.nan)), driving)


def typical_error(
    fit: Fit,
    noise: NoiseModel,
    driving: Driving,
    horizons_s: Sequence[float],
    counted: Bools | None = None,
    between: tuple[Fit, ...] = (),
) -> float:
    """Mean logarithm of the median errors of the lateral channels, over all horizons.

    Infinite where the model loses the car in most blocks. Of the predictions some may be counted
    alone, as for `squares_ahead`; `between` as for `all_ahead`.
    """
    found = []
    errors = _errors_of(fit, noise, driving, tuple(horizons_s), counted, between)
    for by_block in errors.swapaxes(0, 1):
        by_block = by_block[:, _LATERAL]
        known = ~np.isnan(by_block).all(axis=0)
        found += list(median_of_known(by_block[:, known], axis=0))
    return float(np.mean(np.log(found))) if found else np.inf


def changes(
    before: Fit, after: Fit, driving: Driving, horizons_s: Sequence[float]
) -> tuple[ErrorChange, ...]:
    """How errors some seconds ahead change from one model to another.

    Parameters
    ----------
    before, after : Fit
        The noise floor of the latter starts the predictions of both.
    driving : Driving
    horizons_s : sequence of float

    Returns
    -------
    tuple of ErrorChange
        By channel and horizon, of those that enough blocks show.
    """
    noise = after.noise.floor()
    found = []
    ahead, models = tuple(horizons_s), (before, after)
    both = [block_errors(fit, noise, driving, ahead, models) for fit in models]
    for i, h in enumerate(horizons_s):
        one, other = (errors[:, i] for errors in both)
        for channel in explainable(driving):
            j = PREDICTED.index(channel)
            known = (one[:, j] > 0.0) & (other[:, j] > 0.0)
            # Of a block that both models lose there is nothing to be learnt.
            known &= np.isfinite(one[:, j]) | np.isfinite(other[:, j])
            if np.count_nonzero(known) < _FEWEST:
                continue
            with np.errstate(divide="ignore", over="ignore"):
                ratio = np.log(other[known, j]) - np.log(one[known, j])
            ratio = np.clip(ratio, -LOST, LOST)
            middle = float(np.median(ratio))
            scatter = NORMAL_MAD * float(np.median(np.abs(ratio - middle)))
            found.append(
                ErrorChange(
                    channel,
                    h,
                    middle,
                    _OF_MEDIAN * scatter * of_few(len(ratio)) / float(np.sqrt(len(ratio))),
                )
            )
    return tuple(found)
