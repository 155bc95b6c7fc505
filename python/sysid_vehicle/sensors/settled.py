"""What a check of the sensors says of the effects that stand for faults of sensors."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np

from ..effects import Effect, Parameter
from ..rules import USUAL, Rules
from .faults import SensorFault, to_put_right


class _Estimate(Protocol):
    @property
    def name(self) -> str: ...
    @property
    def value(self) -> float: ...
    @property
    def std(self) -> float: ...


# Effects of the catalogue that are not to be looked for any more once their faults are told.
_SETTLED = {
    "sensor_delay": ("delay_vx_s", "delay_vy_s", "delay_ay_s"),
    "speed_sensor_misalignment": ("imu_turn_rad",),
    "gyro_bias": ("bias_yaw_rate_radps",),
    "gyro_scale": ("gain_yaw_rate",),
    "body_attitude": ("gain_ax", "gain_ay"),
    "body_roll": ("gain_ay",),
    "accelerometer_scale": ("gain_ax", "gain_ay"),
}
# Parameters that are a fault by another name.
_SAME = {
    "imu_lever_arm.forward_m": "imu_forward_m",
    "imu_lever_arm.left_m": "imu_left_m",
    "accelerometer_scale.ax_error": "gain_ax",
    "accelerometer_scale.ay_error": "gain_ay",
    "body_attitude.pitch_per_g_rad": "gain_ax",
    "body_attitude.roll_per_g_rad": "gain_ay",
    "body_roll.roll_per_g_rad": "gain_ay",
    "gyro_scale.scale_error": "gain_yaw_rate",
}


# Of these kinematics knows no other effect that would be the same fault.
_ITS_OWN = ("imu_lever_arm", "gyro_scale")


def settled(faults: Sequence[SensorFault]) -> tuple[str, ...]:
    """Effects that were dealt with, or are not there."""
    told = {fault.name for fault in faults if fault.told}
    return tuple(effect for effect, names in _SETTLED.items() if told.issuperset(names))


def narrowed(
    effects: Iterable[Effect], faults: Sequence[SensorFault], rules: Rules = USUAL
) -> tuple[Effect, ...]:
    """Effects within what kinematics leaves of them.

    A fault that is not told well enough to be settled is known all the same: a model with tyres may
    not find a size that the sensors refuse between themselves.

    Parameters
    ----------
    effects : iterable of Effect
    faults : sequence of SensorFault
        What was found is put right, and the effect stands for what may be left.
    rules : Rules
        How far apart two sets of data may be (`Rules.sure`).
    """
    by_name = {fault.name: fault for fault in faults}
    right = to_put_right(faults)
    return tuple(
        replace(
            e,
            parameters=tuple(
                _within(p, by_name.get(_SAME.get(name, "")), right, rules)
                for name, p in e.named.items()
            ),
        )
        for e in effects
    )


def backed(
    estimates: Sequence[_Estimate], faults: Sequence[SensorFault], rules: Rules = USUAL
) -> dict[str, str]:
    """Effects that kinematics finds, too, with the same size: what it says, by effect.

    Parameters
    ----------
    estimates : sequence
        Of parameters of effects, by full name.
    faults : sequence of SensorFault
        That are still in the readings.
    rules : Rules
        How far apart two sets of data may be (`Rules.sure`).
    """
    by_name = {fault.name: fault for fault in faults}
    found = {e.name: e for e in estimates}
    told: dict[str, str] = {}
    for effect in _ITS_OWN:
        same = {n: by_name.get(f) for n, f in _SAME.items() if n.split(".")[0] == effect}
        if not all(n in found and fault is not None for n, fault in same.items()):
            continue
        pairs = [(fault, found[n]) for n, fault in same.items() if fault is not None]
        agree = all(abs(e.value - f.value) < rules.sure * np.hypot(e.std, f.std) for f, e in pairs)
        there = [str(fault) for fault, _ in pairs if fault.found]
        if agree and there:
            told[effect] = ", ".join(there)
    return told


def _within(
    p: Parameter, fault: SensorFault | None, right: Mapping[str, float], rules: Rules
) -> Parameter:
    """The parameter between bounds that hold no fault, and what may be left of this one."""
    if fault is None or not np.isfinite(fault.std):
        return p
    left = p.null_value + fault.value - right.get(fault.name, 0.0)
    reach = rules.sure * fault.std
    low, high = min(left - reach, p.null_value), max(left + reach, p.null_value)
    return replace(p, lower=max(p.lower, low), upper=min(p.upper, high))
