"""Windows of a driving, each predicted from the motion that it begins with."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import groupby
from operator import itemgetter

import numpy as np
import numpy.typing as npt

from ... import _core
from ..._common.arrays import FloatArray, as_float64
from ...errors import InvalidInput
from ...estimate import Driving, turning
from ...model import Model

_MOST = 400  # windows
_BLOCK_S, _FEWEST = 10.0, 6  # windows of one such time are wrong alike; fewest such times
_TINY = 1e-300


Gains = tuple[_core.FrozenFilter, ...]


@dataclass(frozen=True)
class Windows:
    """Prediction errors over windows, whose mean square over a window and channel is near one.

    Logs have rates of their own: a window counts as one observation of each channel, however many
    samples it has.
    """

    problems: tuple[_core.Problem, ...]  # one for each length of windows
    units: tuple[float, ...]

    @property
    def samples(self) -> int:
        """Of all windows."""
        return sum(problem.samples for problem in self.problems)

    def freeze(self, p: FloatArray, noise: FloatArray) -> Gains:
        """The gains for each length of windows."""
        return tuple(problem.freeze(p, noise) for problem in self.problems)

    def _each(self, gains: Gains) -> Iterator[tuple[_core.Problem, float, _core.FrozenFilter]]:
        return zip(self.problems, self.units, gains, strict=True)

    def residuals(self, p: FloatArray, gains: Gains) -> FloatArray:
        """Shape (samples, channels)."""
        return np.vstack([one.residuals(p, g) / unit for one, unit, g in self._each(gains)])

    def sensitivities(self, p: FloatArray, gains: Gains, columns: list[int]) -> FloatArray:
        """Their derivatives by some parameters."""
        each = self._each(gains)
        return np.vstack([one.sensitivities(p, g, columns) / unit for one, unit, g in each])

    def half_sum_of_squares(self, p: FloatArray, gains: Gains) -> float:
        """Over all windows."""
        return sum(one.half_sum_of_squares(p, g) / unit**2 for one, unit, g in self._each(gains))

    def normal_equations(
        self, p: FloatArray, gains: Gains, columns: list[int]
    ) -> tuple[float, FloatArray, FloatArray]:
        """That sum, downhill, and the information, by some parameters."""
        cost, descent = 0.0, np.zeros(len(columns))
        information = np.zeros((len(columns), len(columns)))
        for one, unit, g in self._each(gains):
            own = one.normal_equations(p, g, columns)
            cost += own[0] / unit**2
            descent += own[1] / unit**2
            information += own[2] / unit**2
        return cost, descent, information


def windows_of(driving: Driving, horizon_s: float) -> list[tuple[int, int]]:
    """First sample and number of samples of windows that begin half a horizon apart."""
    found = []
    for first, end, rate in driving.spans:
        length = max(round(horizon_s * rate), 1) + 1
        found += [(k, length) for k in range(first, end - length + 1, max(length // 2, 1))]
    if not found:
        raise InvalidInput(
            f"horizon_s = {horizon_s:g}: no stretch of {driving} is as long; give a shorter one"
        )
    if len(found) <= _MOST:
        return found
    return [found[i] for i in np.linspace(0, len(found) - 1, _MOST).round().astype(int)]


def turns_of(driving: Driving, windows: list[tuple[int, int]]) -> npt.NDArray[np.bool_]:
    """In which windows the car turns half of the time; all, where it does in none."""
    turned = np.concatenate([[0], np.cumsum(turning(driving))])
    found = np.array([2 * (turned[at + size] - turned[at]) >= size for at, size in windows])
    return found if found.any() else ~found


def counting(
    driving: Driving,
    model: Model,
    windows: list[tuple[int, int]],
    told: FloatArray,
    square: float,
) -> Windows:
    """Windows, sorted by their length, of which the typical mean square is known."""
    alike = [(length, list(few)) for length, few in groupby(windows, key=itemgetter(1))]
    return Windows(
        tuple(driving.windows(model, few, told) for _, few in alike),
        tuple(float(np.sqrt(max(square * length, _TINY))) for length, _ in alike),
    )


def squares_of(errors: FloatArray, windows: list[tuple[int, int]]) -> FloatArray:
    """Mean square error of each window, over samples and channels that were measured."""
    begins = np.cumsum([0, *(size for _, size in windows[:-1])])
    sums = np.add.reduceat((errors**2).sum(axis=1), begins)
    counts = np.add.reduceat(np.count_nonzero(errors, axis=1), begins)
    return as_float64(sums / np.maximum(counts, 1))


def blocks_of(driving: Driving, windows: list[tuple[int, int]]) -> npt.NDArray[np.intp]:
    """For each window the number of its block, from zero on without gaps."""
    length = max(min(_BLOCK_S, driving.usable_s / _FEWEST) * driving.mean_rate_hz, 1.0)
    return np.unique([int(first / length) for first, _ in windows], return_inverse=True)[1]
