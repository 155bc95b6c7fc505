"""One column of a foreign log: how it becomes numbers in SI units, on the clock of the log."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..._common.arrays import FloatArray, as_float64
from ..._common.files import refuse_unknown
from ...errors import InvalidInput, near_names
from ...log import CHANNELS, COMMANDS, MEASURED, held_rows, interpolated, listed
from ..table import Table
from ..units import WHAT, factor_to, measures, states_nothing

_SOURCE_KEYS = (
    *("column", "factor", "offset", "despike", "delay_s", "sideslip", "sign", "mean_with"),
    *("as_stated", "held"),
)
_GROUND = ("east", "north", "speed", "course", "heading")  # speeds and angles are measured too
Between = Callable[[FloatArray, FloatArray, FloatArray], FloatArray]


@dataclass(frozen=True)
class Source:
    """Where a canonical channel comes from: ``value = factor * column + offset``.

    `delay_s` is how late the column is [s]: its values are taken from so much later in the file.
    `sideslip`, for `vy_mps` alone: the column is the sideslip angle, which `factor` makes radians;
    the lateral speed is ``vx_mps tan(angle)``. `sign`: another column that is not 0 where the
    value is negative, for buses that send size and sign apart. `mean_with`: columns of which the
    mean with `column` is taken, such as the speeds of both wheels of an axle. `as_stated`: a unit
    that the file states is converted, as neither factor nor offset is given; a factor of 1 that is
    given says that the file is wrong. `held`, for `steer_rad` and `fx_n` alone: the column is a
    command that stands until the next one.
    """

    column: str
    factor: float = 1.0
    offset: float = 0.0
    despike: bool = False
    delay_s: float = 0.0
    sideslip: bool = False
    sign: str = ""
    mean_with: tuple[str, ...] = ()
    as_stated: bool = True
    held: bool = False

    def __post_init__(self) -> None:
        if (self.factor, self.offset) != (1.0, 0.0):
            object.__setattr__(self, "as_stated", False)

    @property
    def columns(self) -> tuple[str, ...]:
        """All columns that it is read from."""
        return (self.column, *self.mean_with, *filter(None, [self.sign]))

    def unit_of(self, channel: str) -> str:
        """The unit to which `factor` brings the column."""
        return "rad" if self.sideslip else CHANNELS[channel].unit

    def read(self, table: Table, channel: str, si_unit: str, notes: list[str]) -> FloatArray:
        """Return the values in SI units, shape (n,), as the rows of the file have them.

        Where the map gives neither a factor nor an offset but 0, a unit that the file states is
        converted, which `notes` tells.

        Raises
        ------
        InvalidInput
            If the column is not in the table (near names are given) or not numeric.
        """
        for name in self.columns:
            if not table.counts[name]:
                hint = near_names(name, table.names)
                raise InvalidInput(
                    f"{channel}: the channel map names column '{name}', which is not in "
                    f"the file{hint}; columns are {listed(table.names)}"
                )
        own: list[FloatArray] = []
        for name in (self.column, *self.mean_with):
            factor = 1.0
            if self.as_stated:
                factor = stated_factor(table, name, channel, si_unit, [] if own else notes)
            own.append(factor * values_of(table, name, channel))
        values = as_float64(np.mean(own, axis=0))
        if not np.isfinite(values).any() and all(np.isfinite(x).any() for x in own):
            raise InvalidInput(
                f"{channel}: {listed((self.column, *self.mean_with))} have no sample at the same "
                f"time, so there is no mean of them; take mean_with out of the channel map"
            )
        if self.sign:
            values = signed(values, table.column(self.sign))
        with np.errstate(over="ignore", invalid="ignore"):  # what is endless is refused later
            return as_float64(self.factor * values + self.offset)

    def on_time(self, time_s: FloatArray, values: FloatArray, channel: str) -> FloatArray:
        """Return values that were read, earlier by `delay_s`; beyond the ends none is known.

        What is measured keeps its noise as it is. An input may step, which only a straight line
        between samples follows; so may a channel whose values a logger repeats.
        """
        if not self.delay_s or self.held:  # a command is brought there as it stands
            return values
        sharp = (channel in (*MEASURED, *_GROUND)) and not held_rows(values)
        return _earlier(time_s, values, self.delay_s, interpolated if sharp else _line)


def signed(values: FloatArray, sign: FloatArray) -> FloatArray:
    """Return sizes with their sign, which holds until it is sent again; unknown before."""
    known = np.flatnonzero(np.isfinite(sign))
    if known.size == 0:
        return np.full(values.shape, np.nan)
    last = np.searchsorted(known, np.arange(values.size), side="right") - 1
    negative = sign[known[np.maximum(last, 0)]] != 0.0
    return as_float64(np.where(last < 0, np.nan, np.where(negative, -values, values)))


def values_of(table: Table, column: str, channel: str) -> FloatArray:
    """Return the values of a column; of time stamps the seconds."""
    if channel == "time_s" and column in table.seconds and table.counts[column] == 1:
        return table.seconds[column]
    return table.column(column)


def _line(time_s: FloatArray, values: FloatArray, at_s: FloatArray) -> FloatArray:
    return as_float64(np.interp(at_s, time_s, values, np.nan, np.nan))


def _earlier(
    time_s: FloatArray, values: FloatArray, delay_s: float, between: Between
) -> FloatArray:
    """Return the values that were written `delay_s` later; beyond the ends nothing is known."""
    known = np.isfinite(values) & np.isfinite(time_s)
    if np.count_nonzero(known) < 2 or not (np.diff(time_s) > 0.0).all():
        return values  # the log is refused for it
    shifted = between(time_s[known], values[known], time_s + delay_s)
    # A hole stays one, and a slow channel keeps as many samples as it has.
    nearest = np.clip(np.searchsorted(time_s, time_s + delay_s - 1e-9), 0, time_s.size - 1)
    result: FloatArray = np.where(known[nearest], shifted, np.nan)
    return result


def stated_factor(table: Table, column: str, channel: str, si_unit: str, notes: list[str]) -> float:
    """Return the factor for the unit that the file states for a column; 1 if it states none.

    Raises
    ------
    InvalidInput
        If the unit is one of another quantity.
    """
    unit = table.unit(column, si_unit)
    if not unit or column in table.seconds:
        return 1.0
    factor = factor_to(si_unit, unit)
    if factor is None and states_nothing(unit):
        return 1.0
    if factor is None and (what := measures(unit)):
        raise InvalidInput(
            f"{channel}: the file states '{unit}' for column '{column}', {what}, but the channel "
            f"is {WHAT[si_unit]} [{si_unit}]; name another column in the channel map, or a factor "
            f"that makes {si_unit} of it"
        )
    if factor is None:
        notes.append(
            f"{channel}: the file states '{unit}', which is no known unit for it; it was taken as "
            f"{si_unit}: put its factor in the channel map"
        )
        return 1.0
    if factor != 1.0:
        notes.append(
            f"{channel}: the file states '{unit}' and it was converted; put factor = "
            f"{factor:.7g} for {channel} in the channel map to confirm it"
        )
    return factor


def source_of(entry: Mapping[str, Any], channel: str, where: str) -> Source:
    """Return what the table of a channel in a channel map says.

    Raises
    ------
    InvalidInput
        If it holds an unknown key or a value of the wrong kind; the message begins with `where`.
    """
    refuse_unknown(
        entry, (*_SOURCE_KEYS, "rate_hz") if channel == "time_s" else _SOURCE_KEYS, where
    )
    column = entry.get("column", channel)
    others = entry.get("mean_with", ())
    if (
        isinstance(others, str)
        or not isinstance(others, Sequence)
        or not all(isinstance(name, str) for name in others)
        or len({column, *others}) < 1 + len(others)
        or (others and channel == "time_s")
    ):
        raise InvalidInput(
            f"{where}: mean_with = {others!r}; give a list of the columns whose mean with the "
            f"first the channel is"
        )
    if not isinstance(column, str):
        raise InvalidInput(f"{where}: column = {column!r}; give the name of the source column")
    despike, sideslip = (_flag(entry, key, where) for key in ("despike", "sideslip"))
    if sideslip and channel != "vy_mps":
        raise InvalidInput(f"{where}: sideslip = true makes a lateral speed; give it for vy_mps")
    held = _flag(entry, "held", where)
    if held and channel not in COMMANDS:
        raise InvalidInput(
            f"{where}: held = true says that a command stands until the next one; give it for "
            f"{listed(COMMANDS)} alone"
        )
    factor = number(entry, "factor", 1.0, where)
    if factor == 0.0:
        raise InvalidInput(f"{where}: factor = 0 would erase the channel; give its unit factor")
    delay_s = number(entry, "delay_s", 0.0, where)
    if delay_s and channel == "time_s":
        raise InvalidInput(f"{where}: delay_s has no meaning for the time; give it for a channel")
    offset = number(entry, "offset", 0.0, where)
    sign = entry.get("sign", "")
    if not isinstance(sign, str):
        raise InvalidInput(f"{where}: sign = {sign!r}; give the name of the column with the sign")
    stated = _flag(entry, "as_stated", where) if "as_stated" in entry else "factor" not in entry
    means = tuple(others)
    return Source(column, factor, offset, despike, delay_s, sideslip, sign, means, stated, held)


def _flag(entry: Mapping[str, Any], key: str, where: str) -> bool:
    value = entry.get(key, False)
    if not isinstance(value, bool):
        raise InvalidInput(f"{where}: {key} = {value!r}; give true or false")
    return value


def number(entry: Mapping[str, Any], key: str, default: float, where: str) -> float:
    """Return the number of a key, or `default` where there is none."""
    value = entry.get(key, default)
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        raise InvalidInput(f"{where}: {key} = {value!r} is not a number; give a plain number")
    return float(value)
