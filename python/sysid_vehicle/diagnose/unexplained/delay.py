"""How late the car follows an input.

The input comes later by T: to first order - T du/dt is added to it, goes through the
model, and generalised least squares of the residuals finds T together with the fitted parameters.
These have taken up a part of the delay, and the noise model another. So what is found is put in,
both are fitted anew, and what is left is sought again, until it is less than its standard error.

A driver's steering answers to what the residuals hold, but later: what T multiplies must know
nothing of the input to come (Ljung, System Identification, sec. 13.4). Bands of frequencies do, and
serve to look at alone. In each the input may act larger by a share a and later by a phase phi:
signals

    (1 + a) cos(phi) u_band + (1 + a) sin(phi) H[u_band],  H the Hilbert transform,

go through the model in place of u, for all bands together. A delay shows as phi = 2 pi f T.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt
import scipy

from ..._common.arrays import FloatArray, as_float64
from ..._common.text import HALF_95
from ...estimate import again
from ...estimate.driving import Span
from ...identify import refine, refit, relearn
from ..evidence.evidence import Evidence, solve
from .omnibus import omnibus_of

_BANDS = 6
_LOWEST_HZ, HIGHEST_HZ = 0.15, 5.0
_SMALL = 1e-3  # of an input, to differentiate by
_ROUNDS, _LONGER = 8, 4.0  # steps, and how much longer than to first order one may be
_TINY_RAD, _NOTABLE = 0.1, 2.0  # phase, standard errors; a delay is claimed beyond three
_DRAWS = 16  # of noise of the inputs


@dataclass(frozen=True, eq=False)
class Delay:
    """How much later than the model the car follows an input.

    Attributes
    ----------
    delay_s, std_s : float
        And its standard error.
    frequency_hz, phase_rad, phase_std_rad : array, shape (bands,)
        Phase by which the car lags the model; the parameters of the fit left free.
    linear : bool
        Whether the phases lie on one line as closely as their errors allow: a delay, not a lag or
        a gain that changes with frequency.
    alone : bool
        Whether nothing is left that depends on the driving once the delay is put in. Where
        something is, what the model lacks may look like a delay that is not there.
    """

    delay_s: float
    std_s: float
    frequency_hz: FloatArray
    phase_rad: FloatArray
    phase_std_rad: FloatArray
    linear: bool
    alone: bool

    @property
    def interval(self) -> tuple[float, float]:
        """95 % interval."""
        return self.delay_s - HALF_95 * self.std_s, self.delay_s + HALF_95 * self.std_s

    @property
    def significant(self) -> bool:
        """Whether it differs from none by three standard errors."""
        return abs(self.delay_s) > 3.0 * self.std_s

    def to_dict(self) -> dict[str, object]:
        """The findings, ready for JSON."""
        return {
            "delay_s": self.delay_s,
            "std_s": self.std_s,
            "linear": self.linear,
            "alone": self.alone,
        }

    def answers(self, behind: str = "the model", what: str = "it") -> str:
        """How late the car answers an input, in words.

        Parameters
        ----------
        behind : str
            The model that was compared with.
        what : str
            The input.
        """
        sooner = "later" if self.delay_s > 0 else "sooner"
        size = f"{1e3 * abs(self.delay_s):.0f} +- {1e3 * self.std_s:.1g} ms {sooner}"
        if self.alone:
            return f"the car answers {what} {size} than {behind}"
        return (
            f"{behind} fits best where the car answers {what} {size}, but an error that depends on "
            "the driving remains: a missing effect may look like a delay"
        )


def delay(
    evidence: Evidence,
    inputs: FloatArray,
    which: int,
    rng: np.random.Generator,
    complete: Callable[[], bool],
) -> Delay | None:
    """Find how much later than the model the car follows input number `which`.

    None where the input hardly moved. `complete` tells whether the model without a delay leaves
    nothing that depends on the driving.
    """
    # The deviation of equal numbers need not be zero: their mean is rounded.
    if float(np.ptp(inputs[:, which])) <= 0.0:
        return None
    put_in, late, first, ended, before, beyond = 0.0, inputs, evidence, False, 0.0, 0.0
    for _ in range(_ROUNDS):
        direction, step, std = _later(evidence, late, which)
        ended = _arrived(step, std)
        if ended:
            break  # the second order of so small a step is next to nothing
        by, before = _stretched(step, before), step
        there = later(inputs, which, evidence.driving.spans, put_in + by)
        fit = refit(evidence.fit.model, evidence.driving, evidence.fit.noise, inputs=there)
        if fit.log_likelihood < evidence.fit.log_likelihood and evidence is not first:
            beyond = by  # gains that are held lead on past the likeliest delay
            break
        put_in, late = put_in + by, there
        evidence = Evidence(fit, evidence.driving, late)
    if evidence is not first:
        # Noise is learned once, where the input is in its place. What a climb to the maximum would
        # move as well the parameters do to first order, where no more than that is left to do.
        learn = relearn if ended else refine
        fit = learn(evidence.fit.model, evidence.driving, evidence.fit.noise, inputs=late)
        evidence = Evidence(fit, evidence.driving, late)
        direction, step, std = _later(evidence, late, which)
    total = put_in + step
    arrived = evidence is first or (not beyond and _arrived(step, std))
    std = float(np.hypot(std, std**2 * _by_input_noise(evidence, direction, rng)))
    if not arrived:
        # Where the search would end is not known any closer.
        std = float(np.linalg.norm([std, step, beyond]))
    found = _phases(evidence, late, which)
    if found is None:
        return None
    f, phase, phase_std, linear = found
    alone = complete() if evidence is first else not omnibus_of(evidence).rejects
    return Delay(
        total, std, f, as_float64(phase + 2.0 * np.pi * f * put_in), phase_std, linear, alone
    )


def _arrived(step: float, std: float) -> bool:
    tiny = 2.0 * np.pi * HIGHEST_HZ * abs(step) < _TINY_RAD and abs(step) < _NOTABLE * std
    return abs(step) < std or tiny


def _stretched(step: float, before: float) -> float:
    """A step as long as it takes where the one before was too short by as much again.

    Disturbances take up a part of what a delay does, and steps to first order fall short.
    """
    if step * before <= 0.0:
        return step
    falls = 1.0 - step / before
    return step * (min(1.0 / falls, _LONGER) if falls > 0.0 else _LONGER)


def _later(evidence: Evidence, inputs: FloatArray, which: int) -> tuple[FloatArray, float, float]:
    """By how much an input should come later, to first order: direction, size, standard error."""
    slower = np.zeros(len(inputs))
    for begin, end, rate in evidence.driving.spans:
        # From the last sample to this one: what the driver does next answers to this residual.
        slower[begin + 1 : end] = -rate * np.diff(inputs[begin:end, which])
    R = evidence.project(_through(evidence, inputs, which, slower)[:, None])
    found = solve(R, evidence.left)
    return R[:, 0], float(found.size[0]), float(np.sqrt(found.covariance[0, 0]))


def _by_input_noise(evidence: Evidence, direction: FloatArray, rng: np.random.Generator) -> float:
    """Scatter of the score along a direction that comes from noise of the measured inputs.

    What `quiet` leaves of it is slow, and to the noise model, which knows white noise only, it
    looks smaller than it is.
    """
    scores = []
    for _ in range(_DRAWS):
        noisy = evidence.with_input_noise(again(evidence.driving, rng))
        scores.append(float(direction @ (noisy.residual - evidence.residual)))
    return float(np.sqrt(np.mean(np.square(scores))))


def _phases(
    evidence: Evidence, inputs: FloatArray, which: int
) -> tuple[FloatArray, FloatArray, FloatArray, bool] | None:
    """Frequency, phase by which the car lags, its standard error; whether a delay would do that."""
    u = inputs[:, which]
    edges = np.concatenate([[0.0], np.geomspace(_LOWEST_HZ, HIGHEST_HZ, _BANDS)])
    columns, middles = [], []
    for low, high in pairwise(edges):
        signal, quadrature = np.zeros_like(u), np.zeros_like(u)
        power, moment = 0.0, 0.0
        for begin, end, rate in evidence.driving.spans:
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
    chance = float(scipy.stats.chi2.sf(off @ weight @ off, max(int(known.sum()) - 1, 1)))
    return f, as_float64(phase), as_float64(std), chance > 0.01


def _spectrum(u: FloatArray, rate: float) -> tuple[FloatArray, npt.NDArray[np.complex128]]:
    """Frequencies and spectrum of a signal mirrored at its end, where it then has no jump."""
    f = np.fft.rfftfreq(2 * len(u), 1.0 / rate)
    return as_float64(f), np.fft.rfft(np.concatenate([u, u[::-1]]))


def delayed(u: FloatArray, rate: float, by_s: float) -> FloatArray:
    """A signal that comes later, all its frequencies as large as before.

    Interpolating between samples would smooth their noise, and a model whose input is less noisy
    predicts better for the wrong reason.
    """
    f, spectrum = _spectrum(u, rate)
    return as_float64(np.fft.irfft(spectrum * np.exp(-2j * np.pi * f * by_s), 2 * len(u))[: len(u)])


def later(inputs: FloatArray, which: int, spans: Sequence[Span], by_s: float) -> FloatArray:
    """Inputs of which number `which` comes later in every stretch."""
    late = inputs.copy()
    for begin, end, rate in spans:
        late[begin:end, which] = delayed(inputs[begin:end, which], rate, by_s)
    return late


def _in_band(
    u: FloatArray, rate: float, low: float, high: float
) -> tuple[FloatArray, FloatArray, float, float]:
    """A band of a signal and its Hilbert transform, its power, and that times frequency squared."""
    f, spectrum = _spectrum(u, rate)
    inside = (f >= low) & (f < high)
    part = np.fft.irfft(np.where(inside, spectrum, 0.0), 2 * len(u))
    power = np.where(inside & (f > 0.0), np.abs(spectrum) ** 2, 0.0)
    turned = np.imag(scipy.signal.hilbert(part))
    return part[: len(u)], turned[: len(u)], float(power.sum()), float(power @ f**2)


def _through(evidence: Evidence, inputs: FloatArray, which: int, signal: FloatArray) -> FloatArray:
    """What the model makes of a signal added to an input: minus the derivative of the residuals."""
    step = _SMALL * float(np.std(inputs[:, which])) / max(float(np.std(signal)), 1e-300)
    moved = inputs.copy()
    moved[:, which] += step * signal
    # Cut into pieces as the evidence is: gains that are held are those of its pieces.
    problem = evidence.problem_of(moved)
    after = problem.residuals(evidence.fit.model.vector(), evidence.frozen).ravel()
    return as_float64((evidence.residual - after) / step)
