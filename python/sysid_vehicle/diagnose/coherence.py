"""Whether what is left follows an input, frequency by frequency, and how late the car follows it.

Coherence is that of the whitened residuals with each input (Welch's method; Bendat & Piersol,
Random Data, ch. 9). Its phase is not a delay: filter and car lie between. So the delay is sought
where it acts. In each band of frequencies the input may act larger by a share a and later by a
phase phi: signals

    (1 + a) cos(phi) u_band + (1 + a) sin(phi) H[u_band],  H the Hilbert transform,

go through the model in place of u, and generalised least squares of the residuals finds both for
all bands together with the fitted parameters. A delay T shows as phi = 2 pi f T: its estimate is
the slope, weighted with the joint covariance of the phases.

It is a hint. The fitted parameters have taken up part of a delay and are put right to first order
only: 40 ms are read as 31 to 39 ms, and the interval knows nothing of that. An effect of the
catalogue that is refitted tells the delay itself.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from scipy.signal import csd, hilbert, welch
from scipy.stats import chi2

from .._arrays import FloatArray, as_float64
from .._style import axes_or_new, tidy
from ..estimate import MEASURED, Driving
from .evidence import Evidence, solve

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["Coherence", "Delay", "coherence"]

_WINDOW_S = 5.0
_BANDS = 6
_LOWEST_HZ, _HIGHEST_HZ = 0.15, 5.0
_LEVEL = 0.05
_WORDS = {"steer": "steering", "force": "wheel force"}
_SMALL = 1e-3  # of an input, to differentiate by


@dataclass(frozen=True, eq=False)
class Delay:
    """How much later than the model the car follows an input.

    Attributes
    ----------
    delay_s, std_s : float
        Slope of the phase over frequency, and its standard error.
    frequency_hz, phase_rad, phase_std_rad : array, shape (bands,)
        Phase by which the car lags the model; the parameters of the fit left free.
    linear : bool
        Whether the phases lie on one line as closely as their errors allow: a delay, not a lag or
        a gain that changes with frequency.
    """

    delay_s: float
    std_s: float
    frequency_hz: FloatArray
    phase_rad: FloatArray
    phase_std_rad: FloatArray
    linear: bool

    @property
    def interval(self) -> tuple[float, float]:
        """95 % interval."""
        return self.delay_s - 1.96 * self.std_s, self.delay_s + 1.96 * self.std_s

    @property
    def significant(self) -> bool:
        """Whether it differs from none by three standard errors."""
        return abs(self.delay_s) > 3.0 * self.std_s


@dataclass(frozen=True, eq=False)
class Coherence:
    """Coherence of the residuals with one input.

    Attributes
    ----------
    input : str
        `steer` or `force`.
    frequency_hz : array, shape (n,)
    coherence : dict of str to array, shape (n,)
        By measured channel, from 0 to 1.
    threshold : float
        Exceeded anywhere by chance in 5 % of complete models.
    delay : Delay or None
        None where the input hardly moved.
    """

    input: str
    frequency_hz: FloatArray
    coherence: dict[str, FloatArray]
    threshold: float
    delay: Delay | None

    @property
    def peak(self) -> tuple[str, float, float]:
        """Channel, frequency and coherence where it is largest."""
        channel = max(self.coherence, key=lambda c: float(self.coherence[c].max()))
        at = int(np.argmax(self.coherence[channel]))
        return channel, float(self.frequency_hz[at]), float(self.coherence[channel][at])

    def __str__(self) -> str:
        channel, f, c = self.peak
        name = _WORDS[self.input]
        if c > self.threshold:
            text = f"residuals of {channel} follow the {name} at {f:.1f} Hz (coherence {c:.2f})"
        else:
            text = f"no residual follows the {name}"
        if self.delay is not None and self.delay.significant:
            d = self.delay
            sooner = "later" if d.delay_s > 0 else "sooner"
            size = f"{1e3 * abs(d.delay_s):.0f} +- {1e3 * d.std_s:.1g} ms"
            text += f"; the car answers it {size} {sooner} than the model"
            if not d.linear:
                text += ", but not equally at all frequencies"
        return text

    def _repr_html_(self) -> str:
        return f"<pre>{self}</pre>"

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw coherence over frequency, and what exceeds chance."""
        ax = axes_or_new(ax, 6.0, 3.0)
        for channel, c in self.coherence.items():
            ax.plot(self.frequency_hz, c, lw=1.2, label=channel)
        ax.axhline(self.threshold, color="0.4", ls="--", lw=1.0, label="by chance, 95 %")
        ax.set_ylim(0.0, 1.0)
        ax.legend(frameon=False, fontsize="small", ncols=2)
        return tidy(ax, xlabel="frequency [Hz]", ylabel=f"coherence with the {_WORDS[self.input]}")

    def plot_phase(self, ax: Axes | None = None) -> Axes:
        """Draw by how much the car lags the model, and the delay that fits."""
        ax = axes_or_new(ax, 5.0, 3.0)
        ax.axhline(0.0, color="0.5", lw=0.8)
        if self.delay is not None:
            d = self.delay
            f = np.linspace(0.0, 1.1 * float(d.frequency_hz.max()), 50)
            line = np.degrees(2.0 * np.pi * f)
            low, high = d.interval
            ax.fill_between(f, low * line, high * line, color="tab:blue", alpha=0.25, lw=0.0)
            label = f"{1e3 * d.delay_s:.1f} $\\pm$ {1e3 * d.std_s:.1f} ms"
            ax.plot(f, d.delay_s * line, color="tab:blue", label=label)
            phase, std = np.degrees(d.phase_rad), np.degrees(d.phase_std_rad)
            known = std < 30.0
            ax.errorbar(
                d.frequency_hz[known], phase[known], 1.96 * std[known], fmt="ko", ms=4.0, lw=1.0
            )
            ax.legend(frameon=False, loc="upper left")
        return tidy(
            ax, xlabel="frequency [Hz]", ylabel=f"lag behind the {_WORDS[self.input]} [deg]"
        )


def coherence(evidence: Evidence) -> tuple[Coherence, ...]:
    """Coherence with the steering angle and, where it is known, with the wheel force."""
    names = ("steer", "force") if evidence.driving.force_known else ("steer",)
    inputs = evidence.driving.inputs()
    return tuple(_with(evidence, inputs, i, name) for i, name in enumerate(names))


def _with(evidence: Evidence, inputs: FloatArray, which: int, name: str) -> Coherence:
    driving = evidence.driving
    rate = driving.logs[0].rate_hz
    e = evidence.residual.reshape(driving.samples, -1)
    pieces = _pieces(driving)
    length = min(round(_WINDOW_S * rate), max(end - begin for begin, end, _ in pieces) // 3)
    windows, cross, own, of_e = 0, 0.0, 0.0, 0.0
    f = np.zeros(0)
    how = {"fs": rate, "nperseg": length, "axis": 0}
    for begin, end, own_rate in pieces:
        if end - begin < length or own_rate != rate:
            continue
        u = inputs[begin:end, which : which + 1]
        count = 2 * (end - begin) // length - 1
        f, p = csd(u, e[begin:end], **how)
        cross = cross + count * p
        own = own + count * welch(u, **how)[1]
        of_e = of_e + count * welch(e[begin:end], **how)[1]
        windows += count
    band = (f > 0.0) & (f <= _HIGHEST_HZ)
    with np.errstate(invalid="ignore", divide="ignore"):
        gamma = np.nan_to_num((np.abs(cross) ** 2 / (own * of_e))[band])
    there = {c: gamma[:, i] for i, c in enumerate(MEASURED) if c in driving.present}
    # Windows that overlap by half are worth 11/18 of as many independent ones (Welch 1967).
    effective = max(1.0 + (windows - 1) * 11.0 / 18.0, 2.0)
    tests = len(there) * int(band.sum())
    threshold = 1.0 - (_LEVEL / tests) ** (1.0 / (effective - 1.0))
    delay = _delay(evidence, inputs, which, pieces)
    return Coherence(name, as_float64(f[band]), there, float(threshold), delay)


def _pieces(driving: Driving) -> list[tuple[int, int, float]]:
    """Begin, end and sampling rate of each stretch."""
    ends = np.cumsum([s.where.stop - s.where.start for s in driving.stretches])
    rates = [driving.logs[s.log].rate_hz for s in driving.stretches]
    return list(zip([0, *map(int, ends[:-1])], map(int, ends), rates, strict=True))


def _delay(
    evidence: Evidence, inputs: FloatArray, which: int, pieces: list[tuple[int, int, float]]
) -> Delay | None:
    u = inputs[:, which]
    size = float(np.std(u))
    if size <= 0.0:
        return None
    edges = np.concatenate([[0.0], np.geomspace(_LOWEST_HZ, _HIGHEST_HZ, _BANDS)])
    columns, middles = [], []
    for low, high in pairwise(edges):
        signal, quadrature = np.zeros_like(u), np.zeros_like(u)
        power, moment = 0.0, 0.0
        for begin, end, rate in pieces:
            part, turned, p, m = _in_band(u[begin:end], rate, low, high)
            signal[begin:end], quadrature[begin:end] = part, turned
            power, moment = power + p, moment + m
        if power <= 0.0:
            continue
        middles.append(np.sqrt(moment / power))
        columns += [_through(evidence, inputs, which, s) for s in (signal, quadrature)]
    R = evidence.project(np.column_stack(columns))
    found = solve(R, evidence.left)
    # Bands in which the input hardly moved tell nothing.
    gain, shift = 1.0 + found.size[0::2], found.size[1::2]
    phase = np.arctan2(shift, gain)
    jacobian = np.zeros((len(phase), len(found.size)))
    square = np.maximum(gain**2 + shift**2, 1e-12)
    for b in range(len(phase)):
        jacobian[b, 2 * b : 2 * b + 2] = np.array([-shift[b], gain[b]]) / square[b]
    covariance = jacobian @ found.covariance @ jacobian.T
    std = np.sqrt(np.diag(covariance))
    f = np.array(middles)
    known = (std < 0.5) & (square > 0.1)
    if not known.any():
        return None
    line = 2.0 * np.pi * f[known]
    weight = np.linalg.pinv(covariance[np.ix_(known, known)], rcond=1e-10)
    information = float(line @ weight @ line)
    slope = float(line @ weight @ phase[known]) / information
    off = phase[known] - slope * line
    chance = float(chi2.sf(off @ weight @ off, max(int(known.sum()) - 1, 1)))
    return Delay(
        slope, float(information**-0.5), f, as_float64(phase), as_float64(std), chance > 0.01
    )


def _in_band(
    u: FloatArray, rate: float, low: float, high: float
) -> tuple[FloatArray, FloatArray, float, float]:
    """A band of a signal and its Hilbert transform, its power, and that times frequency squared.

    Mirrored at its end, the signal has no jump there that would leak into all bands.
    """
    both = np.concatenate([u, u[::-1]])
    spectrum = np.fft.rfft(both)
    f = np.fft.rfftfreq(len(both), 1.0 / rate)
    inside = (f >= low) & (f < high)
    part = np.fft.irfft(np.where(inside, spectrum, 0.0), len(both))
    power = np.where(inside & (f > 0.0), np.abs(spectrum) ** 2, 0.0)
    turned = np.imag(hilbert(part))
    return part[: len(u)], turned[: len(u)], float(power.sum()), float(power @ f**2)


def _through(evidence: Evidence, inputs: FloatArray, which: int, signal: FloatArray) -> FloatArray:
    """What the model makes of a signal added to an input: minus the derivative of the residuals."""
    step = _SMALL * float(np.std(inputs[:, which])) / max(float(np.std(signal)), 1e-300)
    moved = inputs.copy()
    moved[:, which] += step * signal
    problem = evidence.driving.problem(evidence.fit.model, other_inputs=moved)
    after = problem.residuals(evidence.fit.model.vector(), evidence.frozen).ravel()
    return as_float64((evidence.residual - after) / step)
