"""The few seconds in which the baseline failed most."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._arrays import FloatArray
from ..estimate import MEASURED
from ..study import Study, look_ahead
from .words import stages

__all__ = ["Excerpt", "worst_excerpt"]

_SHOWN = ("yaw_rate_radps", "ay_mps2")


@dataclass(frozen=True, eq=False)
class Excerpt:
    """Measured channels over some seconds, and how far each model's predictions were off.

    Attributes
    ----------
    log : str
        Name of the log.
    horizon_s : float
        How far ahead was predicted, from what the filter knew by then and the inputs since.
    channels : tuple of str
    time_s : array, shape (n,)
    measured : array, shape (n, channels)
    errors : dict of array, shape (n, channels)
        Measurement less prediction, by model.
    """

    log: str
    horizon_s: float
    channels: tuple[str, ...]
    time_s: FloatArray
    measured: FloatArray
    errors: dict[str, FloatArray]


def worst_excerpt(study: Study, *, seconds: float = 6.0, horizon_s: float = 0.5) -> Excerpt | None:
    """Find the part of the validation data in which the baseline predicted worst.

    Returns None if no stretch is long enough to predict that far.
    """
    driving = study.validation
    channels = tuple(c for c in _SHOWN if c in driving.present)
    columns = [MEASURED.index(c) for c in channels]
    errors = {
        title: look_ahead(study.fits[i], study.fit.noise.floor(), driving, horizon_s)[:, columns]
        for title, i in stages(study)
    }
    measured = driving.measured[:, columns]
    scale = np.nanstd(measured, axis=0)
    badness = np.nansum((errors["baseline"] / np.where(scale > 0.0, scale, 1.0)) ** 2, axis=1)
    best: tuple[float, slice, str] | None = None
    begin = 0
    for s in driving.stretches:
        log = driving.logs[s.log]
        n = s.where.stop - s.where.start
        first = begin + round(horizon_s * log.rate_hz)
        end, begin = begin + n, begin + n
        width = min(int(seconds * log.rate_hz), end - first)
        if width < 2:
            continue
        total = np.convolve(badness[first:end], np.ones(width), "valid")
        at = first + int(np.argmax(total))
        if best is None or total.max() / width > best[0]:
            best = (float(total.max()) / width, slice(at, at + width), log.name)
    if best is None or not channels:
        return None
    _, where, name = best
    return Excerpt(
        name,
        horizon_s,
        channels,
        driving.channel("time_s")[where],
        measured[where],
        {title: e[where] for title, e in errors.items()},
    )
