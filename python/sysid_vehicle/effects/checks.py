"""What is checked when a user defines an effect: names, values, how parameters and states act."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np

from .. import _core
from .._common.arrays import FloatArray
from ..errors import InvalidInput
from .catalogue import catalogue
from .formula import EVERYTHING, SIGNALS, TARGETS, evaluate
from .parts import Parameter

Function = Callable[[Any, Any], Any]

CANONICAL = {
    "time_s": "d.time",
    "vx_mps": "d.v_x",
    "vy_mps": "d.v_y",
    "yaw_rate_radps": "d.r",
    "ax_mps2": "d.a_x",
    "ay_mps2": "d.a_y",
    "steer_rad": "d.steer",
    "fx_n": "d.F_x",
}
"""Canonical channels, and what a formula reads in their place."""

_SLIPS = {"alpha_fl", "alpha_fr", "alpha_rl", "alpha_rr"}
_LATERAL = {"v_y", "r", "steer", "alpha_f", "alpha_r", "F_yf", "F_yr", "a_y", "r_dot"} | _SLIPS
_NEAR_NULL = 1e-4  # of the way to the typical value
_OTHER_SIDE = str.maketrans("lr", "rl")
_TURNING = {"force_y", "moment_z", "force_y_front", "force_y_rear"} | {
    "vy_mps",
    "yaw_rate_radps",
    "ay_mps2",
}
# What a car in brisk driving shows, for checking functions.
_RANGES = {
    "time": (0.0, 60.0),
    "v_x": (8.0, 50.0),
    "v_y": (-2.0, 2.0),
    "r": (-0.8, 0.8),
    "steer": (-0.1, 0.1),
    "F_x": (-8e3, 6e3),
    "alpha_f": (-0.1, 0.1),
    "alpha_r": (-0.1, 0.1),
    "F_xf": (-5e3, 3e3),
    "F_xr": (-3e3, 5e3),
    "F_zf": (3e3, 9e3),
    "F_zr": (3e3, 9e3),
    "F_yf": (-7e3, 7e3),
    "F_yr": (-7e3, 7e3),
    "a_x": (-8.0, 5.0),
    "a_y": (-9.0, 9.0),
    "r_dot": (-2.0, 2.0),
    **dict.fromkeys(("F_zfl", "F_zfr", "F_zrl", "F_zrr"), (5e2, 7e3)),
    **dict.fromkeys(_SLIPS, (-0.1, 0.1)),
    **dict.fromkeys(("v_xfl", "v_xfr", "v_xrl", "v_xrr"), (8.0, 50.0)),
}


_SPEEDS = {"v_x", "v_xfl", "v_xfr", "v_xrl", "v_xrr"}
# What the slowest and lightest cars show beside it, a model car of 1.5 kg and a car that parks.
_SLOW = {
    **{
        n: (low / 1e3, high / 1e3) if n[0] == "F" else (low, high)
        for n, (low, high) in _RANGES.items()
    },
    **dict.fromkeys(_SPEEDS, (0.5, 8.0)),
}


@dataclass(frozen=True)
class State:
    """A state of an effect of your own; :func:`state` makes it."""

    name: str
    unit: str
    rate: Function
    initial: Function | None
    usual: tuple[float, float]


def check_names(
    id_: str,
    what: str,
    parameters: Sequence[Parameter],
    functions: Mapping[str, Function],
    channels: Mapping[str, tuple[float, float]],
    states: Sequence[State],
) -> None:
    """Refuse names that are taken or malformed, and more of anything than there is room for."""
    if not re.fullmatch(r"[a-z][a-z0-9_]*", id_):
        raise InvalidInput(f"{what}: use small letters, digits and underscores")
    if any(e.id == id_ and not e.acts for e in catalogue()):
        raise InvalidInput(f"{what}: the catalogue has one of this name")
    if not functions:
        raise InvalidInput(f"{what}: give at least one function of {', '.join(TARGETS)}")
    unknown = [t for t in functions if t not in TARGETS]
    if unknown:
        raise InvalidInput(f"{what}: there is no '{unknown[0]}'; there are {', '.join(TARGETS)}")
    read = [*channels, *(s.name for s in states)]
    _check_parameters(what, parameters, read)
    if len(states) > _core.USER_STATES:
        raise InvalidInput(f"{what}: it must have at most {_core.USER_STATES} states")
    _check_read(what, read)


def _check_parameters(what: str, parameters: Sequence[Parameter], read: Sequence[str]) -> None:
    if not 1 <= len(parameters) <= _core.USER_PARAMETERS:
        raise InvalidInput(f"{what}: it must have 1 to {_core.USER_PARAMETERS} parameters")
    if len({p.name for p in parameters}) < len(parameters):
        raise InvalidInput(f"{what}: two parameters have the same name")
    same = next((p.name for p in parameters if p.name in {*SIGNALS, *read}), None)
    if same is not None:
        raise InvalidInput(
            f"{what}: the parameter {same} is called as what the functions read; rename it, so "
            "that the equation can be read"
        )
    scanned = [i for i, p in enumerate(parameters) if p.scan]
    if scanned and (scanned != [1] or len(parameters) != 2):
        raise InvalidInput(f"{what}: only the second of two parameters may be scanned")


def _check_read(what: str, names: Sequence[str]) -> None:
    """Refuse names of channels and states that formulas could not read."""
    for name in names:
        if not name.isidentifier() or name in SIGNALS or names.count(name) > 1:
            raise InvalidInput(
                f"{what}: '{name}' is taken, or no Python name; rename the column or the state"
            )
        if name in CANONICAL:
            raise InvalidInput(
                f"{what}: the model has {name} itself; read {CANONICAL[name]} in its place"
            )


def checked(
    what: str,
    parameters: tuple[Parameter, ...],
    functions: Mapping[str, Function],
    channels: Mapping[str, tuple[float, float]],
    states: Sequence[State],
) -> tuple[tuple[Parameter, ...], bool]:
    """Parameters that know whether a mirror turns them, and whether a slope at null is missing."""
    own = dict(channels) | {s.name: s.usual for s in states}
    for name, (low, high) in own.items():
        if not -np.inf < low < high < np.inf:
            raise InvalidInput(
                f"{what}: {name} ranges from {low:g} to {high:g}; give (lowest, highest)"
            )
    signals, slow = _drawn(_RANGES, own), _drawn(_SLOW, own)
    typical = {p.name: p.typical for p in parameters}
    null = {p.name: p.null_value for p in parameters}
    scanned = {p.name: p.typical for p in parameters if p.scan}

    def values(at: Mapping[str, float], given: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
        with np.errstate(all="ignore"):
            return {t: evaluate(f, t, given, at) for t, f in functions.items()}

    _check_null(what, null | scanned, values(null | scanned, signals))
    steep = False
    seen = []
    for p in parameters:
        if p.scan:
            seen.append(p)
            continue
        full = values(null | scanned | {p.name: p.typical}, signals)
        driven = signals
        if _norm(full) == 0.0:  # what acts in slow driving alone is looked at there
            full, driven = values(null | scanned | {p.name: p.typical}, slow), slow
        size = _size_of(p, full, what)
        near = p.null_value + _NEAR_NULL * (p.typical - p.null_value)
        few = values(null | scanned | {p.name: near}, driven)
        steep |= not 0.02 < _norm(few) / (_NEAR_NULL * size) < 50.0
        mirror = _mirrored(what, driven, states, typical)
        turned = values(null | scanned | {p.name: p.typical}, mirror)
        other = all(
            np.allclose(turned[t], y if t in _TURNING else -y, rtol=1e-9, atol=1e-12)
            for t, y in full.items()
        )
        seen.append(replace(p, mirrored=other))
    return tuple(seen), steep


def _drawn(
    ranges: Mapping[str, tuple[float, float]], own: Mapping[str, tuple[float, float]]
) -> dict[str, FloatArray]:
    """Signals of driving within these ranges, and columns and states of the effect's own."""
    rng = np.random.default_rng(0)
    every = {n: ranges[n] for n in SIGNALS} | dict(own)
    return {n: rng.uniform(*between, 200) for n, between in every.items()}


def _norm(values: Mapping[str, FloatArray]) -> float:
    return sum(float(np.linalg.norm(y)) for y in values.values())


def _size_of(p: Parameter, full: Mapping[str, FloatArray], what: str) -> float:
    """Size of what the effect does where one parameter is typical; refuse none, and no number."""
    size = _norm(full)
    if not np.isfinite(size):
        raise InvalidInput(
            f"{what}: with {p.name} = {p.typical:g} it is not finite for all of the driving that "
            "a car meets"
        )
    if size == 0.0:
        raise InvalidInput(
            f"{what}: {p.name} does nothing by itself, at any speed from 0.5 to 50 m/s; where it "
            "means nothing while another is null, give it scan='range'"
        )
    return size


def _check_null(what: str, at: Mapping[str, float], found: Mapping[str, FloatArray]) -> None:
    """Refuse an effect that is no number, or that is there, at its null values."""
    for target, y in found.items():
        if not np.isfinite(y).all():
            raise InvalidInput(f"{what}, {target}: it is not finite for all of brisk driving")
        if np.any(y != 0.0):
            values = ", ".join(f"{n} = {v:g}" for n, v in at.items())
            raise InvalidInput(
                f"{what}, {target}: at the null values ({values}) it must vanish exactly, "
                f"and is up to {np.abs(y).max():g}"
            )


def _mirrored(
    what: str,
    signals: Mapping[str, FloatArray],
    states: Sequence[State],
    parameters: Mapping[str, float],
) -> dict[str, FloatArray]:
    """The same driving in a mirror that swaps left and right.

    A state turns there or not, as its rate says; one that does neither is taken as one that stays.
    """
    sides = {n: _across(n) for n in SIGNALS if n[-2:] in ("fl", "fr", "rl", "rr")}
    turned = {n: signals[sides.get(n, n)] * (-1.0 if n in _LATERAL else 1.0) for n in signals}

    def rates(at: Mapping[str, FloatArray]) -> list[FloatArray]:
        with np.errstate(all="ignore"):
            return [evaluate(s.rate, EVERYTHING, at, parameters) for s in states]

    here = rates(signals)
    for s, rate in zip(states, here, strict=True):
        if not np.isfinite(rate).all():
            raise InvalidInput(f"{what}, rate of {s.name}: it is not finite for all of its range")
    for signs in product((1.0, -1.0), repeat=len(states)):
        there = turned | {s.name: k * signals[s.name] for s, k in zip(states, signs, strict=True)}
        if all(
            np.allclose(k * rate, other, rtol=1e-9, atol=1e-12)
            for k, rate, other in zip(signs, here, rates(there), strict=True)
        ):
            return there
    return turned


def _across(wheel: str) -> str:
    """The wheel on the other side: `F_zfl` of `F_zfr`."""
    return wheel[:-1] + wheel[-1].translate(_OTHER_SIDE)
