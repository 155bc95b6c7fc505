"""A channel map for a log that nobody has mapped yet: by names, stated units and laws of motion."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from ..._common.arrays import FloatArray
from ..._common.files import as_path
from ..._common.typed import typed
from ...errors import warn
from ...log import CHANNELS, COMMANDS, Columns, Log, standing
from ...vehicle import Vehicle
from ..recording import Recording
from ..registry import located, recognised
from ..units import factor_to
from .ground import PARTS
from .look import Signal, View, by_name, ended, even, ranked, stated
from .names import is_command, is_sideslip, is_speed, si_unit, sign_of, wheel_of
from .navigation import (
    NAMED,
    Navigation,
    combination,
    ground_speed,
    is_over_ground,
    told,
    twins,
)
from .physics import scales, sideways
from .proposal import Proposal, Proposed
from .source import signed

_DESPIKED = ("steer_rad", "ax_mps2", "ay_mps2")  # of states a log leaves dropouts out by itself
_TURNED = ("yaw_rate_radps", "ay_mps2", "steer_rad")  # together, where the axes have z down
_FINER = ((0.5, 1.0), (500.0, 1e-3), (5e5, 1e-6), (np.inf, 1e-9))  # steps below, factor of time
_DAYS_BELOW = 1e-5  # steps that are days
_DATES = (30000.0, 60000.0)  # days since 1900: from 1982 to 2064


@typed
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

    Warns
    -----
    SysidWarning
        Of what the file holds and nothing here reads.
    """
    from .. import contents

    if isinstance(source, Log):
        source = {name: source[name] for name in source.channels}
    is_path = isinstance(source, (str, Path))
    entry = recognised(as_path(source)) if is_path else None
    where = str(as_path(source)) if is_path else "log"
    with located(where, entry=entry):
        held = contents(source, dbc, entry)
        for left in held.left_out if isinstance(held, Recording) else ():
            warn(f"{as_path(source).stem if is_path else 'log'}: {left}")
        view = View(held)
        chosen = {
            channel: found
            for channel in CHANNELS
            if not (channel == "time_s" and view.has_times) and (found := ranked(view, channel))
        }
        if {"u", "v"} <= {*view.names}:  # in textbooks speeds along and across
            chosen |= {"vx_mps": ["u"], "vy_mps": ["v"]}
        if "time_s" in chosen:  # a clock of whole seconds repeats between samples
            steady = {*view.rising}
            chosen["time_s"].sort(key=lambda name: name not in steady)
        if "time_s" not in chosen and not view.has_times:
            rising = view.stamps or [
                name for name in view.rising if not any(name in c for c in chosen.values())
            ]
            chosen = {"time_s": rising, **chosen} if len(rising) == 1 else chosen
        axles = ("rear", "front")
        if vehicle is not None and vehicle.drive_front_share < 0.5:
            axles = ("front", "rear")
        guess = _Guess(view, _moving_first(view, chosen), axles)
        return guess.proposal(None if vehicle is None else vehicle.wheelbase_m)


def _in_seconds(time: FloatArray) -> FloatArray:
    """Return times in the unit that their steps ask for, which no name or unit is asked for."""
    return time * _factor(time)


def _factor(time: FloatArray) -> float:
    """The factor that makes seconds of times, by their steps; days as spreadsheets count them."""
    step = float(np.median(np.diff(time))) if time.size > 1 else 0.0
    if 0.0 < step < _DAYS_BELOW and _DATES[0] < float(time[0]) < _DATES[1]:
        return 86400.0
    return next(factor for below, factor in _FINER if step < below)


def _first(chosen: Mapping[str, list[str]]) -> dict[str, str]:
    """The likeliest column of each channel; a column is that of the first channel in the list."""
    first: dict[str, str] = {}
    for channel, names in chosen.items():
        free = [name for name in names if name not in first.values()]
        if free:
            first[channel] = free[0]
    return first


def _moving_first(view: View, chosen: Mapping[str, list[str]]) -> dict[str, list[str]]:
    """Put columns of one number behind those that move: buses have fields that nothing fills."""
    still: set[str] = set()
    seen: set[str] = set()
    while True:
        by_life = {c: sorted(names, key=still.__contains__) for c, names in chosen.items()}
        likeliest = _first({c: names for c, names in by_life.items() if len(names) > 1})
        asked = [n for c, n in likeliest.items() if c != "time_s" and n not in seen]
        if not asked:
            return by_life
        seen.update(asked)
        still.update({*asked} - {*view.moves(asked)})


class _Guess:
    """What the columns are taken for, step by step."""

    def __init__(self, view: View, chosen: Mapping[str, list[str]], axles: tuple[str, ...]) -> None:
        self.view, self.chosen = view, chosen
        self.first = _first(chosen)
        self.parts = self._over_ground()
        self.factors: dict[str, float] = {}
        self.why: dict[str, list[str]] = {}
        self.signs: dict[str, str] = {}
        self.beside: tuple[str, ...] = ()
        self.lost: set[str] = set()
        self.wheels: tuple[str, ...] = ()
        self.parts = self.parts or self._navigated()
        if "vx_mps" not in self.first and "east" not in self.parts:
            self._wheels(axles)
        self.stated = stated(view, self.first)

    def proposal(self, wheelbase_m: float | None) -> Proposal:
        """Ask the laws of motion for what names and units leave open."""
        time = self.first.get("time_s")
        columns = [*(n for c, n in self.first.items() if c != "time_s"), *self.parts.values()]
        columns += self.beside
        held = self.view.values(columns, time)
        signals = {c: held[n] for c, n in self.first.items() if n in held}
        for name in self.beside if held else ():
            clock, values = signals["vx_mps"]
            signals["vx_mps"] = clock, 0.5 * (values + np.interp(clock, *held[name]))
        self._dropouts(signals)
        self._signed(signals, time)
        units = stated(self.view, self.parts)
        if "east" in self.parts and held:
            signals["vx_mps"] = ground_speed(held[self.parts["east"]], held[self.parts["north"]])
            self.stated.pop("vx_mps", None)
            self.stated.update({"vx_mps": units["east"]} if "east" in units else {})
        self.factors.update(self.stated)
        if time is not None:
            self._time(time, held)
        drive = self._by_motion(signals, wheelbase_m)
        own = {part: held[name] for part, name in self.parts.items() if name in held}
        nav = None if drive is None else self._by_navigation(own, units, *drive)
        return self._told(nav)

    def _wheels(self, axles: tuple[str, ...]) -> None:
        """Take the wheels of one axle where no other speed is logged, if their unit is stated.

        An angular speed of a wheel looks like a speed in km/h: of others a speed may only be made
        by the user.
        """
        turning = {
            wheel: name
            for name in self.view.names
            if (wheel := wheel_of(name))
            and (is_speed(name) or factor_to("rad/s", self.view.said(name, "rad/s")))
        }
        speeds = {
            wheel: name
            for name in self.view.names
            if (wheel := wheel_of(name)) and factor_to("m/s", self.view.said(name, "m/s"))
        }
        for axle in axles:
            pair = [speeds.get((axle, side), "") for side in ("left", "right")]
            others = [turning.get((axle, side), "") for side in ("left", "right")]
            self.wheels = self.wheels or (tuple(others) if all(others) else ())
            if all(pair):
                self.first["vx_mps"], self.beside = pair[0], (pair[1],)
                self.chosen = {**self.chosen, "vx_mps": list(speeds.values())}
                self._note(
                    "vx_mps",
                    f"mean of both wheels of the {axle} axle, which is the speed where they do "
                    f"not slip: take the axle that is not driven",
                )
                return

    def _over_ground(self) -> dict[str, str]:
        """Columns of a velocity over ground that is called as that of the body, and the heading.

        Messages of ROS have both in fields of one name: of several that which points along the car
        is taken.
        """
        needed = {"vx_mps", "vy_mps", "yaw_rate_radps"}
        if not needed <= {*self.first} or is_sideslip(self.first["vy_mps"]):
            return {}
        yaw = self.first["yaw_rate_radps"]
        unit = stated(self.view, {"yaw_rate_radps": yaw}).get("yaw_rate_radps")
        kept = {n for c, n in self.first.items() if c not in ("vx_mps", "vy_mps")}
        heading = [n for n in ranked(self.view, "heading") if n not in kept]
        pairs = twins(self.first["vx_mps"], self.first["vy_mps"], self.chosen)
        for number, (along, across) in enumerate(pairs):
            held = self.view.values([along, across, yaw], self.first.get("time_s"))
            held = {name: (_in_seconds(time), x) for name, (time, x) in held.items()}
            if not held or not is_over_ground(held[along], held[across], held[yaw], unit):
                self.first.update({"vx_mps": along, "vy_mps": across} if number else {})
                return {}
        if not heading:
            return {}
        del self.first["vy_mps"]
        return {"east": pairs[0][0], "north": pairs[0][1], "heading": heading[0]}

    def _navigated(self) -> dict[str, str]:
        """Columns of what navigation knows, where they make a lateral speed that is not logged."""
        if "vy_mps" in self.first:
            return {}
        kept = set(self.first.values())
        there = {p: [n for n in ranked(self.view, p) if n not in kept] for p in NAMED}
        found = combination(there)
        return found if "east" in found or "vx_mps" in self.first else {}

    def _dropouts(self, signals: Mapping[str, Signal]) -> None:
        """Ask for what sensors read while they drop out to be taken out."""
        for channel in [c for c in _DESPIKED if c in signals]:
            found = standing(signals[channel][1], fewest=1)
            if found.size:
                self.lost.add(channel)
                value = float(signals[channel][1][found[0]])
                self._note(channel, f"drops out, first to {value:.6g}, {found.size} samples in all")

    def _signed(self, signals: dict[str, Signal], time: str | None) -> None:
        """Give their signs to channels that a bus sends as sizes, with the sign beside."""
        for channel, (clock, values) in list(signals.items()):
            sign = sign_of(self.first[channel], self.view.names)
            if not sign or np.nanmin(values, initial=0.0) < 0.0:
                continue
            own_s, own = self.view.values([sign], time)[sign]
            at = np.clip(np.searchsorted(own_s, clock, side="right") - 1, 0, None)
            if own.size and {*np.unique(own[np.isfinite(own)]).tolist()} <= {0.0, 1.0}:
                signals[channel] = clock, signed(values, own[at])
                self.signs[channel] = sign
                self._note(channel, "with its sign beside it")

    def _note(self, channel: str, text: str) -> None:
        if text:
            self.why.setdefault(channel, []).append(text)

    def _time(self, time: str, held: Mapping[str, Signal]) -> None:
        """Take the unit of time for the one that is stated, or for one that its steps ask for.

        A column that is called `time_s` may count nanoseconds.
        """
        if self.view.is_stamps(time):
            self.factors["time_s"] = 1.0
            self._note("time_s", "time stamps")
            return
        known = self.stated.get("time_s", 0.0)
        clock = next(iter(held.values()))[0] if held else np.zeros(0)
        step = float(np.median(np.diff(clock))) if clock.size > 1 else 0.0
        longest = _FINER[1 if self.view.unit(time, "s") else 0][0]
        if known and known * step < longest:
            self.factors["time_s"] = known
        else:
            self.factors["time_s"] = _factor(clock)
            self._note("time_s", f"steps of {step:.4g}" if held else "")

    def _by_motion(
        self, signals: Mapping[str, Signal], wheelbase_m: float | None
    ) -> tuple[FloatArray, dict[str, FloatArray]] | None:
        """Find units and signs by the motion of the car; return it, on common times."""
        clock = self.factors.get("time_s", 1.0)
        drive = even({c: x for c, x in signals.items() if c != "vy_mps"}, clock)
        if drive is None:
            return None
        # The sign and the gear of the steering are no matter of its unit: they are always sought.
        known = {c: f for c, f in self.stated.items() if c in drive[1]}
        steer = self.first.get("steer_rad")
        share = steer is not None and factor_to("%", self.view.said(steer, "%")) is not None
        found = scales(*drive, known, wheelbase_m, of_full_lock=share)
        if found.swapped:
            first = self.first
            first["ax_mps2"], first["ay_mps2"] = first["ay_mps2"], first["ax_mps2"]
        self.factors.update(found.factors)
        for channel, text in found.notes.items():
            self._note(channel, text)
        # By itself: a sensor of sideslip often knows less of the drive than the others.
        every = even(signals, clock)
        if every is not None and "vy_mps" in every[1]:
            angle = is_sideslip(self.first["vy_mps"])
            factor, text = sideways(*every, self.factors, self.stated, angle=angle)
            self.factors["vy_mps"] = factor
            self._note("vy_mps", text)
        return drive

    def _by_navigation(
        self,
        held: Mapping[str, Signal],
        units: Mapping[str, float],
        time_s: FloatArray,
        drive: Mapping[str, FloatArray],
    ) -> Navigation | None:
        """Tell velocity over ground and heading by the motion that the other channels show."""
        needed = {"vx_mps", "yaw_rate_radps"}
        if not (held and needed <= {*drive, *self.factors}):
            return None
        clock = self.factors.get("time_s", 1.0)
        yaw_rate, speed = (
            (time_s, self.factors[c] * drive[c]) for c in ("yaw_rate_radps", "vx_mps")
        )
        own = {part: (clock * t, x) for part, (t, x) in held.items()}
        nav = told(own, units, yaw_rate, speed, self.factors["vx_mps"])
        if nav is not None and nav.to_the_right:
            for channel in [c for c in _TURNED if c in self.first]:
                self.factors[channel] = -self.factors.get(channel, 1.0)
                self._note(channel, "positive to the right, as the heading tells")
        return nav

    def _told(self, nav: Navigation | None) -> Proposal:
        # The speed is no channel of its own beside a velocity over ground.
        ground = {} if nav is None else self._ground(nav)
        made = {"vx_mps"} if ground else set()
        channels = {c: self._channel(c, n) for c, n in self.first.items() if c not in made}
        made |= {"time_s"} if self.view.has_times else set()
        missing = [c for c in CHANNELS if CHANNELS[c].required and c not in {*channels, *made}]
        counted_from = "north" if nav is None else nav.counted_from
        return Proposal(channels, tuple(missing), ground, counted_from, self.wheels)

    def _channel(self, channel: str, name: str) -> Proposed:
        unit = self.view.unit(name, si_unit(channel, name))
        held = channel in COMMANDS and is_command(name)
        reasons = [by_name(channel, name, unit), ended(channel, name, unit)]
        reasons += ["a command, which stands until the next one"] if held else []
        return Proposed(
            name,
            self.factors.get(channel, 1.0),
            unit,
            "; ".join(filter(None, [*reasons, *self.why.get(channel, [])])),
            tuple(n for n in self.chosen[channel] if n != name)[:5],
            channel == "vy_mps" and is_sideslip(name),
            self.signs.get(channel, ""),
            self.beside if channel == "vx_mps" else (),
            channel in self.lost,
            held,
        )

    def _ground(self, nav: Navigation) -> dict[str, Proposed]:
        columns = dict(self.parts)
        if "east" not in columns:
            columns["speed"] = self.first["vx_mps"]
        found = {}
        for part, name in columns.items():
            unit = self.view.unit(name, PARTS[part])
            factor = nav.factors[part] if part in nav.factors else self.factors["vx_mps"]
            text = f"by its name, the file states '{unit}'" if unit else "by its name"
            if PARTS[part] == "rad":
                text += f", counted from {nav.counted_from}, as the car moves the way it points"
            found[part] = Proposed(name, factor, unit, text, ())
        return found
