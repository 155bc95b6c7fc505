"""How a model came about: its steps, and what was known at each."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field

from ..._common.text import unit_after
from ..._common.threads import in_parallel
from ...diagnose import Candidate, Diagnosis, Size
from ...errors import Interrupted
from ...estimate import Driving
from ...identify import Fit
from ...rules import Rules, worse
from ..ahead.unmoved import changes_of
from ..validation import AHEAD, serving
from .steps import alternatives
from .together import InPlace


@dataclass(eq=False)
class Trail:
    """How a model came about.

    Attributes
    ----------
    fits : list of Fit
        After each step; the first is the baseline.
    diagnoses : list of Diagnosis
        Before each step, and the last one, which found nothing more to add.
    p_values : dict
        By effect, when it was chosen or nearly chosen.
    rivals : dict
        By effect that was chosen or nearly chosen, what the driving could not tell from it.
    nearly : dict
        By effect, what was nearly chosen in its place.
    sizes : dict
        Parameters of rivals and their standard errors, each refitted in place of what was chosen.
    stopped : tuple of str
        Effects with evidence that the time limit left untried.
    unpaired : bool
        Whether the time limit ended the search for effects that hold only together.
    full : tuple of str
        Effects with evidence that would have been one more than may be added.
    short : bool
        Whether the length of the training data says how many these are, not the user.
    taken_back : tuple of str
        Effects of last steps without which the model predicts better (`without_harm`).
    harmful : tuple of str
        Effects taken out of the last model, as errors ahead are larger with them.
    """

    fits: list[Fit]
    diagnoses: list[Diagnosis] = field(default_factory=list)
    p_values: dict[str, float] = field(default_factory=dict)
    rivals: dict[str, tuple[str, ...]] = field(default_factory=dict)
    nearly: dict[str, tuple[Candidate, ...]] = field(default_factory=dict)
    sizes: dict[str, Size] = field(default_factory=dict)
    stopped: tuple[str, ...] = ()
    unpaired: bool = False
    full: tuple[str, ...] = ()
    short: bool = False
    taken_back: tuple[str, ...] = ()
    harmful: tuple[str, ...] = ()

    @property
    def fit(self) -> Fit:
        """Where it leads."""
        return self.fits[-1]

    @property
    def refitted(self) -> tuple[str, ...]:
        """Effects near the best of the last diagnosis, by refits with noise of their own."""
        return tuple(c.id for dx in self.diagnoses[-1:] for c in dx.significant if c.finished)

    @property
    def confounded(self) -> dict[str, tuple[str, ...]]:
        """By effect of the last model, its rivals that are not in the model beside it."""
        there = self.fit.model.effects
        found = {e: names for e, names in self.rivals.items() if e in there}
        return {e: tuple(n for n in names if n not in there) for e, names in found.items()}

    @property
    def told(self) -> str:
        """The effects so far with their sizes, in words."""
        effects = [e for e in self.fit.model.effects if e not in self.fits[0].model.effects]
        if not effects:
            found = ", ".join(c.id for dx in self.diagnoses[:1] for c in dx.significant[:3])
            return f"no effect was added yet; there is evidence for {found or 'none'}"
        return "; ".join(f"{e}: {_sizes(self.fit, [e])}" for e in effects)

    def without_harm(self, test: Driving, rules: Rules) -> None:
        """Take back last steps while the model errs more ahead than the baseline, as it is fitted.

        Each step was judged by the parameters that predict best: what they show an effect to take
        away, those of the likelihood may lose where the effects that belong to it are not found.
        What the fit left open does not speak against it: tyres that never met a slip angle take
        any value, with an effect and without.
        """
        last = self.fit.model.effects

        def harms() -> bool:
            one, other = in_parallel(lambda fit: serving(fit, test), (self.fits[0], self.fit))
            return bool(worse(changes_of(one, other, test, AHEAD), rules))

        while len(self.fits) > 1 and harms():
            self.fits.pop()
            self.diagnoses.pop()
        self.taken_back = tuple(e for e in last if e not in self.fit.model.effects)

    def note_several(
        self, dx: Diagnosis, chosen: Sequence[str], rivals: Mapping[str, InPlace]
    ) -> None:
        """Remember what was chosen together, and what is confounded with each of it.

        So by the posterior, and as `in_place_of` finds. What fits as well in the place of one was
        nearly chosen: of subsets that score alike one alone is refitted.
        """
        self.sizes |= dx.sizes
        for name in chosen:
            self.p_values[name] = dx.family[name]
            shared = dx.proposed.of(name)
            others = () if shared is None else shared.effects
            known = set(dx.family) - set(chosen)
            in_place = rivals.get(name, InPlace())
            alike = dict.fromkeys((*others, *in_place.names))
            self.rivals[name] = tuple(e for e in alike if e in known)
            self.sizes |= in_place.sizes
            self.nearly[name] = in_place.likeliest

    def note(self, dx: Diagnosis, chosen: Candidate) -> None:
        """Remember what was chosen, and what nearly was."""
        near = alternatives(dx, chosen)
        self.nearly[chosen.id] = near
        self.p_values |= {c.id: c.p_value for c in (chosen, *near)}
        for c in near:
            self.nearly.setdefault(c.id, alternatives(dx, c))
            self.rivals.setdefault(c.id, c.indistinguishable_from)
        self.rivals[chosen.id] = chosen.indistinguishable_from
        self.sizes |= dx.sizes


@contextmanager
def kept(trail: Trail) -> Iterator[None]:
    """Say after Ctrl-C in the block what is known by then.

    Raises
    ------
    Interrupted
    """
    try:
        yield
    except KeyboardInterrupt as signal:
        told = Interrupted(
            f"after {len(trail.fits) - 1} step(s): {trail.told}. The models so far, the baseline "
            "first, are the `fits` of this exception (sys.last_value.fits)"
        )
        told.fits = tuple(trail.fits)
        raise told from signal


def step_in_words(found: Fit, known: Collection[str]) -> str:
    """What a step put into the model, with sizes, and what it took out of it, in words.

    A step may exchange what was there before, and drop what it began with itself.
    """
    new = [e for e in found.model.effects if e not in known]
    gone = sorted(e for e in known if e not in found.model.effects)
    said = [f"Added {' and '.join(new)}: {_sizes(found, new)}."] if new else []
    said += [f"Removed {' and '.join(gone)}."] if gone else []
    return " ".join(said)


def _sizes(fit: Fit, effects: Sequence[str]) -> str:
    """Parameters of effects with standard errors, in words."""
    found = [e for e in fit.estimates if e.name.split(".")[0] in effects]
    several = len(effects) > 1
    return ", ".join(
        f"{e.name if several else e.name.split('.')[1]} {e.size}{unit_after(e.unit)}" for e in found
    )
