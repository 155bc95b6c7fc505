"""Errors some seconds ahead beyond the noise of the sensors, and what takes them away."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..._common.arguments import generator
from ..._common.arrays import FloatArray, as_float64, in_turn, mean_of_known, median_of_known
from ...estimate import Driving
from ...identify import Fit
from ...rules import UNKNOWN, Share, share_of
from .fitted_range import Bools
from .horizons import squares_ahead
from .where_models_differ import apart

_DRAWS = 300


@dataclass(frozen=True)
class Beyond:
    """Errors some seconds ahead beyond the noise of the sensors, in one number for each model.

    Attributes
    ----------
    squares : tuple of float
        Mean over channels and horizons of the square of the median error, less that of the
        sensor noise, over the square of the first model's error.
    share, low, high : float
        Of the first one's, what the last model takes away; 95 % interval from draws of the blocks.
    within : float
        Share of the driving in which no slip angle is larger than those that were fitted.
    """

    squares: tuple[float, ...]
    share: float
    low: float
    high: float
    within: float = 1.0

    def __str__(self) -> str:
        # What grows is not taken away: how many times it grows is another figure.
        share, low, high = (f"{100 * max(x, 0.0):.0f}" for x in (self.share, self.low, self.high))
        return f"{share} % ({low} to {high})"

    def to_dict(self) -> dict[str, float]:
        """Share, interval, and of how much of the driving, ready for JSON."""
        figures = {"share": self.share, "low": self.low, "high": self.high}
        return {**figures, "within_fitted_range": self.within}


_UNSEEN = Beyond((0.0, 0.0), 1.0, 0.0, 1.0)


def beyond_noise(
    fits: Sequence[Fit],
    driving: Driving,
    horizons_s: Sequence[float],
    *,
    counted: Bools | None = None,
    seed: int = 0,
) -> Beyond:
    """Work out what errors some seconds ahead are beyond the noise of the sensors.

    Parameters
    ----------
    fits : sequence of Fit
        The last one's noise starts every prediction.
    driving : Driving
    horizons_s : sequence of float
    counted : array of bool, shape (horizons, samples), optional
        Predictions that count, by the sample at which they end; by default all.
    seed : int
        Of the draws.
    """
    squares, sensor, seen = squares_ahead(fits, driving, horizons_s, counted)
    if not seen.any():  # too short for any prediction
        return replace(_UNSEEN, squares=(0.0,) * len(fits))
    noise = as_float64(np.broadcast_to(sensor**2, seen.shape)[seen])
    return _taken(squares[:, :, seen], noise, seed)


def own_share(
    without: Fit,
    final: Fit,
    driving: Driving,
    horizons_s: Sequence[float],
    *,
    channels: Collection[str] = (),
    counted: Bools | None = None,
    seed: int = 0,
) -> Share:
    """Work out what a model takes off the errors of one that lacks a part of it.

    Where the two predict something else (`apart`), and block against block, so that neither counts
    more for driving that it loses: mean over channels and horizons of the median over blocks of
    what is taken off beyond the noise of the sensors, over the larger of the two squares. With a
    95 % interval from draws of the blocks.

    Parameters
    ----------
    without, final : Fit
        The latter's noise starts every prediction.
    driving : Driving
    horizons_s : sequence of float
    channels : collection of str
        Those that count; by default, and where none of them is predicted, all.
    counted : array of bool, shape (horizons, samples), optional
        As for `beyond_noise`.
    seed : int
        Of the draws.
    """
    squares, noise = apart(without, final, driving, horizons_s, channels, counted)
    if not squares.size:
        return UNKNOWN
    beyond = np.maximum(squares - noise, 0.0)
    with np.errstate(invalid="ignore", divide="ignore"):
        each = (beyond[0] - beyond[1]) / np.max(squares, axis=0)

    def mean(rows: FloatArray) -> FloatArray:  # (draws, blocks, errors)
        return mean_of_known(median_of_known(rows, axis=-2), axis=-1)

    draws = generator(seed).integers(0, len(each), (_DRAWS, len(each)))
    # A draw in which the models differ nowhere tells nothing for the effect.
    found = np.nan_to_num(in_turn(lambda d: mean(each[d]), draws))
    low, high = np.quantile(found, (0.025, 0.975))
    return Share(float(mean(each[None])[0]), float(low), float(high))


def taken_of(
    first: Fit,
    last: Fit,
    driving: Driving,
    horizons_s: Sequence[float],
    channels: Collection[str],
    *,
    counted: Bools | None = None,
    seed: int = 0,
) -> Beyond:
    """Work out what a model takes off the errors of the baseline in some channels.

    Where the two predict something else: as `beyond_noise` of these alone.

    Parameters
    ----------
    first, last : Fit
        The latter's noise starts every prediction.
    driving : Driving
    horizons_s : sequence of float
    channels : collection of str
        Those that count; where none of them is predicted, all.
    counted : array of bool, shape (horizons, samples), optional
        As for `beyond_noise`.
    seed : int
        Of the draws.
    """
    squares, noise = apart(first, last, driving, horizons_s, channels, counted)
    if not squares.size:
        return _UNSEEN
    return _taken(squares, noise, seed)


def _taken(squares: FloatArray, noise: FloatArray, seed: int) -> Beyond:
    """Of squares (models, blocks, errors)."""
    whole = _beyond(squares, noise)
    draws = generator(seed).integers(0, squares.shape[1], (_DRAWS, squares.shape[1]))
    shares = [_share(b) for b in in_turn(lambda d: _beyond(squares[:, d], noise), draws)]
    low, high = np.quantile(shares, (0.025, 0.975))
    return Beyond(tuple(map(float, whole)), _share(whole), float(low), float(high))


def _beyond(squares: FloatArray, noise: FloatArray) -> FloatArray:
    """Of squares (models, ..., blocks, errors), (..., models)."""
    middle = median_of_known(squares, axis=-2)
    with np.errstate(invalid="ignore", divide="ignore"):
        ratio = np.maximum(middle - noise, 0.0) / middle[0]
    means = np.nan_to_num(ratio, nan=0.0, posinf=0.0).mean(axis=-1)
    return as_float64(np.moveaxis(means, 0, -1))


def _share(squares: FloatArray) -> float:
    return share_of(float(squares[0]), float(squares[-1]))
