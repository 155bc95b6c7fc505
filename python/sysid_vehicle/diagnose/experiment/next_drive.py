"""Which drive would tell effects apart, and by how many standard errors.

Every manoeuvre of a menu within the limits is driven in simulation, and what it would tell is added
to the driving at hand (`rivals.py`). An effect is as far from its rivals as the nearer of each two
stands out from the other.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from ..._common.arguments import check_positive
from ..._common.printed import Part, Printed, Table
from ..._common.progress import with_progress
from ..._common.text import brief, few
from ..._common.typed import typed
from ...effects import Effect
from ...errors import InvalidInput, NumericalError
from ...estimate import Driving
from ...identify import Fit, explaining
from ...log import Log
from ...manoeuvres import Manoeuvre
from ...model import Model
from ...simulate import Drive, SensorNoise, drive_truth
from ...vehicle import AXLES
from .information import Information, information_of
from .limits import DriveLimits, menu
from .rivals import Apart, Fitted, Foreseen, typical
from .suggestion import Suggestion

Sizes = Literal["at hand", "typical", "given"]
_SIZES: dict[Sizes, str] = {
    "at hand": "as large as this driving shows them",
    "typical": "of typical size",
    "given": "of the size asked for",
}
_ENOUGH = 5.0  # standard errors
_OFTEN = 20  # times that a drive may be repeated on several days


@dataclass(frozen=True, eq=False)
class NextDrive(Printed):
    """Drives that tell an effect from others.

    Attributes
    ----------
    first : Effect
    rivals : tuple of Effect
    now : float
        Standard errors between it and the nearest of them with the driving at hand.
    enough : float
        Standard errors that are wanted.
    sizes : str
        Of the effects: `at hand`, as large as the driving at hand shows them; `typical`, where it
        shows none of them; or `given`.
    suggestions : tuple of Suggestion
        Those that are enough first, then those that would be if driven more often than the longest
        drive allows, each by the least to drive; the others by standard errors.
    refused : int
        Manoeuvres of the menu beyond the limits, or that the car did not survive.
    """

    first: Effect
    rivals: tuple[Effect, ...]
    now: float
    enough: float
    sizes: Sizes
    suggestions: tuple[Suggestion, ...]
    refused: int

    @property
    def best(self) -> Suggestion:
        """The drive that is enough with the least to drive, or else the most telling.

        Raises
        ------
        InvalidInput
            No manoeuvre is within the limits.
        """
        if not self.suggestions:
            raise InvalidInput("no manoeuvre of the library is within the limits; widen them")
        return self.suggestions[0]

    @property
    def reaches(self) -> bool:
        """Whether the first suggestion is enough."""
        return bool(self.suggestions) and self.best.sigmas >= self.enough

    @property
    def _head(self) -> tuple[str, ...]:
        other = self.rivals[0].id if len(self.rivals) == 1 else "another"
        errors = (f"standard errors if {self.first.id}", f"if {other}")
        return ("manoeuvre", *errors, "times", "time [s]", "m/s", "a_y [m/s2]", "ground [m]")

    def _rows(self) -> list[list[str]]:
        return [
            [
                s.manoeuvre.name,
                f"{s.if_acts[self.first.id]:.1f}",
                f"{min(s.if_acts[e.id] for e in self.rivals):.1f}",
                str(s.times),
                f"{s.duration_s:.0f}",
                "{:.0f} to {:.0f}".format(*s.speed_mps),
                f"{s.lateral_mps2:.1f}",
                "{:.0f} x {:.0f}".format(*s.ground_m),
            ]
            for s in self.suggestions[:8]
        ]

    def _first(self) -> list[str]:
        return [f"The first: {s.instructions()}" for s in self.suggestions[:1]]

    def _headline(self) -> str:
        others = few([e.id for e in self.rivals])
        nearest = " (the nearest)" if len(self.rivals) > 1 else ""
        pair = f"{self.first.id} and {others}{nearest}, {_SIZES[self.sizes]},"
        told = f"{pair} are {self.now:.1f} standard errors"
        already = ": this driving tells them apart" if self.now >= self.enough else ""
        return f"{told} apart{already}"

    @property
    def reserve(self) -> str:
        """What is to be said of the suggestions; empty where the first is enough."""
        if self.reaches:
            return ""
        if not self.suggestions:
            return "No manoeuvre of the library is within the limits: widen them."
        told = [f"None of these reaches {self.enough:g} standard errors"]
        # Which of them may act unnoticed, and which would be told.
        hidden = [
            e.id
            for e in (self.first, *self.rivals)
            if all(s.if_acts[e.id] < self.enough for s in self.suggestions)
        ]
        if len(hidden) <= len(self.rivals):
            told[0] += f" if it is {' or '.join(hidden)}"
        often = self.best.needed
        if often is not None:
            told.append(f"The first would be enough driven {often} times, beyond the longest drive")
        shown = "; ".join(f"{e.id} by {e.excited_by}" for e in (self.first, *self.rivals[:3]))
        told.append(f"What shows them: {shown}")
        return ". ".join(told) + "."

    __repr__ = brief

    def _parts(self) -> list[Part]:
        if not self.suggestions:
            return [f"{self._headline()}.", self.reserve]
        table = Table(self._head, self._rows())
        return [f"{self._headline()}; after", table, *self._first(), self.reserve]

    def to_dict(self) -> dict[str, Any]:
        """Everything for a JSON file."""
        return {
            "between": [self.first.id, *(e.id for e in self.rivals)],
            "standard_errors_now": self.now,
            "enough": self.enough,
            "reached": self.reaches,
            "sizes": self.sizes,
            "reserve": self.reserve,
            "refused": self.refused,
            "suggestions": [s.to_dict() for s in self.suggestions],
        }


def separations(
    fit: Fit, effects: Sequence[Effect | str], *, information: Information | None = None
) -> dict[tuple[str, str], float]:
    """Standard errors between every two effects of typical size, with the driving at hand.

    Returns
    -------
    dict of (effect, effect) to float
        The nearer of both directions.
    """
    several = tuple(fit.model.effect(e) for e in effects)
    known = information if information is not None else information_of(fit, fit.driving, several)
    shown = [e for e in several if any(e.id == k.id for k in known.effects)]

    def apart(a: Effect, b: Effect) -> float:
        return min(
            known.separation(a.id, typical(a), b.id), known.separation(b.id, typical(b), a.id)
        )

    return {(a.id, b.id): apart(a, b) for i, a in enumerate(shown) for b in shown[i + 1 :]}


@typed
@explaining
def suggest_manoeuvre(
    fit: Fit,
    first: Effect | str,
    *rivals: Effect | str,
    size: Sequence[float] | None = None,
    limits: DriveLimits | None = None,
    enough: float = _ENOUGH,
    progress: bool | None = None,
) -> NextDrive:
    """Suggest the drive with the least to drive that tells an effect from others.

    Drives are those of the library, once, or as often as the longest drive allows.

    Parameters
    ----------
    fit : Fit
        Without any of the effects.
    first, *rivals : Effect or str
        The likeliest one first, and one rival or several.
    size : sequence of float, optional
        Size of the first, as distance from its null values. By default the effects have the sizes
        that the fit's driving gives them, where it shows that one of them acts (`Rules.strict`),
        and typical ones otherwise.
    limits : DriveLimits, optional
        What can be driven; by default `DriveLimits.usual`.
    enough : float
        Standard errors that are wanted.
    progress : bool, optional
        Show a progress bar; by default in a terminal or a notebook, after two seconds.

    Returns
    -------
    NextDrive

    Raises
    ------
    InvalidInput
        The model has one of the effects already, one is named twice or has no rival, the driving
        cannot show it, or `enough` is not positive.
    """
    effects = _asked(fit, (first, *rivals))
    check_positive("suggest_manoeuvre", enough=enough)
    psi = None if size is None else tuple(size)
    bounds = limits if limits is not None else DriveLimits.usual(fit.model.vehicle)
    fitted = Fitted.of(fit, effects) if psi is None else None
    known = fitted if fitted is not None else Foreseen.of(fit, effects, psi)

    def logged(drive: Drive) -> Driving:
        return Driving.of(_as_logged(drive, fit))

    found, refused = [], 0
    choice = menu(bounds, _as_fitted(known.car).vehicle)
    for alternatives in with_progress(choice, "manoeuvres", shown=progress):
        tried = ((m, _driven(known.car, m, fit, bounds)) for m in alternatives)
        driven = next(((m, d) for m, d in tried if d is not None and bounds.hold(d)), None)
        if driven is None:
            refused += 1
            continue
        manoeuvre, drive = driven

        def again(car: Model, manoeuvre: Manoeuvre = manoeuvre) -> Drive | None:
            return _driven(car, manoeuvre, fit)

        apart = known.after(drive, again, logged)
        most = max(int(bounds.duration_s / drive.log.duration_s), 1)
        runs = range(1, max(most, _OFTEN) + 1)
        needed = next((n for n in runs if apart(n).sigmas >= enough), None)
        times = needed if needed is not None and needed <= most else 1
        found.append(_suggested(manoeuvre, drive, times, needed, apart(times), effects))
    found.sort(key=lambda s: _order(s, enough))
    sizes: Sizes = "given" if psi is not None else "typical" if fitted is None else "at hand"
    return NextDrive(effects[0], effects[1:], known.now, enough, sizes, tuple(found), refused)


def _asked(fit: Fit, named: Sequence[Effect | str]) -> tuple[Effect, ...]:
    effects = tuple(fit.model.effect(e) for e in named)
    if len(effects) < 2:
        raise InvalidInput(f"'{effects[0].id}' alone: name what it is to be told from too")
    for i, e in enumerate(effects):
        if e.id in fit.model.effects:
            raise InvalidInput(f"the model has '{e.id}' already; give a fit without it")
        if e.id in (o.id for o in effects[:i]):
            raise InvalidInput(f"'{e.id}' is named twice; name effects that differ")
    return effects


def _suggested(
    manoeuvre: Manoeuvre,
    drive: Drive,
    times: int,
    needed: int | None,
    apart: Apart,
    effects: Sequence[Effect],
) -> Suggestion:
    by_effect = (min(apart.first_acts), *apart.other_acts)
    if_acts = {e.id: float(square**0.5) for e, square in zip(effects, by_effect, strict=True)}
    duration_s = drive.log.duration_s
    return Suggestion(manoeuvre, duration_s, apart.sigmas, drive, times, needed, if_acts)


def _order(s: Suggestion, enough: float) -> tuple[float, ...]:
    """The least to drive first, within the limits and beyond; then what tells most."""
    if s.sigmas >= enough:
        return 0.0, s.whole_s
    if s.needed is not None:
        return 1.0, s.needed * s.duration_s
    return 2.0, -round(s.sigmas, 1), -sum(min(v, enough) ** 2 for v in s.if_acts.values())


def _as_fitted(car: Model) -> Model:
    """The same whose driver knows the tyres that were fitted, and steers and drives by them."""
    tyres = {f"tyre_{axle}": car.tyre(axle) for axle in AXLES}
    return replace(car, vehicle=car.vehicle.replace(**tyres))


def _driven(
    car: Model, manoeuvre: Manoeuvre, fit: Fit, within: DriveLimits | None = None
) -> Drive | None:
    """The drive without noise, at the rate of the longest log; None where the car is lost.

    Nor is it driven where its length, or the way from its begin, is not within limits.
    """
    rate = max(fit.driving.logs, key=lambda log: log.duration_s).rate_hz
    if within is not None and round(manoeuvre.duration_s * rate) / rate > within.duration_s:
        return None
    try:
        return drive_truth(
            _as_fitted(car),
            manoeuvre,
            seed=0,
            noise=SensorNoise.none(),
            rate_hz=rate,
            farthest_m=np.inf if within is None else within.farthest_m,
        )
    except (NumericalError, InvalidInput):
        return None


def _as_logged(drive: Drive, fit: Fit) -> Log:
    """What the user's logger would write of it."""
    there = {c for log in fit.driving.logs for c in log.channels}
    columns = {c: drive.log[c] for c in drive.log.channels if c in there or c == "time_s"}
    return Log.from_arrays(columns, name=drive.log.name, check=False)
