"""A log as its sensors would have written it had they noise that is white.

The likelihood knows white noise and readings of the moment. A sensor's own low-pass makes its
noise coloured and its readings late; readings so far apart that their noise is independent hold
all that it lets through, and its delay is known from its spectrum. Vibration in a narrow band, in
which no car moves, is taken down to the noise beside it, without a shift in time.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy

from .._arrays import FloatArray
from ..log import Log
from ._apply import shifted
from ._signals import MOVING, own_samples
from ._spectrum import NoiseSpectrum, noise_spectrum

_ONE_FILTER = 0.15  # corner frequencies that differ by no more are of one kind of filter
_EDGE_S = 0.5
_DEVICES = (("vx_mps", "vy_mps"), ("yaw_rate_radps", "ax_mps2", "ay_mps2"))  # as a rule


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
    found = [_spectra(log) for log in logs]
    delays = _delays(found)
    return [_put_right(log, spectra, delays) for log, spectra in zip(logs, found, strict=True)]


def _spectra(log: Log) -> dict[str, NoiseSpectrum]:
    found = {}
    for channel in MOVING:
        if not log.has(channel):
            continue
        at, every = own_samples(log[channel])
        if at.size < 2:
            continue
        # Few samples are lost as a rule: a straight line takes their place.
        grid = np.arange(at[0], at[-1] + 1, every)
        values = np.interp(grid, at, log[channel][at])
        spectrum = noise_spectrum(values, log.rate_hz / every)
        if spectrum is not None:
            found[channel] = spectrum
    return found


def _delays(found: Sequence[dict[str, NoiseSpectrum]]) -> dict[str, tuple[float, float]]:
    """Corner and delay of each channel's filter; those of one kind share the figures.

    A device filters its channels alike. Where the noise of one falls in a way that is no low-pass
    of its own (noise of the road, folded frequencies), that of the others is no safe one either:
    one channel shifted by itself would be an error between them.
    """
    own = {}
    unclear = {c for spectra in found for c, s in spectra.items() if s.falls and not s.delay_s}
    for channel in MOVING:
        told = [s[channel] for s in found if channel in s]
        if any(channel in device and unclear.intersection(device) for device in _DEVICES):
            continue
        if told and all(s.delay_s for s in told):
            own[channel] = (
                float(np.median([s.corner_hz for s in told])),
                float(np.median([s.delay_s for s in told])),
            )
    shared = {}
    for channel, (corner, _) in own.items():
        alike = [v for v in own.values() if abs(v[0] - corner) < _ONE_FILTER * corner]
        shared[channel] = (
            float(np.median([v[0] for v in alike])),
            float(np.median([v[1] for v in alike])),
        )
    return shared


def _put_right(
    log: Log, spectra: dict[str, NoiseSpectrum], delays: dict[str, tuple[float, float]]
) -> Log:
    now: dict[str, FloatArray] = {}
    what = []
    for channel, spectrum in spectra.items():
        lines = spectrum.vibration_hz
        if lines:
            now[channel] = _without(log[channel], spectrum)
            shown = ", ".join(f"{f:.3g}" for f in lines)
            what.append(f"{channel}: vibration at {shown} Hz taken out")
        if channel in delays:
            corner, delay = delays[channel]
            values = shifted(log["time_s"], now.get(channel, log[channel]), delay)
            now[channel] = _thinned(values, spectrum.every)
            what.append(
                f"{channel}: its noise is that of a low-pass of {corner:.3g} Hz; read "
                f"{1000.0 * delay:.2g} ms later in the file, every {spectrum.every} samples"
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
