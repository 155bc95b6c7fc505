"""The channel map: how the columns of a foreign log become canonical channels."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from .._common.files import read_toml, refuse_unknown
from ..errors import InvalidInput, near_names
from ..log import CHANNELS, listed
from .recording import Recording
from .sideslip import SIDESLIP, lateral_speed
from .table import Table
from .units import WHAT, factor_to, measures, states_nothing

_SOURCE_KEYS = ("column", "factor", "offset", "despike", "delay_s", "sideslip")


@dataclass(frozen=True)
class Source:
    """Where a canonical channel comes from: ``value = factor * column + offset``.

    `delay_s` is how late the column is [s]: its values are taken from so much later in the file.
    `sideslip`, for `vy_mps` alone: the column is the sideslip angle, which `factor` makes radians;
    the lateral speed is ``vx_mps tan(angle)``.
    """

    column: str
    factor: float = 1.0
    offset: float = 0.0
    despike: bool = False
    delay_s: float = 0.0
    sideslip: bool = False

    def unit_of(self, channel: str) -> str:
        """The unit to which `factor` brings the column."""
        return "rad" if self.sideslip else CHANNELS[channel].unit


@dataclass(frozen=True)
class ChannelMap:
    """Source column, factor and offset of each canonical channel.

    Channels that are not named are taken from the column of the same name.

    Attributes
    ----------
    sources : mapping of str to Source
        By canonical channel.
    absent : tuple of str
        Canonical channels to ignore although a column has their name.
    rate_hz : float or None
        Sample rate of a file without a time column.
    """

    sources: Mapping[str, Source]
    absent: tuple[str, ...] = ()
    rate_hz: float | None = None

    def __post_init__(self) -> None:
        for channel, source in self.sources.items():
            if not isinstance(source, Source):
                raise InvalidInput(
                    f"ChannelMap: {channel} = {source!r} is no Source; ChannelMap.from_dict takes "
                    "names of columns"
                )

    @classmethod
    def from_toml(cls, path: str | Path) -> ChannelMap:
        """Read a channel map, a TOML file with the table ``[channels]``.

        Each entry is the name of the source column, a table with ``column``, ``factor`` (1),
        ``offset`` (0), ``despike`` (false), ``delay_s`` (0) and, for ``vy_mps``, ``sideslip``
        (false), or ``false`` to ignore the channel;
        ``time_s = { rate_hz = 100 }`` numbers the rows of a file without time.

        Raises
        ------
        InvalidInput
            If the file cannot be read or holds an unknown key or a value of the wrong kind.
        """
        content = read_toml(path)
        refuse_unknown(content, ("channels",), str(path))
        table = content.get("channels")
        if not isinstance(table, dict):
            raise InvalidInput(f"{path}: the table [channels] is missing; add it")
        return cls.from_dict(table, where=str(path))

    @classmethod
    def from_dict(cls, table: Mapping[str, Any], where: str = "channel map") -> ChannelMap:
        """Build a channel map from the content of a ``[channels]`` table.

        Raises
        ------
        InvalidInput
            As :meth:`from_toml`; the message begins with `where`.
        """
        if set(table) == {"channels"} and isinstance(table["channels"], Mapping):
            table = table["channels"]
        refuse_unknown(table, CHANNELS, where)
        sources: dict[str, Source] = {}
        absent: list[str] = []
        rate_hz = None
        for channel, entry in table.items():
            if isinstance(entry, str):
                sources[channel] = Source(entry)
            elif entry is False:
                absent.append(channel)
            elif not isinstance(entry, Mapping):
                raise InvalidInput(
                    f"{where}: {channel} = {entry!r}; give a column name or a table such as "
                    f'{{ column = "name", factor = 1.0 }}'
                )
            elif channel == "time_s" and "rate_hz" in entry:
                refuse_unknown(entry, ("rate_hz",), f"{where}, time_s with rate_hz")
                rate_hz = _number(entry, "rate_hz", 0.0, f"{where}, {channel}")
                if rate_hz <= 0.0:
                    raise InvalidInput(f"{where}: rate_hz = {rate_hz:g}; give a positive rate")
            else:
                sources[channel] = _source(entry, channel, f"{where}, {channel}")
        for channel in absent:
            if CHANNELS[channel].required:
                raise InvalidInput(f"{where}: {channel} = false, but every log needs it; map it")
        return cls(sources, tuple(absent), rate_hz)

    @property
    def despiked(self) -> tuple[str, ...]:
        """Canonical channels whose one-sample spikes are to be removed."""
        return tuple(channel for channel, source in self.sources.items() if source.despike)

    def rows_of(self, recording: Recording, notes: list[str]) -> Table:
        """Return the channels of a recording as a table whose rows are their times.

        Raises
        ------
        InvalidInput
            If a source is not there, or if the map gives the time, which each channel has itself.
        """
        if "time_s" in self.sources or self.rate_hz is not None:
            raise InvalidInput(
                "time_s: every channel of this log has its own time; take time_s out of the "
                "channel map"
            )
        wanted = {channel: source.column for channel, source in self.sources.items()}
        return recording.table(wanted, self.absent, notes)

    def apply(self, table: Table, notes: list[str]) -> dict[str, npt.NDArray[np.float64]]:
        """Return the canonical channels of `table`, then its other numeric columns.

        Where the map gives neither factor nor offset, a unit that the file states is converted,
        which `notes` tells.

        Raises
        ------
        InvalidInput
            If a source column is not in the table (near names are given) or not numeric.
        """
        result: dict[str, npt.NDArray[np.float64]] = {}
        for channel, source in self.sources.items():
            if not table.counts[source.column]:
                hint = near_names(source.column, table.names)
                raise InvalidInput(
                    f"{channel}: the channel map names column '{source.column}', which is not in "
                    f"the file{hint}; columns are {listed(table.names)}"
                )
            values = _values(table, source.column, channel)
            if (source.factor, source.offset) == (1.0, 0.0):
                values = values * _stated_factor(
                    table, source.column, channel, source.unit_of(channel), notes
                )
            with np.errstate(over="ignore", invalid="ignore"):  # what is endless is refused later
                result[channel] = source.factor * values + source.offset
        if self.rate_hz is not None:
            result["time_s"] = np.arange(table.n) / self.rate_hz
        elif "time_s" not in result and "time_s" in table.counts:
            factor = _stated_factor(table, "time_s", "time_s", "s", notes)
            result["time_s"] = factor * _values(table, "time_s", "time_s")
        for channel, source in self.sources.items():
            if source.delay_s and "time_s" in result:
                result[channel] = _earlier(result["time_s"], result[channel], source.delay_s)
        used = {source.column for source in self.sources.values()}
        for name in dict.fromkeys(table.names):
            if name in result or name in self.absent:
                continue
            if name in CHANNELS:
                factor = _stated_factor(table, name, name, CHANNELS[name].unit, notes)
                result[name] = factor * _values(table, name, name)
            elif name not in used and table.counts[name] == 1 and name in table.columns:
                result[name] = table.columns[name]
        self._slip_to_speed(result)
        return result

    def _slip_to_speed(self, columns: dict[str, npt.NDArray[np.float64]]) -> None:
        """Make the lateral speed of a sideslip angle, if that is what the map or the file gives."""
        source = self.sources.get("vy_mps")
        if source is not None and source.sideslip:
            angle = columns["vy_mps"]
        elif SIDESLIP in columns and "vy_mps" not in columns and "vy_mps" not in self.absent:
            angle = columns[SIDESLIP]
        else:
            return
        if "vx_mps" not in columns or "time_s" not in columns:
            return  # the log is refused for it
        columns["vy_mps"] = lateral_speed(columns["time_s"], columns["vx_mps"], angle)


def _values(table: Table, column: str, channel: str) -> npt.NDArray[np.float64]:
    if channel == "time_s" and column in table.seconds and table.counts[column] == 1:
        return table.seconds[column]
    return table.column(column)


def _earlier(
    time_s: npt.NDArray[np.float64], values: npt.NDArray[np.float64], delay_s: float
) -> npt.NDArray[np.float64]:
    """Return the values that were written `delay_s` later; beyond the ends nothing is known."""
    known = np.isfinite(values) & np.isfinite(time_s)
    if np.count_nonzero(known) < 2 or not (np.diff(time_s) > 0.0).all():
        return values  # the log is refused for it
    shifted = np.interp(time_s + delay_s, time_s[known], values[known], np.nan, np.nan)
    # A hole stays one, and a slow channel keeps as many samples as it has.
    nearest = np.clip(np.searchsorted(time_s, time_s + delay_s - 1e-9), 0, time_s.size - 1)
    result: npt.NDArray[np.float64] = np.where(known[nearest], shifted, np.nan)
    return result


def _stated_factor(
    table: Table, column: str, channel: str, si_unit: str, notes: list[str]
) -> float:
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


def _source(entry: Mapping[str, Any], channel: str, where: str) -> Source:
    refuse_unknown(
        entry, (*_SOURCE_KEYS, "rate_hz") if channel == "time_s" else _SOURCE_KEYS, where
    )
    column = entry.get("column", channel)
    if not isinstance(column, str):
        raise InvalidInput(f"{where}: column = {column!r}; give the name of the source column")
    despike, sideslip = (_flag(entry, key, where) for key in ("despike", "sideslip"))
    if sideslip and channel != "vy_mps":
        raise InvalidInput(f"{where}: sideslip = true makes a lateral speed; give it for vy_mps")
    factor = _number(entry, "factor", 1.0, where)
    if factor == 0.0:
        raise InvalidInput(f"{where}: factor = 0 would erase the channel; give its unit factor")
    delay_s = _number(entry, "delay_s", 0.0, where)
    if delay_s and channel == "time_s":
        raise InvalidInput(f"{where}: delay_s has no meaning for the time; give it for a channel")
    offset = _number(entry, "offset", 0.0, where)
    return Source(column, factor, offset, despike, delay_s, sideslip)


def _flag(entry: Mapping[str, Any], key: str, where: str) -> bool:
    value = entry.get(key, False)
    if not isinstance(value, bool):
        raise InvalidInput(f"{where}: {key} = {value!r}; give true or false")
    return value


def _number(entry: Mapping[str, Any], key: str, default: float, where: str) -> float:
    value = entry.get(key, default)
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        raise InvalidInput(f"{where}: {key} = {value!r} is not a number; give a plain number")
    return float(value)
