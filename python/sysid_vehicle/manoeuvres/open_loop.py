"""Manoeuvres with open-loop steering at held speed."""

from __future__ import annotations

from collections.abc import Sequence

from .._common.arguments import check_positive
from .._common.typed import typed
from .curves import Knots, Pulse, Pulses, Sweep, constant
from .manoeuvre import Manoeuvre

_SPEED_CHANGE_MPS2 = 2.0
# Ends of a speed change are round, so that the next steering meets a settled car.
_SETTLE_S = 1.5


class _Track:
    """Knots of speed and of lateral acceleration, drawn one after the other."""

    def __init__(self, speed_mps: float) -> None:
        self.speed = [(0.0, speed_mps)]
        self.lateral = [(0.0, 0.0)]
        self.now_s = 0.0

    def wait(self, duration_s: float) -> None:
        self.now_s += duration_s

    def change_speed(self, speed_mps: float) -> None:
        old = self.speed[-1][1]
        if speed_mps == old:
            return
        self.speed.append((self.now_s, old))
        self.now_s += abs(speed_mps - old) / _SPEED_CHANGE_MPS2
        self.speed.append((self.now_s, speed_mps))
        self.now_s += _SETTLE_S

    def trapezoid(self, height: float, rise_s: float, hold_s: float, fall_s: float) -> None:
        for value, duration_s in ((0.0, rise_s), (height, hold_s), (height, fall_s)):
            self.lateral.append((self.now_s, value))
            self.now_s += duration_s
        self.lateral.append((self.now_s, 0.0))

    def manoeuvre(self, name: str, purpose: str) -> Manoeuvre:
        self.speed.append((self.now_s, self.speed[-1][1]))
        self.lateral.append((self.now_s, 0.0))
        speed_t, speed = zip(*self.speed, strict=True)
        lateral_t, lateral = zip(*self.lateral, strict=True)
        return Manoeuvre(
            name=name,
            purpose=purpose,
            duration_s=self.now_s,
            speed_mps=Knots(speed_t, speed, smooth=True),
            lateral_mps2=Knots(lateral_t, lateral),
            tracks_path=False,
        )


STEP_S = (0.2, 1.8)
"""How long the step of an ordinary car rises, and how long it holds."""


@typed
def step_steer(
    speeds_mps: Sequence[float] = (17.0, 24.0, 31.0),
    lateral_mps2: Sequence[float] = (3.0, 6.0),
    rise_s: float = STEP_S[0],
    hold_s: float = STEP_S[1],
) -> Manoeuvre:
    """Step the steering angle to both sides, as in ISO 7401.

    Parameters
    ----------
    speeds_mps : sequence of float
        Speeds, one after the other.
    lateral_mps2 : sequence of float
        Sizes of the steps: the lateral acceleration that the largest holds in the end; the others
        are in proportion to it. Each is driven to the left and to the right.
    rise_s, hold_s : float
        How long the steering takes to get there, and how long it stays.
    """
    sizes = {"speeds_mps": speeds_mps, "lateral_mps2": lateral_mps2}
    check_positive("step_steer", **sizes, rise_s=rise_s, hold_s=hold_s)
    track = _Track(speeds_mps[0])
    for speed in speeds_mps:
        track.change_speed(speed)
        for size in lateral_mps2:
            for side in (1.0, -1.0):
                track.wait(1.0)
                track.trapezoid(side * size, rise_s, hold_s, rise_s)
        track.wait(1.0)
    return track.manoeuvre("step_steer", "steps of the steering angle to both sides")


@typed
def ramp_steer(
    speeds_mps: Sequence[float] = (18.0, 27.0),
    lateral_mps2: float = 9.2,
    rise_s: float = 8.0,
) -> Manoeuvre:
    """Steer slow ramps to both sides towards the limit, as in ISO 13674-2.

    Parameters
    ----------
    speeds_mps : sequence of float
        Speeds, one after the other.
    lateral_mps2 : float
        Lateral acceleration that the end of the ramp would hold for ever.
    rise_s : float
        Length of a ramp; the steering comes back in a third of it.
    """
    check_positive("ramp_steer", speeds_mps=speeds_mps, lateral_mps2=lateral_mps2, rise_s=rise_s)
    track = _Track(speeds_mps[0])
    for speed in speeds_mps:
        track.change_speed(speed)
        for side in (1.0, -1.0):
            track.wait(1.0)
            track.trapezoid(side * lateral_mps2, rise_s, 0.5, rise_s / 3.0)
        track.wait(1.0)
    return track.manoeuvre("ramp_steer", "slow ramps of the steering angle towards the limit")


@typed
def sine_sweep(
    duration_s: float = 40.0,
    speed_mps: float = 25.0,
    lateral_mps2: float = 3.5,
    from_hz: float = 0.2,
    to_hz: float = 3.0,
) -> Manoeuvre:
    """Steer a sine with rising frequency, as in ISO 7401.

    Parameters
    ----------
    duration_s : float
        Length, a second or more of straight running at either end included.
    speed_mps : float
        Speed.
    lateral_mps2 : float
        Lateral acceleration that the peak of the steering would hold for ever.
    from_hz, to_hz : float
        First and last frequency.
    """
    check_positive("sine_sweep", speed_mps=speed_mps, lateral_mps2=lateral_mps2)
    return Manoeuvre(
        name="sine_sweep",
        purpose="a sine of the steering angle with rising frequency",
        duration_s=duration_s,
        speed_mps=constant(speed_mps, duration_s),
        lateral_mps2=Sweep.of_whole_periods(lateral_mps2, 1.0, duration_s - 2.0, from_hz, to_hz),
        tracks_path=False,
    )


@typed
def sine_with_dwell(
    speed_mps: float = 22.2,
    lateral_mps2: Sequence[float] = (2.5, 4.0, 5.5, 7.0),
    frequency_hz: float = 0.7,
    dwell_s: float = 0.5,
) -> Manoeuvre:
    """Steer sines that rest at their second peak, as in ISO 19365.

    Parameters
    ----------
    speed_mps : float
        Speed.
    lateral_mps2 : sequence of float
        Sizes, one after the other, each first to the left and then first to the right: the
        lateral acceleration that the largest would hold for ever; the others are in proportion.
    frequency_hz, dwell_s : float
        Frequency of the sine, and how long it rests.
    """
    check_positive(
        "sine_with_dwell",
        speed_mps=speed_mps,
        lateral_mps2=lateral_mps2,
        frequency_hz=frequency_hz,
    )
    now, pulses = 1.0, []
    for size in lateral_mps2:
        for side in (1.0, -1.0):
            pulses.append(Pulse(now, side * size, frequency_hz, dwell_s))
            now = pulses[-1].end_s + 1.5
    return Manoeuvre(
        name="sine_with_dwell",
        purpose="sines of the steering angle that rest at their second peak",
        duration_s=now,
        speed_mps=constant(speed_mps, now),
        lateral_mps2=Pulses(tuple(pulses)),
        tracks_path=False,
    )
