"""The spectrum of a channel above the frequencies at which a car moves.

What is there is noise of the sensor and of the road, narrow lines of vibration and the colour that
a sensor's own low-pass gives to all of them; `_low_pass` tells them apart.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt
import scipy

from ..._common.arrays import FloatArray, as_float64

LOWEST_HZ: Final = 5.0  # the motion of a car has next to nothing beyond
_HIGHEST: Final = 0.45  # of the sampling rate
_WINDOW_S: Final = 2.0
_FEWEST_WINDOWS: Final = 8
_FEWEST: Final = 10  # frequencies beside lines
_PEAK: Final = 6.0  # power above its neighbours that is vibration
_SIDES: Final = 1.1  # what of its sides is still vibration
_STEADY: Final = 2.0  # upper over lower quartile of the power over time; motion has ten and more
_EVEN: Final = 5  # frequencies over which skirts are smoothed
_LINE: Final = 8.0  # power above that on both sides that is a line
_ABOVE: Final = 2.0  # and above the higher side: a slope is no line
_NEAR_HZ, _FAR_HZ = 1.5, 2.5  # where the sides of a line are
_CORE_HZ: Final = 1.3  # about a line the window's own width tells nothing else
# Readings of a periodogram that count as independent: windows of Hann overlap by half, neighbouring
# frequencies share power, and the median of windows is known less well than the mean.
_OF_WINDOWS, _OF_FREQUENCIES, _OF_MEDIAN = 0.947, 0.515, 1.0 / 2.08


@dataclass(frozen=True, eq=False)
class Spectrum:
    """Power of one channel over frequency, as it was recorded.

    Attributes
    ----------
    rate_hz : float
        Rate of the channel's own samples.
    rows_hz : float
        Rate of the log; the sensor may have filtered at it before samples were left out.
    frequency_hz, power : ndarray, shape (k,)
        One-sided power spectral density [unit^2/Hz], median over windows.
    used : ndarray of bool, shape (k,)
        Frequencies that tell of noise: above those of the motion, beside lines.
    lines_hz : tuple of float
        Where lines stand out.
    floor : float
        Power of counting in quanta, white and after any filter.
    weight : float
        Number of independent values that each frequency stands for.
    """

    rate_hz: float
    rows_hz: float
    frequency_hz: FloatArray
    power: FloatArray
    used: npt.NDArray[np.bool_]
    lines_hz: tuple[float, ...]
    floor: float
    weight: float

    @property
    def independent(self) -> float:
        """Share of the frequencies that are independent of each other, times their number."""
        return _OF_FREQUENCIES * float(np.count_nonzero(self.used))


@dataclass(frozen=True, eq=False)
class NoiseSpectrum:
    """Noise of one channel over frequency.

    Attributes
    ----------
    rate_hz : float
        Rate of the channel's own samples.
    frequency_hz, power, smooth : ndarray, shape (k,)
        One-sided power spectral density [unit^2/Hz], and that of the fitted noise without lines.
    """

    rate_hz: float
    frequency_hz: FloatArray
    power: FloatArray
    smooth: FloatArray

    @property
    def gain(self) -> FloatArray:
        """Factor at each frequency that takes vibration down to the noise beside it."""
        ratio = self.power / self.smooth
        over = (ratio > _PEAK) & (self.frequency_hz > LOWEST_HZ)
        if not over.any():
            return np.ones(ratio.size)
        # From each peak on to both sides as far as the power stands out: what is left of its skirts
        # would be noise of a colour.
        even = np.exp(scipy.ndimage.uniform_filter1d(np.log(ratio), _EVEN, mode="nearest"))
        ratio = np.where(ratio > _PEAK, ratio, even)
        near = even > _SIDES
        labels, _ = scipy.ndimage.label(near | over)
        part = np.isin(labels, np.unique(labels[over])) & (self.frequency_hz > LOWEST_HZ)
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


def spectrum_of(
    values: FloatArray, rate_hz: float, rows_hz: float, quantum: float = 0.0
) -> Spectrum | None:
    """Spectrum of a channel; None where it is too short or too slow.

    Parameters
    ----------
    values : ndarray, shape (n,)
        The channel's own samples, no gaps.
    rate_hz, rows_hz : float
        Their rate, and that of the log's rows.
    quantum : float
        Step in which the channel counts.
    """
    width = round(_WINDOW_S * rate_hz)
    if values.size < 0.5 * (_FEWEST_WINDOWS + 1) * width or _HIGHEST * rate_hz < 2.5 * LOWEST_HZ:
        return None
    # The median of the windows, for a step or a kerb is no noise.
    each = _of_windows(values, rate_hz, width)
    f = as_float64(np.fft.rfftfreq(width, 1.0 / rate_hz))
    power = as_float64(np.median(each, axis=0) / _bias(len(each)))
    power = np.maximum(power, 0.2 * (1e-9 * float(np.std(values))) ** 2 / rate_hz + 1e-300)
    used = (f >= LOWEST_HZ) & (f <= _HIGHEST * rate_hz)
    lines = _lines(f, power)
    for line in lines:
        used &= np.abs(f - line) > _CORE_HZ
    if np.count_nonzero(used) < _FEWEST:
        return None
    windows = values.size // (width // 2) - 1
    weight = windows * _OF_WINDOWS * _OF_FREQUENCIES * _OF_MEDIAN
    floor = quantum**2 / 6.0 / rate_hz
    return Spectrum(rate_hz, rows_hz, f, power, used, lines, floor, weight)


def steady(values: FloatArray, spectrum: Spectrum, smooth: FloatArray) -> bool:
    """Whether there is about as much noise at all times: what comes and goes is motion.

    Parameters
    ----------
    values : ndarray, shape (n,)
        The channel's own samples.
    spectrum : Spectrum
        Of them.
    smooth : ndarray, shape (k,)
        Power of the fitted noise, by which every frequency counts as much.
    """
    width = round(_WINDOW_S * spectrum.rate_hz)
    at = spectrum.used
    if not at.any():
        return False
    power = _of_windows(values, spectrum.rate_hz, width)
    low, high = np.percentile((power[:, at] / smooth[at]).sum(axis=1), (25, 75))
    return bool(high < _STEADY * low)


def _of_windows(values: FloatArray, rate_hz: float, width: int) -> FloatArray:
    """Power density in windows that overlap by half, (windows, frequencies).

    Each is one-sided, without its straight line, by Hann's window: what `scipy.signal.welch` takes
    the median of, all windows at once.
    """
    windows = np.lib.stride_tricks.sliding_window_view(values, width)[:: width - width // 2]
    line = np.linalg.qr(np.column_stack([np.ones(width), np.arange(width)]))[0]
    shape = scipy.signal.get_window("hann", width)
    bent = (windows - (windows @ line) @ line.T) * shape
    power = np.abs(np.fft.rfft(bent, axis=1)) ** 2 / (rate_hz * float(shape @ shape))
    power[:, 1 : (width + 1) // 2] *= 2.0  # the other side; Nyquist's frequency has none
    return as_float64(power)


def _bias(count: int) -> float:
    """Median over the mean of so many exponential numbers (B. Allen et al., gr-qc/0509116)."""
    even = 2.0 * np.arange(1, (count - 1) // 2 + 1)
    return 1.0 + float(np.sum(1.0 / (even + 1.0) - 1.0 / even))


def _lines(f: FloatArray, power: FloatArray) -> tuple[float, ...]:
    """Frequencies that stand out from both their sides."""
    log_power = np.log(power)
    near, far = round(_NEAR_HZ / f[1]), round(_FAR_HZ / f[1])
    padded = np.pad(log_power, far, mode="reflect", reflect_type="odd")
    below, above = (
        np.mean([np.roll(padded, sign * k) for k in range(near, far + 1)], axis=0)[far:-far]
        for sign in (1, -1)
    )
    over = log_power - 0.5 * (below + above) > np.log(_LINE)
    over &= log_power - np.maximum(below, above) > np.log(_ABOVE)
    over &= (f >= LOWEST_HZ) & (f <= _HIGHEST / 0.5 * f[-1])
    labels, count = scipy.ndimage.label(over)
    return tuple(
        float(np.average(f[labels == i], weights=power[labels == i])) for i in range(1, count + 1)
    )
