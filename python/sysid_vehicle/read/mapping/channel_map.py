"""The channel map: how the columns of a foreign log become canonical channels."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..._common.arrays import FloatArray
from ..._common.files import read_toml, refuse_unknown
from ..._common.kinds import MAP
from ..._common.typed import typed_fields
from ...errors import InvalidInput
from ...log import CHANNELS, listed
from ..recording import Recording
from ..table import Table
from .ground import Ground
from .held import stand
from .sideslip import SIDESLIP, lateral_speed
from .source import Source, number, source_of, stated_factor, values_of

_TABLES = ("channels", "ground")
_OVER_GROUND = ("vx_mps", "vy_mps")


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
    ground : Ground or None
        Velocity over ground and heading, which make `vx_mps` and `vy_mps`.
    """

    sources: Mapping[str, Source]
    absent: tuple[str, ...] = ()
    rate_hz: float | None = None
    ground: Ground | None = None

    @typed_fields
    def __post_init__(self) -> None:
        for channel, source in self.sources.items():
            if not isinstance(source, Source):
                raise InvalidInput(
                    f"ChannelMap: {channel} = {source!r} is no Source; ChannelMap.from_dict takes "
                    "names of columns"
                )
        both = [c for c in _OVER_GROUND if c in self.sources]
        if self.ground is not None and both:
            raise InvalidInput(
                f"ChannelMap: {both[0]} is mapped, and [ground] gives it too; take one of them out"
            )

    @classmethod
    def from_toml(cls, path: str | Path) -> ChannelMap:
        """Read a channel map, a TOML file with the table ``[channels]``, or ``[ground]``, or both.

        Each entry is the name of the source column, a table with ``column``, ``mean_with`` (a list
        of others, whose mean with it is taken), ``factor`` (1),
        ``offset`` (0), ``despike`` (false), ``delay_s`` (0), ``sign`` (the column that is 1 where
        the value is negative), ``as_stated`` (whether a unit that the file states is converted:
        true where there is no factor, and false where there is one, 1 too) and, for ``vy_mps``,
        ``sideslip`` (false), for ``steer_rad`` and ``fx_n`` ``held`` (false; a command that stands
        until the next one), or ``false`` to ignore the channel;
        ``time_s = { rate_hz = 100 }`` numbers the rows of a file without time. ``[ground]`` has
        ``heading`` and ``east`` and ``north``, or ``speed`` and ``course``, in the same form, and
        for angles ``from``, which is ``"north"`` (clockwise) or ``"east"`` (anticlockwise).

        Raises
        ------
        InvalidInput
            If the file cannot be read or holds an unknown key or a value of the wrong kind.
        """
        content = read_toml(path, MAP)
        refuse_unknown(content, _TABLES, str(path))
        if not any(isinstance(content.get(name), dict) for name in _TABLES):
            raise InvalidInput(f"{path}: the table [channels] is missing; add it")
        return cls.from_dict(content, where=str(path))

    @classmethod
    def from_dict(cls, table: Mapping[str, Any], where: str = "channel map") -> ChannelMap:
        """Build a channel map from the content of a ``[channels]`` table, or of the whole file.

        Raises
        ------
        InvalidInput
            As :meth:`from_toml`; the message begins with `where`.
        """
        ground = None
        if table and all(n in _TABLES and isinstance(x, Mapping) for n, x in table.items()):
            if "ground" in table:
                ground = Ground.from_dict(table["ground"], f"{where}, [ground]")
            table = table.get("channels", {})
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
                rate_hz = number(entry, "rate_hz", 0.0, f"{where}, {channel}")
                if rate_hz <= 0.0:
                    raise InvalidInput(f"{where}: rate_hz = {rate_hz:g}; give a positive rate")
            else:
                sources[channel] = source_of(entry, channel, f"{where}, {channel}")
        for channel in absent:
            if CHANNELS[channel].required:
                raise InvalidInput(f"{where}: {channel} = false, but every log needs it; map it")
        return cls(sources, tuple(absent), rate_hz, ground)

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
        wanted = {c: source.column for c, source in self.sources.items() if c != "time_s"}
        wanted |= {f"{c}, {n}": n for c, s in self.sources.items() for n in s.columns[1:]}
        time = self.sources["time_s"].column if "time_s" in self.sources else "time_s"
        if self.rate_hz is not None or time != "time_s":
            if recording.clocked is None:
                raise InvalidInput(
                    "time_s: every channel of this log has its own time; take time_s out of the "
                    "channel map, or leave only a factor there: time_s = { factor = 0.001 }"
                )
            like = time if self.rate_hz is None else next(iter(wanted.values()), "")
            recording = recording.clocked(like, self.rate_hz)
        skipped = self.absent
        if self.ground is not None:
            wanted.update({part: s.column for part, s in self.ground.sources.items()})
            skipped = (*skipped, *_OVER_GROUND)
        table = recording.table(wanted, skipped, notes)
        return table if time == "time_s" else table.renamed("time_s", time)

    def apply(self, table: Table, notes: list[str]) -> dict[str, FloatArray]:
        """Return the canonical channels of `table`, then its other numeric columns.

        Where the map gives neither a factor nor an offset but 0, a unit that the file states is
        converted, which `notes` tells.

        Raises
        ------
        InvalidInput
            If a source column is not in the table (near names are given) or not numeric.
        """
        notes += table.notes
        result: dict[str, FloatArray] = {}
        for channel, source in self.sources.items():
            unit = source.unit_of(channel)
            result[channel] = source.read(table, channel, unit, notes)
        if self.rate_hz is not None and "time_s" not in table.counts:
            result["time_s"] = np.arange(table.n) / self.rate_hz
        elif "time_s" not in result and "time_s" in table.counts:
            factor = stated_factor(table, "time_s", "time_s", "s", notes)
            result["time_s"] = factor * values_of(table, "time_s", "time_s")
        for channel, source in self.sources.items():
            if "time_s" in result:
                result[channel] = source.on_time(result["time_s"], result[channel], channel)
        over_ground = {} if self.ground is None else self.ground.read(table, result, notes)
        skipped = {*result, *self.absent, *(_OVER_GROUND if over_ground else ())}
        used = {column for source in self.sources.values() for column in source.columns}
        if self.ground is not None:
            used |= {source.column for source in self.ground.sources.values()}
        for name in dict.fromkeys(table.names):
            if name in skipped:
                continue
            if name in CHANNELS:
                factor = stated_factor(table, name, name, CHANNELS[name].unit, notes)
                result[name] = factor * values_of(table, name, name)
            elif name not in used and table.counts[name] == 1 and name in table.columns:
                result[name] = table.columns[name]
        if self.ground is not None:
            result.update(self.ground.in_the_body(result, over_ground))
        self._slip_to_speed(result)
        _refuse_text(table, result)
        commands = {c: s.delay_s for c, s in self.sources.items() if s.held}
        return stand(result, commands) if commands and "time_s" in result else result

    def factors(self, table: Table) -> dict[str, float]:
        """Return what the columns of `table` are multiplied by, by canonical channel.

        Of a velocity over ground nothing is told: its parts are other channels.
        """
        sources = {c: Source(c) for c in CHANNELS if table.counts[c]} | dict(self.sources)
        return {
            channel: stated_factor(table, s.column, channel, s.unit_of(channel), [])
            if s.as_stated
            else s.factor
            for channel, s in sources.items()
        }

    def _slip_to_speed(self, columns: dict[str, FloatArray]) -> None:
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


def _refuse_text(table: Table, columns: Mapping[str, FloatArray]) -> None:
    """Tell of columns that hold text where a channel that every log needs is not among the others.

    Raises
    ------
    InvalidInput
        The message names the first cell.
    """
    absent = [
        name for name, channel in CHANNELS.items() if channel.required and name not in columns
    ]
    text = [name for name in table.not_numbers if name not in table.seconds]
    if absent and text:
        bad = table.not_numbers[text[0]]
        raise InvalidInput(
            f"missing column{'s' if len(absent) > 1 else ''} {', '.join(absent)}, but "
            f"{listed(text)} hold{'s' if len(text) == 1 else ''} no numbers (of {text[0]} the "
            f"first cell is {bad}): export plain numbers, or name other columns in the channel map "
            f"(columns of numbers: {listed(table.columns) or 'none'})"
        )
