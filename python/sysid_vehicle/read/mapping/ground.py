"""Velocity over ground and heading, as navigation gives them, in the axes of the body."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..._common.arrays import FloatArray, as_float64
from ..._common.files import refuse_unknown
from ...errors import InvalidInput
from ..table import Table
from .source import Source, source_of

PARTS = {"east": "m/s", "north": "m/s", "speed": "m/s", "course": "rad", "heading": "rad"}
"""What navigation knows, with SI units; an angle counts from north or from east."""

_VELOCITIES = (("east", "north"), ("speed", "course"))
FROM = ("north", "east")

_WINDOW_S = 0.5  # over which the heading's turn is compared with the yaw rate's
_TURNS_RAD = 0.03  # root mean square of these turns, below which nothing is compared
_FOLLOWS = (0.5, 2.0)  # times the turn by the yaw rate
_DEGREES = (30.0, 110.0)
_SLOW = 0.2  # of the usual speed: slower, the direction of motion is noise
_TOGETHER = 0.6  # length of the mean of unit vectors along the motion; drifting cars have more
_AHEAD_RAD = 0.5
_NO_SIDESLIP_RAD = 1e-3  # nine tenths of the angles are smaller
_GAP = 2.5  # usual periods, over which a heading is interpolated


@dataclass(frozen=True)
class Ground:
    """Where velocity over ground and heading come from.

    Attributes
    ----------
    sources : mapping of Source
        ``heading``, and ``east`` and ``north`` [m/s] or ``speed`` [m/s] and ``course`` [rad].
    counted_from : mapping of str
        By angle: ``"north"``, clockwise as a compass (where nothing is said), or ``"east"``,
        anticlockwise.
    """

    sources: Mapping[str, Source]
    counted_from: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        given = set(self.sources)
        if not any(given == {"heading", *pair} for pair in _VELOCITIES):
            raise InvalidInput(
                f"[ground] names {', '.join(sorted(given)) or 'nothing'}; it takes heading with "
                "east and north, or heading with speed and course"
            )

    @classmethod
    def from_dict(cls, table: Mapping[str, Any], where: str = "[ground]") -> Ground:
        """Build it from the content of the table ``[ground]`` of a channel map.

        Raises
        ------
        InvalidInput
            If something is missing, unknown or of the wrong kind; the message begins with `where`.
        """
        refuse_unknown(table, PARTS, where)
        sources, counted = {}, {}
        for part, entry in table.items():
            at = f"{where}, {part}"
            if isinstance(entry, str):
                sources[part] = Source(entry)
                continue
            if not isinstance(entry, Mapping):
                raise InvalidInput(f"{at} = {entry!r}; give a column name or a table")
            rest = dict(entry)
            if PARTS[part] == "rad" and "from" in rest:
                counted[part] = rest.pop("from")
                if counted[part] not in FROM:
                    raise InvalidInput(
                        f'{at}: from = {counted[part]!r}; give "north" (clockwise, as a compass) '
                        'or "east" (anticlockwise)'
                    )
            refuse_unknown(rest, ("column", "factor", "offset", "delay_s", "from"), at)
            sources[part] = source_of(rest, part, at)
        try:
            return cls(sources, counted)
        except InvalidInput as error:
            raise InvalidInput(f"{where}: {error}") from None

    def read(
        self, table: Table, columns: Mapping[str, FloatArray], notes: list[str]
    ) -> dict[str, FloatArray]:
        """Return the parts in SI units, angles unwrapped and anticlockwise from east."""
        found = {}
        for part, source in self.sources.items():
            values = source.read(table, part, PARTS[part], notes)
            if PARTS[part] == "rad":
                values = from_east(values, self.counted_from.get(part, "north"))
            found[part] = (
                source.on_time(columns["time_s"], values, part) if "time_s" in columns else values
            )
        return found

    def in_the_body(
        self, columns: Mapping[str, FloatArray], parts: Mapping[str, FloatArray]
    ) -> dict[str, FloatArray]:
        """Return `vx_mps` and `vy_mps`, shape (n,), where velocity and heading are known.

        ``v_x = v cos(course - heading)``, ``v_y = v sin(course - heading)``, in ISO 8855 axes. A
        heading that was sampled at other times is interpolated.

        Raises
        ------
        InvalidInput
            If the heading does not turn as the yaw rate does, or if the car would not move the
            way it points; the message names the remedy.
        """
        time_s = columns.get("time_s")
        if time_s is None or not (np.diff(time_s) > 0.0).all():
            return {name: np.full(len(parts["heading"]), np.nan) for name in ("vx_mps", "vy_mps")}
        speed, course = polar(time_s, parts)
        angle = course - _between(time_s, parts["heading"])
        # As it would be if the heading counted the other way.
        other = 2.0 * course - 0.5 * np.pi - angle
        ahead, else_ahead = (Direction.of(speed, x) for x in (angle, other))
        if "yaw_rate_radps" in columns:
            ratio = turns_of(time_s, parts["heading"], columns["yaw_rate_radps"], speed)
            self._refuse_another_turn(ratio, ahead, else_ahead)
            _refuse_the_course(angle, ratio)
        if not ahead.forward and else_ahead.forward:
            raise InvalidInput(f"heading: the car would move {ahead}; {self._counted_otherwise()}")
        if not ahead.forward:
            remedy = (
                f"put offset = {self.sources['heading'].offset + self._sign * ahead.mean_rad:.4g} "
                "for it, in rad, if the aerials stand so in the car"
                if ahead.together
                else "check the column and the unit"
            )
            raise InvalidInput(f"heading: the car would move {ahead}; {remedy}")
        return {
            "vx_mps": as_float64(speed * np.cos(angle)),
            "vy_mps": as_float64(speed * np.sin(angle)),
        }

    @property
    def _sign(self) -> float:
        """Of the logged heading in the one that counts anticlockwise."""
        return -1.0 if self.counted_from.get("heading", "north") == "north" else 1.0

    def _counted_otherwise(self) -> str:
        now = self.counted_from.get("heading", "north")
        other = next(name for name in FROM if name != now)
        return f'put from = "{other}" for it, as it counts from there'

    def _refuse_another_turn(self, ratio: float, ahead: Direction, other: Direction) -> None:
        """Refuse a heading that does not turn by about what the yaw rate says."""
        if np.isnan(ratio) or _FOLLOWS[0] < ratio < _FOLLOWS[1]:
            return
        to_rad = np.pi / 180.0
        turned = "turn the sign of yaw_rate_radps round, which is positive to the left"
        remedy = "check the columns and the units of both"
        if _FOLLOWS[0] < -ratio < _FOLLOWS[1]:
            if "course" in self.sources and ahead.forward:
                remedy = f"{self._counted_otherwise()}, and the course too, or {turned}"
            elif ahead.forward:
                remedy = turned
            elif other.forward:
                remedy = self._counted_otherwise()
        elif _DEGREES[0] < abs(ratio) < _DEGREES[1]:
            remedy = f"put factor = {to_rad:.7g} for it: it seems to be in degrees"
        elif _DEGREES[0] < abs(1.0 / ratio) < _DEGREES[1]:
            remedy = f"put factor = {to_rad:.7g} for yaw_rate_radps: it seems to be in deg/s"
        raise InvalidInput(f"heading: it turns {ratio:.3g} times as yaw_rate_radps; {remedy}")


@dataclass(frozen=True)
class Direction:
    """Where the car moves as seen from its nose: mean angle, and how far that is one direction."""

    mean_rad: float
    length: float

    @classmethod
    def of(cls, speed: FloatArray, angle: FloatArray) -> Direction:
        """Of the samples at which the car moves."""
        known = np.isfinite(speed) & np.isfinite(angle)
        if not known.any():
            return cls(0.0, 1.0)  # the log is refused for it
        mean = np.mean(np.exp(1j * angle[known & (speed >= _slowest(speed[known]))]))
        return cls(float(np.angle(mean)), float(np.abs(mean)))

    @property
    def together(self) -> bool:
        """Whether it is one direction."""
        return self.length > _TOGETHER

    @property
    def forward(self) -> bool:
        """Whether that is about where the car points."""
        return self.together and abs(self.mean_rad) < _AHEAD_RAD

    def __str__(self) -> str:
        if not self.together:
            return "in all directions as seen from its nose"
        side = "left" if self.mean_rad > 0.0 else "right"
        return f"{abs(np.degrees(self.mean_rad)):.0f} deg to the {side} of its nose"


def _refuse_the_course(angle: FloatArray, ratio: float) -> None:
    """Refuse a heading that is the direction of motion, where the car turns."""
    known = angle[np.isfinite(angle)]
    if not np.isnan(ratio) and known.size and np.percentile(np.abs(known), 90.0) < _NO_SIDESLIP_RAD:
        raise InvalidInput(
            "heading: it is the direction of motion, which knows no sideslip; name the heading of "
            "the body, or take [ground] out and map the speed to vx_mps"
        )


def from_east(angle: FloatArray, counted_from: str) -> FloatArray:
    """Return an angle [rad] anticlockwise from east, without jumps; NaN where it is unknown."""
    out = np.full(angle.shape, np.nan)
    known = np.isfinite(angle)
    out[known] = np.unwrap(angle[known] if counted_from == "east" else 0.5 * np.pi - angle[known])
    return out


def polar(time_s: FloatArray, parts: Mapping[str, FloatArray]) -> tuple[FloatArray, FloatArray]:
    """Return speed and course, anticlockwise from east, at the samples of the speed."""
    if "course" in parts:
        return parts["speed"], _between(time_s, parts["course"])
    east, north = parts["east"], parts["north"]
    return as_float64(np.hypot(east, north)), as_float64(np.arctan2(north, east))


def _between(time_s: FloatArray, angle: FloatArray) -> FloatArray:
    """Return an unwrapped angle at all times, interpolated where neighbours are near."""
    at = np.flatnonzero(np.isfinite(angle))
    if at.size < 2:
        return angle
    known_s = time_s[at]
    behind = np.clip(np.searchsorted(known_s, time_s, side="right") - 1, 0, at.size - 2)
    step = np.diff(known_s)
    near = np.isfinite(angle) | (step[behind] <= _GAP * np.median(step))
    found = np.interp(time_s, known_s, angle[at], np.nan, np.nan)
    return as_float64(np.where(near, found, np.nan))


def turns_of(
    time_s: FloatArray, heading: FloatArray, yaw_rate: FloatArray, speed: FloatArray
) -> float:
    """Return how far the heading turns for each turn by the yaw rate; NaN on a straight road."""
    at, known, moving = (np.isfinite(x) for x in (heading, yaw_rate, speed))
    if min(np.count_nonzero(x) for x in (at, known, moving)) < 2:
        return np.nan
    t, r = time_s[known], yaw_rate[known]
    turned = np.concatenate(([0.0], np.cumsum(0.5 * (r[1:] + r[:-1]) * np.diff(t))))
    _, begins = np.unique(np.floor((t - t[0]) / _WINDOW_S), return_index=True)
    ticks = t[begins]
    if ticks.size < 2:  # a log of a moment tells no turns
        return np.nan
    step = np.diff(ticks)
    no_gap = step <= _GAP * np.median(step)
    fast = np.interp(ticks, time_s[moving], speed[moving]) > _slowest(speed[moving])
    by_rate, by_heading = (
        np.diff(np.interp(ticks, at_s, angle))[fast[1:] & fast[:-1] & no_gap]
        for at_s, angle in ((t, turned), (time_s[at], heading[at]))
    )
    total = float(by_rate @ by_rate)
    if max(total, float(by_heading @ by_heading)) <= _TURNS_RAD**2 * len(by_rate):
        return np.nan
    return float(by_heading @ by_rate) / total if total > 0.0 else np.inf


def _slowest(speed: FloatArray) -> float:
    return _SLOW * float(np.percentile(speed, 95.0))
