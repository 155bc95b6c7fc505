"""The samples of the validation data that the pictures of a report share."""

from __future__ import annotations

import json
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from .._common.arrays import FloatArray
from ..estimate import MEASURED
from ..study import Study, look_ahead
from .excerpt import Excerpt, worst_excerpt
from .words import shown_in, stages

_MOST = 1500  # samples of all the driving, and of the worst seconds
_OVAL = 0.15  # a track's smaller extent over its larger one, above which its map is worth a look


@dataclass(frozen=True, eq=False)
class Samples:
    """Columns of equal length, thinned outside the seconds in which the baseline is worst.

    Attributes
    ----------
    excerpt : Excerpt
        Those seconds.
    columns : dict of str to array, shape (n,)
        `t` [s], `d` (distance [m]), `run` (number of the stretch), `v`, `ay`, `ax`, `x`, `y` (the
        track [m]; NaN beside the stretch of the excerpt), `e0` and `e1` (running error of the
        baseline and the final model, in noise floors), `s0` and `s1` (mean square of the residuals
        of one sample); by channel `m.`, `p0.`, `p1.` (measured and predicted) and `r0.`, `r1.`
        (running size of the residuals).
    inside : array of bool, shape (n,)
        The seconds of the excerpt.
    has_track : bool
        Whether the track is worth a map.
    logs : tuple of str
        Name of the log of each stretch.
    """

    excerpt: Excerpt
    columns: dict[str, FloatArray]
    inside: npt.NDArray[np.bool_]
    has_track: bool
    logs: tuple[str, ...]

    @property
    def time_label(self) -> str:
        """Of an axis: clocks of several stretches tell nothing together."""
        return "time [s]" if len(self.logs) == 1 else "seconds driven"

    __iter__ = None  # numbers are no names

    def __getitem__(self, name: str) -> FloatArray:
        return self.columns[name]

    def range(self, *names: str, rows: npt.NDArray[np.bool_] | None = None) -> tuple[float, float]:
        """From the smallest to the largest value of some columns, and a little more."""
        both = np.concatenate(
            [self.columns[n] if rows is None else self.columns[n][rows] for n in names]
        )
        both = both[np.isfinite(both)]
        if not both.size:
            return 0.0, 1.0
        low, high = float(both.min()), float(both.max())
        return low - 0.04 * (high - low), high + 0.04 * (high - low)

    def json(self) -> str:
        """The columns for the page's script."""
        told: dict[str, list[float | int | None]] = {
            name: [None if not np.isfinite(v) else v for v in _rounded(name, column)]
            for name, column in self.columns.items()
        }
        told["selected"] = self.inside.astype(int).tolist()
        return json.dumps({**told, "logs": self.logs}, separators=(",", ":"), allow_nan=False)


def _rounded(name: str, column: FloatArray) -> list[float]:
    if name in ("t", "d", "x", "y"):
        return [round(v, 3) for v in column.tolist()]
    return [float(f"{v:.4g}") for v in column.tolist()]


def samples_of(study: Study) -> Samples | None:
    """Draw up the samples; None where no stretch is long enough to predict ahead."""
    excerpt = worst_excerpt(study)
    if excerpt is None:
        return None
    driving = study.validation
    begins = np.array([span.first for span in driving.spans])
    run = np.searchsorted(begins, np.arange(driving.samples), side="right") - 1
    step = 1.0 / driving.sample_rate_hz
    v, r, ax, ay = (driving.channel(c) for c in ("vx_mps", "yaw_rate_radps", "ax_mps2", "ay_mps2"))
    own = int(run[excerpt.where.start])
    track, has_track = _track(np.nan_to_num(v), np.nan_to_num(r), step, run == own)
    time = driving.channel("time_s")
    if len(begins) > 1:
        time = np.cumsum(step) - step[0]
    all_: dict[str, FloatArray] = {
        "t": time,
        "d": np.cumsum(np.nan_to_num(v) * step),
        "run": run.astype(float),
        "v": v,
        "ay": ay,
        "ax": ax,
        "x": track[:, 0],
        "y": track[:, 1],
    }
    thin = max(driving.samples // _MOST, 1)
    ends = np.zeros(driving.samples, dtype=bool)
    noise = study.fit.noise.floor()
    between = (study.fits[0], study.fit)
    for k, (title, i) in enumerate(stages(study)):
        residual = study.test[i].residual
        square, count = np.nan_to_num(residual) ** 2, np.isfinite(residual)
        all_[f"e{k}"] = _running(square.sum(axis=1), count.sum(axis=1), step, begins)
        all_[f"s{k}"] = square.sum(axis=1) / np.maximum(count.sum(axis=1), 1)
        for j, c in enumerate(MEASURED):
            if c in driving.present:
                all_[f"r{k}.{c}"] = _running(square[:, j], count[:, j], step, begins)
        apart = thin / max(excerpt.horizon_s * float(driving.sample_rate_hz.max()), 1.0)
        rough = look_ahead(
            study.fits[i], noise, driving, excerpt.horizon_s, apart=apart, between=between
        )
        for j, c in enumerate(excerpt.channels):
            factor, column = shown_in(c).factor, MEASURED.index(c)
            error = rough[:, column].copy()
            error[excerpt.where] = excerpt.errors[title][:, j]
            measured = driving.measured[:, column]
            all_[f"m.{c}"] = factor * measured
            all_[f"p{k}.{c}"] = factor * (measured - error)
            all_[f"d{k}.{c}"] = factor * error
        ends |= np.isfinite(rough).any(axis=1)
    keep = ends.copy()
    keep[excerpt.where] = False
    within = np.arange(excerpt.where.start, excerpt.where.stop)
    keep[within[:: max(len(within) // _MOST, 1)]] = True
    rows = np.flatnonzero(keep)
    logs = tuple(driving.logs[s.log].name for s in driving.stretches)
    inside = (rows >= excerpt.where.start) & (rows < excerpt.where.stop)
    return Samples(excerpt, {n: c[rows] for n, c in all_.items()}, inside, has_track, logs)


def _running(
    square: FloatArray, count: FloatArray, step: FloatArray, begins: npt.NDArray[np.intp]
) -> FloatArray:
    """Root mean square over half a second, stretch by stretch."""
    out = np.full(len(square), np.nan)
    for begin, end in zip(begins, [*begins[1:], len(square)], strict=True):
        box = np.ones(min(max(round(0.5 / step[begin]), 1), end - begin))
        sums = np.convolve(square[begin:end], box, "same")
        terms = np.convolve(count[begin:end].astype(float), box, "same")
        out[begin:end] = np.sqrt(sums / np.where(terms > 0.5, terms, np.nan))
    return out


def _track(
    v: FloatArray, yaw_rate: FloatArray, step: FloatArray, own: npt.NDArray[np.bool_]
) -> tuple[FloatArray, bool]:
    """Path of one stretch, its longer side upright, and whether it is worth a map."""
    track = np.full((len(v), 2), np.nan)
    heading = np.cumsum((yaw_rate * step)[own])
    moved = (v * step)[own, None] * np.column_stack([np.cos(heading), np.sin(heading)])
    path = np.cumsum(moved, axis=0)
    if np.ptp(path[:, 0]) > np.ptp(path[:, 1]):
        path = np.column_stack([-path[:, 1], path[:, 0]])
    track[own] = path
    extent = np.ptp(path, axis=0)
    return track, bool(extent[0] > _OVAL * extent[1])
