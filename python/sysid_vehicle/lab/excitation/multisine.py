"""Several sines at once, with phases that keep the peaks low."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..._common.arguments import check_positive_fields
from ..._common.arrays import FloatArray, as_float64
from ..._common.typed import typed, typed_fields
from ...errors import InvalidInput

_ROUNDS = 400
_SAMPLES_PER_PERIOD = 32  # of the highest line


@dataclass(frozen=True)
class MultiSine:
    """A periodic curve of equal lines from one frequency to another, with a low crest factor.

    Phases begin as Schroeder's and are improved by clipping the peaks and giving the lines their
    sizes back, again and again.

    Parameters
    ----------
    peak : float
        Highest value, in the unit of the curve.
    period_s : float
        Period; lines stand at multiples of its inverse.
    from_hz, to_hz : float
        First and last line, within half a line's distance.

    Raises
    ------
    InvalidInput
        If no line lies between the frequencies, or a parameter is not positive.

    Notes
    -----
    Schroeder, IEEE Trans. Inf. Theory 16 (1970); Van der Ouderaa, Schoukens and Renneboog, IEEE
    Trans. Instrum. Meas. 37 (1988).
    """

    peak: float
    period_s: float
    from_hz: float
    to_hz: float
    _phase: FloatArray = field(init=False, repr=False, compare=False)
    _size: float = field(init=False, repr=False, compare=False)

    @typed_fields
    def __post_init__(self) -> None:
        check_positive_fields(self, "peak", "period_s", "from_hz", "to_hz")
        if self.from_hz > self.to_hz:
            raise InvalidInput(
                f"MultiSine: from_hz = {self.from_hz:g} lies above to_hz = {self.to_hz:g}; give "
                f"the lower frequency first"
            )
        if self.harmonics.size == 0:
            raise InvalidInput(
                f"MultiSine: a period of {self.period_s:g} s has no line from {self.from_hz:g} to "
                f"{self.to_hz:g} Hz; make the period longer"
            )
        phase, highest = _low_crest(self.harmonics)
        object.__setattr__(self, "_phase", phase)
        object.__setattr__(self, "_size", self.peak / highest)

    @property
    def harmonics(self) -> np.ndarray:
        """Numbers of the lines, as multiples of the inverse period."""
        first = max(1, round(self.from_hz * self.period_s))
        return np.arange(first, round(self.to_hz * self.period_s) + 1)

    @property
    def crest_factor(self) -> float:
        """Peak divided by root mean square; a single sine has 1.41."""
        return float(self.peak / (self._size * np.sqrt(0.5 * self.harmonics.size)))

    def __call__(self, time_s: FloatArray) -> FloatArray:
        """Values at these times."""
        value = np.zeros_like(time_s)
        for h, phase in zip(self.harmonics, self._phase, strict=True):
            value += np.cos(2.0 * np.pi * h * time_s / self.period_s + phase)
        return as_float64(self._size * value)

    @typed
    def integral(self, time_s: FloatArray) -> FloatArray:
        """Integral over time, with mean zero over a period."""
        value = np.zeros_like(time_s)
        for h, phase in zip(self.harmonics, self._phase, strict=True):
            omega = 2.0 * np.pi * h / self.period_s
            value += np.sin(omega * time_s + phase) / omega
        return as_float64(self._size * value)


def _low_crest(harmonics: np.ndarray) -> tuple[FloatArray, float]:
    """Phases of lines of size one that keep the peak low, and that peak."""
    count = harmonics.size
    n = 1 << int(np.ceil(np.log2(_SAMPLES_PER_PERIOD * (harmonics[-1] + 1))))
    index = np.arange(count)
    phase = -np.pi * index * (index + 1.0) / count
    best, lowest = phase, np.inf
    for turn in range(_ROUNDS):
        lines = np.zeros(n // 2 + 1, dtype=complex)
        lines[harmonics] = 0.5 * n * np.exp(1j * phase)
        signal = np.fft.irfft(lines, n)
        highest = float(np.abs(signal).max())
        if highest < lowest:
            best, lowest = phase, highest
        # Clipping begins hard and ends soft.
        level = highest * (0.80 + 0.19 * turn / _ROUNDS)
        phase = np.angle(np.fft.rfft(np.clip(signal, -level, level))[harmonics])
    return best, lowest
