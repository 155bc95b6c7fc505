"""Offsets that differ from log to log: biases of sensors, zero of the steering angle, crossfall.

They are known to be there (`Model.with_nuisances`), and no property of the car. Each log has its
own, with the prior of the model about their null values: those of other logs say nothing of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any, NamedTuple, cast

import numpy as np
import scipy

from .._common.arrays import FloatArray, as_float64
from .._common.memo import remembered
from .._common.text import few
from ..errors import InvalidInput, NumericalError, warn
from ..estimate import Driving, NoiseModel, noise_range, without_force, without_unlearned
from ..log import Log
from ..model import Model
from .ahead.ahead import predicting_ahead
from .fit import Fit
from .search.box import free_box, free_prior
from .search.layout import Layout
from .search.objective import Objective
from .search.settle import moved, settle

OFFSETS = "offsets"
"""With a fit the question that `Driving.told` may answer, by `Settled`."""
_ROUNDS = 3
_STANDS = 0.1  # nats


def driving_of(fit: Fit, logs: Log | Sequence[Log] | Driving) -> Driving:
    """Driving as a fit reads it: its logs have the offsets that are best under the fit.

    The likeliest ones with noise of the log's own; of a fit to predictions those that predict best.
    A wheel force, or a channel, that the fit did not have is not used.

    Parameters
    ----------
    fit : Fit
        Everything but its nuisances stays as it is.
    logs : Log, sequence of Log, or Driving
        Driving that has offsets keeps them, and so does what the fit was made of.

    Returns
    -------
    Driving
    """
    driving = _as_measured(fit, Driving.of(logs))
    if driving is fit.driving or driving.offsets or not fit.model.offset_names:
        return driving
    return settled_offsets(fit, driving).driving


def _as_measured(fit: Fit, driving: Driving) -> Driving:
    """Driving without the wheel force, and without readings, where the fit had none.

    What noise they have the fit has not learned.
    """
    if driving is fit.driving:
        return driving
    if driving.force_known and not fit.driving.force_known:
        why = "the fit was made without the wheel force"
        logs = without_force(driving.logs, why)
        warn(
            f"{few([log.name for log in logs])}: {why}, whose noise it did not learn: fx_n is not "
            "used here, and ax_mps2 takes its place; identify with logs that have fx_n to see "
            "errors of it"
        )
        driving = replace(driving, logs=logs, force_known=False)
    logs = tuple(without_unlearned(driving.logs, fit.driving.logs))
    return driving if logs == driving.logs else replace(driving, logs=logs)


def driving_beside(fit: Fit, near: Fit, logs: Log | Sequence[Log] | Driving) -> Driving:
    """Driving whose logs have the offsets that are best under a fit that is like another one.

    As `driving_of`, but from the offsets under the other fit on, and under the noise that each log
    has with that, times what the noise of the fit is of the other's: of many such fits the noise is
    learned once. Offsets differ from those of `driving_of` by less than their standard errors.

    Parameters
    ----------
    fit : Fit
    near : Fit
        Of a model with the same nuisances.
    logs : Log, sequence of Log, or Driving

    Returns
    -------
    Driving
    """
    driving = Driving.of(logs)
    names = fit.model.offset_names
    if driving is fit.driving or driving.offsets or not names:
        return driving
    known = settled_offsets(near, driving)
    if fit.horizon_s or not known.noise or near.model.offset_names != names:
        return driving_of(fit, driving)
    at = {n: near.model.value(n) for n in names}
    alone = _nuisances_alone(fit)
    before, after = near.noise.vector(), fit.noise.vector()
    there_is = (before > 0.0) & (after > 0.0)
    changed = np.where(there_is, after, 1.0) / np.where(there_is, before, 1.0)
    try:
        own = [
            _moved(alone.with_values({n: at[n] + v for n, v in off.items()}), log, told * changed)
            for log, off, told in zip(
                driving.each_log(), known.driving.offsets, known.noise, strict=True
            )
        ]
    except (NumericalError, np.linalg.LinAlgError):
        return driving
    return _with_offsets(fit, driving, own)


class Settled(NamedTuple):
    """Driving with its offsets, and the noise of each log; none where it was not learned."""

    driving: Driving
    noise: tuple[FloatArray, ...]


# Several measures ask for the same fit on the same validation data.
@remembered(64)
def settled_offsets(fit: Fit, driving: Driving) -> Settled:
    """Offsets that are best under a fit, on driving that has none yet."""
    if (OFFSETS, fit) in driving.told:
        return cast(Settled, driving.told[OFFSETS, fit])
    try:
        found = [_best(fit, log) for log in driving.each_log()]
    except (NumericalError, np.linalg.LinAlgError):
        return Settled(driving, ())
    noise = tuple(noise for _, noise in found if noise is not None)
    settled = _with_offsets(fit, driving, [values for values, _ in found])
    return Settled(settled, noise if len(noise) == len(found) else ())


def _with_offsets(fit: Fit, driving: Driving, own: Sequence[dict[str, float]]) -> Driving:
    """Driving with values of the nuisances of each log, as distances from those of the model."""
    at = {n: fit.model.value(n) for n in fit.model.offset_names}
    return replace(driving, offsets=tuple({n: v - at[n] for n, v in o.items()} for o in own))


def _nuisances_alone(fit: Fit) -> Model:
    """The model with nothing free but its nuisances."""
    names = fit.model.offset_names
    return fit.model.with_fixed([n for n in fit.model.free_names if n not in names])


def _values(alone: Model, p: FloatArray) -> dict[str, float]:
    return {n: float(p[alone.parameters[n].column]) for n in alone.offset_names}


def _best(fit: Fit, driving: Driving) -> tuple[dict[str, float], FloatArray | None]:
    """Values of the nuisances of one log, by the criterion of the fit, and noise of the log."""
    alone = _nuisances_alone(fit)
    if fit.horizon_s:
        # One step ahead parameters that are not the likelihood's would bend the offsets.
        with suppress(InvalidInput):  # too short for a window
            found = predicting_ahead(replace(fit, model=alone, driving=driving), fit.horizon_s)
            return {n: found.model.value(n) for n in alone.offset_names}, None
    p, noise = _likeliest(alone, driving, fit.noise)
    return _values(alone, p), noise


def _objective(alone: Model, driving: Driving) -> Objective:
    within = noise_range(alone.vehicle, driving)
    return Objective(driving.problem(alone), free_prior(alone), *within)


def _within(objective: Objective, noise: FloatArray) -> FloatArray:
    """Noise within the range of a log; no road where none is."""
    within = np.clip(noise, objective.lowest, objective.highest)
    return as_float64(np.where(noise > 0.0, within, 0.0))


def _moved(alone: Model, driving: Driving, noise: FloatArray) -> dict[str, float]:
    """Values of the nuisances of one log, from near ones on, under noise that stays."""
    box, objective = free_box(alone), _objective(alone, driving)
    p = box.inside(alone.vector())
    p, _ = moved(objective, p, _within(objective, noise), box, rounds=8, tolerance=_STANDS)
    return _values(alone, p)


def _likeliest(alone: Model, driving: Driving, noise: NoiseModel) -> tuple[FloatArray, FloatArray]:
    """Parameters of the core, the free ones at the maximum of the likelihood, and the noise.

    Noise is that of the log: what a model lacks elsewhere is no offset.
    """
    box, objective = free_box(alone), _objective(alone, driving)
    p = box.inside(alone.vector())
    told = _within(objective, noise.vector())
    value = -np.inf
    for _ in range(_ROUNDS):
        told = objective.learn_noise(p, told, rounds=2).noise
        p, gains = moved(objective, p, told, box, rounds=8, tolerance=_STANDS)
        before, value = value, objective.reached(p, gains)
        if value < before + _STANDS:
            break
    return p, told


def centred(fit: Fit) -> tuple[Model, Driving]:
    """The model with the mean of what its nuisances are in each log, and these by their offsets.

    Found log by log, then together with all other parameters: in turn with them, what a nuisance
    has taken up of an effect that the model lacked it would give back step by step.
    """
    plain = replace(fit.driving, offsets=())
    layout = Layout.of(fit.model, {"": len(plain.logs)}, (), {})
    try:
        objective = layout.objective(plain.each_log())
        near = settled_offsets(fit, plain).driving.offsets or ({},) * len(plain.logs)
        begin = layout.start(fit.model.vector(), near)
        q, _, _ = settle(objective, begin, fit.noise.vector(), layout.box)
    except (NumericalError, np.linalg.LinAlgError):
        return fit.model, fit.driving
    own = {n: q[layout.places(n)] for n in layout.offsets}
    mean = {n: float(np.mean(values)) for n, values in own.items()}
    offsets = tuple(
        {n: float(values[i] - mean[n]) for n, values in own.items()} for i in range(len(plain.logs))
    )
    model = fit.model.from_vector(q[layout.source(0)]).with_values(mean)
    return model, replace(plain, offsets=offsets)


def marginal_information(
    model: Model, driving: Driving, p: FloatArray, noise: NoiseModel
) -> FloatArray:
    """Information about the free parameters where each log has nuisances of its own.

    Of a nuisance it is that about its mean over the logs.

    Parameters
    ----------
    model : Model
    driving : Driving
    p : array, shape (parameters,)
        Of the core.
    noise : NoiseModel

    Returns
    -------
    array, shape (n, n)
        In the order of the model's free parameters.
    """
    box, names = free_box(model), model.free_names
    own = np.isin(names, model.offset_names)
    n, each = len(names), driving.each_log()
    shared, several = int(np.count_nonzero(~own)), int(np.count_nonzero(own))
    prior = np.zeros((n, n))
    for rows in free_prior(model):
        slopes = rows(p)[1][:, box.columns]
        prior += slopes.T @ slopes
    whole = np.zeros((shared + several * len(each),) * 2)
    whole[:shared, :shared] = prior[np.ix_(~own, ~own)]
    # From shared parameters, means of nuisances and what all logs but the last differ by from them.
    back = np.zeros_like(whole)
    back[:shared, :shared] = np.eye(shared)
    at = np.empty(n, dtype=np.intp)
    at[~own] = np.arange(shared)
    for i, log in enumerate(each):
        problem: Any = log.problem(model)
        gains = problem.freeze(p, noise.vector())
        _, _, told = problem.normal_equations(p, gains, box.columns)
        told[np.ix_(own, own)] += prior[np.ix_(own, own)]
        at[own] = shared + several * i + np.arange(several)
        whole[np.ix_(at, at)] += told
        back[at[own], shared : shared + several] = np.eye(several)
        for j in range(len(each) - 1):
            sign = float(i == j) - float(i == len(each) - 1)
            back[at[own], shared + several * (j + 1) + np.arange(several)] = sign
    turned = back.T @ whole @ back
    # Differences have the prior: what they could be is finite, and the rest is free of them.
    kept, apart = slice(0, shared + several), slice(shared + several, None)
    told = turned[kept, kept] - turned[kept, apart] @ scipy.linalg.solve(
        turned[apart, apart], turned[apart, kept], assume_a="pos"
    )
    at[own] = shared + np.arange(several)
    return as_float64(0.5 * (told + told.T)[np.ix_(at, at)])
