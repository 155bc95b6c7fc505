"""What an effect that is not modelled does to the parameters already identified.

The fit's own driving is done again in simulation, without the effect and with it, and the model is
fitted to both without it. Parameters and noise are learned anew each time: a first-order formula
keeps the noise, and so gives to the tyres what the disturbances of a refit take up, as they do
with drag, grade, or anything else that acts along the car.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..._common.arrays import FloatArray, as_float64
from ..._common.progress import with_progress
from ..._common.text import HALF_95, brief, html_table, number, text_table, unit_after
from ..._common.threads import Workers
from ..._common.typed import typed
from ...effects import Effect, base_parameters
from ...errors import InvalidInput, NumericalError
from ...identify import Fit, explaining, longest_s
from ...vehicle import AXLES
from .replay import Replay

_WORTH_TELLING = 0.01  # of the parameter: refits agree no better
# How far two drives may lead apart from their mean: of the parameter, or of the bias.
_NEAR, _SHARE = 0.01, 0.2


@dataclass(frozen=True)
class Bias:
    """One effect of a stated size, and what it does to the identified parameters unnoticed.

    Attributes
    ----------
    effect : Effect
    size : tuple of float
        Its parameters, as distances from their null values.
    relative : dict of str to float
        By which part of itself each identified parameter is off: the cornering stiffness B C D of
        both axles, a yaw inertia that is identified, and parameters of effects that the model has,
        where they are known to differ from zero. B, C, D and E copy each other and are not stated
        one by one. Empty where nothing can be stated.
    because : str
        Why nothing can be stated; otherwise empty.
    """

    effect: Effect
    size: tuple[float, ...]
    relative: dict[str, float]
    because: str = ""

    @property
    def worst(self) -> tuple[str, ...]:
        """Parameters that are off by one percent or more, the worst first."""
        off = {n: abs(r) for n, r in self.relative.items()}
        return tuple(
            sorted((n for n, r in off.items() if r >= _WORTH_TELLING), key=lambda n: -off[n])
        )

    def __str__(self) -> str:
        size = " and ".join(
            f"{p.name} {number(v, 3)}{unit_after(p.unit)}"
            for p, v in zip(self.effect.parameters, self.size, strict=True)
            if v != 0.0
        )
        if self.because:
            return f"{self.effect.title} of {size}: not stated, {self.because}"
        told = [f"{100.0 * self.relative[n]:+.1f} % to {n}" for n in self.worst[:3]]
        what = ", ".join(told) if told else "less than one percent to any parameter"
        return f"{self.effect.title} of {size} that is not modelled adds {what}"


@dataclass(frozen=True, eq=False)
class BiasReport:
    """What each untested effect would do to the parameters already identified.

    Attributes
    ----------
    biases : tuple of Bias
        The most harmful first, those of which nothing can be stated last.
    """

    biases: tuple[Bias, ...]

    _HEAD = ("effect", "size", "front stiffness", "rear stiffness", "worst")

    __iter__ = None  # numbers are no names

    def __getitem__(self, effect: str) -> Bias:
        for b in self.biases:
            if b.effect.id == effect:
                return b
        raise KeyError(f"'{effect}'; there are {', '.join(b.effect.id for b in self.biases)}")

    def _rows(self) -> list[list[str]]:
        rows = []
        for b in self.biases:
            size = ", ".join(
                f"{number(v, 3)}{unit_after(p.unit)}"
                for p, v in zip(b.effect.parameters, b.size, strict=True)
                if v != 0.0
            )
            if b.because:
                rows.append([b.effect.id, size, "-", "-", f"not stated: {b.because}"])
                continue
            worst = f"{b.worst[0]} {100.0 * b.relative[b.worst[0]]:+.1f} %" if b.worst else "-"
            stiff = [f"{100.0 * b.relative[f'stiffness_{a}']:+.1f} %" for a in AXLES]
            rows.append([b.effect.id, size, *stiff, worst])
        return rows

    __repr__ = brief

    def __str__(self) -> str:
        return "What the identified parameters would hide\n" + text_table(self._HEAD, self._rows())

    def _repr_html_(self) -> str:
        return html_table(self._HEAD, self._rows())


@typed
@explaining
def bias_report(
    fit: Fit,
    effects: Sequence[Effect | str] | None = None,
    *,
    most_samples: int = 3000,
    seed: int = 0,
    workers: int | None = None,
    progress: bool | None = None,
) -> BiasReport:
    """Say what each effect of a typical size would do unnoticed to the fit's parameters.

    Each effect takes two refits, about a second of one processor for a minute of driving.

    Parameters
    ----------
    fit : Fit
    effects : sequence of Effect or str, optional
        By default all that the model lacks.
    most_samples : int
        Of driving that has more at 25 Hz, windows are done again, evenly spread.
    seed : int
        Of the simulated noise.
    workers : int, optional
        Threads; by default as many as there are cores. The result is the same for any number.
    progress : bool, optional
        Show a progress bar; by default in a terminal or a notebook, after two seconds.

    Returns
    -------
    BiasReport

    Raises
    ------
    InvalidInput
        An effect that the model has already, or that it identifies otherwise.
    """
    candidates = fit.model.candidates
    wanted = candidates if effects is None else tuple(fit.model.effect(e) for e in effects)
    known = {e.id for e in candidates}
    for e in wanted:
        if e.id not in known:
            raise InvalidInput(
                f"the fit identifies '{e.id}' already; name effects that its model lacks"
            )
    middle_s = 0.5 * longest_s(fit.driving)
    sizes = [
        tuple(middle_s if p.scan == "time" else p.typical for p in e.parameters) for e in wanted
    ]
    effects_at = [
        dict(zip(e.named, size, strict=True)) for e, size in zip(wanted, sizes, strict=True)
    ]
    replay, told = Replay(fit, most_samples, seed), _Told.of(fit)
    try:
        cars = (fit.model, replay.rival())
    except NumericalError as failure:
        because = f"{failure}, even without the effect"
        return BiasReport(
            tuple(
                Bias(e, _away(e, size), {}, because) for e, size in zip(wanted, sizes, strict=True)
            )
        )

    def refitted(job: tuple[int, bool]) -> FloatArray | str:
        which, first = job
        acting = cars[0 if first else 1]
        if which > 0:
            acting = acting.add(wanted[which - 1]).with_values(effects_at[which - 1])
        try:
            p = replay.refitted(acting, 1.0 if first else -1.0, corrects=first)
        except NumericalError as failure:
            return str(failure)
        return told.read(p)

    jobs = [(which, first) for which in range(len(wanted) + 1) for first in (True, False)]
    with Workers(workers) as pool:
        done = with_progress(pool.map(refitted, jobs), "refits", total=len(jobs), shown=progress)
        found = list(done)
    biases = []
    for i, (e, size) in enumerate(zip(wanted, sizes, strict=True), start=1):
        biases.append(_bias(e, _away(e, size), told, found[:2], found[2 * i : 2 * i + 2]))
    biases.sort(key=lambda b: -_harm(b))
    return BiasReport(tuple(biases))


def _away(e: Effect, values: tuple[float, ...]) -> tuple[float, ...]:
    return tuple(v - p.null_value for p, v in zip(e.parameters, values, strict=True))


@dataclass(frozen=True)
class _Told:
    """What of a core's parameter vector is stated: logarithms of stiffness, then other values."""

    columns: tuple[int, ...]
    names: tuple[str, ...]
    values: FloatArray

    @classmethod
    def of(cls, fit: Fit) -> _Told:
        known = fit.model.parameters
        others = [e for e in fit.estimates if e.name[1] != "_" and abs(e.value) > HALF_95 * e.std]
        return cls(
            tuple(known[e.name].column for e in others),
            tuple(e.name for e in others),
            as_float64([abs(e.value) for e in others]),
        )

    def read(self, p: FloatArray) -> FloatArray:
        stiffness = [np.log(np.prod(p[[_column(x, axle) for x in "BCD"]])) for axle in AXLES]
        return np.array([*stiffness, *p[list(self.columns)]])

    def relative(self, off: FloatArray) -> dict[str, float]:
        n = len(AXLES)
        parts = [*np.expm1(off[:n]), *(off[n:] / self.values)]
        names = [*(f"stiffness_{axle}" for axle in AXLES), *self.names]
        return dict(zip(names, map(float, parts), strict=True))


def _column(letter: str, axle: str) -> int:
    name = f"{letter}_{axle}"
    return next(p.column for p in base_parameters() if p.name == name)


def _bias(
    e: Effect,
    size: tuple[float, ...],
    told: _Told,
    without: Sequence[FloatArray | str],
    acting: Sequence[FloatArray | str],
) -> Bias:
    """What both drivers find, if they agree."""
    off = []
    for one, other in zip(without, acting, strict=True):
        if isinstance(one, str):
            return Bias(e, size, {}, f"{one}, even without the effect")
        if isinstance(other, str):
            return Bias(e, size, {}, other)
        off.append(other - one)
    first, second = (told.relative(o) for o in off)
    mean = told.relative(as_float64((off[0] + off[1]) / 2.0))
    excess = {n: abs(first[n] - second[n]) / 2.0 - max(_NEAR, _SHARE * abs(mean[n])) for n in mean}
    worst = max(excess, key=lambda n: excess[n])
    if excess[worst] > 0.0:
        between = " or ".join(f"{100.0 * x[worst]:+.1f} %" for x in (first, second))
        because = f"{between} to {worst}, by the driver, the noise, and tyres that fit as well"
        return Bias(e, size, {}, because)
    return Bias(e, size, mean)


def _harm(b: Bias) -> float:
    return max((abs(b.relative[f"stiffness_{a}"]) for a in AXLES if not b.because), default=-1.0)
