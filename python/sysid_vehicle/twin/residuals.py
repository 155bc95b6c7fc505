"""What the residuals say of a result: whether car and twin go together at all.

Least squares give a number and a spread for any readings, those of another car or of none too.
Over the second half of a run, when the estimates have settled, each channel that taught something
is asked: does the car's reading follow the twin's one to one, is there an offset, is what is left
white noise of the size that was told? Spreads already count residuals in blocks
(`cpp/include/sysid/twin/batch.hpp`), so that colour alone widens them; what contradicts a result is
said, and its spread falls back to that of the first guess.

Whiteness: Ljung and Box, Biometrika 65 (1978) 297.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from .._common.arrays import FloatArray

_PIECES = 20  # of the second half: their sums are taken as independent
_LEAST = 100  # samples that a channel must have
_SIGNIFICANT = 4.0  # standard deviations
_FOLLOWS = 0.25  # a factor so far from one is more than any error of the load left in it
_LAG_S = 1.0
_CHANCE = 1e-6
_COLOURED = 0.2


@dataclass(frozen=True)
class ChannelResidual:
    """Residual of one channel over the second half of a run.

    Attributes
    ----------
    channel : str
        Its name.
    rms : float
        Of the residual, in the channel's unit.
    noise : float
        Standard deviation of the sensor's noise as it was told; NaN if it was not.
    follows, follows_std : float
        Factor by which the car's reading follows the twin's, one where they go together, and its
        standard deviation.
    offset, offset_std : float
        Mean of the residual and its standard deviation.
    twin_std, car_std : float
        Standard deviations of what the twin and the car read.
    largest_correlation : float
        Of the residual with itself, up to a second later.
    white : bool
        Whether that can be chance, or is small.
    """

    channel: str
    rms: float
    noise: float
    follows: float
    follows_std: float
    offset: float
    offset_std: float
    twin_std: float
    car_std: float
    largest_correlation: float
    white: bool

    def contradiction(self) -> str | None:
        """How it contradicts that car and twin go together, if it does."""
        moved = np.isfinite(self.noise) and self.car_std > _SIGNIFICANT * self.noise
        if moved and self.twin_std < _FOLLOWS * self.car_std:
            return (
                f"{self.channel}: the car's reading moves by {self.car_std:.3g}, the twin's by "
                f"{self.twin_std:.3g}; check the units of the inputs and of the channel"
            )
        away = abs(self.follows - 1.0)
        if away > _FOLLOWS and away > _SIGNIFICANT * self.follows_std:
            return (
                f"{self.channel}: the car follows the twin by a factor of {self.follows:.2f} +- "
                f"{self.follows_std:.2g} where 1 belongs; check the channel's sign, unit and time, "
                f"and the inputs"
            )
        floor = max(0.25 * self.twin_std, self.noise if np.isfinite(self.noise) else 0.0)
        if abs(self.offset) > max(floor, _SIGNIFICANT * self.offset_std):
            return (
                f"{self.channel}: car and twin are {self.offset:.3g} apart all the time, their "
                f"readings move by {self.twin_std:.3g}; take the sensor's offset out"
            )
        return None

    def __str__(self) -> str:
        told = f", told {self.noise:.3g}" if np.isfinite(self.noise) else ""
        colour = "white" if self.white else f"coloured ({self.largest_correlation:.2f})"
        return (
            f"residual of {self.channel}: rms {self.rms:.3g}{told}, {colour}; the car follows the "
            f"twin by {self.follows:.3f} +- {self.follows_std:.2g}"
        )


@dataclass(frozen=True)
class Shown:
    """What car and twin read at the same times.

    Attributes
    ----------
    car, twin : mapping of str to ndarray, shape (n,)
        By channel; NaN where the car has no reading.
    step_s : float
        Between two samples.
    """

    car: Mapping[str, FloatArray]
    twin: Mapping[str, FloatArray]
    step_s: float


def residual_of(channel: str, shown: Shown, noise: float) -> ChannelResidual | None:
    """Judge a channel by its second half; None where too little was read or nothing moves.

    Parameters
    ----------
    channel : str
        Its name.
    shown : Shown
        What car and twin read.
    noise : float
        Standard deviation as told, or NaN.
    """
    car, twin = shown.car[channel], shown.twin[channel]
    half = slice(len(car) // 2, None)
    y, s = car[half], twin[half]
    there = np.isfinite(y) & np.isfinite(s)
    count = int(there.sum())
    if count < _LEAST:
        return None
    e = y - s
    offset = float(np.mean(e[there]))
    own = np.where(there, s - np.mean(s[there]), 0.0)
    power = float(np.sum(own**2))
    if not power > 0.0:
        return None
    follows = float(np.sum(own[there] * (y[there] - np.mean(y[there]))) / power)
    left = np.where(there, e - offset, 0.0)
    score = own * np.where(there, left - (follows - 1.0) * own, 0.0)
    correlation, white = _colour(left, there, shown.step_s)
    return ChannelResidual(
        channel,
        float(np.sqrt(np.mean(e[there] ** 2))),
        noise,
        follows,
        _scatter(score) / power,
        offset,
        _scatter(left) / count,
        float(np.sqrt(power / count)),
        float(np.std(y[there])),
        correlation,
        white,
    )


def _scatter(values: FloatArray) -> float:
    """Standard deviation of the sum, from the sums of pieces."""
    sums = np.array([piece.sum() for piece in np.array_split(values, _PIECES)])
    return float(np.sqrt(np.sum(sums**2)))


def _colour(left: FloatArray, there: np.ndarray, step_s: float) -> tuple[float, bool]:
    """Largest correlation up to a second later, and whether the residual may be white."""
    count = float(there.sum())
    most = max(1, min(round(_LAG_S / step_s), len(left) // 4))
    size = 1 << int(np.ceil(np.log2(2 * len(left))))
    spectrum = np.abs(np.fft.rfft(left, size)) ** 2
    product = np.fft.irfft(spectrum, size)[: most + 1]
    if not product[0] > 0.0:
        return 0.0, True
    rho = product[1:] / product[0]
    lags = np.arange(1, most + 1)
    q = count * (count + 2.0) * float(np.sum(rho**2 / np.maximum(count - lags, 1.0)))
    largest = float(rho[np.argmax(np.abs(rho))])
    chance = float(scipy.stats.chi2.sf(q, most))
    return largest, chance > _CHANCE or abs(largest) < _COLOURED


def contradictions(
    residuals: Sequence[ChannelResidual],
    parameters: Mapping[str, FloatArray],
    limits: Mapping[str, tuple[float, float]],
) -> tuple[str, ...]:
    """What speaks against the estimates: residuals, and estimates that stand at their limits.

    Parameters
    ----------
    residuals : sequence of ChannelResidual
        Of the channels that taught something.
    parameters : mapping of str to ndarray
        Estimates over time.
    limits : mapping of str to (float, float)
        Lower and upper limit of each parameter that was looked for.
    """
    said = [text for r in residuals if (text := r.contradiction()) is not None]
    for name, (lower, upper) in limits.items():
        way = parameters[name][len(parameters[name]) // 2 :]
        # Noise takes it off the limit again for a moment, which may be the last one.
        held = way[(way <= lower) | (way >= upper)]
        if held.size:
            said.append(
                f"{name} = {way[-1]:.5g} stands at its limit, {held[-1]:.5g}; give it wider "
                f"limits, or check inputs and readings"
            )
    return tuple(said)
