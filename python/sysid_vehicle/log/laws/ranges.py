"""What no car does: values beyond every range, and jumps from sample to sample."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..._common.arrays import FloatArray, filled
from ..channels import CHANNELS, DEG
from ..grid import at, between
from ..signals import disorder, median_of_five, runs, white_noise
from .laws import Contradiction, Implausible

WHITE = 0.7  # share of white variance from which a channel has no order

_MIN_RATE_HZ = 18.0
_DRIVEN_MPS = 15.0
_LEAST_FORCE_N = 30.0  # drag alone takes more at that speed
# Force that holds a speed at most: rolling and climbing of a lorry, and the drag of 10 m2.
_HOLDING_N, _HOLDING_NS2PM2 = 5e4, 6.2
# Readings beyond the range are dropouts where they are so few, and jump there and back by more than
# this part of what they read. A channel in another unit goes there step by step.
_LOST_SHARE, _LOST_JUMP = 0.05, 0.5
_SAME = 0.9  # factors of units that magnitudes do not tell apart
_SPEEDS = (("km/h", 1.0 / 3.6), ("cm/s", 0.01), ("mm/s", 1e-3))
_ACCELERATIONS = (("mg", 0.00980665), ("cm/s2", 0.01), ("mm/s2", 1e-3))


@dataclass(frozen=True)
class _Range:
    """Largest magnitude of a channel, white noise that is impossible, and that is unusual.

    `likely` are units in which the channel may be instead, with their factors, or the whole remedy.
    """

    largest: float
    jump: float
    noise: float
    likely: tuple[tuple[str, float], ...] | str

    def remedy(self, size: float) -> str:
        """What may be wrong where values are so large: the units that explain it with least."""
        if isinstance(self.likely, str):
            return self.likely
        # The unit of the largest factor that is small enough, and what looks like it.
        within = [factor for _, factor in self.likely if factor * size <= self.largest]
        least = max(within, default=min(factor for _, factor in self.likely))
        alike = [(u, f) for u, f in self.likely if _SAME < f / least < 1.0 / _SAME]
        return "; ".join(f"if it is in {unit}, put factor = {factor:.7g}" for unit, factor in alike)


_RANGES = {
    "vx_mps": _Range(150.0, 2.0, 0.5, _SPEEDS),
    "vy_mps": _Range(60.0, 1.5, 0.2, _SPEEDS),
    "yaw_rate_radps": _Range(10.0, 0.5, 0.05, (("degrees per second", DEG),)),
    "ax_mps2": _Range(60.0, 15.0, 5.0, _ACCELERATIONS),
    "ay_mps2": _Range(60.0, 15.0, 5.0, _ACCELERATIONS),
    "steer_rad": _Range(
        1.2,
        0.1,
        0.02,
        f"if it is in degrees, put factor = {DEG}; if it is the angle of the steering wheel, "
        f"divide the factor by the steering ratio",
    ),
    "fx_n": _Range(1e6, np.inf, np.inf, "if it is in mN, put factor = 0.001"),
}


def dropouts(name: str, values: FloatArray) -> np.ndarray:
    """Return the samples at which a sensor reads, for a moment, what no car does.

    Parameters
    ----------
    name : str
        A canonical channel; of others nothing is known.
    values : ndarray, shape (n,)
        NaN is missing.

    Returns
    -------
    ndarray of int, shape (k,)
        Sorted.
    """
    if name not in _RANGES:
        return np.empty(0, dtype=np.intp)
    known = np.flatnonzero(np.isfinite(values))
    read = values[known]
    beyond = np.abs(read) > _RANGES[name].largest
    if not 0 < np.count_nonzero(beyond) <= _LOST_SHARE * known.size:
        return np.empty(0, dtype=np.intp)
    lost = [
        known[a:b]
        for a, b in runs(beyond)
        if (a == 0 or _leaps(read[a], read[a - 1]))
        and (b == read.size or _leaps(read[b - 1], read[b]))
    ]
    return np.concatenate([np.empty(0, dtype=np.intp), *lost])


def _leaps(beyond: float, within: float) -> bool:
    return bool(abs(beyond - within) > _LOST_JUMP * abs(beyond))


def blank(
    columns: Mapping[str, FloatArray], lost: Mapping[str, np.ndarray]
) -> dict[str, FloatArray]:
    """Return the columns with these samples of each missing."""
    result = dict(columns)
    for name, samples in lost.items():
        if samples.size:
            result[name] = columns[name].copy()
            result[name][samples] = np.nan
    return result


def check_lost(
    columns: Mapping[str, FloatArray], lost: Mapping[str, np.ndarray]
) -> list[Contradiction]:
    """Refuse dropouts that are longer than a spike, warn of the others.

    Raises
    ------
    Implausible
        If a channel has more than two dropped samples in five.
    """
    time_s, notes = columns["time_s"], []
    for name, samples in lost.items():
        if samples.size == 0:
            continue
        beyond = np.zeros(time_s.size, dtype=bool)
        beyond[samples] = True
        blocks = runs(beyond)
        a, b = max(blocks, key=lambda block: block[1] - block[0])
        place = between(a, b, time_s) if b - a > 1 else at(a, time_s)
        more = f" and {len(blocks) - 1} more time(s)" if len(blocks) > 1 else ""
        text = (
            f"{name}: {samples.size} impossible value(s), {columns[name][a]:.4g} "
            f"{CHANNELS[name].unit} at {place}{more}: the sensor dropped out there; "
            f"put despike = true for {name} in the channel map, or empty these cells, so that "
            f"they count as missing"
        )
        if median_of_five(beyond.astype(float)).any():
            raise Implausible(name, text)
        notes.append(Contradiction(name, text))
    return notes


def check_ranges(
    columns: Mapping[str, FloatArray], rate_hz: float, *, model_car: bool = False
) -> list[Contradiction]:
    """Refuse a channel that leaves its range for longer than a spike; warn of spikes beyond it.

    Dropouts are taken out of `columns` before. A `model_car` needs little force.

    Raises
    ------
    Implausible
        If more than two samples in five lie beyond what a car does, or if the channel jumps from
        sample to sample as no car moves.
    """
    notes = []
    time_s = columns["time_s"]
    for name, limits in _RANGES.items():
        if name not in columns:
            continue
        values = columns[name]
        size = np.abs(median_of_five(filled(values)))
        if size.max() > limits.largest:
            i = int(np.argmax(size))
            remedy = limits.remedy(float(size[i]))
            raise Implausible(
                name,
                f"{name}: {filled(values)[i]:.4g} {CHANNELS[name].unit} at {at(i, time_s)} is no "
                f"value of a car (at most {limits.largest:g}): {remedy} in the channel map",
            )
        lone = np.flatnonzero(np.abs(values) > limits.largest)
        if lone.size:
            text = (
                f"{name}: {lone.size} impossible value(s), first {values[lone[0]]:.4g} "
                f"{CHANNELS[name].unit} at {at(int(lone[0]), time_s)}; check the sensor, and empty "
                f"these cells"
            )
            notes.append(Contradiction(name, text))
        if rate_hz > _MIN_RATE_HZ:
            notes += _check_jumps(name, values, limits, time_s)
    if "fx_n" in columns:
        _check_force(columns, model_car)
    return notes


def _check_jumps(
    name: str, values: FloatArray, limits: _Range, time_s: FloatArray
) -> list[Contradiction]:
    """Refuse a channel whose usual second difference is that of large white noise.

    Warn of one that holds nothing else than noise, if it is more than a sensor has.
    """
    known = values[np.isfinite(values)]
    if known.size < 50 or known.size < 0.5 * values.size:  # slow channels move between samples
        return []
    noise = white_noise(known)
    if noise > limits.jump:
        i = int(np.argmax(np.abs(np.diff(filled(values)))))
        raise Implausible(
            name,
            f"{name}: jumps from sample to sample by {2.0**0.5 * noise:.3g} {CHANNELS[name].unit}, "
            f"most at {at(i, time_s)}; no car moves so: check the column, and that its rows are in "
            f"the order of time",
        )
    if noise > limits.noise and disorder(known) > WHITE:
        i = int(np.argmax(np.abs(np.diff(filled(values)))))
        text = (
            f"{name}: holds only noise, {noise:.3g} {CHANNELS[name].unit} from sample to sample "
            f"(most at {at(i, time_s)}); check the column, and that its rows are in the order of "
            f"time"
        )
        return [Contradiction(name, text)]
    return []


def _check_force(columns: Mapping[str, FloatArray], model_car: bool) -> None:
    force, speed = filled(columns["fx_n"]), filled(columns["vx_mps"])
    typical, largest = float(np.median(speed)), float(np.abs(force).max())
    weak = 0.0 < largest < _LEAST_FORCE_N and np.ptp(force) > 0.0
    if typical > _DRIVEN_MPS and weak and not model_car:
        raise Implausible(
            "fx_n",
            f"fx_n: is at most {largest:.3g} N over samples 0 to {force.size - 1} at "
            f"{typical:.3g} m/s, where drag alone takes more: if it is in kN, put factor = 1000 "
            f"in the channel map; of a model car, read the log with its vehicle file",
        )
    usual = float(np.median(np.abs(force)))
    if usual > _HOLDING_N + _HOLDING_NS2PM2 * typical**2:
        i = int(np.argmax(np.abs(force)))
        raise Implausible(
            "fx_n",
            f"fx_n: is {usual:.4g} N half of the time (largest at {at(i, columns['time_s'])}), "
            f"more than any car needs at {typical:.3g} m/s; if it is in mN, put factor = 0.001 in "
            f"the channel map",
        )
