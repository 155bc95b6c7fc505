"""Whether what is left follows an input, frequency by frequency, and how late the car follows it.

Coherence is that of the whitened residuals with each input (Welch's method; Bendat & Piersol,
Random Data, ch. 9). Its phase is not a delay: filter and car lie between. So the delay is sought
where it acts (`delay.py`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from threading import Lock
from typing import TYPE_CHECKING

import numpy as np
import scipy

from ..._common.arguments import generator
from ..._common.arrays import FloatArray, as_float64
from ..._common.style import axes_or_new, tidy
from ..._common.text import HALF_95, brief, html_text
from ..._common.threads import in_parallel
from ...estimate import MEASURED
from ..evidence.evidence import Evidence
from .delay import HIGHEST_HZ, Delay, delay
from .omnibus import Omnibus, omnibus_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_WINDOW_S = 5.0
_LEVEL = 0.05
INPUTS = {"steer": "steering", "force": "wheel force"}
"""Inputs of the model, in words."""


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
        None where the input hardly moved, or where it was not sought.
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

    __repr__ = brief
    _repr_html_ = html_text

    def __str__(self) -> str:
        channel, f, c = self.peak
        name = INPUTS[self.input]
        if c > self.threshold:
            text = f"residuals of {channel} follow the {name} at {f:.1f} Hz (coherence {c:.2f})"
        else:
            text = f"no residual follows the {name}"
        if self.delay is not None and self.delay.significant:
            d = self.delay
            text += f"; {d.answers()}"
            if not d.linear:
                text += ", but not equally at all frequencies"
        return text

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw coherence over frequency, and what exceeds chance."""
        ax = axes_or_new(ax, 6.0, 3.0)
        for channel, c in self.coherence.items():
            ax.plot(self.frequency_hz, c, lw=1.2, label=channel)
        ax.axhline(self.threshold, color="0.4", ls="--", lw=1.0, label="by chance, 95 %")
        ax.set_ylim(0.0, 1.0)
        ax.legend(frameon=False, fontsize="small", ncols=2)
        return tidy(ax, xlabel="frequency [Hz]", ylabel=f"coherence with the {INPUTS[self.input]}")

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
                d.frequency_hz[known], phase[known], HALF_95 * std[known], fmt="ko", ms=4.0, lw=1.0
            )
            ax.legend(frameon=False, loc="upper left")
        return tidy(
            ax, xlabel="frequency [Hz]", ylabel=f"lag behind the {INPUTS[self.input]} [deg]"
        )


def coherence(
    evidence: Evidence, *, delays: bool = True, seed: int = 0, omnibus: Omnibus | None = None
) -> tuple[Coherence, ...]:
    """Coherence with the steering angle and, where it is known, with the wheel force.

    Parameters
    ----------
    evidence : Evidence
    delays : bool
        Whether to seek delays.
    seed : int
        Of the draws of noise of the inputs, which widens the intervals of delays.
    omnibus : Omnibus, optional
        Of the same evidence, where it is known already.
    """
    names = ("steer", "force") if evidence.driving.force_known else ("steer",)
    inputs = evidence.driving.inputs()
    asking = Lock()
    known = [] if omnibus is None else [omnibus]

    def complete() -> bool:
        with asking:
            if not known:
                known.append(omnibus_of(evidence))
            return not known[0].rejects

    def one(i: int) -> Coherence:
        rng = generator(seed) if delays else None
        return _with(evidence, inputs, i, names[i], rng, complete)

    return tuple(in_parallel(one, range(len(names))))


def _with(
    evidence: Evidence,
    inputs: FloatArray,
    which: int,
    name: str,
    rng: np.random.Generator | None,
    complete: Callable[[], bool],
) -> Coherence:
    driving = evidence.driving
    e = evidence.residual.reshape(driving.samples, -1)
    pieces = driving.spans
    # Windows of one duration have one grid of frequencies, whatever the rate.
    window_s = min(_WINDOW_S, max((end - begin) / rate for begin, end, rate in pieces) / 3.0)
    band = min(
        int(np.floor(min(HIGHEST_HZ, 0.5 * rate) * window_s + 1e-6)) for _, _, rate in pieces
    )
    f = np.arange(1, band + 1) / window_s
    windows, cross, own, of_e = 0, 0.0, 0.0, 0.0
    for begin, end, rate in pieces:
        length = round(window_s * rate)
        if end - begin < length:
            continue
        how = {"fs": rate, "nperseg": length, "axis": 0}
        u = inputs[begin:end, which : which + 1]
        count = 2 * (end - begin) // length - 1
        inside = slice(1, band + 1)
        cross = cross + count * scipy.signal.csd(u, e[begin:end], **how)[1][inside]
        own = own + count * scipy.signal.welch(u, **how)[1][inside]
        of_e = of_e + count * scipy.signal.welch(e[begin:end], **how)[1][inside]
        windows += count
    with np.errstate(invalid="ignore", divide="ignore"):
        gamma = np.nan_to_num(np.abs(cross) ** 2 / (own * of_e))
    there = {c: gamma[:, i] for i, c in enumerate(MEASURED) if c in driving.present}
    # Windows that overlap by half are worth 11/18 of as many independent ones (Welch 1967).
    effective = max(1.0 + (windows - 1) * 11.0 / 18.0, 2.0)
    tests = len(there) * band
    threshold = 1.0 - (_LEVEL / tests) ** (1.0 / (effective - 1.0))
    late = None if rng is None else delay(evidence, inputs, which, rng, complete)
    return Coherence(name, as_float64(f), there, float(threshold), late)
