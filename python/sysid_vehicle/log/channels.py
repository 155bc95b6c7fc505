"""The canonical channels of a log: units, meaning, and what is lost without the optional ones."""

from __future__ import annotations

from dataclasses import dataclass

DEG = 0.0174533  # rad per degree, as rounded in messages and channel maps


@dataclass(frozen=True)
class Channel:
    """One canonical column of a log; `without` is empty for the columns every log must have."""

    name: str
    unit: str
    meaning: str
    without: str = ""

    @property
    def required(self) -> bool:
        """Whether no log can do without it."""
        return not self.without


CHANNELS = {
    channel.name: channel
    for channel in (
        Channel("time_s", "s", "time"),
        Channel("vx_mps", "m/s", "longitudinal velocity of the CG"),
        Channel(
            "vy_mps",
            "m/s",
            "lateral velocity of the CG, positive left",
            "sideslip is not measured: front and rear tyres are told apart by the yaw rate alone, "
            "and the estimated sideslip cannot be checked",
        ),
        Channel("yaw_rate_radps", "rad/s", "yaw rate, positive to the left"),
        Channel(
            "ax_mps2",
            "m/s2",
            "longitudinal specific force at the CG",
            "errors of drive force, drag and rolling resistance are seen only slowly, through the "
            "speed, and load transfer under braking rests on the commanded force",
        ),
        Channel("ay_mps2", "m/s2", "lateral specific force at the CG, positive left"),
        Channel("steer_rad", "rad", "road-wheel steering angle, positive left"),
        Channel(
            "fx_n",
            "N",
            "total commanded wheel force, drive positive, brake negative",
            "the longitudinal force is derived from ax_mps2, so drag, rolling resistance and the "
            "drive gain cannot be determined",
        ),
    )
}
MEASURED = ("vx_mps", "vy_mps", "yaw_rate_radps", "ax_mps2", "ay_mps2")
"""Measured channels of the motion, in the core's order."""

REQUIRED = tuple(name for name, channel in CHANNELS.items() if channel.required)
COMMANDS = ("steer_rad", "fx_n")
"""What may be a command, which stands until the next one."""
