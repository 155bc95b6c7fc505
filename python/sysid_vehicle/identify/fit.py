"""What identification returns."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal
from weakref import WeakKeyDictionary

import numpy as np

from .._common.arrays import FloatArray, as_float64
from .._common.tables import frame
from .._common.text import (
    HALF_95,
    brief,
    html_list,
    html_paragraph,
    html_table,
    html_text,
    number,
    text_table,
)
from ..errors import InvalidInput, NumericalError
from ..estimate import Driving, NoiseModel
from ..model import Model
from ..saved import save
from ..vehicle import AXLES
from .intervals.estimates import Estimate, Estimated, profiled
from .intervals.posterior import Posterior, posterior
from .intervals.priors import AgainstPrior, against_priors
from .intervals.profile import Profile
from .intervals.quantities import Quantity, parameter, std_of, tyre_quantity
from .loads import LoadAtRest
from .reached import reached
from .search.starts import Starts
from .search.tyre_shape import COMBINATIONS

_MEANINGS = {"BCD": "cornering stiffness", "peak": "peak friction", "peak_slip": "slip at the peak"}
_UNITS = {"cornering stiffness": "N/rad", "peak friction": "1", "slip at the peak": "rad"}
NOT_FOLLOWED = "the likelihood was not followed to its maximum, and no intervals are told"
"""Of `Fit.late_facts`: that a time limit ended the search."""

_ENDED = "search ended"
_OF_TYRES = (0.0, float("inf"))  # no stiffness, friction or slip of a peak is negative


def late_sentence(facts: Sequence[str]) -> str:
    """What a time limit left out of a fit (`Fit.late_facts`)."""
    return f"the time limit ended the fit: {'; '.join(facts)}"


_REACHED: WeakKeyDictionary[Fit, dict[str, float]] = WeakKeyDictionary()


def _reached(fit: Fit) -> dict[str, float]:
    """Slip angles that the driving reached, by axle; unlimited where nobody knows."""
    try:
        most = reached(fit.model, fit.noise, fit.driving)
    except NumericalError:
        most = (np.inf, np.inf)
    return dict(zip(AXLES, most, strict=True))


@dataclass(frozen=True, eq=False)
class Fit(Estimated):
    """A model fitted to driving.

    Attributes
    ----------
    model : Model
        The model at the estimated values.
    noise : NoiseModel
        Noise learned together with it.
    estimates : tuple of Estimate
        Free parameters.
    covariance : array, shape (n, n)
        Of the estimates, in their order.
    log_likelihood : float
    driving : Driving
        What it was fitted to.
    starts : Starts
        Every start of the search; empty when it went on from an earlier fit.
    converged : bool
    profiles : tuple of Profile
        Profile likelihoods of the estimates and of what follows from them; empty where none were
        asked for.
    horizon_s : float
        What the parameters predict best: this many seconds ahead; zero for one step, the
        likelihood.
    pushed : array, shape (n, times)
        Change of the estimates by one standard error of each time by which readings were moved
        (`Log.retimed`); the covariance holds it.
    late_facts : tuple of str
        What a time limit left out. Where that ended the search, it is the likeliest that was seen:
        its estimates have no standard errors, and the covariance is that of the information there.
    """

    model: Model
    noise: NoiseModel
    estimates: tuple[Estimate, ...]
    covariance: FloatArray
    log_likelihood: float
    driving: Driving
    starts: Starts
    converged: bool
    profiles: tuple[Profile, ...] = ()
    horizon_s: float = 0.0
    pushed: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))
    late_facts: tuple[str, ...] = ()

    @property
    def broken_off(self) -> bool:
        """Whether a time limit ended the search before the maximum of the likelihood."""
        return NOT_FOLLOWED in self.late_facts

    def without_intervals(self) -> Fit:
        """The same with estimates whose standard errors nobody knows."""
        few = (replace(e, std=np.inf, note=_ENDED, unbounded=None) for e in self.estimates)
        return replace(self, estimates=tuple(few))

    @property
    def by_noise(self) -> FloatArray:  # noqa: D102 - as of all fits
        if not self.pushed.size:
            return self.covariance
        return as_float64(self.covariance - self.pushed @ self.pushed.T)

    def save(self, path: str | Path) -> None:
        """Write the fit, with the driving it was fitted to; :func:`sysid_vehicle.load` reads it.

        Raises
        ------
        InvalidInput
            If the file cannot be written.
        """
        save(self, path)

    @property
    def offsets(self) -> dict[str, dict[str, float]]:
        """Nuisances of the model in each log, by the log's name; of one log, its values.

        Logs of one name are numbered: `lap (1)`, `lap (2)`.
        """
        logs = self.driving.logs
        names = [log.name for log in logs]
        labels = [
            name if names.count(name) == 1 else f"{name} ({names[: i + 1].count(name)})"
            for i, name in enumerate(names)
        ]
        at = {n: self.model.value(n) for n in self.model.offset_names}
        own = self.driving.offsets or ({},) * len(logs)
        return {
            label: {n: value + apart.get(n, 0.0) for n, value in at.items()}
            for label, apart in zip(labels, own, strict=True)
        }

    @property
    def derived(self) -> tuple[Estimate, ...]:
        """What the tyre coefficients of an axle mean together.

        Cornering stiffness at the load at rest of the car that was found [N/rad], highest friction
        [1] and slip angle of that peak [rad], which is infinite where the curve has none; `not
        determined` where the 95 % interval reaches nothing. Driving that never reaches the peak
        determines the stiffness long before it determines B, C, D and E one by one. Each is found
        by the name it is printed with, and by that name with underscores. A peak beyond the slip
        angles that the driving reached is `extrapolated`: its interval takes the tyre for a magic
        formula as far as that.
        """
        p, columns = self.model.vector(), self.columns
        found, exactly = [], {f.name for f in self.profiles}
        beyond = self._peaks_beyond(p)
        for what in tuple(self.quantities.values())[len(self.estimates) :]:
            std = std_of(what, p, columns, self.covariance)
            unit = _UNITS[what.name.rsplit(" ", 1)[0]]
            value = what.of(p)
            # None of them is negative: an interval that reaches nothing tells nothing.
            wide = value < HALF_95 * std and what.name not in exactly
            note = "no peak" if not np.isfinite(std) else "not determined" if wide else ""
            if not note and what.name in beyond:
                note = "extrapolated"
            if self.broken_off:
                std, note = np.inf, _ENDED
            found.append(Estimate(what.name, value, std, unit, note, bounds=_OF_TYRES))
        return tuple(profiled(e, self.profiles) for e in found)

    def _peaks_beyond(self, p: FloatArray) -> set[str]:
        """Names of what is told of peaks that lie beyond what the driving reached."""
        if self not in _REACHED:
            _REACHED[self] = _reached(self)
        most = _REACHED[self]
        peaks = {axle: self.quantities[f"slip at the peak {axle}"].of(p) for axle in AXLES}
        far = [axle for axle in AXLES if not peaks[axle] <= most[axle]]
        return {f"{what} {axle}" for what in ("peak friction", "slip at the peak") for axle in far}

    @property
    def against_priors(self) -> tuple[AgainstPrior, ...]:
        """Priors that the data contradict, the surest first; of the likelihood's maximum alone."""
        if self.horizon_s or self.broken_off:
            return ()
        own = self.model.offset_names if self.driving.offsets else ()
        told = {n: prior for n, prior in self.model.priors.items() if n not in own}
        return against_priors(self.estimates, self.by_noise, told)

    def values_of(self, model: Model) -> dict[str, float]:
        """What `derived` is of another model, which may lack this one's effects: the true one."""
        none = np.zeros((0, 0))
        bare = replace(self, model=model, estimates=(), covariance=none, profiles=(), pushed=none)
        return {e.name: e.value for e in bare.derived}

    @property
    def columns(self) -> list[int]:
        """Places of the estimates in the core's parameter vector."""
        known = self.model.parameters
        return [known[e.name].column for e in self.estimates]

    @property
    def quantities(self) -> dict[str, Quantity]:
        """Estimates, then what follows from them, as functions of the core's parameter vector."""
        known = self.model.parameters
        found = [parameter(e.name, known[e.name].column) for e in self.estimates]
        for axle in AXLES:
            load = LoadAtRest(self.model, axle)
            columns = [known[f"{letter}_{axle}"].column for letter in "BCDE"]
            for short, (function, _) in COMBINATIONS.items():
                own = load if short == "BCD" else None
                found.append(tyre_quantity(f"{_MEANINGS[short]} {axle}", columns, function, own))
        return {what.name: what for what in found}

    def posterior(
        self,
        count: int = 1000,
        seed: int | np.random.Generator = 0,
        *,
        method: Literal["normal", "ensemble"] = "normal",
        progress: bool | None = None,
    ) -> Posterior:
        """Draw from what the driving leaves open about the parameters.

        Parameters
        ----------
        count : int
            Draws, at least; of an ensemble, those of all walkers together.
        seed : int or numpy Generator
        method : str
            `normal`: of the normal distribution of the estimates within their bounds, for B of that
            of the cornering stiffness; a warning says where the likelihood is not normal.
            `ensemble`: of the likelihood itself, with the gains of the fitted filter, by emcee;
            minutes, and a warning where `count` is too small for it.
        progress : bool, optional
            Show progress; by default in a terminal or a notebook.

        Raises
        ------
        InvalidInput
            For another method, where emcee is not installed, where hardly any draw lies within the
            bounds, or of a fit that a time limit broke off.
        """
        if self.broken_off:
            raise InvalidInput(
                "the time limit ended the search of this fit, and what the driving leaves open is "
                "not known; identify with a longer time_limit_s, or without"
            )
        return posterior(
            self,
            self.model,
            self.driving,
            self.noise,
            count,
            seed,
            method,
            progress,
            likeliest=not self.horizon_s,
        )

    def to_pandas(self) -> Any:
        """A DataFrame of the estimates and what follows from them, by parameter."""
        every = (*self.estimates, *self.derived)
        low, high = np.array([e.interval for e in every]).T
        return frame(
            {
                "parameter": [e.name for e in every],
                "value": [e.value for e in every],
                "std": [e.std for e in every],
                "low": low,
                "high": high,
                "unit": [e.unit for e in every],
                "note": [e.note for e in every],
            },
            "parameter",
        )

    def _rows(self, told: Sequence[Estimate] = ()) -> list[list[str]]:
        rows = []
        for e in told or (*self.estimates, *self.derived):
            std = number(e.std, 2) if np.isfinite(e.std) else "-"
            rows.append([e.name, number(e.value), std, e.interval_text(), e.unit, e.note])
        return rows

    @property
    def _head(self) -> tuple[str, ...]:
        kind = " (profile)" if self.profiles else ""
        return ("parameter", "value", "std", f"95 % interval{kind}", "unit", "note")

    def _headline(self) -> str:
        effects = ", ".join(self.model.effects) or "baseline"
        text = f"Fit of {effects} to {self.driving}; log-likelihood {self.log_likelihood:.1f}"
        if self.horizon_s:
            text += f" one step ahead, fitted to {self.horizon_s:g} s ahead"
        if len(self.starts):
            text += f"; {int(self.starts.agrees.sum())} of {len(self.starts)} starts agree"
        if not self.converged:
            text += "; NOT CONVERGED"
        return text

    __repr__ = brief

    def text(self, told: Sequence[Estimate] = ()) -> str:
        """As it prints, with `told` in place of the estimates and what follows from them."""
        table = text_table(self._head, self._rows(told))
        lines = [self._headline(), table, *self._warnings(), *self._by_log()]
        return "\n".join([*lines, "Noise", self._noise()])

    def __str__(self) -> str:
        return self.text()

    def _noise(self) -> str:
        return self.noise.text(self.driving.present)

    def _warnings(self) -> list[str]:
        late = (late_sentence(self.late_facts),) if self.late_facts else ()
        several = [*late, *map(str, self.against_priors)]
        return [f"Warning: {text}" for text in several]

    def _by_log(self) -> list[str]:
        """Lines on the logs whose nuisances differ; the table has their means."""
        if not self.driving.offsets:
            return []
        return [
            f"{log}: {', '.join(f'{n} {number(v, 3)}' for n, v in own.items())}"
            for log, own in self.offsets.items()
        ]

    def _repr_html_(self) -> str:
        return (
            html_paragraph(self._headline())
            + html_table(self._head, self._rows())
            + (html_list(warnings) if (warnings := self._warnings()) else "")
            + (html_list(self._by_log()) if self.driving.offsets else "")
            + html_text(self._noise())
        )
