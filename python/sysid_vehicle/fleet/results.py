"""What the studies of a fleet found: a row for each, and the causes over all cars."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from .._common.text import brief, html_paragraph, html_table, number, text_table, unit_after
from ..errors import InvalidInput, near_names
from ..saved import load
from ..study import Study

AHEAD_S = 1.0
"""How far ahead the physical gains of effects are predicted."""


@dataclass(frozen=True)
class Effect:
    """One effect that a study added.

    Attributes
    ----------
    id : str
    grade : str
        `confirmed`, `plausible` or `alias`.
    confounded_with : tuple of str
    stands_in : str
        What tells that it only stands in for something else, or may; empty where it is named.
    parameters : dict
        Value, standard error and unit by name.
    error_before, error_after : float
        One step ahead on validation data, over the noise floor.
    gains : dict
        What it takes off the error one second ahead on validation data, by channel, in its unit;
        None where a model lost the car, or the driving is too short.
    """

    id: str
    grade: str
    confounded_with: tuple[str, ...]
    stands_in: str
    parameters: dict[str, tuple[float | None, float | None, str]]
    error_before: float
    error_after: float
    gains: dict[str, float | None]

    @property
    def named(self) -> bool:
        """Whether its study names it, so that it counts as a cause."""
        return not self.stands_in and self.grade != "alias"


@dataclass(frozen=True)
class Row:
    """One study of a fleet.

    Attributes
    ----------
    name, car : str
    failure : str
        Why there is no study; empty where there is one.
    verdict : str
    effects : tuple of Effect
    error_before, error_after : float or None
        One step ahead on validation data, over the noise floor.
    explained : tuple of float, or None
        Share of the error 1 to 5 s ahead that is gone, and its 95 % interval.
    usable_s, validation_s : float or None
    warnings : tuple of str
    seconds : float
    """

    name: str
    car: str
    failure: str = ""
    verdict: str = ""
    effects: tuple[Effect, ...] = ()
    error_before: float | None = None
    error_after: float | None = None
    explained: tuple[float, float, float] | None = None
    usable_s: float | None = None
    validation_s: float | None = None
    warnings: tuple[str, ...] = ()
    seconds: float = 0.0

    def to_dict(self) -> dict[str, Any]:
        """All of it, ready for JSON."""
        return asdict(self)

    @classmethod
    def from_dict(cls, told: dict[str, Any]) -> Row:
        """The way back."""
        effects = tuple(
            Effect(
                **{
                    **e,
                    "confounded_with": tuple(e["confounded_with"]),
                    "parameters": {n: tuple(p) for n, p in e["parameters"].items()},
                    # JSON has no numbers for what is not finite.
                    **{k: _or_nan(e[k]) for k in ("error_before", "error_after")},
                }
            )
            for e in told["effects"]
        )
        explained = None if told["explained"] is None else tuple(told["explained"])
        given = {"effects": effects, "explained": explained, "warnings": tuple(told["warnings"])}
        return cls(**{**told, **given})


@dataclass(frozen=True)
class Cause:
    """One effect over the fleet.

    Attributes
    ----------
    id : str
    cars, share : int, float
        Cars in which some study names it, and their share of the cars that were studied.
    studies, aliases : int
        Studies that name it; studies in which it stands in for something else, or may.
    gain : float
        Median over the studies that name it of the fall of the one-step error it brings, over the
        noise floor; NaN where none does.
    gains : dict
        The same one second ahead, by channel, in its unit.
    parameters : dict
        By name: median, first and last decile over the studies that name it, unit.
    confounded_with : tuple of str
        What some study cannot tell from it.
    """

    id: str
    cars: int
    share: float
    studies: int
    aliases: int
    gain: float
    gains: dict[str, float]
    parameters: dict[str, tuple[float, float, float, str]]
    confounded_with: tuple[str, ...]

    @property
    def sizes(self) -> str:
        """Its parameters in words."""
        spread = self.studies > 1  # one study has no deciles
        return ", ".join(
            f"{n} {number(m, 3)}"
            + (f" ({number(low, 3)} to {number(high, 3)})" if spread else "")
            + unit_after(unit)
            for n, (m, low, high, unit) in self.parameters.items()
        )


@dataclass(frozen=True)
class Fleet:
    """What the studies of many logs found; a sequence of rows.

    Attributes
    ----------
    folder : Path
        Where the results stand.
    rows : tuple of Row
        One for each study that was asked for, in that order.
    """

    folder: Path
    rows: tuple[Row, ...]

    @property
    def done(self) -> tuple[Row, ...]:
        """The studies that there are."""
        return tuple(r for r in self.rows if not r.failure)

    @property
    def failed(self) -> tuple[Row, ...]:
        """Those that could not be done, with the reason."""
        return tuple(r for r in self.rows if r.failure)

    @cached_property
    def cars(self) -> tuple[str, ...]:
        """Cars of which there is a study."""
        return tuple(dict.fromkeys(r.car for r in self.done))

    @cached_property
    def causes(self) -> tuple[Cause, ...]:
        """Effects that were added somewhere, by the share of cars and by gain."""
        ids = dict.fromkeys(e.id for r in self.done for e in r.effects)
        found = [self._cause(i) for i in ids]
        return tuple(sorted(found, key=lambda c: (-c.share, -np.nan_to_num(c.gain), c.id)))

    def _cause(self, id_: str) -> Cause:
        of_it = [(r.car, e) for r in self.done for e in r.effects if e.id == id_]
        named = [e for _, e in of_it if e.named]
        cars = {car for car, e in of_it if e.named}
        values: dict[str, list[float]] = {}
        units: dict[str, str] = {}
        for e in named:
            for name, (value, _, unit) in e.parameters.items():
                values.setdefault(name, []).append(np.nan if value is None else value)
                units[name] = unit
        gains: dict[str, list[float]] = {}
        for e in named:
            for channel, gain in e.gains.items():
                gains.setdefault(channel, []).append(np.nan if gain is None else gain)
        return Cause(
            id_,
            len(cars),
            len(cars) / len(self.cars),
            len(named),
            len(of_it) - len(named),
            _median(e.error_before - e.error_after for e in named),
            {c: _median(g) for c, g in gains.items()},
            {n: (*_spread(v), units[n]) for n, v in values.items()},
            tuple(dict.fromkeys(o for e in named for o in e.confounded_with)),
        )

    def study(self, name: str) -> Study:
        """Load one study.

        Raises
        ------
        InvalidInput
            There is none of this name, or it failed.
        """
        row = next((r for r in self.rows if r.name == name), None)
        if row is None:
            raise InvalidInput(
                f"there is no study '{name}'{near_names(name, [r.name for r in self.rows])}"
            )
        if row.failure:
            raise InvalidInput(f"{name}: there is no study of it: {row.failure}")
        found = load(study_file(self.folder, name))
        assert isinstance(found, Study)
        return found

    def __len__(self) -> int:
        return len(self.rows)

    def __getitem__(self, i: int) -> Row:
        return self.rows[i]

    HEAD = ("effect", "cars", "share", "gain", "size", "confounded with")

    def table(self) -> list[list[str]]:
        """The causes under `HEAD`."""
        return [
            [
                c.id,
                str(c.cars),
                f"{100.0 * c.share:.0f} %",
                f"{c.gain:.3f}" if np.isfinite(c.gain) else "-",
                c.sizes or f"not named; compensates for something else, or may, in {c.aliases}",
                ", ".join(c.confounded_with) or "-",
            ]
            for c in self.causes
        ]

    @property
    def title(self) -> str:
        """How many studies there are, of how many cars, and how they ended."""
        verdicts = [r.verdict for r in self.done]
        ended = ", ".join(
            f"{verdicts.count(v)} {v.replace('_', ' ')}" for v in dict.fromkeys(verdicts)
        )
        done, cars = len(self.done), len(self.cars)
        said = f"{done} {'study' if done == 1 else 'studies'} of {cars} car{'s' * (cars != 1)}"
        return (
            said
            + (f": {ended}" if ended else "")
            + (f"; {len(self.failed)} failed" if self.failed else "")
        )

    __repr__ = brief

    def __str__(self) -> str:
        lines = [f"{self.title}."]
        if self.causes:
            lines.append(text_table(self.HEAD, self.table()))
        elif self.done:
            lines.append("No effect was added to any of them.")
        return "\n".join([*lines, *(f"Failed: {r.name}: {r.failure}" for r in self.failed)])

    def _repr_html_(self) -> str:
        failed = "".join(html_paragraph(f"Failed: {r.name}: {r.failure}") for r in self.failed)
        return html_paragraph(f"{self.title}.") + html_table(self.HEAD, self.table()) + failed


def study_file(folder: Path, name: str, suffix: str = ".npz") -> Path:
    """Where a study of this name stands."""
    return folder / "studies" / f"{name}{suffix}"


def _or_nan(value: float | None) -> float:
    return float("nan") if value is None else value


def _median(values: Iterable[float]) -> float:
    known = [v for v in values if np.isfinite(v)]
    return float(np.median(known)) if known else float("nan")


def _spread(values: Sequence[float]) -> tuple[float, float, float]:
    known = [v for v in values if np.isfinite(v)]
    if not known:
        return (float("nan"),) * 3
    low, middle, high = np.quantile(known, [0.1, 0.5, 0.9])
    return float(middle), float(low), float(high)
