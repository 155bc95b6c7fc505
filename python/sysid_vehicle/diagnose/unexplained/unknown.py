"""What is known of an effect that has no name: the shape of its force, and formulas for it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from ..._common.arrays import FloatArray
from ..._common.text import brief
from ..._common.typed import typed
from ...estimate import Driving
from ...identify import Fit, explaining
from ...log import Log
from ..evidence.evidence import Evidence, evident
from .force_map import force_maps
from .proposals import Proposal, propose
from .shape import Curve, Surface, curves, surface

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@dataclass(frozen=True, eq=False)
class Unknown:
    """The shape of a missing force, and formulas that hold on validation data.

    Attributes
    ----------
    curves : tuple of Curve
        F_x, F_y, M_z, each over the coordinate that tells most of it; the best supported first.
    surface : Surface or None
        The best supported force over the pair of coordinates that predicts most; None where no
        pair moved.
    proposals : tuple of Proposal
        At most three, which act together; `proposal.as_effect(id)` makes an effect of one.
    """

    curves: tuple[Curve, ...]
    surface: Surface | None
    proposals: tuple[Proposal, ...]

    @property
    def lines(self) -> tuple[str, ...]:
        """The findings, a sentence each."""
        shown = [str(c) for c in self.curves if c.shown]
        told = shown or ["no band excludes zero force"]
        told += [f"proposal {i}: {p}" for i, p in enumerate(self.proposals, 1)]
        if not self.proposals:
            told.append("no formula explains it and also holds on validation data")
        return tuple(told)

    __repr__ = brief

    def __str__(self) -> str:
        return "\n".join(["What is missing", *(f"  {line}" for line in self.lines)])

    def _repr_html_(self) -> str:
        items = "".join(f"<li>{escape(line)}</li>" for line in self.lines)
        return f"<p>What is missing</p><ul>{items}</ul>"

    def plot(self, ax: Axes | None = None) -> Axes:
        """The best supported curve with its band."""
        return self.curves[0].plot(ax)

    def to_dict(self) -> dict[str, Any]:
        """The findings, ready for JSON: SI units, null where nobody drove."""
        s = self.surface
        return {
            "curves": [
                {
                    "target": c.target,
                    "over": c.coordinate.name,
                    "shown": c.shown,
                    "at": _numbers(c.at),
                    "force": _numbers(c.force),
                    "half_width": _numbers(c.half_width),
                }
                for c in self.curves
            ],
            "surface": s
            and {
                "target": s.target,
                "over": [c.name for c in s.coordinates],
                "at": [_numbers(a) for a in s.at],
                "force": [_numbers(row) for row in s.force],
                "half_width": [_numbers(row) for row in s.half_width],
            },
            "proposals": [p.to_dict() for p in self.proposals],
        }


def _numbers(values: FloatArray) -> list[float | None]:
    return [float(f"{v:.6g}") if np.isfinite(v) else None for v in values]


@typed
@explaining
def unknown(
    fit: Fit,
    test: Log | Sequence[Log] | Driving,
    logs: Log | Sequence[Log] | Driving | None = None,
    *,
    seed: int = 0,
) -> Unknown:
    """Find the shape of what a fitted model lacks, and formulas for it.

    Parameters
    ----------
    fit : Fit
    test : Log, sequence of Log, or Driving
        Validation data: no formula is proposed that does not hold on it.
    logs : Log, sequence of Log, or Driving, optional
        Driving to look at; by default what the model was fitted to.
    seed : int
        Of the draws that make the bands.
    """
    driving = evident(fit, logs)
    evidence = Evidence(fit, driving)
    maps, _ = force_maps(fit, driving)
    pairs = (m.coordinates for m in maps if len(m.coordinates) == 2)
    best = next(pairs, None)
    return Unknown(
        curves(evidence, seed),
        best and surface(evidence, (best[0], best[1]), seed),
        propose(evidence, Evidence(fit, evident(fit, test))),
    )
