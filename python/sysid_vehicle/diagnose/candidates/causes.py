"""What is probably missing: inclusion probabilities, and credible sets of confounded effects."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy

from ..._common.printed import Part, Printed, Table
from ..._common.style import axes_or_new
from ..._common.text import brief, unit_after, with_error
from .possible import Size
from .single_effects import Subset

if TYPE_CHECKING:
    from matplotlib.axes import Axes

UNKNOWN = "unknown "
"""Begins the names of forces, moments and readings that no effect of the catalogue explains."""


@dataclass(frozen=True, eq=False)
class CredibleSet:
    """Effects of which one is missing, with 95 % probability usually.

    Attributes
    ----------
    effects : tuple of str
        The likeliest first; several are confounded by this driving. A name that begins with
        `unknown` is a force, moment or reading that no effect of the catalogue explains;
        `clock of` an input is a shift in time that no effect of the catalogue explains (negative:
        the car acts before the log says so), to be mended in the log.
    probabilities : tuple of float
        Of each being the one that acts.
    weights : dict of str to float
        The same of all effects that are not next to impossible.
    """

    effects: tuple[str, ...]
    probabilities: tuple[float, ...]
    weights: dict[str, float] = field(default_factory=dict, repr=False)

    @classmethod
    def of(cls, log_odds: Mapping[str, float], probability: float) -> CredibleSet:
        """The likeliest that reach a probability together, where one of all acts."""
        names = sorted(log_odds, key=lambda e: -log_odds[e])
        odds = np.array([log_odds[e] for e in names])
        weights = np.exp(odds - scipy.special.logsumexp(odds))
        few = int(np.argmax(np.cumsum(weights) >= probability)) + 1
        told = dict(zip(names, map(float, weights), strict=True))
        return cls(tuple(names[:few]), tuple(told.values())[:few], told)

    def led_by(self, effect: str) -> CredibleSet:
        """The same with one of its effects in front, whether or not it is the likeliest."""
        if effect not in self.effects:
            return self
        order = (effect, *(e for e in self.effects if e != effect))
        return replace(self, effects=order, probabilities=tuple(self.weights[e] for e in order))

    def __str__(self) -> str:
        pairs = zip(self.effects, self.probabilities, strict=True)
        return " or ".join(f"{e} ({100 * p:.0f} %)" for e, p in pairs)


@dataclass(frozen=True, eq=False)
class Causes(Printed):
    """The posterior of a sum of single effects (`single_effects.py`).

    Attributes
    ----------
    inclusion : dict of str to float
        Posterior probability that an effect is missing, the likeliest first.
    sets : tuple of CredibleSet
        One for each effect of the sum that is not nothing.
    sizes : dict of str to tuple
        Parameters and standard errors of each effect were it the one that acts beside the other
        sets; linearised at the fit.
    subsets : tuple of Subset
        Leading subsets of up to three effects.
    known : tuple of Subset
        The same of effects of the catalogue alone, which a refit can try. Where a model is wrong in
        several ways, unknown forces lead every other subset.
    units : dict of str to tuple of (str, str)
        Names and units of the parameters.
    rest : dict of str to float
        Probability of being missing by what is in no set.
    """

    inclusion: dict[str, float]
    sets: tuple[CredibleSet, ...]
    sizes: dict[str, Size]
    subsets: tuple[Subset, ...] = ()
    known: tuple[Subset, ...] = ()
    units: dict[str, tuple[tuple[str, str], ...]] = field(default_factory=dict)
    rest: dict[str, float] = field(default_factory=dict)

    def only(self, sets: Sequence[CredibleSet], sizes: Mapping[str, Size]) -> Causes:
        """The same with these sets alone, and some sizes known better."""
        names = dict.fromkeys((*self.inclusion, *(e for s in sets for e in s.weights)))
        absent = {
            e: (1.0 - self.rest.get(e, 0.0)) * np.prod([1.0 - s.weights.get(e, 0.0) for s in sets])
            for e in names
        }
        included = {e: float(1.0 - p) for e, p in absent.items()}
        order = sorted(included, key=lambda e: -included[e])
        better = {e: size for e, size in sizes.items() if e in self.units}
        return replace(
            self,
            inclusion={e: included[e] for e in order},
            sets=tuple(sets),
            sizes=self.sizes | better,
        )

    def of(self, effect: str) -> CredibleSet | None:
        """The credible set an effect is in."""
        return next((s for s in self.sets if effect in s.effects), None)

    _HEAD = ("effect", "probability", "credible set", "size")

    def _rows(self, most: int = 12) -> list[list[str]]:
        return [[e, f"{p:.3f}", self._place(e), self._size(e)] for e, p in self._shown(most)]

    def _shown(self, most: int) -> list[tuple[str, float]]:
        """Effects by set, then the likeliest of the others."""
        grouped = list(dict.fromkeys(e for s in self.sets for e in s.effects))
        others = [e for e in self.inclusion if e not in grouped]
        return [(e, self.inclusion[e]) for e in (*grouped, *others)[:most]]

    def _place(self, effect: str) -> str:
        places = [str(i + 1) for i, s in enumerate(self.sets) if effect in s.effects]
        return ", ".join(places) or "-"

    def _size(self, effect: str) -> str:
        if effect not in self.sizes:
            return "-"
        told = zip(self.units[effect], *self.sizes[effect], strict=True)
        return ", ".join(f"{n} {with_error(v, s)}{unit_after(u)}" for (n, u), v, s in told)

    def _headline(self) -> str:
        if not self.sets:
            return "no effect is shown to be missing: no credible set"
        kind = "effect" if len(self.sets) == 1 else "effects together"
        return f"{len(self.sets)} {kind}: " + "; ".join(map(str, self.sets))

    __repr__ = brief

    def _parts(self) -> list[Part]:
        return [self._headline(), Table(self._HEAD, self._rows())]

    def to_dict(self) -> dict[str, Any]:
        """All figures, ready for JSON."""
        return {
            "inclusion": dict(self.inclusion),
            "sets": [
                {"effects": list(s.effects), "probabilities": list(s.probabilities)}
                for s in self.sets
            ],
            "sizes": {
                e: {
                    n: {"value": v, "std": s, "unit": u}
                    for (n, u), v, s in zip(self.units[e], *size, strict=True)
                }
                for e, size in self.sizes.items()
            },
            "subsets": [
                {"effects": list(s.effects), "log_odds": s.log_odds} for s in self.subsets[:10]
            ],
        }

    def plot(
        self, ax: Axes | None = None, most: int = 12, grades: Mapping[str, str] | None = None
    ) -> Axes:
        """Bars of inclusion probability, grouped by credible set.

        Parameters
        ----------
        ax : matplotlib Axes, optional
        most : int
            Bars.
        grades : mapping, optional
            By effect, a word to print beside its bar.
        """
        shown = self._shown(most)[::-1]
        ax = axes_or_new(ax, 6.0, 0.9 + 0.28 * max(len(shown), 1))
        for i, s in enumerate(self.sets):
            rows = [k for k, (e, _) in enumerate(shown) if self.of(e) is s]
            widths = [shown[k][1] for k in rows]
            ax.barh(rows, widths, color=f"C{i % 10}", label=f"credible set {i + 1}")
        rest = [k for k, (e, _) in enumerate(shown) if self.of(e) is None]
        ax.barh(rest, [shown[k][1] for k in rest], color="0.7", label="in no set")
        for k, (e, p) in enumerate(shown):
            word = (grades or {}).get(e, "")
            ax.text(p + 0.01, k, f"{p:.2f}  {word}".rstrip(), va="center", fontsize="small")
        ax.set_yticks(range(len(shown)), [e for e, _ in shown])
        ax.set(xlim=(0.0, 1.25), xlabel="probability of being missing")
        ax.legend(frameon=False, loc="lower right", fontsize="small")
        return ax
