"""Identification of several runs at once: some parameters differ between runs, some are tied.

One likelihood over all runs: what is common is learned from every run, and so is the noise. What
differs (fuel load, tyre set, a spring) has a value for each run, with the covariance between them,
so that differences have standard errors of their own.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from types import MappingProxyType
from typing import Any

import numpy as np
import scipy

from ..._common.arrays import FloatArray, as_float64
from ..._common.printed import Part, Printed, Table
from ..._common.text import brief, number, unit_after, with_error
from ..._common.typed import typed
from ...errors import InvalidInput, near_names
from ...estimate import Driving, NoiseModel
from ...log import Log
from ...model import Model
from ..fit import Fit
from ..identify import identify
from ..intervals.estimates import Estimate, wald
from ..search.layout import Layout
from ..search.objective import Objective
from ..search.settle import settle
from ..search.starts import Starts
from ..suspects import explaining


@dataclass(frozen=True)
class Difference:
    """How a parameter differs between runs.

    Attributes
    ----------
    name : str
    unit : str
    values, stds : tuple of float
        By run, in their order.
    most : float
        The largest less the smallest value.
    most_std : float
        Standard error of that difference.
    p_value : float
        Of runs that do not differ: chi-squared of all differences together (Wald).
    """

    name: str
    unit: str
    values: tuple[float, ...]
    stds: tuple[float, ...]
    most: float
    most_std: float
    p_value: float

    def __str__(self) -> str:
        return (
            f"{self.name} differs by {with_error(self.most, self.most_std)}{unit_after(self.unit)} "
            f"(p {_equals(self.p_value)})"
        )


@dataclass(frozen=True, eq=False)
class RunsFit(Printed):
    """One fit of several runs; `found["name of the run"]` is that run's :class:`Fit`.

    Attributes
    ----------
    fits : dict of str to Fit
        By run: the model with that run's values, the common noise, and the run's driving.
    shared : tuple of Estimate
        What is common to all runs.
    differences : tuple of Difference
        What may differ, each with its value in every run.
    ties : dict of str to str
        Parameters that follow another one.
    covariance : array, shape (n, n)
        Of `shared`, then of what differs: all runs of the first parameter, of the second, ...; then
        of nuisances: all logs of the first one, of the second, ...
    log_likelihood : float
    common : Fit
        Of the same runs without a difference between them.
    converged : bool
    nuisances : tuple of Difference
        Those of the model, of which each log has its own: means over the logs of every run.
    """

    fits: dict[str, Fit]
    shared: tuple[Estimate, ...]
    differences: tuple[Difference, ...]
    ties: dict[str, str]
    covariance: FloatArray
    log_likelihood: float
    common: Fit
    converged: bool
    nuisances: tuple[Difference, ...] = ()

    __iter__ = None  # numbers are no names

    def __getitem__(self, run: str) -> Fit:
        if run not in self.fits:
            raise KeyError(f"'{run}'; there are {', '.join(self.fits)}")
        return self.fits[run]

    @property
    def gain(self) -> float:
        """Log-likelihood that the differences and ties gain over one model of all runs [nats]."""
        return self.log_likelihood - self.common.log_likelihood

    @property
    def _head(self) -> tuple[str, ...]:
        return ("parameter", *self.fits, "unit", "largest difference", "p")

    def _rows(self) -> list[list[str]]:
        rows = []
        for d in (*self.differences, *self.nuisances):
            told = [_with_std(v, s) for v, s in zip(d.values, d.stds, strict=True)]
            most = _with_std(d.most, d.most_std)
            rows.append([d.name, *told, d.unit, most, _equals(d.p_value).removeprefix("= ")])
        for e in self.shared:
            common = [_with_std(e.value, e.std), *[""] * (len(self.fits) - 1)]
            rows.append([e.name, *common, e.unit, "common", ""])
        return rows

    def _headline(self) -> str:
        tied = "".join(f"; {a} = {b}" for a, b in self.ties.items())
        text = (
            f"Fit of {len(self.fits)} runs; log-likelihood {self.log_likelihood:.1f}, "
            f"{self.gain:+.1f} against one model of all{tied}"
        )
        return text if self.converged else f"{text}; NOT CONVERGED"

    __repr__ = brief

    def _parts(self) -> list[Part]:
        return [self._headline(), Table(self._head, self._rows())]

    def to_dict(self) -> dict[str, Any]:
        """All figures, ready for JSON."""
        return {
            "log_likelihood": self.log_likelihood,
            "gain": self.gain,
            "shared": {e.name: e.to_dict() for e in self.shared},
            "runs": {
                run: {e.name: e.to_dict() for e in fit.estimates} for run, fit in self.fits.items()
            },
            "differences": {
                d.name: {"most": d.most, "std": d.most_std, "p_value": d.p_value, "unit": d.unit}
                for d in self.differences
            },
            "ties": dict(self.ties),
        }


def _equals(p_value: float) -> str:
    return f"= {p_value:.2g}" if p_value > 0.0 else "< 1e-300"


def _with_std(value: float, std: float) -> str:
    return f"{number(value)} +- {number(std, 2)}" if np.isfinite(std) else number(value)


@typed
@explaining
def identify_runs(
    model: Model,
    runs: Mapping[str, Log | Sequence[Log]],
    *,
    vary: Iterable[str] = (),
    tie: Mapping[str, str] = MappingProxyType({}),
    starts: int = 12,
    seed: int = 0,
    workers: int | None = None,
    progress: bool | None = None,
) -> RunsFit:
    """Estimate a model from several runs, between which some parameters may differ.

    Parameters
    ----------
    model : Model
        Of all runs.
    runs : mapping of str to Log or sequence of Log
        The driving of each run, by the name it is to have.
    vary : iterable of str
        Free parameters that may differ between runs, such as `mass.relative_error` or `D_front`.
        Priors are those of every run's own value. A nuisance among them has one value for each
        run, not for each log.
    tie : mapping of str to str
        Free parameters that are always equal to another one: ``{"D_rear": "D_front"}``.
    starts, seed, workers, progress
        As in :func:`sysid_vehicle.identify`, for the model without differences, from which the
        search goes on.

    Returns
    -------
    RunsFit

    Raises
    ------
    InvalidInput
        Fewer than two runs, or one, where something varies; a name that is no free parameter; a
        parameter that is tied and varies, or tied to one that is tied itself.
    NumericalError
        No start led anywhere.
    """
    vary = (vary,) if isinstance(vary, str) else tuple(dict.fromkeys(vary))
    _check(model, runs, vary, tie)
    model = _by_run(model, (*vary, *tie, *tie.values()))
    together = {run: Driving.of(logs).logs for run, logs in runs.items()}
    every = Driving.of([log for logs in together.values() for log in logs])
    common = identify(model, every, starts=starts, seed=seed, workers=workers, progress=progress)
    layout = Layout.of(common.model, {run: len(logs) for run, logs in together.items()}, vary, tie)
    plain = replace(common.driving, offsets=())
    logs = iter(plain.each_log())
    drivings = [Driving.joined(islice(logs, len(own))) for own in together.values()]
    objective = layout.objective(plain.each_log() if layout.offsets else drivings)
    q, noise, converged = settle(
        objective,
        layout.start(common.model.vector(), common.driving.offsets),
        common.noise.vector(),
        layout.box,
    )
    noise = objective.learn_noise(q, noise, rounds=1).noise
    return _summary(common, drivings, layout, objective, q, noise, converged)


def _by_run(model: Model, names: Iterable[str]) -> Model:
    """The model in which effects that runs have their own values of are no offsets of logs.

    An offset has one value for each log, and what differs between runs would be hidden in it.
    """
    ids = {name.partition(".")[0] for name in names}
    parts = (replace(e, same_in_all_logs=True) if e.id in ids else e for e in model.parts)
    return replace(model, parts=tuple(parts))


def _check(
    model: Model, runs: Mapping[str, object], vary: Sequence[str], tie: Mapping[str, str]
) -> None:
    if not isinstance(runs, Mapping) or not runs or not all(isinstance(r, str) for r in runs):
        raise InvalidInput(
            'runs: give a mapping, {"name of the run": log, ...}; each may have several logs'
        )
    if vary and len(runs) < 2:
        raise InvalidInput("runs: one run has no differences; give two or more, or vary nothing")
    free = model.free_names
    for name in (*vary, *tie, *tie.values()):
        if name not in free:
            raise InvalidInput(
                f"'{name}' is no free parameter of the model{near_names(name, free)}"
            )
    for name, other in tie.items():
        if name in vary:
            raise InvalidInput(f"{name} is tied to {other} and cannot vary; vary {other}")
        if other in tie or other == name:
            raise InvalidInput(f"{name} is tied to {other}, which is tied itself")


def _summary(
    common: Fit,
    drivings: Sequence[Driving],
    layout: Layout,
    objective: Objective,
    q: FloatArray,
    noise: FloatArray,
    converged: bool,
) -> RunsFit:
    frozen = objective.freeze(q, noise)
    _, _, information = objective.normal_equations(q, frozen, layout.box.columns)
    x = q[layout.box.columns]
    parameters = common.model.parameters
    labels = [f"{n} [{r}]" if r else n for n, r in layout.every]
    units = {label: parameters[n].unit for label, (n, _) in zip(labels, layout.every, strict=True)}
    estimates, covariance = wald(
        labels,
        units,
        x,
        information,
        layout.box,
        [common.model.bounds(n) for n, _ in layout.every],
    )
    told = NoiseModel.from_vector(noise)
    maps = [layout.of_run(i) for i in range(len(layout.runs))]
    fits = {}
    for i, (run, driving) in enumerate(zip(layout.runs, drivings, strict=True)):
        parts = [k for k, of in enumerate(layout.run_of) if of == i]
        model = common.model.from_vector(q[layout.source(parts[0])])
        # What is tied is not free in the run's own fit.
        model = model.with_fixed({n: model.value(n) for n in layout.tie})
        own = as_float64(maps[i] @ covariance @ maps[i].T)
        some = tuple(
            replace(estimates[int(np.argmax(row))], name=n)
            if row.max() == 1.0
            else _mean_of_logs(n, row, x, own[k, k], common.model)
            for k, (n, row) in enumerate(zip(model.free_names, maps[i], strict=True))
        )
        mean = {e.name: e.value for e in some if e.name in layout.offsets}
        if len(parts) > 1 and mean:
            apart = [{n: float(q[layout.places(n)[k]] - mean[n]) for n in mean} for k in parts]
            driving = replace(driving, offsets=tuple(apart))
        fits[run] = Fit(
            model.with_values(mean),
            told,
            some,
            own,
            float(sum(frozen.parts[k].log_likelihood for k in parts)),
            driving,
            Starts.none(tuple(e.name for e in some)),
            converged,
        )
    free = list(fits[layout.runs[0]].model.free_names)

    def differing(names: Sequence[str]) -> tuple[Difference, ...]:
        rows = (np.array([of[free.index(n)] for of in maps]) for n in names)
        return tuple(
            _difference(n, parameters[n].unit, of @ x, of @ covariance @ of.T)
            for n, of in zip(names, rows, strict=True)
        )

    return RunsFit(
        fits,
        tuple(estimates[: len(layout.shared)]),
        differing(layout.vary),
        dict(layout.tie),
        covariance,
        float(frozen.log_likelihood),
        common,
        converged,
        differing(layout.offsets),
    )


def _mean_of_logs(
    name: str, weights: FloatArray, x: FloatArray, variance: float, model: Model
) -> Estimate:
    unit = model.parameters[name].unit
    std = float(np.sqrt(variance))
    return Estimate(name, float(weights @ x), std, unit, bounds=model.bounds(name))


def _difference(name: str, unit: str, values: FloatArray, of: FloatArray) -> Difference:
    runs = len(values)
    std = np.sqrt(np.diag(of))
    if runs == 1:
        return Difference(name, unit, (float(values[0]),), (float(std[0]),), 0.0, 0.0, 1.0)
    contrast = np.eye(runs)[1:] - np.eye(runs)[0]
    apart = contrast @ values
    chi2 = float(apart @ np.linalg.solve(contrast @ of @ contrast.T, apart))
    low, high = int(np.argmin(values)), int(np.argmax(values))
    variance = of[low, low] + of[high, high] - 2.0 * of[low, high]
    return Difference(
        name,
        unit,
        tuple(map(float, values)),
        tuple(map(float, std)),
        float(values[high] - values[low]),
        float(np.sqrt(max(variance, 0.0))),
        float(scipy.stats.chi2.sf(chi2, runs - 1)),
    )
