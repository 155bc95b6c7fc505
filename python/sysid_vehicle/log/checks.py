"""Checks that warn: holes, constant channels, and drives in which nothing happens."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from .._common.arrays import FloatArray, filled
from .channels import CHANNELS
from .grid import between, own_period
from .signals import runs, smoothed

_NAN_BLOCK_S = 0.5
_REPEATED_S, _REPEATED = 1.0, 20  # so long, and so many rows
_MIXED = np.uint64(0x9E3779B97F4A7C15)  # odd: channels are not exchanged
_MIN_RATE_HZ = 20.0
_EXCITED_AY_MPS2 = 0.5
_EXCITED_STEER_RAD = 0.002
_CORNERING_MPS2 = 2.0  # no crossfall and no wind alone


def nan_block_notes(time_s: FloatArray, columns: Mapping[str, FloatArray]) -> list[str]:
    """Return one note per channel that lacks values for half a second and two of its periods."""
    notes = []
    for name, values in columns.items():
        if name not in CHANNELS:
            continue
        holes = runs(np.isnan(values))
        # Between the samples of a slow channel nothing is missing.
        longest = max(_NAN_BLOCK_S, 2.0 * own_period(time_s, values)) if holes else 0.0
        blocks = [(a, b) for a, b in holes if time_s[b - 1] - time_s[a] > longest]
        if not blocks:
            continue
        a, b = blocks[0]
        effect = (
            "no run of the model goes across this"
            if name in ("steer_rad", "fx_n")
            else "nothing is compared there"
        )
        more = f" and in {len(blocks) - 1} more blocks" if len(blocks) > 1 else ""
        notes.append(
            f"{name}: no values at {between(a, b, time_s)}{more}; {effect}; check the sensor, "
            f"or cut the log there"
        )
    return notes


def low_rate_note(rate_hz: float) -> list[str]:
    """Return a note if the log is too coarse for the yaw dynamics of a car."""
    if rate_hz >= _MIN_RATE_HZ:
        return []
    note = (
        f"time_s: the rate is only {rate_hz:.4g} Hz; a car answers to steering within 0.1 to 0.3 s,"
        f" so record at {_MIN_RATE_HZ:.0f} Hz or more"
    )
    return [note]


def excitation_note(columns: Mapping[str, FloatArray], rate_hz: float) -> str:
    """Return why lateral parameters cannot be determined from the log, or ``""``."""
    width = round(0.5 * rate_hz)
    ay = np.abs(smoothed(columns["ay_mps2"], width)).max()
    low, high = np.nanpercentile(columns["steer_rad"], (0.5, 99.5))
    if ay >= _EXCITED_AY_MPS2 and high - low >= _EXCITED_STEER_RAD:
        return ""
    if ay >= _CORNERING_MPS2 and high == low:
        return (
            f"steer_rad: constant ({low:.6g} rad) over the whole log while the lateral "
            f"acceleration reaches {ay:.2g} m/s2: lateral parameters cannot be determined; check "
            f"the sensor and the column"
        )
    return (
        f"steer_rad and ay_mps2: not excited (steering varies by {high - low:.2g} rad, lateral "
        f"acceleration reaches {ay:.2g} m/s2 over the whole log): lateral parameters cannot be "
        f"determined; drive corners"
    )


def placeholder_notes(channels: dict[str, FloatArray], excited: bool) -> list[str]:
    """Take out a lateral speed that is one number in all corners, and say so.

    Loggers fill columns of signals that nobody measures so. As a measurement without noise it
    would outweigh all others.
    """
    values = channels.get("vy_mps")
    if values is None or not excited:
        return []
    known = values[np.isfinite(values)]
    if known.min() < known.max():
        return []
    del channels["vy_mps"]
    note = (
        f"vy_mps: constant ({known[0]:.6g}) over all "
        f"{between(0, values.size, channels['time_s'])}, corners too, and is treated as absent; "
        f"check the sensor and the column, or leave it out"
    )
    return [note]


def constant_notes(columns: Mapping[str, FloatArray], excited: bool) -> list[str]:
    """Return one note per channel that is constant over the whole log.

    Without lateral excitation the lateral channels may well be, so only the others are looked at
    then.
    """
    time_s = columns["time_s"]
    lateral = ("steer_rad", "yaw_rate_radps", "ay_mps2", "vy_mps")
    notes = []
    for name in CHANNELS:
        if name == "time_s" or name not in columns or (name in lateral and not excited):
            continue
        values = columns[name]
        known = values[np.isfinite(values)]
        if known.min() == known.max():
            notes.append(
                f"{name}: constant ({known[0]:.6g}) over all {between(0, values.size, time_s)}; "
                f"check the sensor and the column"
                + (", or leave it out" if CHANNELS[name].without else "")
            )
    return notes


def repeated_notes(columns: Mapping[str, FloatArray], rate_hz: float) -> list[str]:
    """Return a note where a piece of a drive stands in the log twice, with times of its own.

    Its rows are alike in all channels, noise and all, and follow each other as the first time. Of
    rows that stand still each is like the first one: no piece.
    """
    time_s = columns["time_s"]
    key = np.zeros(time_s.size, dtype=np.uint64)
    for name in CHANNELS:
        if name in columns and name != "time_s":
            key = key * _MIXED + columns[name].view(np.uint64)  # modulo 2^64
    _, first, which = np.unique(key, return_index=True, return_inverse=True)
    back = np.arange(time_s.size) - first[which]
    blocks = [(a, b + 1) for a, b in runs((np.diff(back) == 0) & (back[1:] > 0))]
    a, b = max(blocks, key=lambda block: block[1] - block[0], default=(0, 0))
    if b - a <= max(_REPEATED_S * rate_hz, _REPEATED):
        return []
    start, stop = int(a - back[a]), int(b - back[a])
    note = (
        f"time_s: all channels at {between(a, b, time_s)} repeat those at "
        f"{between(start, stop, time_s)}: a piece of the drive stands there twice; cut the second "
        f"one out, and read what is before and behind it as separate logs"
    )
    return [note]


def usable_seconds(columns: Mapping[str, FloatArray], rate_hz: float) -> float:
    """Return how long the car moves (> 0.5 m/s) with a known steering angle."""
    moving = np.abs(filled(columns["vx_mps"])) > 0.5
    return float(np.count_nonzero(moving & np.isfinite(columns["steer_rad"])) / rate_hz)


def listing(times: Iterable[float], shown: int = 5) -> str:
    """Return the first few times as ``1.2, 3.4, ... s``."""
    times = list(times)
    text = ", ".join(f"{t:.6g}" for t in times[:shown])
    return text + (", ... s" if len(times) > shown else " s")
