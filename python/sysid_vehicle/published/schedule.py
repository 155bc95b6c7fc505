"""The paper's staged schedule in one go: mass, then roll and yaw inertia, then pitch inertia.

Dettu et al. (2023), sec. 4 and figure 12. The twin begins with the unloaded car; each stage has the
drive that excites what it looks for, and begins with the load that the stages before it found. What
they found is not taken as exact: twins side by side look for it again, with the spread it was found
with.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from .._common.printed import Told
from ..errors import InvalidInput
from ..twin.car import NOMINAL_SUV, Load
from ..twin.laws import Unknown, unknowns
from .load import Law, LoadExperiment, drive_of, experiment

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# A later stage trusts an earlier one no further than to this part of the first spread.
_LEAST_SPREAD = 0.02


@dataclass(frozen=True)
class _Stage:
    name: str
    drive: str
    names: tuple[str, ...]  # what it is for
    beside: tuple[str, ...]  # what twins side by side look for too
    channels: tuple[str, ...]  # of the laws, then of the twins too
    more: tuple[str, ...]


_STAGES = (
    _Stage("mass", "town", ("mass_kg",), ("cg_x_m", "cg_z_m"), ("ax_mps2",), ("pitch_rate_radps",)),
    _Stage(
        "roll and yaw inertia",
        "sweep",
        ("jxx_kgm2", "jzz_kgm2"),
        ("mass_kg", "cg_x_m", "cg_y_m", "cg_z_m", "jxy_kgm2", "jxz_kgm2", "jyz_kgm2"),
        ("roll_rate_radps", "yaw_rate_radps"),
        ("ay_mps2",),
    ),
    _Stage(
        "pitch inertia",
        "road",
        ("jyy_kgm2",),
        ("mass_kg", "cg_x_m", "cg_z_m"),
        ("pitch_rate_radps",),
        ("ax_mps2", "az_mps2"),
    ),
)


@dataclass(frozen=True, eq=False, repr=False)
class ScheduleRun(Told):
    """All stages and the load they ended with.

    Attributes
    ----------
    stages : tuple of LoadExperiment
        Mass, roll and yaw inertia, pitch inertia, as they followed one another.
    load : Load
        What was found in the end.
    """

    stages: tuple[LoadExperiment, ...]
    load: Load

    def rows(self) -> dict[str, dict[str, float | str | None]]:
        """Of each number that was estimated: first, found, spread, true, error, last stage."""
        out: dict[str, dict[str, float | str | None]] = {}
        for stage in self.stages:
            for name in stage.found.moved():
                true, nominal = getattr(stage.true, name), getattr(stage.nominal, name)
                first = out[name]["first"] if name in out else nominal
                found = getattr(self.load, name)
                out[name] = {
                    "first": first,
                    "found": found,
                    "spread": stage.found.spread.get(name),
                    "true": true,
                    "error_percent_of_change": 100.0 * abs(found - true) / abs(true - nominal),
                    "stage": stage.name,
                }
        return out

    def to_dict(self) -> dict[str, Any]:
        """All figures, for a file."""
        return {
            "parameters": self.rows(),
            "stages": [stage.to_dict() for stage in self.stages],
        }

    def plot(self, name: str, *, ax: Axes | None = None) -> Axes:
        """Draw a number over the time of the stage that looked for it last."""
        for stage in reversed(self.stages):
            if name in stage.found.moved():
                return stage.plot(name, ax=ax)
        raise InvalidInput(f"no stage looked for '{name}'; there are {', '.join(self.rows())}")

    def __str__(self) -> str:
        lines = [str(stage.drive) for stage in self.stages]
        lines.append(
            f"{'':10s}{'first':>10s}{'found':>10s}{'+-':>9s}{'true':>10s}{'% of change':>13s}"
            "  last stage"
        )
        for name, row in self.rows().items():
            spread = "" if row["spread"] is None else f"{row['spread']:.3g}"
            lines.append(
                f"{name:10s}{row['first']:10.5g}{row['found']:10.5g}{spread:>9s}{row['true']:10.5g}"
                f"{row['error_percent_of_change']:13.2f}  {row['stage']}"
            )
        lines += [
            f"NOT TO BE BELIEVED, {stage.name}: {text}"
            for stage in self.stages
            for text in stage.found.contradictions
        ]
        return "\n".join(lines)


def run_schedule(
    *,
    snr: float = 10.0,
    law: Law = "side_by_side",
    road_noise: float = 0.0,
    seed: int = 0,
    shorten: float = 1.0,
) -> ScheduleRun:
    """Find mass, roll and yaw inertia, pitch inertia, each stage with what those before it found.

    Parameters
    ----------
    snr : float
        Amplitude ratio of signal to noise, infinite for none.
    law : {"side_by_side", "published", "gradient"}
        Which law.
    road_noise : float
        Relative noise of the road that the twin is told, eq. (17).
    seed : int
        Of noise and road.
    shorten : float
        Part of the drives' customary lengths that is driven, from a twentieth to one.

    Raises
    ------
    InvalidInput
        If a ratio, a noise or a length is out of range.
    """
    if not 0.0 <= road_noise < 1.0:
        raise InvalidInput(f"road_noise = {road_noise!r}; give a part from 0 to 1")
    if not 0.05 <= shorten <= 1.0:
        raise InvalidInput(f"shorten = {shorten!r}; give a part from 0.05 to 1")
    if not snr > 0.0:
        raise InvalidInput(f"snr = {snr!r}; give a positive number, inf for no noise")
    load, known = NOMINAL_SUV, dict[str, float]()
    done: list[LoadExperiment] = []
    for number, stage in enumerate(_STAGES):
        rng = np.random.default_rng([seed, number])
        beside, more = (stage.beside, stage.more) if law == "side_by_side" else ((), ())
        looked_for = (*stage.names, *beside)
        done.append(
            experiment(
                stage.name,
                drive_of(stage.drive, seed, shorten),
                load,
                stage.names,
                [_narrowed(u, known) for u in unknowns(*looked_for, around=load)],
                (*stage.channels, *more),
                law=law,
                snr=snr,
                seed=rng,
                road_noise=road_noise if stage.drive == "road" else 0.0,
            )
        )
        found = done[-1].found
        load = load.replace(**{name: found.last(name) for name in looked_for})
        known.update(found.spread)
    return ScheduleRun(tuple(done), load)


def _narrowed(unknown: Unknown, known: dict[str, float]) -> Unknown:
    """An unknown that an earlier stage found, with the spread it was found with."""
    if unknown.parameter not in known:
        return unknown
    least = _LEAST_SPREAD * unknown.spread
    spread = min(max(known[unknown.parameter], least), unknown.spread)
    return dataclasses.replace(unknown, spread=spread)
