"""Draws of what the driving leaves open about the parameters, for whoever computes on with them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from ..._common.arguments import generator, whole
from ..._common.arrays import FloatArray, as_float64
from ..._common.printed import Part, Printed, Table
from ..._common.progress import with_progress
from ..._common.tables import frame, imported
from ..._common.text import brief, number
from ...errors import InvalidInput
from ...estimate import Driving, NoiseModel
from ...model import Model
from ..search.box import free_box, objective_of
from .estimates import Estimated

_BATCH, _BATCHES = 4096, 400
_WALKERS = 4  # of the ensemble, for each parameter
_BURN_IN = 0.3  # share of the steps that is left out


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
            low, middle, high = np.nanpercentile(x, [2.5, 50.0, 97.5])
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
) -> Posterior:
    """Draw parameters; `Fit.posterior` has the parameters of this call.

    `model`, `driving` and `noise` are those of the fit.
    """
    count, rng = whole(count, "count", 1), generator(seed)
    box = free_box(model)
    if method == "normal":
        x, density = _normal(fit, box.lower, box.upper, count, rng)
    elif method == "ensemble":
        walkers = 2 * (_WALKERS * len(box.columns) // 2)
        begin, _ = _normal(fit, box.lower, box.upper, walkers, rng)
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


def _normal(
    fit: Estimated, lower: FloatArray, upper: FloatArray, count: int, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """Of the normal distribution of the fit, within the bounds."""
    mean = np.array([e.value for e in fit.estimates])
    root = np.linalg.cholesky(fit.covariance)
    kept: list[FloatArray] = []
    found = 0
    for _ in range(_BATCHES):
        z = rng.standard_normal((_BATCH, len(mean)))
        x = mean + z @ root.T
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
    box = free_box(model)
    columns, lower, upper = box.columns, box.lower, box.upper
    objective = objective_of(model, driving.problem(model), driving)
    p = model.vector()
    gains = objective.freeze(p, noise.vector())

    def log_density(x: FloatArray) -> float:
        if not ((x >= lower) & (x <= upper)).all():
            return -np.inf
        p[columns] = x
        return -objective.half_sum_of_squares(p, gains)

    walkers, n = begin.shape
    steps = int(np.ceil(count / walkers / (1.0 - _BURN_IN)))
    sampler = emcee.EnsembleSampler(walkers, n, log_density)
    sampler.random_state = np.random.MT19937(rng.integers(2**63)).state
    steady = sampler.sample(begin, iterations=steps)
    for _ in with_progress(steady, "draws", total=steps, shown=progress):
        pass
    first = steps - max(int(np.ceil(count / walkers)), 1)
    x = np.swapaxes(sampler.get_chain(discard=first), 0, 1)
    return as_float64(x), as_float64(sampler.get_log_prob(discard=first).T)
