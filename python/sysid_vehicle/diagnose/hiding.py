"""What an effect that is not modelled does to the parameters already identified."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .._text import html_table, number, text_table
from ..effects import Effect
from ..identify import Fit
from .information import Information, information_of

__all__ = ["Bias", "BiasReport", "bias_report"]

_AXLES = ("front", "rear")
_WORTH_TELLING = 0.005  # of the parameter
_FIRST_ORDER = 0.5  # of the parameter, beyond which a first derivative tells nothing


@dataclass(frozen=True)
class Bias:
    """One effect of a stated size, and what it does to the identified parameters unnoticed.

    Attributes
    ----------
    effect : Effect
    size : tuple of float
        Its parameters, as distances from their null values.
    shift : dict of str to float
        By which each identified parameter is off; cornering stiffnesses B C D of both axles too.
    relative : dict of str to float
        The same over the parameter's value; NaN where that is zero.
    """

    effect: Effect
    size: tuple[float, ...]
    shift: dict[str, float]
    relative: dict[str, float]

    @property
    def worst(self) -> tuple[str, ...]:
        """Parameters that are off by half a percent or more, the worst first.

        None that would be off by half its value or more: B, C, D and E copy each other, and what
        they do far from the fit no derivative tells. Their product, the stiffness, it does.
        """
        off = {n: abs(r) for n, r in self.relative.items() if abs(r) <= _FIRST_ORDER}
        return tuple(
            sorted((n for n, r in off.items() if r >= _WORTH_TELLING), key=lambda n: -off[n])
        )

    def __str__(self) -> str:
        size = " and ".join(
            f"{p.name} {number(v, 3)} {p.unit}".removesuffix(" 1")
            for p, v in zip(self.effect.parameters, self.size, strict=True)
            if v != 0.0
        )
        told = [f"{100.0 * self.relative[n]:+.1f} % to {n}" for n in self.worst[:3]]
        what = ", ".join(told) if told else "less than half a percent to any"
        return f"{self.effect.title} of {size} that is not modelled adds {what}"


@dataclass(frozen=True, eq=False)
class BiasReport:
    """What each untested effect would do to the parameters already identified.

    Attributes
    ----------
    biases : tuple of Bias
        The most harmful first.
    """

    biases: tuple[Bias, ...]

    _HEAD = ("effect", "size", "front stiffness", "rear stiffness", "worst")

    def __getitem__(self, effect: str) -> Bias:
        for b in self.biases:
            if b.effect.id == effect:
                return b
        raise KeyError(f"'{effect}'; there are {', '.join(b.effect.id for b in self.biases)}")

    def _rows(self) -> list[list[str]]:
        rows = []
        for b in self.biases:
            size = ", ".join(
                f"{number(v, 3)} {p.unit}"
                for p, v in zip(b.effect.parameters, b.size, strict=True)
                if v != 0.0
            )
            worst = f"{b.worst[0]} {100.0 * b.relative[b.worst[0]]:+.1f} %" if b.worst else "-"
            stiff = [f"{100.0 * b.relative[f'stiffness_{a}']:+.1f} %" for a in _AXLES]
            rows.append([b.effect.id, size, *stiff, worst])
        return rows

    def __str__(self) -> str:
        return "What the identified parameters would hide\n" + text_table(self._HEAD, self._rows())

    def _repr_html_(self) -> str:
        return html_table(self._HEAD, self._rows())


def bias_report(
    fit: Fit, effects: Sequence[Effect] | None = None, *, information: Information | None = None
) -> BiasReport:
    """Say what each effect of a typical size would do unnoticed to the fit's parameters.

    To first order: (G' G)^-1 G' G_j psi, with G and G_j the sensitivities of the residuals to the
    fitted parameters and to the effect's.

    Parameters
    ----------
    fit : Fit
    effects : sequence of Effect, optional
        By default all that the model lacks.
    information : Information, optional
        Of the driving it was fitted to, if known already.

    Returns
    -------
    BiasReport
    """
    known = information
    if known is None:
        known = information_of(fit, fit.driving, effects or fit.model.candidates)
    wanted = None if effects is None else {e.id for e in effects}
    values = {n: fit.model.value(n) for n in known.fitted}
    biases = []
    for effect in known.effects:
        if wanted is not None and effect.id not in wanted:
            continue
        size = tuple(p.typical - p.null_value for p in effect.parameters)
        shift = known.hidden_by_fit(effect.id, size)
        relative = {
            n: s / abs(values[n]) if abs(values[n]) > 1e-12 else np.nan for n, s in shift.items()
        }
        for axle in _AXLES:
            # d(BCD)/BCD is the sum of the three relative changes.
            terms = [relative.get(f"{x}_{axle}", 0.0) for x in "BCD"]
            relative[f"stiffness_{axle}"] = float(sum(terms))
        biases.append(Bias(effect, size, shift, relative))
    biases.sort(key=lambda b: -_harm(b))
    return BiasReport(tuple(biases))


def _harm(b: Bias) -> float:
    return max(abs(b.relative[f"stiffness_{a}"]) for a in _AXLES)
