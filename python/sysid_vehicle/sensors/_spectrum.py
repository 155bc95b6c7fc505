"""What the spectrum of a channel's noise tells: the sensor's own low-pass, and vibration.

Above the frequencies at which a car moves a channel holds noise alone. White noise that went
through a low-pass shows the low-pass; a causal one of this magnitude delays slow motion by a known
time (it is of minimum phase: Oppenheim & Schafer, *Discrete-Time Signal Processing*, 3rd ed.,
sec. 5.6). Narrow lines above the noise are vibration.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt
import scipy

from .._arrays import FloatArray

_LOWEST_HZ: Final = 5.0  # the motion of a car has next to nothing beyond
_HIGHEST: Final = 0.45  # of the sampling rate
_WINDOW_S: Final = 2.0
_FEWEST_WINDOWS: Final = 8
_FALL: Final = 4.0  # of the power, from which noise is not white any more
_PLATEAU: Final = 1.5  # a low-pass is seen where it begins so far above the lowest frequency
_MISFIT: Final = 0.35  # mean |log| of power to the fitted one
_PEAK: Final = 6.0  # power above its neighbours that is vibration
_SIDES: Final = 1.1  # what of its sides is still vibration
_STEADY: Final = 2.0  # upper over lower quartile of the power over time; motion has ten and more
_EVEN: Final = 5  # frequencies over which skirts are smoothed
_LINE: Final = 8.0  # power above that of its surroundings that is a line
_SKIRT_HZ: Final = 2.5
_FEWEST_BESIDE: Final = 0.6  # share of the frequencies, free of lines, that shows a filter
_USUAL_DAMPING: Final = -0.35  # logarithm, of Butterworth's
_AFTER: Final = 0.02  # share of noise that comes after a filter, up to which the filter is told
_UNCORRELATED: Final = 0.15  # readings count as independent from this correlation down


@dataclass(frozen=True, eq=False)
class NoiseSpectrum:
    """Noise of one channel over frequency.

    Attributes
    ----------
    rate_hz : float
        Rate of the channel's own samples.
    frequency_hz, power, smooth : ndarray, shape (k,)
        One-sided power spectral density [unit^2/Hz], and that of the fitted noise without lines.
    corner_hz : float
        Of the sensor's low-pass; infinite where the noise is white.
    delay_s : float
        Of slow motion by that low-pass; 0 where none is told.
    every : int
        The readings of every so many samples are independent.
    """

    rate_hz: float
    frequency_hz: FloatArray
    power: FloatArray
    smooth: FloatArray
    corner_hz: float
    delay_s: float
    every: int

    @property
    def falls(self) -> bool:
        """Whether the noise is not white."""
        return bool(np.isfinite(self.corner_hz))

    @property
    def gain(self) -> FloatArray:
        """Factor at each frequency that takes vibration down to the noise beside it."""
        ratio = self.power / self.smooth
        over = (ratio > _PEAK) & (self.frequency_hz > _LOWEST_HZ)
        if not over.any():
            return np.ones(ratio.size)
        # From each peak on to both sides as far as the power stands out: what is left of its skirts
        # would be noise of a colour.
        even = np.exp(scipy.ndimage.uniform_filter1d(np.log(ratio), _EVEN, mode="nearest"))
        ratio = np.where(ratio > _PEAK, ratio, even)
        near = even > _SIDES
        labels, _ = scipy.ndimage.label(near | over)
        part = np.isin(labels, np.unique(labels[over])) & (self.frequency_hz > _LOWEST_HZ)
        return np.where(part, np.minimum(1.0, np.sqrt(1.0 / np.maximum(ratio, 1e-12))), 1.0)

    @property
    def vibration_hz(self) -> tuple[float, ...]:
        """Middle frequency of each line."""
        low = self.gain < 1.0
        labels, count = scipy.ndimage.label(low)
        centres = []
        for i in range(1, count + 1):
            at = labels == i
            centres.append(float(np.average(self.frequency_hz[at], weights=self.power[at])))
        return tuple(centres)


def noise_spectrum(values: FloatArray, rate_hz: float, floor: float = 0.0) -> NoiseSpectrum | None:
    """Spectrum of a channel's noise; None where the channel cannot tell it.

    It may be too short or too slow, or hold no noise: what comes and goes with the driving is
    motion.

    Parameters
    ----------
    values : ndarray, shape (n,)
        The channel's own samples, no gaps.
    rate_hz : float
        Their rate.
    floor : float
        Standard deviation of noise that comes after any filter, such as that of counting in quanta.
    """
    width = round(_WINDOW_S * rate_hz)
    if values.size < 0.5 * (_FEWEST_WINDOWS + 1) * width or _HIGHEST * rate_hz < 2.5 * _LOWEST_HZ:
        return None
    # The median of the windows, for a step or a kerb is no noise.
    f, power = scipy.signal.welch(
        values, rate_hz, window="hann", nperseg=width, detrend="linear", average="median"
    )
    power = np.maximum(power, 2.0 * max(floor, 1e-9 * float(np.std(values))) ** 2 / rate_hz * 0.1)
    inside = (f >= _LOWEST_HZ) & (f <= _HIGHEST * rate_hz)
    log_power = np.log(power[inside])
    beside = ~_near_lines(f[inside], log_power)
    if not _steady(values, rate_hz, width, np.flatnonzero(inside)[beside]):
        return None
    found = _white(log_power, beside)
    if np.mean(beside) > _FEWEST_BESIDE and _falls(log_power[beside]):
        found = _filtered(f[inside], log_power, beside, rate_hz)
    smooth = np.full(f.size, np.exp(found.level))
    smooth[inside] = np.exp(found.level + found.shape)
    smooth[f > _HIGHEST * rate_hz] = np.exp(found.level + found.shape[-1])
    every = _independent(smooth) if found.delay_s else 1
    return NoiseSpectrum(rate_hz, f, power, smooth, found.corner_hz, found.delay_s, every)


def _steady(values: FloatArray, rate_hz: float, width: int, at: npt.NDArray[np.intp]) -> bool:
    """Whether there is about as much power at all times."""
    _, _, power = scipy.signal.spectrogram(
        values, rate_hz, window="hann", nperseg=width, noverlap=width // 2, detrend="linear"
    )
    if not at.size:
        return False
    low, high = np.percentile(power[at].sum(axis=0), (25, 75))
    return bool(high < _STEADY * low)


@dataclass(frozen=True, eq=False)
class _Form:
    misfit: float
    level: float
    shape: FloatArray
    corner_hz: float = np.inf
    delay_s: float = 0.0


def _white(log_power: FloatArray, beside: npt.NDArray[np.bool_]) -> _Form:
    level = float(np.median(log_power[beside] if beside.any() else log_power))
    return _Form(_misfit(log_power - level), level, np.zeros(log_power.size))


def _falls(log_power: FloatArray) -> bool:
    quarter = max(log_power.size // 4, 1)
    low, high = np.median(log_power[:quarter]), np.median(log_power[-quarter:])
    return bool(low - high > np.log(_FALL))


def _near_lines(f: FloatArray, log_power: FloatArray) -> npt.NDArray[np.bool_]:
    """Frequencies about a line, whose skirts are no part of the noise."""
    wide = 2 * round(_SKIRT_HZ / (f[1] - f[0])) + 1
    around = scipy.ndimage.percentile_filter(log_power, 25, size=2 * wide + 1, mode="nearest")
    lines = f[log_power - around > np.log(_LINE)]
    near: npt.NDArray[np.bool_] = np.any(np.abs(f[:, None] - lines[None, :]) < _SKIRT_HZ, axis=1)
    return near


def _misfit(errors: FloatArray) -> float:
    return float(np.mean(np.abs(errors)))


def _filtered(
    f: FloatArray, log_power: FloatArray, beside: npt.NDArray[np.bool_], rate_hz: float
) -> _Form:
    """White noise through a low-pass of second order, with white noise that comes after it.

    Noise of the road falls as well, but only as far as the noise of the sensor allows; a filter
    takes its own sensor's noise down with everything else.
    """
    best = _white(log_power, beside)
    # A digital filter made by the bilinear transform sees the second instead of the frequency.
    for seen in (f, rate_hz / np.pi * np.tan(np.pi * f / rate_hz)):

        def shape(x: FloatArray, seen: FloatArray = seen) -> FloatArray:
            u = (seen / np.exp(x[0])) ** 2
            fall = (1.0 - u) ** 2 + 4.0 * np.exp(2.0 * x[2]) * u
            result: FloatArray = np.log(1.0 / fall + np.exp(x[1]))
            return result

        def cost(x: FloatArray, shape: Callable[[FloatArray], FloatArray] = shape) -> float:
            left = (log_power - shape(x))[beside]
            unlikely = 0.02 * (x[2] - _USUAL_DAMPING) ** 2 + 0.5 * max(0.0, x[1]) ** 2
            return _misfit(left - np.median(left)) + float(unlikely)

        for corner in (8.0, 14.0, 24.0):
            start = np.array([np.log(corner), -6.0, _USUAL_DAMPING])
            x = scipy.optimize.minimize(
                cost, start, method="Nelder-Mead", options={"xatol": 3e-3, "fatol": 1e-4}
            ).x
            form = shape(x)
            level = float(np.median((log_power - form)[beside]))
            misfit = _misfit((log_power - level - form)[beside])
            if misfit < best.misfit:
                corner_hz = float(np.exp(x[0]))
                told = (
                    misfit < _MISFIT
                    and corner_hz > _PLATEAU * _LOWEST_HZ
                    and np.exp(x[1]) < _AFTER
                    and form[0] - form[-1] > np.log(_FALL)
                )
                delay = 2.0 * float(np.exp(x[2])) / (2.0 * np.pi * corner_hz)
                best = _Form(misfit, level, form, corner_hz, delay if told else 0.0)
    return best


def _independent(power: FloatArray) -> int:
    """Samples from one reading to the next that is independent of it."""
    correlation = np.fft.irfft(power)
    correlation = np.abs(correlation[: correlation.size // 2] / correlation[0])
    later = np.maximum.accumulate(correlation[::-1])[::-1]
    return max(1, int(np.argmax(later < _UNCORRELATED)))
