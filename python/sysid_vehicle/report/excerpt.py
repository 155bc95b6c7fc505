"""The few seconds in which the baseline failed most."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._common.arrays import FloatArray
from ..estimate import MEASURED
from ..estimate.driving import Stretch
from ..identify import driving_of
from ..study import Study, look_ahead
from .words import stages

_SHOWN = ("yaw_rate_radps", "ay_mps2")
_FORGETS_S = 5.0


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
    where : slice
        Of the samples of the validation data.
    time_s : array, shape (n,)
    measured : array, shape (n, channels)
    errors : dict of array, shape (n, channels)
        Measurement less prediction, by model.
    """

    log: str
    horizon_s: float
    channels: tuple[str, ...]
    where: slice
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
    measured = driving.measured[:, columns]
    noise = study.fit.noise.floor()
    if not channels:
        return None
    # To find the place predictions that begin a tenth of their length apart will do.
    between = (study.fits[0], study.fit)
    rough = look_ahead(study.fits[0], noise, driving, horizon_s, apart=0.1, between=between)
    rough = rough[:, columns]
    scale = np.nanstd(measured, axis=0)
    badness = np.nansum((rough / np.where(scale > 0.0, scale, 1.0)) ** 2, axis=1)
    best: tuple[float, int, int, Stretch, int] | None = None
    for s, (begin, end, rate) in zip(driving.stretches, driving.spans, strict=True):
        first = begin + round(horizon_s * rate)
        width = min(int(seconds * rate), end - first)
        if width >= 2:
            total = np.convolve(badness[first:end], np.ones(width), "valid")
            at = first + int(np.argmax(total))
            if best is None or total.max() / width > best[0]:
                best = (float(total.max()) / width, at, width, s, begin)
    if best is None:
        return None
    _, at, width, stretch, begin = best
    log, where = driving.logs[stretch.log], slice(at, at + width)
    # The filter forgets where it began within a few seconds.
    start = stretch.where.start + at - begin
    before = start - round((_FORGETS_S + horizon_s) * log.rate_hz)
    first = max(before, stretch.where.start)
    # Some samples more: what comes before and after takes noise out of inputs, and tells slopes.
    part = slice(first, min(start + width + round(log.rate_hz), stretch.where.stop))
    shown = slice(start - first, start - first + width)
    errors = {}
    for title, i in stages(study):
        # Offsets are those of the whole log: a few seconds would take up every error.
        near = driving_of(study.fits[i], driving).only(Stretch(stretch.log, part))
        ahead = look_ahead(study.fits[i], noise, near, horizon_s, between=between)
        errors[title] = ahead[shown, columns]
    return Excerpt(
        log.name,
        horizon_s,
        channels,
        where,
        driving.channel("time_s")[where],
        measured[where],
        errors,
    )
