"""Spectra of known form: noise of sensor and road, vibration, and what a low-pass makes of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from ..._common.arrays import FloatArray
from .spectrum import LOWEST_HZ, Spectrum

_ROAD_HZ: Final = (3.0, 8.0)  # corners of noise that falls by 6 dB per octave
_ROAD_POWERS: Final = (4, 6)  # of noise that falls faster
ROAD: Final = slice(1, 1 + len(_ROAD_HZ) + len(_ROAD_POWERS))  # parts that are road and motion
_FOLDS: Final = (-2, -1, 1, 2)


@dataclass(frozen=True)
class Response:
    """Low-pass of second order.

    Attributes
    ----------
    corner_hz, damping : float
        Of the filter; of a digital one as its bilinear transform sees them.
    after : float
        White noise that comes after it, as a share of that before.
    digital : bool
        Whether it works on samples at the rate of the log.
    """

    corner_hz: float
    damping: float
    after: float
    digital: bool

    @property
    def delay_s(self) -> float:
        """Of slow motion."""
        return self.damping / (np.pi * self.corner_hz)

    def power(self, frequency_hz: FloatArray, rows_hz: float) -> FloatArray:
        """Factor on the power at each frequency."""
        u = self._over_corner(frequency_hz, rows_hz) ** 2
        result: FloatArray = 1.0 / ((1.0 - u) ** 2 + 4.0 * self.damping**2 * u)
        return result

    def turned(self, frequency_hz: FloatArray, rows_hz: float) -> FloatArray:
        """Angle by which each frequency lags [rad]."""
        u = self._over_corner(frequency_hz, rows_hz)
        result: FloatArray = np.arctan2(2.0 * self.damping * u, 1.0 - u**2)
        return result

    def _over_corner(self, frequency_hz: FloatArray, rows_hz: float) -> FloatArray:
        seen = frequency_hz
        if self.digital:
            seen = rows_hz / np.pi * np.abs(np.tan(np.pi * frequency_hz / rows_hz))
        result: FloatArray = seen / self.corner_hz
        return result


def count(s: Spectrum) -> int:
    """Number of parts: white noise of the sensor first, then the road, then lines."""
    return ROAD.stop + len(s.lines_hz)


def images_of(
    s: Spectrum, frequency_hz: FloatArray, digital: bool | None
) -> list[tuple[FloatArray, FloatArray]]:
    """Frequencies that look alike to the samples, and the parts of the noise there."""
    at = [frequency_hz]
    if digital:
        for k in range(1, round(s.rows_hz / s.rate_hz)):
            half = 0.5 * s.rows_hz
            at.append(np.abs((frequency_hz + k * s.rate_hz + half) % s.rows_hz - half))
    elif digital is not None:
        at += [np.abs(frequency_hz + k * s.rate_hz) for k in _FOLDS]
    return [(f, _forms(s, f, own=i == 0)) for i, f in enumerate(at)]


def _forms(s: Spectrum, f: FloatArray, *, own: bool) -> FloatArray:
    """White noise of the sensor, noise of the road and of the motion, skirts of lines."""
    forms = [np.ones(f.size)]
    forms += [1.0 / (1.0 + (f / corner) ** 2) for corner in _ROAD_HZ]
    forms += [(LOWEST_HZ / np.maximum(f, 1e-3)) ** power for power in _ROAD_POWERS]
    forms += [own / np.maximum((f - line) ** 2, 1.0) for line in s.lines_hz]
    return np.array(forms)


def parts_of(
    images: list[tuple[FloatArray, FloatArray]], response: Response | None, s: Spectrum
) -> FloatArray:
    """The parts as the samples show them."""
    if response is None:
        return images[0][1]
    return folded(images, [response.power(f, s.rows_hz) for f, _ in images], response)


def folded(
    images: list[tuple[FloatArray, FloatArray]], powers: list[FloatArray], response: Response
) -> FloatArray:
    """The same where the factor of a response on the power at each image is known."""
    result: FloatArray = np.zeros_like(images[0][1])
    for (_, forms), power in zip(images, powers, strict=True):
        result += forms * power
    result[0] += response.after
    return result
