"""Is a filter as good as it says? NIS, NEES and whiteness of the innovations, with their bounds.

Bar-Shalom, Li & Kirubarajan, *Estimation with Applications to Tracking and Navigation* (2001),
section 5.4.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from .._common.arrays import FloatArray, as_float64
from .._common.text import html_text
from ..errors import InvalidInput


@dataclass(frozen=True)
class Consistency:
    """A mean that should lie in its interval if the filter's covariances are true.

    Attributes
    ----------
    what : str
        What was averaged.
    mean, low, high : float
        The mean, and the interval that holds it with the probability asked for.
    count : int
        Samples behind it.
    """

    what: str
    mean: float
    low: float
    high: float
    count: int

    @property
    def passed(self) -> bool:
        """Whether the mean lies in its interval."""
        return self.low <= self.mean <= self.high

    def __str__(self) -> str:
        verdict = "inside" if self.passed else "too low" if self.mean < self.low else "too high"
        return (
            f"{self.what}: mean {self.mean:.4g}, interval {self.low:.4g} .. {self.high:.4g} "
            f"({verdict}, {self.count} samples)"
        )

    _repr_html_ = html_text


def nis_check(nis: FloatArray, observed: FloatArray, *, probability: float = 0.95) -> Consistency:
    """Mean squared whitened innovation per reading; 1 if the covariances are true.

    Parameters
    ----------
    nis, observed : array_like, shape (n,)
        Of each sample: the squared whitened innovation and the number of readings in it.
    probability : float
        That the mean of a true filter lies inside.
    """
    nis, observed = as_float64(nis), as_float64(observed)
    used = np.isfinite(nis) & (observed > 0)
    readings = int(observed[used].sum())
    return _chi2("NIS per reading", float(nis[used].sum()), readings, probability)


def nees_check(
    error: FloatArray, covariance: FloatArray, *, probability: float = 0.95, runs: int = 1
) -> Consistency:
    """Mean squared normalised estimation error per state; 1 if the covariances are true.

    Parameters
    ----------
    error : array_like, shape (n, nx)
        Estimated less true state. Errors of one run hang together in time: give one sample of each
        of many simulated runs, or say in `runs` how many runs the samples come from.
    covariance : array_like, shape (n, nx, nx)
        As the filter gives it.
    probability : float
        That the mean of a true filter lies inside.
    runs : int
        If above 1, the interval is that of so many independent samples.
    """
    error, covariance = as_float64(error), as_float64(covariance)
    if error.ndim != 2 or covariance.shape != (*error.shape, error.shape[1]):
        raise InvalidInput(
            f"error, covariance: shapes {error.shape}, {covariance.shape}; "
            f"give (n, nx), (n, nx, nx)"
        )
    solved = np.linalg.solve(covariance, error[..., None])[..., 0]
    squares = (error * solved).sum(axis=1)
    independent = runs if runs > 1 else len(error)
    mean = float(squares.mean())
    freedom = independent * error.shape[1]
    found = _chi2("NEES per state", mean * independent, freedom, probability)
    return Consistency(found.what, found.mean, found.low, found.high, len(error))


def whiteness_check(
    whitened: FloatArray, *, lag: int = 1, probability: float = 0.95
) -> tuple[Consistency, ...]:
    """Autocorrelation of each whitened innovation at a lag; 0 if the filter uses all there is.

    Parameters
    ----------
    whitened : array_like, shape (n,) or (n, ny)
        Innovations of variance 1, NaN where missing.
    lag : int
        In samples.
    probability : float
        That the autocorrelation of a true filter lies inside.
    """
    whitened = as_float64(whitened)
    columns = whitened.T if whitened.ndim == 2 else whitened[None]
    bound = float(scipy.stats.norm.isf(0.5 * (1.0 - probability)))
    out = []
    for i, e in enumerate(columns):
        product = e[lag:] * e[:-lag]
        pairs = int(np.isfinite(product).sum())
        if pairs < 2:
            raise InvalidInput(f"whitened: fewer than two pairs {lag} samples apart")
        r = float(np.nansum(product) / pairs / np.nanmean(e**2))
        limit = bound / np.sqrt(pairs)
        out.append(Consistency(f"autocorrelation of reading {i}", r, -limit, limit, pairs))
    return tuple(out)


def _chi2(what: str, total: float, freedom: int, probability: float) -> Consistency:
    if freedom < 1:
        raise InvalidInput(f"{what}: there is no reading to judge by")
    low, high = scipy.stats.chi2.interval(probability, freedom)
    return Consistency(what, total / freedom, float(low) / freedom, float(high) / freedom, freedom)
