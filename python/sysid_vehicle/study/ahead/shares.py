"""How much of the error ahead could be explained, and how much of that is.

For each channel and horizon four errors on validation data, in physical units: of the baseline, of
the final model, of the ceiling, and of the sensors. The ceiling is what is left beside any function
of the driving: the errors of a model are regressed on the histories of steering, speed and
longitudinal acceleration (`sysid_vehicle.diagnose.unexplained.ceiling`), on training data, and
what that regression predicts of validation data is taken off. A regression finds only a part: the
true ceiling is no higher than this one, and the shares are no larger than these.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from ..._common.arguments import generator
from ..._common.arrays import FloatArray, as_float64, in_turn, median_of_known, spread_of_known
from ..._common.text import html_paragraph, html_table, number, text_table
from ..._common.threads import in_parallel
from ...diagnose.evidence.coordinates import begins
from ...diagnose.unexplained.ceiling import Inputs, folds, ridge
from ...errors import NumericalError
from ...estimate import MEASURED, UNITS, Driving, NoiseModel, turning, turning_blocks
from ...identify import Fit, driving_of
from ...rules import Share, share_between
from .road import told_by

CHANNELS = ("vy_mps", "yaw_rate_radps", "ay_mps2", "path_m")
AHEAD = (0.0, 0.5, 1.0, 2.0, 5.0)
_UNITS = {**UNITS, "path_m": "m"}
_WORDS = {"vy_mps": "v_y", "yaw_rate_radps": "yaw rate", "ay_mps2": "a_y", "path_m": "path"}
_LEAST_APART_S, _APART = 0.1, 0.1  # between predictions; the latter of the horizon
_DRAWS = 300
_LONG_S = 1.0  # horizons of which the share of all is
_FEW = 30  # predictions that a regression needs
_VISIBLE = 0.01  # of an error: what is explained beyond shows in three digits
_LOST = 1e3  # standard deviations of the channel: what a model that loses the car errs
_LEAST = 1.0 - (1.0 - _VISIBLE) ** 2  # of its square
_QUANTILES = (0.1, 0.5, 0.9)

_Errors = tuple[npt.NDArray[np.intp], FloatArray]
"""Samples at which predictions end, and errors there."""


@dataclass(frozen=True, eq=False)
class Shares:
    """Errors ahead on validation data, what could be explained of them, and what is.

    Attributes
    ----------
    channels : tuple of str
        Those that were measured, and `path_m`: how far the car is beside the predicted path.
    horizons_s : tuple of float
        0 is one sample.
    baseline, final, ceiling : array, shape (3, horizons, channels)
        First decile, median and last decile over blocks of turning (`Horizons`); NaN where the
        driving is too short.
    noise : array, shape (channels,)
        Standard deviation of the sensors; NaN of the path.
    share : tuple of tuple of Share
        For each horizon and channel: of what could be explained, what the effects explain.
    whole : Share
        Over all channels, 1 s ahead and further.
    named : tuple of str
        The effects.
    """

    channels: tuple[str, ...]
    horizons_s: tuple[float, ...]
    baseline: FloatArray
    final: FloatArray
    ceiling: FloatArray
    noise: FloatArray
    share: tuple[tuple[Share, ...], ...]
    whole: Share
    named: tuple[str, ...] = ()

    HEAD = (
        *("ahead by", "channel", "baseline", "with effects", "ceiling", "sensor noise", "unit"),
        "explained",
    )
    CAPTION = (
        "Errors on validation data, with the parameters that predict them best: median (first to "
        "last decile of the driving)."
    )

    def rows(self) -> list[list[str]]:
        """Cells of the printed table, under `HEAD`."""
        return [
            [
                f"{h:g} s" if h > 0.0 else "one step",
                _WORDS[c],
                _spread(self.baseline[:, i, j]),
                _spread(self.final[:, i, j]),
                _spread(self.ceiling[:, i, j]),
                number(float(self.noise[j]), 2) if np.isfinite(self.noise[j]) else "",
                _UNITS[c],
                str(self.share[i][j]) if self.named or not self.share[i][j].known else "0 %",
            ]
            for i, h in enumerate(self.horizons_s)
            for j, c in enumerate(self.channels)
            if not np.isnan(self.baseline[1, i, j])
        ]

    @property
    def sentence(self) -> str:
        """What the effects explain of what could be explained."""
        some = [
            _WORDS[c]
            for j, c in enumerate(self.channels)
            if any(row[j].known for row in self.share)
        ]
        if not some:
            return (
                "No function of the driving is shown to predict the errors ahead better than the "
                "baseline."
            )
        if not self.named:
            return (
                f"A function of the driving predicts a part of the errors ahead of "
                f"{', '.join(some)}, and no effect was added that explains it."
            )
        if not self.whole.known:
            return (
                f"A function of the driving predicts a part of the errors ahead of "
                f"{', '.join(some)}; the share over 1 to 5 s is not significant."
            )
        return (
            f"The effects added explain {self.whole} of the explainable part of the errors 1 to "
            "5 s ahead."
        )

    def __str__(self) -> str:
        return f"{self.CAPTION}\n{text_table(self.HEAD, self.rows())}\n{self.sentence}"

    def _repr_html_(self) -> str:
        table = html_table(self.HEAD, self.rows())
        return html_paragraph(self.CAPTION) + table + html_paragraph(self.sentence)

    def to_dict(self) -> dict[str, Any]:
        """All figures, ready for JSON; None where there are none."""
        return {
            "horizons_s": list(self.horizons_s),
            "quantiles": list(_QUANTILES),
            "whole": self.whole.to_dict(),
            "channels": {
                c: {
                    "unit": _UNITS[c],
                    "sensor_noise": _finite(self.noise[j : j + 1])[0],
                    "baseline": [_finite(q) for q in self.baseline[:, :, j]],
                    "with_effects": [_finite(q) for q in self.final[:, :, j]],
                    "ceiling": [_finite(q) for q in self.ceiling[:, :, j]],
                    "share": [row[j].to_dict() for row in self.share],
                }
                for j, c in enumerate(self.channels)
            },
        }


def _spread(deciles: FloatArray) -> str:
    low, middle, high = map(float, deciles)
    if not np.isfinite(middle):
        return "" if np.isnan(middle) else "lost"
    return f"{number(middle, 3)} ({number(low, 2)} to {number(high, 2)})"


def _finite(figures: FloatArray) -> list[float | None]:
    return [float(v) if np.isfinite(v) else None for v in figures]


def shares(
    baseline: Fit,
    final: Fit,
    test: Driving,
    *,
    named: Sequence[str] = (),
    horizons_s: Sequence[float] = AHEAD,
    seed: int = 0,
) -> Shares:
    """Work out errors of two models ahead, and the ceiling.

    Parameters
    ----------
    baseline, final : Fit
        The latter's noise starts every prediction; its driving teaches the ceiling.
    test : Driving
        Validation data.
    named : sequence of str
        The effects that the final model has more.
    horizons_s : sequence of float
        0 is one sample.
    seed : int
        Of the draws of blocks that make the intervals.
    """
    noise = final.noise.floor()
    channels = tuple(c for c in CHANNELS if c == "path_m" or c in test.present)
    columns = [CHANNELS.index(c) for c in channels]
    inputs = Inputs.of(final, final.driving, test)
    models = (baseline,) if final is baseline else (baseline, final)
    drives = (final.driving, test)
    pairs = [(fit, driving) for fit in models for driving in drives]
    found = in_parallel(lambda pair: _errors(pair[0], noise, pair[1], horizons_s, models), pairs)
    by_horizon = [list(zip(few[::2], few[1::2], strict=True)) for few in zip(*found, strict=True)]
    # Shape (models and ceilings, blocks, horizons, channels).
    squares = np.stack(
        in_parallel(lambda few: _squares(few, drives, inputs)[..., columns], by_horizon), axis=2
    )
    n = len(models)
    deciles = _deciles(np.sqrt(squares))
    # The best regression, and no worse than the final model: it is a function of the driving too.
    order = np.argmin(_filled(deciles[1, n - 1 :]), axis=0)
    best = np.take_along_axis(squares[n - 1 :], order[None, None], axis=0)[0]
    ceiling = _deciles(np.sqrt(best)[None])[:, 0]
    stack = np.stack([squares[0], squares[n - 1], best])
    drawn = generator(seed).integers(0, squares.shape[1], (_DRAWS, squares.shape[1]))
    every = np.vstack([np.arange(squares.shape[1]), drawn])
    middle = in_turn(lambda d: median_of_known(np.moveaxis(stack[:, d], 1, 0), 2), every)
    long = np.array(horizons_s) >= _LONG_S
    scale = middle[0, 0][long]
    whole = np.nansum(middle[:, :, long] / np.where(scale > 0.0, scale, np.nan), axis=(2, 3))
    sensor = np.array([*(noise.reading[MEASURED.index(c)] for c in channels[:-1]), np.nan])
    return Shares(
        channels,
        tuple(map(float, horizons_s)),
        deciles[:, 0],
        deciles[:, n - 1],
        as_float64(ceiling),
        as_float64(sensor),
        tuple(
            tuple(share_between(middle[:, :, i, j], _LEAST) for j in range(len(channels)))
            for i in range(len(horizons_s))
        ),
        share_between(whole, _LEAST),
        tuple(named),
    )


def _filled(x: FloatArray) -> FloatArray:
    return as_float64(np.where(np.isnan(x), np.inf, x))


def _deciles(errors: FloatArray) -> FloatArray:
    """Over the second axis; of the sorted blocks themselves, as some may be infinite."""
    out = np.full((3, errors.shape[0], *errors.shape[2:]), np.nan)
    for at in np.ndindex(out.shape[1:]):
        few = errors[(at[0], slice(None), *at[1:])]
        few = np.sort(few[~np.isnan(few)])
        if len(few):
            for k, q in enumerate(_QUANTILES):
                out[(k, *at)] = few[round(q * (len(few) - 1))]
    return as_float64(out)


def _squares(
    errors: Sequence[tuple[_Errors, _Errors]], drives: tuple[Driving, Driving], inputs: Inputs
) -> FloatArray:
    """Mean squares by block: of each model, then of each beside its regression; (2n, blocks, 4).

    `errors` are those of each model on training and validation data, at one horizon.
    """
    train, test = drives
    # Every model predicts the same samples.
    few, there = (ends for ends, _ in errors[0])
    known, hidden = (np.hstack([each[i][1] for each in errors]) for i in (0, 1))
    left, usable = hidden.copy(), np.isfinite(known)
    for pattern in np.unique(usable, axis=1).T:
        if np.count_nonzero(pattern) < _FEW:
            continue
        own = (usable == pattern[:, None]).all(axis=0)
        rows = few[pattern]
        law = ridge(inputs.train[rows], known[pattern][:, own], folds(train)[rows])
        left[:, own] -= law.mean + inputs.other[there] @ law.size
    each = [x for both in (hidden, left) for x in np.hsplit(both, len(errors))]
    return as_float64(np.stack([_by_block(test, there, x) for x in each]))


def _by_block(driving: Driving, at: npt.NDArray[np.intp], errors: FloatArray) -> FloatArray:
    starts = turning_blocks(driving)
    block = np.searchsorted(starts, at, side="right") - 1
    out = np.full((len(starts), errors.shape[1]), np.nan)
    turns = turning(driving)[at]
    for k in range(errors.shape[1]):
        known = np.isfinite(errors[:, k]) & turns
        number_of = np.bincount(block[known], minlength=len(starts))
        total = np.bincount(block[known], errors[known, k] ** 2, minlength=len(starts))
        out[number_of > 0, k] = (total / np.maximum(number_of, 1))[number_of > 0]
    return as_float64(out)


def _errors(
    fit: Fit,
    noise: NoiseModel,
    driving: Driving,
    horizons_s: Sequence[float],
    between: Sequence[Fit],
) -> list[_Errors]:
    """At each horizon, samples at which predictions end, and errors, shape (predictions, 4)."""
    problem = driving_of(fit, driving).problem(fit.model)
    p, w, road = fit.model.vector(), noise.vector(), told_by(fit, between, noise, driving)
    lateral = [MEASURED.index(c) for c in CHANNELS[:-1]]
    spread = spread_of_known(driving.measured[:, lateral], axis=0)
    parts: list[list[_Errors]] = [[] for _ in horizons_s]
    for rate in np.unique(driving.sample_rate_hz):
        ahead = [max(round(h * rate), 1) for h in horizons_s]
        apart = [max(round(max(_LEAST_APART_S, _APART * h) * rate), 1) for h in horizons_s]
        half_way = [max(n // 2, 1) for n in ahead]  # for the path
        try:
            asked = list(zip((*half_way, *ahead), (*apart, *apart), strict=True))
            found = problem.look_ahead(p, w, asked, road=road)
        except NumericalError:
            found = None
        for i, (n, half, every) in enumerate(zip(ahead, half_way, apart, strict=True)):
            first = _starts(driving, float(rate), n, every)
            if found is None:
                lost = np.broadcast_to(_LOST * spread, (len(first), 3))
                errors = np.column_stack([lost, np.full(len(first), np.nan)])
            else:
                middle, last = found[i][first + half], found[i + len(ahead)][first + n]
                v = driving.channel("vx_mps")[first]
                errors = np.column_stack([last[:, lateral], _path(middle, last, v, n / rate)])
            parts[i].append((first + n, as_float64(errors)))
    return [_joined(driving.measured[:, lateral], few) for few in parts]


def _joined(measured: FloatArray, parts: list[_Errors]) -> _Errors:
    """In the order of time, NaN where nothing was measured."""
    at = np.concatenate([ends for ends, _ in parts])
    order = np.argsort(at)
    found = np.concatenate([errors for _, errors in parts])[order]
    found[:, :-1][~np.isfinite(measured[at[order]])] = np.nan
    return at[order], as_float64(found)


def _path(half: FloatArray, whole: FloatArray, v: FloatArray, seconds: float) -> FloatArray:
    """Distance beside the predicted path: errors of v_y and yaw rate integrated by Simpson's rule.

    The yaw rate's error is a parabola over the time; its integral is the error of the course.
    """
    side = [half[:, 1], whole[:, 1]]
    turn = [half[:, 2], whole[:, 2]]
    course_half = seconds * (8.0 * turn[0] - turn[1]) / 24.0
    course_whole = seconds * (4.0 * turn[0] + turn[1]) / 6.0
    slip = [side[0] + v * course_half, side[1] + v * course_whole]
    return as_float64(seconds * (4.0 * slip[0] + slip[1]) / 6.0)


def _starts(driving: Driving, rate_hz: float, ahead: int, every: int) -> npt.NDArray[np.intp]:
    """Samples at which whole predictions begin, in the stretches of this rate."""
    out = [np.empty(0, dtype=np.intp)]
    firsts = begins(driving)
    for first, last in zip(firsts, [*firsts[1:], driving.samples], strict=True):
        if driving.sample_rate_hz[first] == rate_hz:
            out.append(np.arange(first, last - ahead, every, dtype=np.intp))
    return np.concatenate(out)
