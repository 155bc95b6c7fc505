"""A channel map for a log that nobody has mapped yet: proposed, told why, to be edited."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from .._common.arrays import FloatArray
from .._common.files import as_path
from ..errors import InvalidInput
from ..log import CHANNELS, Columns, Log, listed
from ..vehicle import Vehicle
from .channel_map import ChannelMap
from .ground import PARTS, Ground
from .names import is_sideslip, rank, si_unit
from .navigation import NAMED, Navigation, combination, ground_speed, told
from .physics import scales, sideways
from .recording import Recording
from .registry import blamed, recognised
from .source import Source
from .table import Table
from .units import factor_to, unit_at_end, unit_in_name

_RATE_HZ = 50.0  # at which units and signs are looked for
_FEWEST = 100
_TURNED = ("yaw_rate_radps", "ay_mps2", "steer_rad")  # together, where the axes have z down
_FINER = ((0.5, 1.0), (500.0, 1e-3), (5e5, 1e-6), (np.inf, 1e-9))  # steps below, factor of time


@dataclass(frozen=True)
class Proposed:
    """Where a channel is to come from, and why."""

    column: str
    factor: float
    unit: str
    why: str
    others: tuple[str, ...]
    sideslip: bool = False

    @property
    def source(self) -> Source:
        """As a channel map has it."""
        return Source(self.column, self.factor, sideslip=self.sideslip)


@dataclass(frozen=True)
class Proposal:
    """A proposed channel map.

    Attributes
    ----------
    channels : mapping of Proposed
        By canonical channel.
    missing : tuple of str
        Needed channels for which nothing was found.
    ground : mapping of Proposed
        Velocity over ground and heading, by part, where they make the speeds of the body.
    counted_from : str
        Where its angles begin.
    """

    channels: Mapping[str, Proposed]
    missing: tuple[str, ...]
    ground: Mapping[str, Proposed] = field(default_factory=dict)
    counted_from: str = "north"

    @property
    def channel_map(self) -> ChannelMap:
        """The map, ready for `read_log`."""
        angles = dict.fromkeys((p for p in self.ground if PARTS[p] == "rad"), self.counted_from)
        parts = {part: p.source for part, p in self.ground.items()}
        return ChannelMap(
            {c: p.source for c, p in self.channels.items()},
            ground=Ground(parts, angles) if parts else None,
        )

    def to_toml(self) -> str:
        """The map as a file to look through and to edit."""
        lines = ["# Proposed channel map: look at every line, mend what is wrong.", "[channels]"]
        for channel, p in self.channels.items():
            lines.append(f"# {CHANNELS[channel].meaning} [{CHANNELS[channel].unit}]: {p.why}")
            if p.others:
                lines.append(f"#   or one of: {listed(map(_quoted, p.others))}")
            entry = f"column = {_quoted(p.column)}, factor = {p.factor!r}"
            entry += ", sideslip = true" if p.sideslip else ""
            lines.append(f"{channel} = {{ {entry} }}")
        for name in self.missing:
            lines.append(f"# {CHANNELS[name].meaning} [{CHANNELS[name].unit}]: nothing was found")
            lines.append(f'# {name} = {{ column = "", factor = 1.0 }}')
        if self.ground:
            lines += [
                "",
                "# Velocity over ground and heading make vx_mps and vy_mps.",
                "[ground]",
            ]
        for part, p in self.ground.items():
            lines.append(f"# {part} [{PARTS[part]}]: {p.why}")
            entry = f"column = {_quoted(p.column)}, factor = {p.factor!r}"
            entry += f', from = "{self.counted_from}"' if PARTS[part] == "rad" else ""
            lines.append(f"{part} = {{ {entry} }}")
        return "\n".join(lines) + "\n"

    def __str__(self) -> str:
        return self.to_toml()


def propose_channels(
    source: str | Path | Columns | Log,
    *,
    dbc: str | Path | None = None,
    vehicle: Vehicle | None = None,
) -> Proposal:
    """Propose which column of a log is which channel, in which unit and with which sign.

    Columns are found by their names and by the units that the file states. Units that it does not
    state, signs, swapped accelerations and the angle of the steering wheel in place of the road
    wheels' are found by the laws of motion. The steering ratio follows from the wheelbase; without
    a vehicle it is only as good as a usual one.

    Parameters
    ----------
    source : str, Path, table or Log
        As for `read_log`.
    dbc : str or Path, optional
        Database of the CAN frames that the file holds.
    vehicle : Vehicle, optional
        The car, for its wheelbase.

    Raises
    ------
    InvalidInput
        If the log cannot be read.
    """
    from . import contents

    if isinstance(source, Log):
        source = {name: source[name] for name in source.channels}
    is_path = isinstance(source, (str, Path))
    entry = recognised(as_path(source)) if is_path else None
    with blamed(entry, source if is_path else "log"):
        try:
            held = contents(source, dbc, entry)
        except InvalidInput as error:
            if not is_path or as_path(source).name in str(error):
                raise
            raise InvalidInput(f"{source}: {error}") from error
        view = _View(held)
        chosen = {
            channel: found
            for channel in CHANNELS
            if not (channel == "time_s" and view.has_times) and (found := _ranked(view, channel))
        }
        if "time_s" not in chosen and not view.has_times:
            rising = [name for name in view.rising if not any(name in c for c in chosen.values())]
            chosen = {"time_s": rising, **chosen} if len(rising) == 1 else chosen
        return _proposal(view, chosen, None if vehicle is None else vehicle.wheelbase_m)


class _View:
    """A table or a recording, alike: names, units, values with times."""

    def __init__(self, held: Table | Recording) -> None:
        self._held = held
        self.has_times = isinstance(held, Recording)
        self.names = list(held.entries) if isinstance(held, Recording) else list(held.columns)
        if isinstance(held, Table):
            self.names += [n for n in held.seconds if n not in self.names]

    def unit(self, name: str, si_unit: str) -> str:
        if isinstance(self._held, Recording):
            return self._held.entries[name].unit or unit_in_name(name, si_unit)
        return self._held.unit(name, si_unit)

    def said(self, name: str, si_unit: str) -> str:
        """The unit that the file states, or else the one at the end of the name."""
        return self.unit(name, si_unit) or unit_at_end(name, si_unit)[1]

    @property
    def rising(self) -> list[str]:
        """Columns of a table that rise from each row to the next."""
        columns = self._held.columns if isinstance(self._held, Table) else {}
        return [n for n, x in columns.items() if x.size >= _FEWEST and (np.diff(x) > 0.0).all()]

    def is_stamps(self, name: str) -> bool:
        return isinstance(self._held, Table) and name in self._held.seconds

    def values(
        self, names: list[str], time: str | None
    ) -> dict[str, tuple[FloatArray, FloatArray]]:
        if isinstance(self._held, Recording):
            signals = self._held.signals(names, [])
            return {name: (s.time_s, s.values) for name, s in signals.items()}
        if time is None:
            return {}
        clock = self._held.seconds.get(time, self._held.columns.get(time))
        assert clock is not None
        return {name: (clock, self._held.columns[name]) for name in names}


def _ranked(view: _View, channel: str) -> list[str]:
    scored = [(rank(n, view.unit(n, si_unit(channel, n)), channel), n) for n in view.names]
    kept = [(score, name) for score, name in scored if score > 0.0]
    return [name for _, name in sorted(kept, key=lambda pair: -pair[0])]


def _proposal(view: _View, chosen: dict[str, list[str]], wheelbase_m: float | None) -> Proposal:
    # A column is one channel: the one that is first in the list of channels.
    first: dict[str, str] = {}
    for channel, names in chosen.items():
        free = [name for name in names if name not in first.values()]
        if free:
            first[channel] = free[0]
    stated = _stated(view, first)
    time = first.get("time_s")
    parts = _navigated(view, first)
    held = view.values([*(n for c, n in first.items() if c != "time_s"), *parts.values()], time)
    signals = {c: held[n] for c, n in first.items() if n in held}
    said = _stated(view, parts)
    if "east" in parts and held:
        signals["vx_mps"] = ground_speed(held[parts["east"]], held[parts["north"]])
        stated.pop("vx_mps", None)
        stated.update({"vx_mps": said["east"]} if "east" in said else {})
    driven = {c: x for c, x in signals.items() if c != "vy_mps"}
    factors = dict(stated)
    why: dict[str, str] = {}
    if time is not None:
        factors["time_s"], why["time_s"] = _time_factor(view, time, held, stated.get("time_s"))
    clock = factors.get("time_s", 1.0)
    even = _even(driven, clock)
    if even is not None:
        # The sign and the gear of the steering are no matter of its unit: they are always sought.
        known = {c: f for c, f in stated.items() if c in even[1]}
        found = scales(*even, known, wheelbase_m)
        if found.swapped:
            first["ax_mps2"], first["ay_mps2"] = first["ay_mps2"], first["ax_mps2"]
        factors.update(found.factors)
        why.update(found.notes)
        # By itself: a sensor of sideslip often knows less of the drive than the others.
        every = _even(signals, clock)
        if every is not None and "vy_mps" in every[1]:
            angle = is_sideslip(first["vy_mps"])
            factors["vy_mps"], why["vy_mps"] = sideways(*every, factors, stated, angle=angle)
    nav = None
    if parts and even is not None and {"vx_mps", "yaw_rate_radps"} <= {*even[1], *factors}:
        motion = {c: (even[0], factors[c] * even[1][c]) for c in ("vx_mps", "yaw_rate_radps")}
        own = {part: (clock * held[n][0], held[n][1]) for part, n in parts.items()}
        nav = told(own, said, motion["yaw_rate_radps"], motion["vx_mps"], factors["vx_mps"])
    ground = {} if nav is None else _ground(view, nav, parts, first, factors)
    if nav is not None and nav.to_the_right:
        for channel in [c for c in _TURNED if c in first]:
            factors[channel] = -factors.get(channel, 1.0)
            why[channel] = "; ".join(
                filter(None, [why.get(channel), "positive to the right, as the heading tells"])
            )
    channels = {
        channel: Proposed(
            name,
            factors.get(channel, 1.0),
            unit,
            "; ".join(filter(None, [_by_name(channel, name, unit), ended, why.get(channel)])),
            tuple(n for n in chosen[channel] if n != name)[:5],
            channel == "vy_mps" and is_sideslip(name),
        )
        for channel, name in first.items()
        for unit in (view.unit(name, si_unit(channel, name)),)
        for ended in (_ended(channel, name, unit),)
    }
    needed = [c for c in CHANNELS if CHANNELS[c].required and c not in channels]
    if view.has_times:
        needed = [c for c in needed if c != "time_s"]
    if nav is None:
        return Proposal(channels, tuple(needed))
    return Proposal(channels, tuple(c for c in needed if c != "vx_mps"), ground, nav.counted_from)


def _stated(view: _View, columns: Mapping[str, str]) -> dict[str, float]:
    """Factors of what has a unit that is stated, or the name of the channel itself."""
    found: dict[str, float] = {}
    for channel, name in columns.items():
        unit = si_unit(channel, name)
        factor = factor_to(unit, view.said(name, unit))
        if factor is not None:
            found[channel] = factor
        elif name == channel and channel in CHANNELS:
            found[channel] = 1.0
    return found


def _navigated(view: _View, first: Mapping[str, str]) -> dict[str, str]:
    """Columns of what navigation knows, where no lateral speed is logged and they make one."""
    if "vy_mps" in first:
        return {}
    kept = set(first.values())
    found = combination({p: [n for n in _ranked(view, p) if n not in kept] for p in NAMED})
    return found if "east" in found or "vx_mps" in first else {}


def _ground(
    view: _View,
    nav: Navigation,
    parts: Mapping[str, str],
    first: dict[str, str],
    factors: Mapping[str, float],
) -> dict[str, Proposed]:
    """Proposals of what navigation knows; the speed is no channel of its own beside them."""
    columns = dict(parts)
    speed = first.pop("vx_mps", "")
    if "east" not in columns:
        columns["speed"] = speed
    found = {}
    for part, name in columns.items():
        unit = view.unit(name, PARTS[part])
        factor = nav.factors[part] if part in nav.factors else factors["vx_mps"]
        text = f"by its name, the file states '{unit}'" if unit else "by its name"
        if PARTS[part] == "rad":
            text += f", counted from {nav.counted_from}, as the car moves the way it points"
        found[part] = Proposed(name, factor, unit, text, ())
    return found


def _by_name(channel: str, name: str, unit: str) -> str:
    if channel == "time_s" and not rank(name, unit, channel):
        return "the only column that always rises"
    text = "by its name" if name != channel else "so called"
    return f"{text}, the file states '{unit}'" if unit else text


def _ended(channel: str, name: str, unit: str) -> str:
    """What a unit at the end of a name is told as, if that is all there is."""
    found = "" if unit or name == channel else unit_at_end(name, si_unit(channel, name))[1]
    return f"in '{found}', as its name ends" if found else ""


def _time_factor(
    view: _View, time: str, held: Mapping[str, Any], stated: float | None
) -> tuple[float, str]:
    if view.is_stamps(time):
        return 1.0, "time stamps"
    if stated is not None or not held:
        return stated or 1.0, ""
    clock = next(iter(held.values()))[0]
    step = float(np.median(np.diff(clock))) if clock.size > 1 else 0.0
    factor = next(f for below, f in _FINER if step < below)
    return factor, f"steps of {step:.4g}"


def _even(
    held: Mapping[str, tuple[FloatArray, FloatArray]], factor: float
) -> tuple[FloatArray, dict[str, FloatArray]] | None:
    """The channels on common even times, to look at: interpolated, for nothing else."""
    known = {}
    for channel, (clock, values) in held.items():
        there = np.isfinite(clock) & np.isfinite(values)
        if np.count_nonzero(there) >= _FEWEST and (np.diff(clock[there]) > 0.0).all():
            known[channel] = factor * clock[there], values[there]
    if not known:
        return None
    begin = max(float(t[0]) for t, _ in known.values())
    end = min(float(t[-1]) for t, _ in known.values())
    if (end - begin) * _RATE_HZ < _FEWEST:
        return None
    time_s = np.arange(begin, end, 1.0 / _RATE_HZ)
    return time_s, {c: np.interp(time_s, t, values) for c, (t, values) in known.items()}


def _quoted(name: str) -> str:
    text = name.replace("\\", "\\\\").replace('"', '\\"')
    if any(ord(c) < 32 for c in text):
        raise InvalidInput(f"column {name!r}: its name holds a control character; rename it")
    return f'"{text}"'
