"""Draws of what the driving leaves open about the parameters, for whoever computes on with them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import scipy

from ..._common.arguments import generator, whole
from ..._common.arrays import FloatArray, as_float64
from ..._common.printed import Part, Printed, Table
from ..._common.progress import with_progress
from ..._common.tables import frame, imported
from ..._common.text import brief, few, number
from ...errors import InvalidInput, warn
from ...estimate import Driving, NoiseModel
from ...model import Model
from ...vehicle import AXLES
from ..search.box import free_box, objective_of
from .estimates import Estimated

_BATCH, _BATCHES = 4096, 400
_WALKERS = 4  # of the ensemble, for each parameter
_BURN_IN = 0.3  # share of the steps that is left out
_HALVINGS = 40  # of the way of a walker to the likeliest parameters, before it begins
_TIMES = 50.0  # the correlation time that chains have to be long (emcee's rule)
_ASKED = 40  # draws of the normal distribution that are compared with the likelihood


@dataclass(frozen=True, eq=False)
class Posterior(Printed):
    """Draws of the parameters of a fit.

    Attributes
    ----------
    names, units : tuple of str
        Free parameters, then what the coefficients of each tyre mean together.
    values : array, shape (chains, draws, names)
    log_density : array, shape (chains, draws)
        Of the posterior, without its constant: exact for the gains of the fitted filter with the
        method `ensemble`, that of the normal distribution with `normal`.
    method : str
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    values: FloatArray
    log_density: FloatArray
    method: str

    __iter__ = None  # numbers are no names

    def __getitem__(self, name: str) -> FloatArray:
        """All draws of one parameter, shape (chains, draws)."""
        for i, known in enumerate(self.names):
            if name in (known, known.replace(" ", "_")):
                return self.values[..., i]
        raise KeyError(f"'{name}'; there are {', '.join(self.names)}")

    def to_pandas(self) -> Any:
        """A DataFrame: a row for each draw, a column for each name."""
        flat = self.values.reshape(-1, len(self.names))
        return frame(
            {"draw": np.arange(len(flat)), **dict(zip(self.names, flat.T, strict=True))}, "draw"
        )

    def to_arviz(self) -> Any:
        """An ArviZ InferenceData with the groups `posterior` and `sample_stats`.

        Raises
        ------
        InvalidInput
            If ArviZ is not installed.
        """
        arviz = imported("arviz", "arviz")
        named = {n: self.values[..., i] for i, n in enumerate(self.names)}
        found = arviz.from_dict(posterior=named, sample_stats={"lp": self.log_density})
        for name, unit in zip(self.names, self.units, strict=True):
            found.posterior[name].attrs["units"] = unit
        return found

    def _rows(self) -> list[list[str]]:
        rows = []
        for i, (name, unit) in enumerate(zip(self.names, self.units, strict=True)):
            x = self.values[..., i]
            # Of draws, not between them: slips at the peak of tyres without one are infinite.
            low, middle, high = np.nanpercentile(x, [2.5, 50.0, 97.5], method="nearest")
            rows.append([name, number(float(middle)), f"{number(low)} .. {number(high)}", unit])
        return rows

    _HEAD = ("parameter", "median", "95 % of the draws", "unit")

    def _headline(self) -> str:
        chains, draws = self.log_density.shape
        return f"{chains * draws} draws of the posterior ({self.method})"

    __repr__ = brief

    def _parts(self) -> list[Part]:
        return [self._headline(), Table(self._HEAD, self._rows())]


def posterior(
    fit: Estimated,
    model: Model,
    driving: Driving,
    noise: NoiseModel,
    count: int,
    seed: int | np.random.Generator,
    method: Literal["normal", "ensemble"],
    progress: bool | None,
    *,
    likeliest: bool = True,
) -> Posterior:
    """Draw parameters; `Fit.posterior` has the parameters of this call.

    `model`, `driving` and `noise` are those of the fit, whose parameters are the likeliest ones or
    not.
    """
    count, rng = whole(count, "count", 1), generator(seed)
    box = free_box(model)
    if method == "normal":
        x, density = _normal(fit, model, box.lower, box.upper, count, rng)
        if likeliest:
            _compare(fit, model, driving, noise, x[0])
    elif method == "ensemble":
        walkers = 2 * (_WALKERS * len(box.columns) // 2)
        begin, _ = _normal(fit, model, box.lower, box.upper, walkers, rng)
        x, density = _ensemble(model, driving, noise, begin[0], count, rng, progress)
    else:
        raise InvalidInput(f"method = {method!r}: choose 'normal' or 'ensemble'")
    quantities = list(fit.quantities.values())
    p = np.repeat(model.vector()[None], x[..., 0].size, axis=0)
    p[:, box.columns] = x.reshape(-1, x.shape[-1])
    derived = np.array([[q.of(row) for q in quantities[x.shape[-1] :]] for row in p])
    values = np.concatenate([x, derived.reshape(*x.shape[:2], -1)], axis=2)
    units = tuple(e.unit for e in (*fit.estimates, *fit.derived))
    return Posterior(tuple(q.name for q in quantities), units, as_float64(values), density, method)


class _Straight:
    """Coordinates in which estimates are drawn: B by the logarithm of the stiffness B C D.

    The stiffness is known far better than the coefficients by themselves. Along the straight lines
    of a normal distribution of these it would change by many times its standard error.
    """

    def __init__(self, model: Model) -> None:
        names, known = model.free_names, model.parameters
        at = model.vector()
        # The place of B among what is drawn, those of C and D or None, and their values.
        self._tyres = [
            (
                names.index(f"B_{axle}"),
                [
                    (names.index(n) if n in names else None, float(at[known[n].column]))
                    for n in (f"C_{axle}", f"D_{axle}")
                ],
            )
            for axle in AXLES
            if f"B_{axle}" in names
        ]
        self._stiff = [b for b, _ in self._tyres]

    def to(self, x: FloatArray) -> FloatArray:
        """Coordinates of parameters."""
        out = x.copy()
        for b, others in self._tyres:
            c, d = (value if i is None else x[i] for i, value in others)
            out[b] = np.log(x[b] * c * d)
        return out

    def slope(self, x: FloatArray) -> FloatArray:
        """Derivatives of the coordinates by the parameters, a row for each."""
        out = np.eye(len(x))
        for b, others in self._tyres:
            for i in (b, *(i for i, _ in others if i is not None)):
                out[b, i] = 1.0 / x[i]
        return out

    def volume(self, x: FloatArray) -> FloatArray:
        """Logarithm of what a unit of the coordinates is in parameters, along the last axis."""
        return np.asarray(np.log(x[..., self._stiff]).sum(axis=-1))

    def back(self, y: FloatArray) -> FloatArray:
        """Parameters of coordinates, which stand along the last axis."""
        out = y.copy()
        for b, others in self._tyres:
            c, d = (value if i is None else y[..., i] for i, value in others)
            with np.errstate(divide="ignore", over="ignore"):
                out[..., b] = np.exp(y[..., b]) / (c * d)
        return out


def _normal(
    fit: Estimated,
    model: Model,
    lower: FloatArray,
    upper: FloatArray,
    count: int,
    rng: np.random.Generator,
) -> tuple[FloatArray, FloatArray]:
    """Of the normal distribution of the fit, within the bounds."""
    at = np.array([e.value for e in fit.estimates])
    straight = _Straight(model)
    mean = straight.to(at)
    root = straight.slope(at) @ np.linalg.cholesky(fit.covariance)
    kept: list[FloatArray] = []
    found = 0
    for _ in range(_BATCHES):
        z = rng.standard_normal((_BATCH, len(mean)))
        x = straight.back(mean + z @ root.T)
        inside = ((x >= lower) & (x <= upper)).all(axis=1)
        kept.append(np.column_stack([x, -0.5 * (z**2).sum(axis=1)])[inside])
        found += int(inside.sum())
        if found >= count:
            both = np.concatenate(kept)[:count]
            return as_float64(both[None, :, :-1]), as_float64(both[None, :, -1])
    loose = ", ".join(fit.undetermined) or "none"
    raise InvalidInput(
        f"only {found} of {_BATCH * _BATCHES} draws lie within the bounds (not determined: "
        f"{loose}); state priors for these parameters, or fix them"
    )


def _compare(
    fit: Estimated, model: Model, driving: Driving, noise: NoiseModel, draws: FloatArray
) -> None:
    """Warn where the likelihood refuses draws of the normal distribution.

    Of draws of the likelihood the log-likelihood falls by half of a chi-squared number.
    """
    objective = objective_of(model, driving.problem(model), driving)
    columns, p = free_box(model).columns, model.vector()
    gains = objective.freeze(p, noise.vector())
    best = objective.half_sum_of_squares(p, gains)
    falls = []
    for x in draws[:_ASKED]:
        p[columns] = x
        falls.append(objective.half_sum_of_squares(p, gains) - best)
    fall = float(np.median(falls))
    if fall < 0.5 * scipy.stats.chi2.ppf(0.95, len(columns)):
        return
    loose = few(fit.undetermined)
    warn(
        f"the parameters drawn are less likely than what the driving leaves open: by {fall:.3g} "
        f"nats in the median, where {0.5 * len(columns):g} are usual, as the likelihood is not "
        "normal"
        + (f" (not determined: {loose})" if loose else "")
        + "; draw by method='ensemble', or state priors for these parameters, or fix them"
    )


def _ensemble(
    model: Model,
    driving: Driving,
    noise: NoiseModel,
    begin: FloatArray,
    count: int,
    rng: np.random.Generator,
    progress: bool | None,
) -> tuple[FloatArray, FloatArray]:
    """Of the likelihood itself, by the affine-invariant sampler (Goodman & Weare 2010, emcee)."""
    emcee = imported("emcee", "arviz")
    box, straight = free_box(model), _Straight(model)
    columns, lower, upper = box.columns, box.lower, box.upper
    objective = objective_of(model, driving.problem(model), driving)
    p = model.vector()
    gains = objective.freeze(p, noise.vector())

    def log_density(y: FloatArray) -> float:
        x = straight.back(y)
        if not ((x >= lower) & (x <= upper)).all():
            return -np.inf
        p[columns] = x
        return float(straight.volume(x) - objective.half_sum_of_squares(p, gains))

    likeliest = straight.to(model.vector()[columns])
    least = log_density(likeliest) - 0.5 * scipy.stats.chi2.ppf(0.95, len(columns))
    walkers = np.array([_nearer(straight.to(x), likeliest, log_density, least) for x in begin])
    steps = int(np.ceil(count / len(walkers) / (1.0 - _BURN_IN)))
    sampler = emcee.EnsembleSampler(*walkers.shape, log_density)
    sampler.random_state = np.random.MT19937(rng.integers(2**63)).state
    steady = sampler.sample(walkers, iterations=steps)
    for _ in with_progress(steady, "draws", total=steps, shown=progress):
        pass
    first = steps - max(int(np.ceil(count / len(walkers))), 1)
    _ask_for_more(float(np.max(sampler.get_autocorr_time(tol=0))), steps, len(walkers))
    y = np.swapaxes(sampler.get_chain(discard=first), 0, 1)
    x = straight.back(y)
    density = sampler.get_log_prob(discard=first).T - straight.volume(x)
    return as_float64(x), as_float64(density)


def _nearer(
    y: FloatArray, likeliest: FloatArray, log_density: Callable[[FloatArray], float], least: float
) -> FloatArray:
    """A place on the way from a draw to the likeliest one, from where no walker has to come back.

    A walker that begins where the likelihood is next to nothing takes thousands of steps.
    """
    for _ in range(_HALVINGS):
        if log_density(y) >= least:
            break
        y = 0.5 * (y + likeliest)
    return y


def _ask_for_more(correlated: float, steps: int, walkers: int) -> None:
    """Warn where steps are too few for draws that do not depend on where they began."""
    enough = _TIMES * correlated
    if np.isfinite(enough) and steps < enough:
        count = float(f"{enough * walkers * (1.0 - _BURN_IN):.2g}")
        warn(
            f"the walkers took {steps} steps, and one in {correlated:.2g} tells something new: "
            f"their draws still depend on where they began; draw {count:.0f} or more"
        )
