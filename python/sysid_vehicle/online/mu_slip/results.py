"""What the estimators of friction over slip return."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..._common.arrays import FloatArray
from ..._common.printed import Told
from ..._common.style import AFTER, MEASURED, axes_or_new, tidy
from ..._common.text import HALF_95, text_table
from ..._common.typed import typed
from ...errors import NumericalError
from .curve import MuSlipCurve, magic_formula_coefficients
from .data import MuSlipData

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_ROUNDS = 50  # of the smoother


@dataclass(frozen=True, repr=False)
class MuSlipEstimate(Told):
    """Parameters of a curve with their uncertainty.

    Attributes
    ----------
    method : str
        How they were found.
    curve : MuSlipCurve
        What they belong to.
    values : ndarray, shape (p,)
        The parameters.
    covariance : ndarray, shape (p, p)
        As the estimator believes it.
    notes : tuple of str
        What the reader should know before using the values.
    at_bound, too_narrow : tuple of str
        Parameters that rest at a bound, and those whose interval does not hold.
    """

    method: str
    curve: MuSlipCurve
    values: FloatArray
    covariance: FloatArray
    notes: tuple[str, ...] = ()
    at_bound: tuple[str, ...] = ()
    too_narrow: tuple[str, ...] = ()

    @property
    def std(self) -> FloatArray:
        """Standard deviation of each parameter."""
        return np.sqrt(np.diag(self.covariance))

    @typed
    def cell(self, i: int) -> str:
        """A value with its standard deviation, or why that says nothing."""
        kernels, value, std = self.curve.kernels, self.values[i], float(self.std[i])
        name = self.curve.parameters[i]
        if name in self.at_bound:
            return f"{value:.5f} at its bound"
        if not std < kernels.UPPER[i] - kernels.LOWER[i]:
            return f"{value:.5f} not determined"
        return f"{value:.5f} ± {std:.5f}{', too narrow' if name in self.too_narrow else ''}"

    @typed
    def band(self, slip: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Friction at each slip and its standard deviation (delta method)."""
        mu, gradient, _ = self.curve.points(slip, self.values)
        variance = np.einsum("ki,ij,kj->k", gradient, self.covariance, gradient)
        return mu, np.sqrt(np.maximum(variance, 0.0))

    def __str__(self) -> str:
        rows = [
            [name, f"{x:.5g}", f"{s:.2g}"]
            for name, x, s in zip(self.curve.parameters, self.values, self.std, strict=True)
        ]
        text = f"{self.method}\n" + text_table(["parameter", "value", "std"], rows)
        if len(self.values) == 4:
            letters = zip("BCDE", magic_formula_coefficients(list(self.values)), strict=True)
            text += "\n  " + ", ".join(f"{name} {x:.4g}" for name, x in letters)
        return "\n".join([text, *(f"  note: {note}" for note in self.notes)])

    @typed
    def plot(self, data: MuSlipData, ax: Axes | None = None) -> Axes:
        """Draw the readings, the curve and its 2-sigma band onto `ax`."""
        ax = axes_or_new(ax, 6.0, 4.0)
        slip = np.linspace(min(0.0, data.slip.min()), max(data.slip.max(), 0.1), 300)
        mu, std = self.band(slip)
        ax.fill_between(
            slip, mu - 2 * std, mu + 2 * std, color=AFTER, alpha=0.2, linewidth=0, label="2 sigma"
        )
        ax.plot(slip, mu, color=AFTER, label="estimated")
        ax.plot(data.slip, data.mu, ".", color=MEASURED, markersize=4, label="measured")
        ax.legend(frameon=False)
        return tidy(ax, xlabel="slip ratio", ylabel="friction", title=self.method)


def resting(
    curve: MuSlipCurve, values: FloatArray, low: FloatArray, high: FloatArray
) -> tuple[str, ...]:
    """Parameters that rest at a bound."""
    ends = zip(curve.parameters, values, low, high, strict=True)
    return tuple(name for name, x, lowest, highest in ends if x in (lowest, highest))


def cautions(
    curve: MuSlipCurve, data: MuSlipData, values: FloatArray, at_bound: tuple[str, ...]
) -> tuple[str, ...]:
    """Say where values are not what the readings alone tell."""
    notes = [
        f"{name} rests at its bound {x:g}"
        for name, x in zip(curve.parameters, values, strict=True)
        if name in at_bound
    ]
    largest = np.abs(data.slip[np.isfinite(data.mu)]).max()
    if largest < values[1]:
        notes.append(f"readings end at slip {largest:.3g}, before the peak: it is extrapolated")
    return tuple(notes)


@dataclass(frozen=True, repr=False)
class MuSlipRun(Told):
    """A filter's way through the readings; `n` readings, `p` parameters.

    Attributes
    ----------
    method, curve, data :
        What was run, on what.
    start : tuple
        Mean (p,) and covariance (p, p) before the first reading.
    mean, covariance : ndarray, shapes (n, p), (n, p, p)
        After each reading.
    innovation, innovation_variance : ndarray, shape (n,)
        Reading less expectation, and the variance the filter gave it.
    noise_variance : ndarray, shape (n,)
        Of a reading as the filter took it, pseudo-noise included.
    signal_before, signal_after : ndarray, shape (n,)
        Variance of the expected friction, H P H', before and after the reading.
    drift_std : ndarray, shape (p,)
        Random walk of the parameters per reading.
    sensor_std : float
        Noise of a reading, without the factor of the filter and without pseudo-noise.
    """

    method: str
    curve: MuSlipCurve
    data: MuSlipData
    start: tuple[FloatArray, FloatArray]
    mean: FloatArray
    covariance: FloatArray
    innovation: FloatArray
    innovation_variance: FloatArray
    noise_variance: FloatArray
    signal_before: FloatArray
    signal_after: FloatArray
    drift_std: FloatArray
    sensor_std: float

    @property
    def expected_mu(self) -> FloatArray:
        """Friction expected of each reading from those before it, shape (n,); NaN where missing."""
        return self.data.mu - self.innovation

    @property
    def estimate(self) -> MuSlipEstimate:
        """After the last reading; a note says where its interval does not hold."""
        kernels, values = self.curve.kernels, self.mean[-1]
        at_bound = resting(self.curve, values, kernels.LOWER, kernels.UPPER)
        bent = self._bent()
        notes = (*cautions(self.curve, self.data, values, at_bound), *bent.values())
        return MuSlipEstimate(
            self.method, self.curve, values, self.covariance[-1], notes, at_bound, tuple(bent)
        )

    def _bent(self) -> dict[str, str]:
        """Parameters whose interval does not hold that of the smoother, with what to say of each.

        A filter keeps what it made of the first readings by a curve that is straight around the
        prior: far from there the peak is pulled towards nothing, by more than its standard
        deviation knows. The smoother straightens the curve around the result, and its interval
        holds the truth in 94 to 95 % of drives on any surface.
        """
        try:
            found = self.curve.kernels.smooth(
                self.data.slip,
                self.data.mu,
                *self.start,
                self.sensor_std,
                True,
                self.drift_std,
                _ROUNDS,
            )
        except NumericalError:
            return {}
        apart = found["mean"][-1] - self.mean[-1]
        own, other = (np.sqrt(np.diag(c[-1])) for c in (self.covariance, found["covariance"]))
        beyond = np.abs(apart) + HALF_95 * other > HALF_95 * own
        return {
            name: f"{name}: the interval does not hold that of the smoother, {mean:.4g} +- "
            f"{std:.2g}: the curve bends too much between the prior and here; use mu_slip_smooth"
            for name, mean, std, far in zip(
                self.curve.parameters, found["mean"][-1], other, beyond, strict=True
            )
            if far and found["converged"]
        }

    def __str__(self) -> str:
        return str(self.estimate)


@dataclass(frozen=True, repr=False)
class MuSlipSmoothed(Told):
    """Parameters at each reading, given all readings.

    Attributes
    ----------
    mean, covariance : ndarray, shapes (n, p), (n, p, p)
        Equal at all readings unless the parameters may drift.
    rounds : int
        Passes of filter and smoother.
    converged : bool
        Whether a further pass would change nothing.
    """

    curve: MuSlipCurve
    data: MuSlipData
    mean: FloatArray
    covariance: FloatArray
    rounds: int
    converged: bool

    @property
    def estimate(self) -> MuSlipEstimate:
        """At the last reading."""
        kernels, values = self.curve.kernels, self.mean[-1]
        at_bound = resting(self.curve, values, kernels.LOWER, kernels.UPPER)
        notes = cautions(self.curve, self.data, values, at_bound)
        if not self.converged:
            notes = (f"not at rest after {self.rounds} rounds", *notes)
        return MuSlipEstimate(
            "iterated smoother", self.curve, values, self.covariance[-1], notes, at_bound
        )

    def __str__(self) -> str:
        return str(self.estimate)
