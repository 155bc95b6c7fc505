"""A log as its sensors would have written it had they noise that is white.

The likelihood knows white noise and readings of the moment. A sensor's own low-pass makes its
noise coloured and its readings late; readings so far apart that their noise is independent hold
all that it lets through, and its delay is known from its spectrum. Vibration in a narrow band, in
which no car moves, is taken down to the noise beside it, without a shift in time.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Final

import numpy as np
import scipy

from .._arrays import FloatArray
from ..log import Log
from ._apply import shifted
from ._low_pass import NoiseFit, Response, fitted, with_low_pass
from ._signals import MOVING, own_samples, quantum
from ._spectrum import NoiseSpectrum, Spectrum, independent_every, spectrum_of, steady

__all__ = ["conditioned", "low_passes"]

_EDGE_S: Final = 0.5
_DEVICES: Final = (("vx_mps", "vy_mps"), ("yaw_rate_radps", "ax_mps2", "ay_mps2"))  # as a rule
# Chosen on seeds 100 to 105 and 200 to 224 of benchmarks/ladder, and on measured drives: without a
# filter at most 4 nats, with all imperfections 23 at least; forms that do not fit leave 1.8 and more
# where no filter is known, those that do 1.2 at most; 0.4 to 1.5 ms.
_EVIDENCE: Final = 10.0  # nats that a filter must bring
_MISMATCH: Final = 1.5  # of forms that are taken for right
_DELAY_STD_S: Final = 0.0015  # of a delay that is taken out
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
    found = _filters(channels)
    result = []
    for number, log in enumerate(logs):
        spectra = {}
        for channel in channels:
            if channel.log != number:
                continue
            s, filtered = channel.spectrum, found.get(channel.name)
            smooth = filtered.smooth_of(channel) if filtered else channel.plain.smooth[0]
            spectra[channel.name] = NoiseSpectrum(s.rate_hz, s.frequency_hz, s.power, smooth)
        result.append(_put_right(log, spectra, found))
    return result


def low_passes(logs: Sequence[Log]) -> dict[str, tuple[Response, float]]:
    """The low-pass of each channel's sensor where it is told, and the delay's standard error [s].

    Parameters
    ----------
    logs : sequence of Log
        Of the same sensors.
    """
    channels = _channels(logs)
    return {name: (f.response, f.fit.delay_std_s) for name, f in _filters(channels).items()}


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
            and self.response.corner_hz < _BAND * lowest_hz
        )

    @property
    def every(self) -> int:
        """Samples from one reading to the next that is independent of it."""
        return max(independent_every(white) for white in self.fit.white)

    def smooth_of(self, channel: _Channel) -> FloatArray:
        """Power of a channel's noise without lines."""
        return self.fit.smooth[self.channels.index(channel)]


def _filters(channels: Sequence[_Channel]) -> dict[str, _Filtered]:
    """The filter of each channel; a device has one for all its channels or none.

    One channel shifted by itself would be an error between them. The devices of a logger often
    filter alike: one filter for both where it explains them as well as two do.
    """
    devices = [tuple(c for c in channels if c.name in device) for device in _DEVICES]
    found = [f for f in map(_filtered, devices) if f is not None]
    if len(found) == len(_DEVICES):
        both = _filtered(tuple(channels))
        count = sum(c.spectrum.independent for c in channels)
        if both and both.fit.cost - sum(f.fit.cost for f in found) < 1.5 * np.log(count):
            found = [both]
    return {c.name: f for f in found if f.told for c in f.channels}


def _filtered(channels: tuple[_Channel, ...]) -> _Filtered | None:
    """The filter that the noise of some channels speaks for."""
    count = sum(c.spectrum.independent for c in channels)
    # What fits without a filter leaves one nothing to explain.
    over = sum((c.plain.mismatch - 1.0) * c.spectrum.independent for c in channels)
    if 0.5 * over + 3.0 * np.sqrt(0.5 * count) < _EVIDENCE:
        return None
    fit = with_low_pass([c.spectrum for c in channels])
    brings = sum(c.plain.cost for c in channels) - fit.cost
    if fit.response is None or brings < _EVIDENCE * max(fit.mismatch, 1.0):
        return None
    return _Filtered(channels, fit, fit.response)


def _put_right(
    log: Log, spectra: dict[str, NoiseSpectrum], filters: dict[str, _Filtered]
) -> Log:
    now: dict[str, FloatArray] = {}
    what = []
    for channel, spectrum in spectra.items():
        lines = spectrum.vibration_hz
        if lines:
            now[channel] = _without(log[channel], spectrum)
            shown = ", ".join(f"{f:.3g}" for f in lines)
            what.append(f"{channel}: vibration at {shown} Hz taken out")
        if channel in filters:
            found = filters[channel]
            delay, every = found.response.delay_s, found.every
            values = shifted(log["time_s"], now.get(channel, log[channel]), delay)
            now[channel] = _thinned(values, every)
            what.append(
                f"{channel}: its noise is that of a low-pass of {found.response.corner_hz:.3g} Hz; "
                f"read {1000.0 * delay:.3g} +- {1000.0 * found.fit.delay_std_s:.1g} ms later in "
                f"the file, every {every} samples"
            )
    return log.corrected(now, what) if now else log


def _without(values: FloatArray, spectrum: NoiseSpectrum) -> FloatArray:
    """Apply the gain over frequency, of zero phase, to the channel's own samples."""
    at, every = own_samples(values)
    grid = np.arange(at[0], at[-1] + 1, every)
    whole = np.interp(grid, at, values[at])
    # The gain is of windows of that many samples; so long is its answer to an impulse.
    width = 2 * (spectrum.gain.size - 1)
    answer = np.roll(np.fft.irfft(spectrum.gain, width), width // 2)
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
    result = values.copy()
    result[at] = np.interp(at, grid, smooth)
    return result


def _thinned(values: FloatArray, every: int) -> FloatArray:
    at, _ = own_samples(values)
    kept = at[::every]
    result = np.full(values.size, np.nan)
    result[kept] = values[kept]
    return result
