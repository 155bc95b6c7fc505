"""A log as its sensors would have written it had they noise that is white.

The likelihood knows white noise and readings of the moment. A sensor's own low-pass makes its
noise coloured and its readings late, and takes from the forces of the road what tells them from
noise; where its spectrum tells the filter it is undone, as far as what came after it allows.
Vibration in a narrow band, in which no car moves, is taken down to the noise beside it, without a
shift in time.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Final, NamedTuple

import numpy as np
import scipy

from .._common.arrays import ComplexArray, FloatArray
from ..log import Log, Retimed
from .kinematics.motion import IntArray
from .low_pass.forms import Response
from .low_pass.low_pass import NoiseFit, fitted, with_low_pass
from .low_pass.spectrum import NoiseSpectrum, Spectrum, spectrum_of, steady
from .signals import MOVING, own_samples, quantum

_EDGE_S: Final = 0.5
_BESIDE_GAP_S: Final = 0.1  # which a filter that is undone carries far no more
_REGULAR: Final = 0.9  # share of a channel's samples that lie at equal distances
_DEVICES: Final = (("vx_mps", "vy_mps"), ("yaw_rate_radps", "ax_mps2", "ay_mps2"))  # as a rule
# Chosen by benchmarks/ladder, seeds 100 to 105 and 200 to 224, and by the measured drives of
# benchmarks/real_driving: without a filter one brings 4 nats at most, with all imperfections 23 at
# least; forms that fit leave 1.1 at most, measured drives with steady noise 1.7 or more.
_EVIDENCE: Final = 10.0  # nats that a filter must bring
_MISMATCH: Final = 1.3  # of forms that are taken for right
_DELAY_STD_S: Final = 0.0015  # of a delay that is taken out
_RAISED: Final = 4.0  # times the power of noise at low frequencies, up to which it comes up
_DAMPING: Final = (0.5, 0.95)  # Butterworth's is 0.71, Bessel's 0.87; one of 1 may be none in time
_BAND: Final = 0.45  # of the rate; a corner beyond it is not seen


@dataclass(frozen=True, eq=False)
class _Channel:
    """A channel of one log whose noise is the same at all times."""

    log: int
    name: str
    spectrum: Spectrum
    plain: NoiseFit


def conditioned(logs: Sequence[Log]) -> list[Log]:
    """The logs with readings whose noise is white, in time with the motion.

    Parameters
    ----------
    logs : sequence of Log
        Of the same sensors.

    Returns
    -------
    list of Log
        The same logs where their noise is white already.
    """
    channels = _channels(logs)
    found = Conditioning(_filters(channels, logs))
    return [
        found.put_right(log, [c for c in channels if c.log == number])
        for number, log in enumerate(logs)
    ]


def _channels(logs: Sequence[Log]) -> list[_Channel]:
    found = []
    for (number, log), name in product(enumerate(logs), MOVING):
        if not log.has(name):
            continue
        at, every = own_samples(log[name])
        if at.size < 2:
            continue
        # Few samples are lost as a rule: a straight line takes their place.
        grid = np.arange(at[0], at[-1] + 1, every)
        if np.mean(np.isin(at, grid)) < _REGULAR:
            continue
        values = np.interp(grid, at, log[name][at])
        spectrum = spectrum_of(values, log.rate_hz / every, log.rate_hz, quantum(log[name][at]))
        if spectrum is None:
            continue
        plain = fitted([spectrum])
        if steady(values, spectrum, plain.smooth[0]):
            found.append(_Channel(number, name, spectrum, plain))
    return found


@dataclass(frozen=True, eq=False)
class _Filtered:
    channels: tuple[_Channel, ...]
    fit: NoiseFit
    response: Response

    @property
    def told(self) -> bool:
        """Whether the forms fit, and the delay is known."""
        lowest_hz = min(c.spectrum.rate_hz for c in self.channels)
        return (
            self.fit.mismatch < _MISMATCH
            and self.fit.delay_std_s < _DELAY_STD_S
            and _DAMPING[0] < self.response.damping < _DAMPING[1]
            and self.response.corner_hz < _BAND * lowest_hz
        )

    @property
    def sentence(self) -> str:
        """What it is."""
        delay, std = 1000.0 * self.response.delay_s, 1000.0 * self.fit.delay_std_s
        return (
            f"the noise is that of a low-pass of {self.response.corner_hz:.3g} Hz, "
            f"{delay:.3g} +- {std:.1g} ms late"
        )

    def known(self, name: str, channel: _Channel | None, log: Log) -> _Channel | None:
        """The channel that told the filter: of this log, or of another one at the same rate."""
        if channel in self.channels:
            return channel
        at, every = own_samples(log[name])
        if at.size < 2:
            return None
        rate_hz = log.rate_hz / every
        alike = (c for c in self.channels if c.name == name)
        return next((c for c in alike if np.isclose(c.spectrum.rate_hz, rate_hz, rtol=1e-3)), None)

    def undone(self, channel: _Channel) -> ComplexArray:
        """Factor at each frequency that undoes the filter.

        Where counting in quanta or folding came after it, only as far as noise allows.
        """
        s, white = channel.spectrum, self.fit.white[self.channels.index(channel)]
        power = self.response.power(s.frequency_hz, s.rows_hz)
        turn = self.response.turned(s.frequency_hz, s.rows_hz)
        up = np.minimum(1.0 / np.maximum(power, 1e-12), _RAISED * white[0] / white)
        result: ComplexArray = np.sqrt(up) * np.exp(1j * turn)
        return result

    def smooth_of(self, channel: _Channel) -> FloatArray:
        """Power of a channel's noise without lines."""
        return self.fit.smooth[self.channels.index(channel)]


class _Repaired(NamedTuple):
    """Channels with white noise and in time, what was done to them, and times that are not sure."""

    channels: dict[str, FloatArray]
    undone: list[str]
    shaken: list[str]
    moved: list[Retimed]


@dataclass(frozen=True, eq=False)
class Conditioning:
    """Low-passes of some sensors, and how logs of them are freed of these and of vibration.

    Attributes
    ----------
    filters : dict of str to _Filtered
        By channel.
    """

    filters: dict[str, _Filtered]

    @classmethod
    def of(cls, logs: Sequence[Log]) -> Conditioning:
        """That of logs of the same sensors."""
        return cls(_filters(_channels(logs), logs))

    def apply(self, log: Log) -> Log:
        """A log of the same sensors, with white noise and in time with the motion."""
        return self.put_right(log, _channels([log]))

    @property
    def low_passes(self) -> dict[str, tuple[Response, float]]:
        """The low-pass of each channel's sensor, and the delay's standard error [s]."""
        return {name: (f.response, f.fit.delay_std_s) for name, f in self.filters.items()}

    @property
    def figures(self) -> dict[str, dict[str, float]]:
        """The same in numbers."""
        return {
            name: {
                "corner_hz": response.corner_hz,
                "damping": response.damping,
                "delay_s": response.delay_s,
                "delay_std_s": std_s,
            }
            for name, (response, std_s) in self.low_passes.items()
        }

    def remarks(self, logs: Sequence[Log]) -> list[str]:
        """What is taken out of some logs, in sentences."""
        filters = {id(f): f for f in self.filters.values()}
        said = []
        for f in filters.values():
            names = ", ".join(name for name, own in self.filters.items() if own is f)
            said.append(f"{names}: {f.sentence}; studies undo it")
        for log in logs:
            shaken = self._repaired(log, _channels([log])).shaken
            said += [f"{log.name}, {t}" if len(logs) > 1 else t for t in shaken]
        return said

    def put_right(self, log: Log, channels: Sequence[_Channel]) -> Log:
        """The same, where those of its channels are known whose noise is the same at all times."""
        done = self._repaired(log, channels)
        if not done.channels:
            return log
        return log.corrected(done.channels, (*done.undone, *done.shaken), done.moved)

    def _repaired(self, log: Log, channels: Sequence[_Channel]) -> _Repaired:
        own = {c.name: c for c in channels}
        done = _Repaired({}, [], [], [])
        # What one filter has made late comes late by the same time.
        together: dict[int, list[str]] = {}
        for name in filter(log.has, MOVING):
            found, channel = self.filters.get(name), own.get(name)
            known = None if found is None else found.known(name, channel, log)
            factor: FloatArray | ComplexArray | None = None
            if channel is not None:
                smooth = channel.plain.smooth[0]
                if found is not None and known is not None:
                    smooth = found.smooth_of(known)
                factor = _without_vibration(channel, smooth, done.shaken)
            if found is not None and known is not None:
                undone = found.undone(known)
                factor = undone if factor is None else undone * factor
                done.undone.append(f"{name}: {found.sentence}; undone")
                together.setdefault(id(found), []).append(name)
            spectrum = channel if known is None else known
            if factor is not None and spectrum is not None:
                done.channels[name] = _passed(log[name], spectrum.spectrum, factor)
        for names in together.values():
            std_s = self.filters[names[0]].fit.delay_std_s
            done.moved.append(Retimed(tuple(names), std_s))
        return done


def _filters(channels: Sequence[_Channel], logs: Sequence[Log]) -> dict[str, _Filtered]:
    """The filter of each channel; a device has one for all its channels or none.

    One channel shifted by itself would be an error between them. The devices of a logger often
    filter alike: one filter for both where it explains them as well as two do.
    """
    found = []
    for device in _DEVICES:
        own = tuple(c for c in channels if c.name in device)
        if len(own) == sum(log.has(name) for log in logs for name in device):
            found += [f for f in [_filtered(own)] if f is not None]
    if len(found) == len(_DEVICES):
        both = _filtered(tuple(channels))
        count = sum(c.spectrum.independent for c in channels)
        if both and both.fit.cost - sum(f.fit.cost for f in found) < 1.5 * np.log(count):
            found = [both]
    return {c.name: f for f in found if f.told for c in f.channels}


def _filtered(channels: tuple[_Channel, ...]) -> _Filtered | None:
    """The filter that the noise of some channels speaks for."""
    count = sum(c.spectrum.independent for c in channels)
    if not channels:
        return None
    # What fits without a filter leaves one nothing to explain.
    over = sum((c.plain.mismatch - 1.0) * c.spectrum.independent for c in channels)
    if 0.5 * over + 3.0 * np.sqrt(0.5 * count) < _EVIDENCE:
        return None
    plain = sum(c.plain.cost for c in channels)
    fit = with_low_pass([c.spectrum for c in channels], plain - _EVIDENCE)
    if fit is None or fit.response is None:
        return None
    if plain - fit.cost < _EVIDENCE * max(fit.mismatch, 1.0):
        return None
    return _Filtered(channels, fit, fit.response)


def _without_vibration(
    channel: _Channel, smooth: FloatArray, shaken: list[str]
) -> FloatArray | None:
    """Factor at each frequency that takes vibration out; what is taken out is told."""
    s = channel.spectrum
    noise = NoiseSpectrum(s.rate_hz, s.frequency_hz, s.power, smooth)
    lines = noise.vibration_hz
    if not lines:
        return None
    shown = ", ".join(f"{f:.3g}" for f in lines)
    shaken.append(f"{channel.name}: vibration at {shown} Hz taken out")
    return noise.gain


def _passed(
    values: FloatArray, spectrum: Spectrum, factor: ComplexArray | FloatArray
) -> FloatArray:
    """Apply a factor over frequency to the channel's own samples."""
    at, every = own_samples(values)
    grid = np.arange(at[0], at[-1] + 1, every)
    whole = np.interp(grid, at, values[at])
    # The factor is of windows of that many samples; so long is its answer to an impulse.
    width = 2 * (factor.size - 1)
    answer = np.roll(np.fft.irfft(factor, width), width // 2)
    answer = np.append(answer, answer[0])
    answer[[0, -1]] *= 0.5
    answer *= np.hanning(answer.size + 2)[1:-1]
    answer /= answer.sum()
    half = width // 2
    padded = np.pad(whole, half, mode="reflect", reflect_type="odd")
    smooth = scipy.signal.fftconvolve(padded, answer, mode="valid")
    # At the ends vibration cannot be told from what it adds to.
    edge = round(_EDGE_S * spectrum.rate_hz)
    smooth[:edge] = smooth[len(smooth) - edge :] = np.nan
    if np.iscomplexobj(factor):
        # What was put into a gap is no reading, and comes up with the noise.
        nearest = np.abs(grid[:, None] - at[_beside(at, grid)]).min(axis=1)
        gaps = scipy.ndimage.binary_dilation(
            nearest >= every, iterations=max(1, round(_BESIDE_GAP_S * spectrum.rate_hz))
        )
        smooth[gaps] = np.nan
    result = values.copy()
    result[at] = np.interp(at, grid, smooth)
    return result


def _beside(at: IntArray, grid: IntArray) -> IntArray:
    """Numbers of the samples before and after each place."""
    after = np.clip(np.searchsorted(at, grid), 1, at.size - 1)
    return np.stack([after - 1, after], axis=1)
