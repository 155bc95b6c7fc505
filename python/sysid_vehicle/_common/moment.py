"""One moment that holds most of an error.

Three questions, of the time with the largest error above the noise floor:

- Is its part of the squared error worth telling?
- Does it hold more of what lies above the floor than all other driving together?
- Is that more than chance? What is not known of a car errs as the driver moves it. Were that all,
  the energy of the error in block i would be exponential (two degrees of freedom) with a mean in
  proportion to q_i, the energy of his commands there. One block w would then hold r times what all
  others hold with probability prod_i 1 / (1 + r q_i / q_w); for equal q_i this is Fisher's test of
  the largest share (Proc. R. Soc. A 125, 1929). It is added up over all places of w. So a log of a
  single manoeuvre, with all of its error in that, has no such moment.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from .arrays import FloatArray, as_float64

Span = tuple[int, int, float]  # first sample of uninterrupted driving, end, rate [Hz]


class Moment(NamedTuple):
    """Where most of an error lies.

    Attributes
    ----------
    inside : slice
        Samples.
    share : float
        Of the squared error above the noise floor.
    """

    inside: slice
    share: float


def moment_of(
    squares: FloatArray,
    count: FloatArray,
    energy: FloatArray,
    spans: Sequence[Span],
    *,
    longest_s: float,
    least: float,
    level: float,
    known_floor: bool = True,
) -> Moment | None:
    """Find the moment; None where the error is spread as driving is.

    Parameters
    ----------
    squares, count : array, shape (n,)
        Sum and number of the squares of each sample's errors at the noise floor.
    energy : array, shape (n,)
        Of the driver's commands.
    spans : sequence of (int, int, float)
        Uninterrupted driving.
    longest_s : float
        Of a moment.
    least : float
        Part of the squared error that is worth telling.
    level : float
        At which chance is refused.
    known_floor : bool
        Otherwise every block may be off it by the standard deviation of as many squares.
    """
    above = squares - count
    held, span, window = max(_fullest(spans, above, longest_s), key=lambda w: w[0])
    if not squares[window].sum() > least * squares.sum():
        return None
    starts = _blocks(spans, longest_s)
    scatter = 0.0 if known_floor else np.sqrt(2.0 * _outside(count, window, starts))
    elsewhere = np.maximum(_outside(above, window, starts), scatter).sum()
    if not held > elsewhere:
        return None
    # What a car does now it was told up to a moment ago.
    before = slice(max(2 * window.start - window.stop, span), window.stop)
    with np.errstate(divide="ignore"):
        odds = held / (elsewhere * energy[before].sum())
    others = _outside(energy, window, starts)
    chance = -np.log1p(odds * others[others > 0.0]).sum()
    if not math.log(len(squares)) + chance <= math.log(level):
        return None
    inside = _likeliest(spans, squares, count, window)
    held = above[inside].sum()
    elsewhere = np.maximum(_outside(above, inside, starts), 0.0).sum()
    return Moment(inside, float(held / (held + elsewhere)))


def commands(steer: FloatArray, vx: FloatArray, along: FloatArray) -> FloatArray:
    """Energy of what the driver asks of the car, sideways and along it, by sample.

    Of commands, not of the motion: an event moves the car too. Both have the same weight.
    """
    energy = np.zeros(len(steer))
    for values in (steer * vx**2, along):
        squares = (values - np.median(values)) ** 2
        energy += squares / max(float(squares.sum()), 1e-300)
    return energy


def _fullest(
    spans: Sequence[Span], above: FloatArray, longest_s: float
) -> Iterable[tuple[float, int, slice]]:
    """In each stretch the window with the largest sum, that sum, and where the stretch begins."""
    for first, end, rate in spans:
        width = min(_width(longest_s, rate), end - first)
        sums = np.concatenate([[0.0], np.cumsum(above[first:end])])
        sums = sums[width:] - sums[:-width]
        at = first + int(np.argmax(sums))
        yield float(sums.max()), first, slice(at, at + width)


def _width(seconds: float, rate_hz: float) -> int:
    return max(round(seconds * rate_hz), 1)


def _blocks(spans: Sequence[Span], seconds: float) -> npt.NDArray[np.intp]:
    """First samples of the blocks of that length of which each stretch consists."""
    return np.concatenate(
        [np.arange(first, end, _width(seconds, rate)) for first, end, rate in spans]
    )


def _outside(values: FloatArray, window: slice, starts: npt.NDArray[np.intp]) -> FloatArray:
    """Sums over blocks, without what lies in the window."""
    values = values.copy()
    values[window] = 0.0
    return as_float64(np.add.reduceat(values, starts))


def _likeliest(
    spans: Sequence[Span], squares: FloatArray, count: FloatArray, window: slice
) -> slice:
    """The likeliest samples, near a window, to have its mean square, and not that of the others."""
    high = squares[window].sum() / count[window].sum()
    low = (squares.sum() - squares[window].sum()) / (count.sum() - count[window].sum())
    gain = (1.0 / low - 1.0 / high) * squares - np.log(high / low) * count
    first, end = next((a, b) for a, b, _ in spans if a <= window.start < b)
    sums = np.concatenate([[0.0], np.cumsum(gain[first:end])])
    stop = int(np.argmax(sums - np.minimum.accumulate(sums)))
    begin = int(np.argmin(sums[:stop]))
    return slice(first + begin, first + stop)
