"""A proposed channel map: which column is which channel, told why, as a file to be edited."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from ...errors import InvalidInput
from ...log import CHANNELS, listed
from ...log.laws.laws import LATERAL
from .channel_map import ChannelMap
from .ground import PARTS, Ground
from .source import Source

_WHEELS = (
    "take the axle that is not driven, and as the factor in rad/s the radius of its tyres [m], "
    "in rpm 0.1047198 times that, in km/h 0.2777778"
)
_PULL = ("ax_mps2", "fx_n")


@dataclass(frozen=True)
class Proposed:
    """Where a channel is to come from, and why."""

    column: str
    factor: float
    unit: str
    why: str
    others: tuple[str, ...]
    sideslip: bool = False
    sign: str = ""
    mean_with: tuple[str, ...] = ()
    despike: bool = False
    held: bool = False

    @property
    def source(self) -> Source:
        """As a channel map has it."""
        return Source(
            self.column,
            self.factor,
            sideslip=self.sideslip,
            sign=self.sign,
            mean_with=self.mean_with,
            despike=self.despike,
            as_stated=False,
            held=self.held,
        )


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
    wheels : tuple of str
        Columns of the wheels of one axle, in no unit of a speed, where there is no other speed.
    """

    channels: Mapping[str, Proposed]
    missing: tuple[str, ...]
    ground: Mapping[str, Proposed] = field(default_factory=dict)
    counted_from: str = "north"
    wheels: tuple[str, ...] = ()

    @property
    def channel_map(self) -> ChannelMap:
        """The map, ready for `read_log`."""
        angles = dict.fromkeys((p for p in self.ground if PARTS[p] == "rad"), self.counted_from)
        parts = {part: p.source for part, p in self.ground.items()}
        return ChannelMap(
            {c: p.source for c, p in self.channels.items()},
            ground=Ground(parts, angles) if parts else None,
        )

    @property
    def needs_pull(self) -> bool:
        """Whether nothing was found that tells how the car is driven and braked."""
        return not {*_PULL} & {*self.channels}

    def to_toml(self) -> str:
        """The map as a file to look through and to edit."""
        lines = ["# Proposed channel map: look at every line, mend what is wrong."]
        turned = [c for c in LATERAL if c in self.channels]
        if not self.ground and len(turned) > 1:
            lines.append(
                "# Nothing tells left from right: of a log in axes with z down (SAE J670: y and "
                f"yaw to the right) turn round the factors of {listed(turned)} together."
            )
        lines.append("[channels]")
        for channel, p in self.channels.items():
            lines.append(f"# {CHANNELS[channel].meaning} [{CHANNELS[channel].unit}]: {p.why}")
            if p.others:
                lines.append(f"#   or one of: {listed(map(_quoted, p.others))}")
            entry = f"column = {_quoted(p.column)}, factor = {p.factor!r}"
            if p.mean_with:
                entry += f", mean_with = [{', '.join(map(_quoted, p.mean_with))}]"
            entry += ", sideslip = true" if p.sideslip else ""
            entry += ", despike = true" if p.despike else ""
            entry += ", held = true" if p.held else ""
            entry += f", sign = {_quoted(p.sign)}" if p.sign else ""
            lines.append(f"{channel} = {{ {entry} }}")
        for name in self.missing:
            wheels = self.wheels if name == "vx_mps" else ()
            but = f" but wheels; {_WHEELS}" if wheels else ""
            column, *others = wheels or ("",)
            lines.append(
                f"# {CHANNELS[name].meaning} [{CHANNELS[name].unit}]: nothing was found{but}"
            )
            entry = f"column = {_quoted(column)}, factor = 1.0"
            entry += f", mean_with = [{', '.join(map(_quoted, others))}]" if others else ""
            lines.append(f"# {name} = {{ {entry} }}")
        if self.needs_pull:
            lines.append(
                "# Nothing was found for either; one is needed, for how the car is driven:"
            )
            lines += [f'# {name} = {{ column = "", factor = 1.0 }}' for name in _PULL]
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


def _quoted(name: str) -> str:
    text = name.replace("\\", "\\\\").replace('"', '\\"')
    if any(ord(c) < 32 for c in text):
        raise InvalidInput(f"column {name!r}: its name holds a control character; rename it")
    return f'"{text}"'
