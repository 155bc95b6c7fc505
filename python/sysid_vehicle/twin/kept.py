"""What a twin keeps for long, and which of its inputs are forces: names tell both."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from .drives import INPUTS

_TORQUES = INPUTS[2:10]
_FORCES = ("_n", "_nm")  # how the names of forces and torques end
_FEEL_SPEED = ("ax_mps2", "ay_mps2")  # by drag, and in bends
_IN_BENDS = ("ay_mps2", "vy_mps", "yaw_rate_radps")


def kept_state(channel: str) -> str:
    """The state that a channel reads and that keeps what it began with; empty if there is none."""
    if channel.startswith("wheel_speed_"):
        return "vx_mps"  # wheels roll
    forgets = channel == "vy_mps" or channel.endswith("_rate_radps")
    return "" if forgets else channel


def shows_speed(channel: str) -> bool:
    """Whether a channel is off by about as much as the speed of a twin is."""
    return kept_state(channel) == "vx_mps" or channel in _IN_BENDS


def kept_states(channels: Iterable[str]) -> list[str]:
    """States that compared channels show and that keep what they began with.

    An acceleration shows the speed: by drag, and in bends.
    """
    channels = list(channels)
    kept = [kept_state(channel) for channel in channels]
    kept += ["vx_mps"] * any(channel in _FEEL_SPEED for channel in channels)
    return [name for name in dict.fromkeys(kept) if name]


def forces_among(inputs: Sequence[str]) -> list[str]:
    """Inputs that drive and brake: torques of the built-in car, else whatever has such a unit."""
    own = [name for name in inputs if name in _TORQUES]
    return own or [name for name in inputs if name.endswith(_FORCES)]
