"""Formulas for a missing force or a false reading, tried on validation data.

Each formula of the grammar is a column of sensitivities, projected on all that the fitted
parameters can do; forces at an unknown place act on F_y and M_z at once. The best by

    T - q ln n - 2 ln N

(T the fall of the sum of squares, q gains, n samples, N formulas tried: Chen & Chen, Biometrika
2008) is kept if, with its gains and the shift of the fitted parameters taken over unchanged, the
validation data become likelier by more than a standard error. What remains is searched again.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np

from ..._common.arrays import FloatArray, as_float64
from ..._common.text import brief, number
from ...effects import Effect, define_effect, parameter
from ..evidence.coordinates import BLOCK_S, blocks
from ..evidence.evidence import FORCES, READINGS, Evidence, Solution, solve
from .grammar import Form, forms, unit_of_gain
from .shape import known

_MOST = 3
_TRIED = 4  # on validation data, before a step gives up
_ALIKE = 9.0  # difference of statistics that does not tell two formulas apart
_RETAINED = 0.02  # below that the formula is what a fitted parameter does as well
_VISIBLE = 0.03  # share of a formula that those chosen before it cannot copy
_CHANNELS = {"r": "yaw_rate_radps", "a_x": "ax_mps2", "a_y": "ay_mps2"}
_FORCES = {"F_x": "force_x", "F_y": "force_y", "M_z": "moment_z"}


@dataclass(frozen=True, eq=False)
class Proposal:
    """A formula for what is missing.

    Attributes
    ----------
    form : Form
    gain, std : dict of str to float
        By target: the number before the formula, and its standard error.
    statistic : float
        Fall of the sum of squared residuals in training.
    validation_gain, validation_gain_std : float
        Gain in log-likelihood on validation data, and its standard error.
    alike : tuple of str
        Other formulas that this driving hardly tells from it.
    """

    form: Form
    gain: dict[str, float]
    std: dict[str, float]
    statistic: float
    validation_gain: float
    validation_gain_std: float
    alike: tuple[str, ...]

    @property
    def units(self) -> dict[str, str]:
        """Units of the gains."""
        return {t: unit_of_gain(t, self.form) for t in self.gain}

    @property
    def equation(self) -> str:
        """What it adds to each target, with names for the gains."""
        product = str(self.form)
        return ", ".join(f"{t} += {_gain_name(t, self.gain)} {product}".rstrip() for t in self.gain)

    __repr__ = brief

    def __str__(self) -> str:
        sizes = ", ".join(
            f"{_gain_name(t, self.gain)} = {number(g, 3)} +- {number(self.std[t], 2)} "
            f"{self.units[t]}"
            for t, g in self.gain.items()
        )
        text = (
            f"{self.equation} with {sizes}; validation data become likelier by "
            f"{self.validation_gain:.0f} +- {self.validation_gain_std:.0f} nats"
        )
        return f"{text}; much like {', '.join(self.alike)}" if self.alike else text

    def functions(self) -> dict[str, Callable[[Any, Any], Any]]:
        """A function f(d, p) of each target: what the car does, and the gains."""
        return {t: _function(self.form, _gain_name(t, self.gain)) for t in self.gain}

    def as_effect(self, id: str, title: str = "") -> Effect:
        """Define it as an effect under a name of your own."""
        act = self.functions()
        parameters = [
            parameter(
                _gain_name(t, self.gain),
                self.units[t],
                typical=g,
                lower=-20.0 * abs(g),
                upper=20.0 * abs(g),
                matters=min(2.0 * self.std[t], 0.5 * abs(g)),
            )
            for t, g in self.gain.items()
        ]
        forces = {_FORCES[t]: f for t, f in act.items() if t in _FORCES}
        reads: Mapping[str, Any] = {_CHANNELS[t]: f for t, f in act.items() if t in _CHANNELS}
        return define_effect(
            id,
            title=title or f"proposed: {self.equation}",
            parameters=parameters,
            force_x=forces.get("force_x"),
            force_y=forces.get("force_y"),
            moment_z=forces.get("moment_z"),
            reads=reads or None,
        )

    def to_dict(self) -> dict[str, Any]:
        """All of it, ready for JSON."""
        return {
            "equation": self.equation,
            "gains": {
                t: {"value": g, "std": self.std[t], "unit": self.units[t]}
                for t, g in self.gain.items()
            },
            "statistic": self.statistic,
            "validation_gain": self.validation_gain,
            "validation_gain_std": self.validation_gain_std,
            "alike": list(self.alike),
        }


def _gain_name(target: str, among: Mapping[str, float]) -> str:
    return "gain" if len(among) == 1 else f"gain_{target.lower()}"


def _function(form: Form, gain: str) -> Callable[[Any, Any], Any]:
    def act(d: Any, p: Any) -> Any:
        return getattr(p, gain) * form(d)

    return act


@dataclass(frozen=True, eq=False)
class _Candidate:
    form: Form
    targets: tuple[str, ...]
    columns: tuple[int, ...]

    @property
    def text(self) -> str:
        return f"{' and '.join(self.targets)} with {str(self.form) or 'no change'}"


def propose(train: Evidence, validation: Evidence) -> tuple[Proposal, ...]:
    """Find at most three formulas that explain what is left and also hold on validation data."""
    targets = train.targets(*FORCES, *READINGS)
    acting = [
        (t, f) for t in targets for f in forms(t) if train.driving.force_known or not f.uses("F_x")
    ]
    candidates = _candidates(acting)
    R = _columns(train, acting, projected=True)
    gram, score = R.T @ R, R.T @ train.left
    before = np.sqrt(np.diag(gram))
    dear = float(np.log(train.driving.samples))
    tried_price = 2.0 * float(np.log(len(candidates)))
    taken: list[int] = []
    found: list[Proposal] = []
    refused: set[int] = set()
    while len(found) < _MOST:
        # What was chosen before stays free, as the fitted parameters do.
        copied = np.linalg.pinv(gram[np.ix_(taken, taken)]) @ gram[taken]
        G, s = gram - gram[:, taken] @ copied, score - copied.T @ score[taken]
        scores = np.array([_statistic(G, s, before, c) for c in candidates])
        merit = scores - dear * np.array([len(c.columns) for c in candidates]) - tried_price
        merit[list(refused)] = -np.inf
        added = None
        for k in map(int, np.argsort(-merit)[:_TRIED]):
            if merit[k] <= 0.0:
                break
            c = candidates[k]
            refused.add(k)
            places = [*taken, *c.columns]
            own = _with_others_free(R, train.left, places, len(c.columns))
            if own.statistic - dear * len(c.columns) - tried_price <= 0.0:
                continue
            few = [acting[i] for i in places]
            here, there = _columns(train, few), _columns(validation, few)
            whole, part = (np.linalg.norm(m, axis=0) for m in (here, R[:, places]))
            if np.any(part < _RETAINED * whole):
                continue
            gain, error = _on_validation(train, validation, here, there, len(c.columns))
            if gain > error:
                near = np.flatnonzero(merit > merit[k] - _ALIKE)
                alike = [candidates[j].text for j in near[np.argsort(-merit[near])] if j != k]
                added = _proposal(c, own, gain, error, tuple(alike[:3]))
                taken = places
                break
        if added is None:
            break
        found.append(added)
    return tuple(found)


def _with_others_free(R: FloatArray, e: FloatArray, places: list[int], new: int) -> Solution:
    """Sizes of the last columns, those before them left free."""
    Q = np.linalg.qr(R[:, places[:-new]])[0]
    own = R[:, places[-new:]]
    return solve(as_float64(own - Q @ (Q.T @ own)), as_float64(e - Q @ (Q.T @ e)))


def _candidates(acting: list[tuple[str, Form]]) -> list[_Candidate]:
    place = {pair: i for i, pair in enumerate(acting)}
    single = [_Candidate(form, (target,), (i,)) for i, (target, form) in enumerate(acting)]
    both = [
        _Candidate(form, ("F_y", "M_z"), (i, place["M_z", form]))
        for i, (target, form) in enumerate(acting)
        if target == "F_y"
    ]
    return single + both


def _columns(
    evidence: Evidence, acting: list[tuple[str, Form]], *, projected: bool = False
) -> FloatArray:
    where = known(evidence)
    d = SimpleNamespace(
        v_x=where["vx_mps"],
        r=where["yaw_rate_radps"],
        steer=where["steer_rad"],
        alpha_f=where["slip_front_rad"],
        alpha_r=where["slip_rear_rad"],
        F_x=where["ax_mps2"] * evidence.fit.model.vehicle.mass_kg,
    )
    signals = np.column_stack([form(d) for _, form in acting])
    return evidence.of_signals(signals, [t for t, _ in acting], projected=projected)


def _statistic(
    gram: FloatArray, score: FloatArray, before: FloatArray, candidate: _Candidate
) -> float:
    few = list(candidate.columns)
    scale = np.sqrt(np.maximum(np.diag(gram)[few], 0.0))
    if np.any(scale <= _VISIBLE * before[few]):
        return 0.0  # a copy of what is there already
    S = score[few] / scale
    return float(S @ np.linalg.pinv(gram[np.ix_(few, few)] / np.outer(scale, scale), 1e-8) @ S)


def _on_validation(
    train: Evidence, validation: Evidence, here: FloatArray, there: FloatArray, new: int
) -> tuple[float, float]:
    """Gain in log-likelihood on validation data of the last columns, and its standard error.

    Gains and the shift of the fitted parameters beside them are those of the training.
    """
    residuals = []
    for count in (here.shape[1] - new, here.shape[1]):
        gains = np.zeros(0)
        if count:
            gains = solve(train.project(here[:, :count]), train.left).size
        rest = train.residual - here[:, :count] @ gains
        shift = np.linalg.lstsq(train.fitted, rest, rcond=1e-6)[0]
        predicted = validation.fitted @ shift + there[:, :count] @ gains
        residuals.append(validation.residual - predicted)
    fall = 0.5 * (residuals[0] ** 2 - residuals[1] ** 2)
    by_sample = fall.reshape(validation.driving.samples, -1).sum(axis=1)
    sums = np.add.reduceat(by_sample, blocks(validation.driving, BLOCK_S))
    return float(fall.sum()), float(np.std(sums) * np.sqrt(len(sums)))


def _proposal(
    c: _Candidate, own: Solution, gain: float, error: float, alike: tuple[str, ...]
) -> Proposal:
    std = np.sqrt(np.diag(own.covariance))
    return Proposal(
        c.form,
        dict(zip(c.targets, map(float, own.size), strict=True)),
        dict(zip(c.targets, map(float, std), strict=True)),
        own.statistic,
        gain,
        error,
        alike,
    )
