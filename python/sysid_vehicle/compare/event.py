"""One moment that holds most of a model's error, as something outside the model happened there.

A kerb, a contact, a hand brake or a jump of a sensor leaves most of its error in less time than
any disturbance that is learned may last. What a model lacks errs wherever it acts: of drives with a
missing effect no second holds more than a part of the error. Three questions, of the second with
the largest error above the noise floor:

- Is its part of the squared error worth telling?
- Does it hold more of what lies above the floor than all other driving together?
- Is that more than chance? Forces that a model lacks grow with what the driver asks of the car.
  Were these all, the energy of the error in second i would be exponential (two degrees of freedom)
  with a mean in proportion to q_i, the energy of his commands there. One second w would then hold
  r times what all others hold with probability prod_i 1 / (1 + r q_i / q_w); for equal q_i this is
  Fisher's test of the largest share (Proc. R. Soc. A 125, 1929). It is added up over all places of
  w. So a log of a single manoeuvre, with all of its error in that, has no event.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from .._common.arrays import FloatArray, as_float64, filled
from .._common.text import number
from ..estimate import Driving
from ..log import LEAST_STRETCH_S, Log
from ..rules import USUAL


@dataclass(frozen=True)
class Event:
    """Where most of the error of some driving lies.

    Attributes
    ----------
    log : str
        Name of the log.
    from_s, until_s : float
        First and last sample of it, in that log.
    share : float
        Of the squared error above the noise floor, of all the driving.
    error : float
        Root mean square of the normalised residual there; 1 is the noise floor.
    remedy : str
        How to leave it out, in words.
    """

    log: str
    from_s: float
    until_s: float
    share: float
    error: float
    remedy: str

    def of(self, data: str) -> str:
        """The finding of some data, in a sentence or two."""
        return self._said(f" of the {data}")

    def __str__(self) -> str:
        return self._said("")

    def _said(self, of: str) -> str:
        begin, end = _told(self.from_s, self.until_s)
        return (
            f"{100 * self.share:.0f} % of the squared error{of} above the noise floor lies in "
            f"{number(end - begin, 2)} s of '{self.log}', {begin:.1f} to {end:.1f} s "
            f"({number(self.error, 3)} times the floor there). Look at what happened then, or "
            f"leave these seconds out: {self.remedy}."
        )

    def to_dict(self) -> dict[str, Any]:
        """All figures, ready for JSON."""
        return asdict(self)

    @classmethod
    def of_driving(
        cls, driving: Driving, squares: FloatArray, count: FloatArray, longest_s: float
    ) -> Event | None:
        """Find the event of some driving; None where the error is spread as driving is.

        Parameters
        ----------
        driving : Driving
        squares, count : array, shape (n,)
            Sum and number of the squares of each sample's whitened residuals at the noise floor.
        longest_s : float
            Of a moment: the longest that a disturbance may last.
        """
        above = squares - count
        held, span, window = max(_fullest(driving, above, longest_s), key=lambda w: w[0])
        if not squares[window].sum() > USUAL.taken * squares.sum():
            return None
        starts = _blocks(driving, longest_s)
        elsewhere = np.maximum(_outside(above, window, starts), 0.0).sum()
        if not held > elsewhere:
            return None
        energy = _commands(driving)
        # What a car does now it was told up to a moment ago.
        before = slice(max(2 * window.start - window.stop, span), window.stop)
        with np.errstate(divide="ignore"):
            odds = held / (elsewhere * energy[before].sum())
        others = _outside(energy, window, starts)
        chance = -np.log1p(odds * others[others > 0.0]).sum()
        if not math.log(driving.samples) + chance <= math.log(USUAL.level):
            return None
        inside = _likeliest(driving, squares, count, window)
        held = above[inside].sum()
        elsewhere = np.maximum(_outside(above, inside, starts), 0.0).sum()
        log = driving.logs[int(driving.log_number[inside.start])]
        time = driving.channel("time_s")[inside]
        return cls(
            log.name,
            float(time[0]),
            float(time[-1]),
            float(held / (held + elsewhere)),
            float(np.sqrt(squares[inside].sum() / count[inside].sum())),
            _remedy(log, *_told(float(time[0]), float(time[-1]))),
        )


def _fullest(
    driving: Driving, above: FloatArray, longest_s: float
) -> Iterator[tuple[float, int, slice]]:
    """In each stretch the window with the largest sum, that sum, and where the stretch begins."""
    for first, end, rate in driving.spans:
        width = min(_width(longest_s, rate), end - first)
        sums = np.concatenate([[0.0], np.cumsum(above[first:end])])
        sums = sums[width:] - sums[:-width]
        at = first + int(np.argmax(sums))
        yield float(sums.max()), first, slice(at, at + width)


def _width(seconds: float, rate_hz: float) -> int:
    return max(round(seconds * rate_hz), 1)


def _blocks(driving: Driving, seconds: float) -> npt.NDArray[np.intp]:
    """First samples of the blocks of that length of which each stretch consists."""
    return np.concatenate(
        [np.arange(first, end, _width(seconds, rate)) for first, end, rate in driving.spans]
    )


def _outside(values: FloatArray, window: slice, starts: npt.NDArray[np.intp]) -> FloatArray:
    """Sums over blocks, without what lies in the window."""
    values = values.copy()
    values[window] = 0.0
    return as_float64(np.add.reduceat(values, starts))


def _commands(driving: Driving) -> FloatArray:
    """Energy of what the driver asks of the car, sideways and along it, by sample.

    Of commands, not of the motion: an event moves the car too. Both have the same weight.
    """
    steer, along = driving.inputs().T
    asked = (steer * filled(driving.channel("vx_mps")) ** 2, along)
    energy = np.zeros(driving.samples)
    for values in asked:
        squares = (values - np.median(values)) ** 2
        energy += squares / max(float(squares.sum()), 1e-300)
    return energy


def _likeliest(driving: Driving, squares: FloatArray, count: FloatArray, window: slice) -> slice:
    """The likeliest samples, near a window, to have its mean square, and not that of the others."""
    high = squares[window].sum() / count[window].sum()
    low = (squares.sum() - squares[window].sum()) / (count.sum() - count[window].sum())
    gain = (1.0 / low - 1.0 / high) * squares - np.log(high / low) * count
    first, end = next((a, b) for a, b, _ in driving.spans if a <= window.start < b)
    sums = np.concatenate([[0.0], np.cumsum(gain[first:end])])
    stop = int(np.argmax(sums - np.minimum.accumulate(sums)))
    begin = int(np.argmin(sums[:stop]))
    return slice(first + begin, first + stop)


def _told(begin: float, end: float) -> tuple[float, float]:
    """Times as they are printed: the tenths of a second before and after, as ends count."""
    before, after = (round(10.0 * t, 6) for t in (begin, end))
    return (math.ceil(before) - 1) / 10.0, (math.floor(after) + 1) / 10.0


def _remedy(log: Log, begin: float, end: float) -> str:
    first, last = (round(float(t), 1) for t in log["time_s"][[0, -1]])
    parts = ((first, begin), (end, last))
    kept = [f"`log.between({a:.6g}, {b:.6g})`" for a, b in parts if b - a >= LEAST_STRETCH_S]
    if not kept:
        return "take the other logs"
    return f"take {' and '.join(kept)} in place of that log, or a file without these rows"
