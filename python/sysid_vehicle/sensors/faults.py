"""The faults of a sensor as they are told: values with intervals, or why they cannot be told."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy

from .._common.text import HALF_95
from ..effects import matters_in
from .kinematics.equations import lean
from .kinematics.estimate import Estimate
from .kinematics.parts import scatter
from .texts import DEG, why_not

FALSE_CLAIMS = 0.01
"""Level of all claims of one check together."""
_OF_THE_SPEEDS = ("delay_vx_s", "delay_vy_s")
_NEGLIGIBLE_S = 0.002  # of a delay, which harms nothing
_LEARNED = 0.5  # share of what is known of a fault that has to come from the log


@dataclass(frozen=True)
class SensorFault:
    """A fault that a sensor may have.

    Attributes
    ----------
    name : str
        Name of the fault, with its unit.
    channel : str
        Channel that shows it.
    title : str
        What it is, in words.
    value, std : float
        Estimate and standard deviation [`unit`].
    unit : str
        Unit.
    told : bool
        Whether the log tells the fault well enough to say whether it is there.
    found : bool
        Whether it is there: different from zero, at a level of 1 % over all faults together, and
        large enough to matter.
    why_not : str
        Why it cannot be told; empty where it can.
    or_another : str
        Name of the fault that stands in its place in an explanation that is as likely, where one of
        the two is there; empty elsewhere.
    measured : bool
        Whether the log says more of its size than was known before. Where it does not, `value` and
        `std` are those of what sensors usually do: no result of this log, and none is shown.
    """

    name: str
    channel: str
    title: str
    value: float
    std: float
    unit: str
    told: bool
    found: bool
    why_not: str = ""
    or_another: str = ""
    measured: bool = True

    @property
    def interval(self) -> tuple[float, float]:
        """Bounds that hold the true value with a probability of 95 %."""
        return self.value - HALF_95 * self.std, self.value + HALF_95 * self.std

    def __str__(self) -> str:
        if not self.measured:
            return f"{self.title}: cannot be told, {self.why_not}"
        scale, unit = _SHOWN.get(self.unit, (1.0, self.unit))
        low, high = (scale * x for x in self.interval)
        tail = f" {unit}" if unit else ""
        return f"{self.title}: {scale * self.value:.3g}{tail} (95 %: {low:.3g} to {high:.3g})"


@dataclass(frozen=True)
class _Told:
    """A fault as it is told, the sum of estimated ones.

    `enough` is a useful half interval; faults smaller than `negligible` harm nothing. Both
    are those of an ordinary car.
    """

    name: str
    channel: str
    title: str
    unit: str
    of: tuple[str, ...]
    enough: float
    negligible: float

    def in_car(self, wheelbase_m: float) -> _Told:
        """The same with the sizes of a car: a centimetre matters in a model car."""
        by = matters_in(self.unit, wheelbase_m)
        return replace(self, enough=by * self.enough, negligible=by * self.negligible)


_SHOWN = {"s": (1000.0, "ms"), "rad": (1.0 / DEG, "deg"), "": (100.0, "%")}
_TOLD = (
    _Told("delay_vx_s", "vx_mps", "delay against ax_mps2", "s",
          ("delay.speeds", "delay.vx_mps"), 0.03, _NEGLIGIBLE_S),
    _Told("delay_vy_s", "vy_mps", "delay against yaw_rate_radps", "s",
          ("delay.speeds", "delay.vy_mps"), 0.03, _NEGLIGIBLE_S),
    _Told("delay_ay_s", "ay_mps2", "delay against yaw_rate_radps", "s",
          ("delay.ay_mps2",), 0.02, _NEGLIGIBLE_S),
    _Told("gain_yaw_rate", "yaw_rate_radps", "scale error", "",
          ("gain.yaw_rate_radps",), 0.02, 0.002),
    _Told("gain_ax", "ax_mps2", "scale error, or gravity by pitch", "",
          ("gain.ax_mps2",), 0.04, 0.002),
    _Told("gain_ay", "ay_mps2", "scale error, or gravity by roll", "",
          ("gain.ay_mps2",), 0.04, 0.002),
    _Told("bias_yaw_rate_radps", "yaw_rate_radps", "bias", "rad/s",
          ("bias.yaw_rate_radps",), 0.01, 0.0005),
    _Told("bias_vy_mps", "vy_mps", "bias", "m/s", ("bias.vy_mps",), 0.2, 0.02),
    _Told("imu_forward_m", "ay_mps2", "IMU ahead of the speed sensor", "m", ("arm_x",), 0.3, 0.03),
    _Told("imu_left_m", "ax_mps2", "IMU left of the speed sensor", "m", ("arm_y",), 0.3, 0.03),
    _Told("imu_turn_rad", "ay_mps2", "IMU turned to the left of the speed sensor", "rad",
          ("turn",), 0.03, 0.002),
)  # fmt: skip


@dataclass(frozen=True)
class Rival:
    """An explanation without one of the faults, and how much less likely it is [nats]."""

    estimate: Estimate
    worse: float

    @property
    def share(self) -> float:
        """Its probability beside the explanation with the fault."""
        return 1.0 / (1.0 + math.exp(min(self.worse, 500.0)))


def to_put_right(faults: Sequence[SensorFault]) -> dict[str, float]:
    """Faults that a log is freed of, by name: those found, and what follows from them.

    Both speeds come from one device as a rule: where the delay of one is found, that of the other
    is taken out as it is estimated, unless that is nearer to none.
    """
    values = {fault.name: fault.value for fault in faults if fault.found}
    known = [values[name] for name in _OF_THE_SPEEDS if name in values]
    if len(known) == 1:
        values |= {
            fault.name: fault.value
            for fault in faults
            if fault.name in _OF_THE_SPEEDS and abs(fault.value - known[0]) < abs(fault.value)
        }
    return values


def leaning(found: Estimate, faults: Sequence[SensorFault], axis: str) -> float:
    """How late an axis is by delay and leaning together, where the log tells that it is late [s].

    How late a body leans is known beforehand, by no more than its share of what the axis feels lets
    the log say. Their sum is what the log tells: 0 where it is not off nothing, at the level of a
    fault that is found, or is mostly known beforehand.

    Parameters
    ----------
    found : Estimate
    faults : sequence of SensorFault
        As they are told.
    axis : str
        `ax` or `ay`.
    """
    share, late_s = lean(f"{axis}_mps2", found.faults)
    names = list(found.faults)
    weights = {f"lean.{axis}_mps2": share, f"delay.{axis}_mps2": 1.0}
    pick = np.array([weights.get(name, 0.0) for name in names])
    if not pick.any():  # an axis that feels too little has no gravity in it, and no delay
        return 0.0
    delay = next((f for f in faults if f.name == f"delay_{axis}_s"), None)
    total = share * late_s
    variance = float(pick @ found.covariance @ pick)
    own = names.index(f"delay.{axis}_mps2") if f"delay.{axis}_mps2" in names else None
    if own is not None and delay is not None:
        total += found.faults[names[own]]
        # What parts of the driving and other explanations add to the delay.
        variance += max(delay.std**2 - float(found.covariance[own, own]), 0.0)
    rows = sum(math.isfinite(fault.std) for fault in faults)
    before = float(np.sum(pick[pick > 0.0] ** 2 / found.prior[pick > 0.0]))
    learned = 1.0 - float(pick @ np.linalg.inv(found.information) @ pick) / before
    told = abs(total) > _critical(rows) * math.sqrt(variance) and learned > _LEARNED
    return total if told and abs(total) > _NEGLIGIBLE_S else 0.0


def _critical(rows: int) -> float:
    """Standard errors beyond which one of so many faults is found."""
    return float(scipy.stats.norm.isf(0.5 * FALSE_CLAIMS / rows))


def doubted(names: Sequence[str]) -> list[tuple[str, ...]]:
    """What has to be left out, to see whether the driving can do without the faults found.

    Each fault by itself, and with those that it shares something with: a delay of one device.
    """
    of = {told.name: told.of for told in _TOLD if told.name in names}
    together = (
        tuple(dict.fromkeys(part for other in of.values() if {*one} & {*other} for part in other))
        for one in of.values()
    )
    return list(dict.fromkeys([*of.values(), *together]))


def faults_of(
    found: Estimate,
    absent: Sequence[str],
    parts: Sequence[Estimate] = (),
    rivals: Mapping[tuple[str, ...], Rival] | None = None,
    *,
    wheelbase_m: float | None = None,
    level: bool = False,
) -> tuple[SensorFault, ...]:
    """Say what an estimate tells of each fault.

    Parameters
    ----------
    found : Estimate
        Of all the driving.
    absent : sequence of str
        Channels without which faults cannot be told.
    parts : sequence of Estimate
        Of parts of the driving, which have to ask for the same faults.
    rivals : mapping of Rival, optional
        Explanations by what they leave out; one that is as likely as `found` makes all faults
        unsure in which the two differ.
    wheelbase_m : float, optional
        Of the car; by default an ordinary one.
    level : bool
        Whether the road neither leans with its turns nor climbs.
    """
    every = _TOLD if wheelbase_m is None else tuple(told.in_car(wheelbase_m) for told in _TOLD)
    rows = [t for t in every if t.of[-1] in found.faults]
    asked = _Asked(found, parts, rivals or {}, _critical(len(rows)), every, level)
    return tuple(
        asked.fault(told) if told in rows else _untold(told, why_not(told.name, absent=absent))
        for told in every
    )


def _untold(told: _Told, why: str) -> SensorFault:
    return SensorFault(
        told.name, told.channel, told.title, 0.0, math.inf, told.unit, False, False, why,
        measured=False,
    )  # fmt: skip


@dataclass(frozen=True)
class _Asked:
    """What `faults_of` is told, how many standard errors make a claim, and all that may be told."""

    found: Estimate
    parts: Sequence[Estimate]
    rivals: Mapping[tuple[str, ...], Rival]
    critical: float
    every: Sequence[_Told]
    level: bool

    @cached_property
    def naive(self) -> np.ndarray:
        """Covariance of a complete model with the noise as it is."""
        return np.linalg.inv(self.found.information)

    def fault(self, told: _Told) -> SensorFault:
        """What the estimate tells of one fault."""
        found = self.found
        pick = np.array([1.0 if name in told.of else 0.0 for name in found.faults])
        value = _size(found, pick, found.covariance)[0]
        kind, road = ("", 0.0) if self.level else _road(found, told.name)
        std = math.hypot(self._std(told, pick), road)
        at_null = math.hypot(_size(found, pick, found.null_covariance)[1], road)
        widest = max(std, at_null)
        rival = self._likeliest_without(told)
        claimed = rival is None and abs(value) > max(self.critical * widest, told.negligible)
        variance = float(pick @ self.naive @ pick) + road**2
        if not claimed:
            # No fault is as likely: its interval is that of no fault, if that is wider.
            std, variance = widest, max(variance, at_null**2)
        learned = 1.0 - variance / float(np.sum(1.0 / found.prior[pick > 0.0]))
        claimed = claimed and learned > 0.0
        well = rival is None and learned > _LEARNED and abs(value) + HALF_95 * std < told.enough
        reason = another = ""
        if rival is not None:
            other = _instead(found, rival.estimate, told)
            another = self._one_of_two(told, rival, other)
            reason = why_not(told.name, other=other, there=bool(another))
        elif not (claimed or well) and 2.0 * road**2 > widest**2:
            reason = why_not(told.name, other=kind)
        elif not (claimed or well):
            reason = _confounded(told, pick, found, self.naive, list(found.faults))
        return SensorFault(
            told.name, told.channel, told.title, value, std, told.unit, claimed or well, claimed,
            reason, another, measured=claimed or learned > _LEARNED,
        )  # fmt: skip

    def _one_of_two(self, told: _Told, rival: Rival, other: str) -> str:
        """Name of the fault that is there where this one is not, if that has to be so."""
        twin = next((t for t in self.every if other in t.of), None)
        if twin is None or not replace(self, rivals={}).fault(told).found:
            return ""
        there = replace(self, found=rival.estimate, parts=(), rivals={}).fault(twin).found
        return twin.name if there else ""

    def _std(self, told: _Told, pick: np.ndarray) -> float:
        """Standard deviation of a fault, with what parts of the driving and rivals add."""
        value, std = _size(self.found, pick, self.found.covariance)
        own = [
            (_size(p, pick, p.covariance), _size(p, pick, p.null_covariance)) for p in self.parts
        ]
        spread = scatter([v for (v, _), _ in own], [max(s, null) for (_, s), (_, null) in own])
        if spread is not None:
            std = spread.widened(value, std)
        return math.hypot(std, *(_apart(other, told, value) for other in self.rivals.values()))

    def _likeliest_without(self, told: _Told) -> Rival | None:
        """The likeliest explanation without a fault, if it is as likely as the estimate."""
        others = [rival for without, rival in self.rivals.items() if {*told.of} <= {*without}]
        rival = min(others, key=lambda rival: rival.worse, default=None)
        return None if rival is None or rival.share < FALSE_CLAIMS else rival


def _road(found: Estimate, name: str) -> tuple[str, float]:
    """What a road that is not level does that acts like a fault, and how large that may be."""
    if name == "gain_ay":
        return "lean", found.leaning_with_turns
    scale, late_s = found.slowing_on_climbs
    return "climb", scale if name == "gain_ax" else late_s if name in _OF_THE_SPEEDS else 0.0


def _size(found: Estimate, pick: np.ndarray, covariance: np.ndarray) -> tuple[float, float]:
    """Value and standard deviation of a sum of faults."""
    value = float(pick @ np.array(list(found.faults.values())))
    return value, float(np.sqrt(pick @ covariance @ pick))


def _apart(rival: Rival, told: _Told, value: float) -> float:
    """Standard deviation of a fault that takes one of two values."""
    other = sum(rival.estimate.faults.get(name, 0.0) for name in told.of)
    return math.sqrt(rival.share) * abs(other - value)


def _instead(found: Estimate, rival: Estimate, told: _Told) -> str:
    """What takes the place of a fault in an explanation without it."""
    std = np.sqrt(np.diag(found.null_covariance))
    moved = {
        name: abs(rival.faults[name] - found.faults[name]) / sigma
        for name, sigma in zip(found.faults, std, strict=True)
        if name in rival.faults and name not in told.of
    }
    std = np.sqrt(np.diag(rival.null_covariance))
    claimed = {
        name: abs(value) / sigma
        for (name, value), sigma in zip(rival.faults.items(), std, strict=True)
        if name not in found.faults
    }
    moved |= claimed
    return max(moved, key=lambda name: moved[name])


def _confounded(
    told: _Told,
    pick: np.ndarray,
    found: Estimate,
    naive: np.ndarray,
    names: Sequence[str],
) -> str:
    """What takes the information away: the driving, or another fault."""
    own = int(np.argmax(pick * np.arange(1, pick.size + 1)))
    data = max(found.information[own, own] - found.prior[own], 1e-300)
    alone = 1.0 / math.sqrt(data)
    if HALF_95 * alone > told.enough:
        return why_not(told.name, alone=alone)
    along = naive @ pick
    correlation = np.abs(along) / np.sqrt(np.diag(naive) * float(pick @ along))
    correlation[pick > 0.0] = 0.0
    return why_not(told.name, other=names[int(np.argmax(correlation))])
