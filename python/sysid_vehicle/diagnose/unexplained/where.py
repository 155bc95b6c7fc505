"""Where, when and at which frequencies a fitted model fails."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING, Any

from ..._common.text import brief
from ..._common.threads import Workers
from ..._common.typed import typed
from ...estimate import Driving
from ...identify import Fit, explaining
from ...log import Log
from ..evidence.evidence import Evidence, evident
from .change_points import ChangePoint, change_points
from .coherence import Coherence, coherence
from .force_map import UNITS, ForceMap, force_maps
from .omnibus import Omnibus, omnibus_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_TELLS = 0.02  # share of the variance below which a map predicts nothing worth a look


@dataclass(frozen=True, eq=False)
class Where:
    """Where, when and at which frequencies a model fails.

    Attributes
    ----------
    maps : tuple of ForceMap
        Of the missing force, the most telling first.
    steady : dict of str to tuple of float
        Mean of each missing force over all the driving, and its standard error.
    change_points : tuple of ChangePoint or None
        Moments at which the car changed, in their order; None where they were not sought.
    alpha : float
        Rate of change points claimed where the car stays the same.
    coherence : tuple of Coherence
        With the steering angle and the wheel force.
    model : str
        What fails, in words.
    left : Omnibus or None
        Whether anything is left at all. Where nothing is no map is worth a look: what the smoother
        takes for a force follows the noise of the readings, as slip angles do.
    """

    maps: tuple[ForceMap, ...]
    steady: dict[str, tuple[float, float]]
    change_points: tuple[ChangePoint, ...] | None
    alpha: float
    coherence: tuple[Coherence, ...]
    model: str = "the model"
    left: Omnibus | None = None

    @property
    def title(self) -> str:
        """What the findings are about."""
        return f"Where {self.model} fails"

    @property
    def best_map(self) -> ForceMap | None:
        """The map over the motion that predicts most of the missing force.

        None where nothing moved by more than the smoother could miss of it.
        """
        return next((m for m in self.maps if m.coordinates != ("time_s",)), None)

    @property
    def over_time(self) -> ForceMap:
        """The missing force over the time driven."""
        return next(m for m in self.maps if m.coordinates == ("time_s",))

    @property
    def lines(self) -> tuple[str, ...]:
        """The findings, a sentence each."""
        best = self.best_map
        if self.left is not None and not self.left.rejects:
            told = [str(self.left)]
        elif best is None:
            told = ["nothing moved by more than the smoother could miss of it"]
        elif best.share > _TELLS:
            share = f"{100 * best.share:.0f} % of the missing force depends on {best.title}"
            told = [f"{share}, mostly {best.strongest}; {best.peak(best.strongest)}"]
        else:
            told = ["no coordinate of the motion predicts a missing force"]
        told += [
            f"a steady {target} is missing: {mean:+.3g} +- {std:.2g} {UNITS[target]}"
            for target, (mean, std) in self.steady.items()
            if abs(mean) > 3.0 * std
        ]
        if self.change_points is not None:
            told += [str(c) for c in self.change_points] or ["no moment at which the car changed"]
        return (*told, *(str(c) for c in self.coherence))

    __repr__ = brief

    def __str__(self) -> str:
        return "\n".join([self.title, *(f"  {line}" for line in self.lines)])

    def _repr_html_(self) -> str:
        items = "".join(f"<li>{escape(line)}</li>" for line in self.lines)
        return f"<p>{escape(self.title)}</p><ul>{items}</ul>"

    def plot(self, ax: Axes | None = None) -> Axes:
        """The missing force over the most telling coordinates; over time where nothing moved."""
        return (self.best_map or self.over_time).plot(ax)

    def plot_time(self, ax: Axes | None = None) -> Axes:
        """The missing force over time, and the moments at which the car changed."""
        ax = self.over_time.plot(ax)
        for c in self.change_points or ():
            ax.axvline(c.driven_s, color="tab:red", lw=1.2)
            ax.annotate(
                c.what,
                (c.driven_s, 1.0),
                (3, -10),
                xycoords=("data", "axes fraction"),
                textcoords="offset points",
                color="tab:red",
                fontsize="small",
            )
        return ax

    def to_dict(self) -> dict[str, Any]:
        """The findings, ready for JSON; what was not sought is left out."""
        best = self.best_map
        described: dict[str, Any] = {
            "best_pair": best
            and {  # the key of the first version
                "coordinates": list(best.coordinates),
                "share": best.share,
                "shares": best.shares,
            },
            "steady": {t: {"value": v, "std": s} for t, (v, s) in self.steady.items()},
            "coherence": {
                c.input: dict(zip(("channel", "frequency_hz", "coherence"), c.peak, strict=True))
                | {"threshold": c.threshold}
                for c in self.coherence
            },
        }
        if self.change_points is None:
            return described
        return described | {
            "change_points": [
                {
                    "log": c.log,
                    "time_s": c.time_s,
                    "interval_s": [c.from_s, c.until_s],
                    "what": c.what,
                    "size": {n: {"value": v, "std": c.std[n]} for n, v in c.size.items()},
                    "p_value": c.p_value,
                }
                for c in self.change_points
            ],
            "delays": {c.input: c.delay.to_dict() for c in self.coherence if c.delay is not None},
        }


@typed
@explaining
def where(
    fit: Fit,
    logs: Log | Sequence[Log] | Driving | None = None,
    *,
    alpha: float = 0.01,
    seed: int = 0,
    causes: bool = True,
    name: str = "the model",
    omnibus: Omnibus | None = None,
) -> Where:
    """Find where, when and at which frequencies a fitted model fails.

    Parameters
    ----------
    fit : Fit
    logs : Log, sequence of Log, or Driving, optional
        By default what the model was fitted to. Change points and delays leave the fitted
        parameters free, so that validation data are right as well.
    alpha : float
        Rate of change points claimed where the car stays the same.
    seed : int
        Of the draws that calibrate change points and delays.
    causes : bool
        Whether to seek change points and delays too. They are claims about the car, and a model
        that is known to lack something else may feign them.
    name : str
        What to call the model in words.
    omnibus : Omnibus, optional
        Of the model on this driving, where it is known already.
    """
    driving = evident(fit, logs)
    evidence = Evidence(fit, driving)
    with Workers() as pool:
        mapped = pool.submit(force_maps, fit, driving)
        changes = pool.submit(change_points, evidence, alpha=alpha, seed=seed) if causes else None
        omnibus = omnibus or omnibus_of(evidence)
        coherent = coherence(evidence, delays=causes, seed=seed, omnibus=omnibus)
        maps, steady = mapped.result()
    return Where(
        maps,
        steady,
        None if changes is None else changes.result(),
        alpha,
        coherent,
        name,
        omnibus,
    )
