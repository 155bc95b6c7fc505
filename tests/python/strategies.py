"""Hypothesis strategies that several test files share: driving logs, right and spoilt, and cars.

``logs()`` gives columns as a user would hand them over, ``clean_logs()`` those before anything was
spoilt, ``vehicles()`` cars from plausible to extreme. Hypothesis draws a few numbers and names; the
arrays are made from them, so that examples are quick to make and shrink to few faults.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from hypothesis import strategies as st

from sysid_vehicle import Tyre, Vehicle

Columns = dict[str, np.ndarray]

CHANNELS = (
    "time_s",
    "vx_mps",
    "vy_mps",
    "yaw_rate_radps",
    "ax_mps2",
    "ay_mps2",
    "steer_rad",
    "fx_n",
)
OPTIONAL = ("vy_mps", "ax_mps2", "fx_n")
LEFT_OUT = ((), ("vy_mps",), ("ax_mps2",), ("fx_n",), ("vy_mps", "ax_mps2"), ("vy_mps", "fx_n"))
UNIT_FACTORS = (3.6, 1 / 0.44704, 180 / np.pi, 1 / 9.80665, 16.0, 1e3, 1e-3, 1e6, 0.0, -1.0)

LENGTHS = st.one_of(
    st.integers(0, 12), st.integers(13, 600), st.integers(601, 3000), st.sampled_from([5000])
)
RATES = st.one_of(st.sampled_from([10.0, 20.0, 50.0, 100.0, 200.0, 1000.0]), st.floats(5.0, 2000.0))
SEEDS = st.integers(0, 2**32 - 1)


def car_columns(
    n: int,
    rate_hz: float,
    seed: int,
    speed_mps: float = 20.0,
    lateral_mps2: float = 4.0,
    noise: float = 1.0,
) -> Columns:
    """Columns of a linear car (1500 kg, 1.2 + 1.5 m) in curves at varying speed, noisy sensors.

    Negative speeds reverse the car. All channels agree with each other but for the noise.
    """
    rng = np.random.default_rng(seed)
    time_s = np.arange(n) / rate_hz
    w = rng.uniform(0.3, 1.2, 3)
    phase = rng.uniform(0.0, 2.0 * np.pi, 3)
    swing = rng.uniform(0.0, 0.25)
    vx = speed_mps * (1.0 + swing * np.sin(w[0] * time_s + phase[0]))
    vx_dot = speed_mps * swing * w[0] * np.cos(w[0] * time_s + phase[0])
    shape = 0.7 * np.sin(w[1] * time_s + phase[1]) + 0.3 * np.sin(3.0 * w[2] * time_s + phase[2])
    wanted = lateral_mps2 * shape
    speed = np.where(np.abs(vx) < 1.0, 1.0, vx)
    yaw_rate = wanted / speed * (np.abs(vx) > 0.2)
    vy = yaw_rate * 1.5 - 0.009 * wanted * np.abs(vx) ** 0.5
    vy_dot = np.gradient(vy, 1.0 / rate_hz) if n > 1 else np.zeros(n)
    ay = vx * yaw_rate + vy_dot
    ax = vx_dot - vy * yaw_rate
    yaw_acceleration = np.gradient(yaw_rate, 1.0 / rate_hz) if n > 1 else np.zeros(n)
    steer = 2.7 * yaw_rate / speed + 0.002 * wanted
    front_n = (1.5 * 1500.0 * ay + 2700.0 * yaw_acceleration) / 2.7
    white = noise * rng.standard_normal((6, n))
    return {
        "time_s": time_s,
        "vx_mps": vx + 0.03 * white[0],
        "vy_mps": vy + 0.03 * white[1],
        "yaw_rate_radps": yaw_rate + 0.0025 * white[2],
        "ax_mps2": ax + 0.06 * white[3],
        "ay_mps2": ay + 0.06 * white[4],
        "steer_rad": steer + 2e-4 * white[5],
        "fx_n": 1500.0 * ax + front_n * np.sin(steer) + 0.4 * vx * np.abs(vx),
    }


@st.composite
def clean_logs(
    draw: st.DrawFn,
    lengths: st.SearchStrategy[int] = LENGTHS,
    rates: st.SearchStrategy[float] = RATES,
    speeds: st.SearchStrategy[float] | None = None,
) -> Columns:
    """Columns in which nothing is spoilt; at most the optional channels are left out."""
    columns = car_columns(
        draw(lengths),
        draw(rates),
        draw(SEEDS),
        draw(speeds if speeds is not None else st.floats(8.0, 50.0)),
        draw(st.floats(0.0, 9.0)),
        draw(st.sampled_from([1.0, 0.0, 5.0])),
    )
    for channel in draw(st.sampled_from(LEFT_OUT)):
        del columns[channel]
    return columns


Fault = Callable[[Columns, str, np.random.Generator, float], None]


def _part(n: int, rng: np.random.Generator) -> slice:
    first = int(rng.integers(0, n)) if n else 0
    return slice(first, first + int(rng.geometric(0.02)))


def _block(value: float) -> Fault:
    def spoil(data: Columns, channel: str, rng: np.random.Generator, size: float) -> None:
        data[channel][_part(data[channel].size, rng)] = value

    return spoil


def _sparse(data: Columns, channel: str, rng: np.random.Generator, size: float) -> None:
    keep = np.arange(data[channel].size) % max(2, round(10 * size)) == 0
    data[channel][~keep] = np.nan


def _held(data: Columns, channel: str, rng: np.random.Generator, size: float) -> None:
    n, width = data[channel].size, max(2, round(10 * size))
    data[channel] = data[channel][np.arange(n) // width * width]


def _spikes(data: Columns, channel: str, rng: np.random.Generator, size: float) -> None:
    where = rng.random(data[channel].size) < 0.003
    data[channel][where] = 10.0 ** rng.uniform(-3, 300 * size, np.count_nonzero(where))


def _permuted(data: Columns, channel: str, rng: np.random.Generator, size: float) -> None:
    data[channel] = rng.permutation(data[channel])


def _swapped(data: Columns, channel: str, rng: np.random.Generator, size: float) -> None:
    other = str(rng.choice([name for name in data if name != "time_s"]))
    data[channel], data[other] = data[other].copy(), data[channel].copy()


def _late(data: Columns, channel: str, rng: np.random.Generator, size: float) -> None:
    data[channel] = np.roll(data[channel], round(20 * size))


def _quantised(data: Columns, channel: str, rng: np.random.Generator, size: float) -> None:
    quantum = 10.0 ** rng.uniform(-6, 1)
    data[channel] = np.round(data[channel] / quantum) * quantum


def _noise(data: Columns, channel: str, rng: np.random.Generator, size: float) -> None:
    data[channel] = data[channel] + size * rng.standard_normal(data[channel].size)


def _standstill(data: Columns, channel: str, rng: np.random.Generator, size: float) -> None:
    where = _part(data["time_s"].size, rng)
    for name in data:
        if name != "time_s":
            data[name][where] = 0.0


def _reverse(data: Columns, channel: str, rng: np.random.Generator, size: float) -> None:
    data["vx_mps"] = data["vx_mps"] - 2.0 * size * data["vx_mps"]


def _time_jitter(data: Columns, channel: str, rng: np.random.Generator, size: float) -> None:
    time_s = data["time_s"]
    step = time_s[1] - time_s[0] if time_s.size > 1 else 0.0
    data["time_s"] = time_s + size * step * rng.uniform(-0.5, 0.5, time_s.size)


def _time_repeats(data: Columns, channel: str, rng: np.random.Generator, size: float) -> None:
    if data["time_s"].size > 2:
        k = int(rng.integers(1, data["time_s"].size))
        data["time_s"][k] = np.nextafter(data["time_s"][k - 1], np.inf if size > 0.5 else 0.0)


def _time_back(data: Columns, channel: str, rng: np.random.Generator, size: float) -> None:
    data["time_s"][_part(data["time_s"].size, rng)] *= 1.0 - size


def _time_jump(data: Columns, channel: str, rng: np.random.Generator, size: float) -> None:
    k = int(rng.integers(0, data["time_s"].size + 1))
    data["time_s"][k:] += 10.0 ** (6.0 * size - 3.0)


def _rows_lost(data: Columns, channel: str, rng: np.random.Generator, size: float) -> None:
    keep = rng.random(data["time_s"].size) > 0.5 * size
    for name in data:
        data[name] = data[name][keep]


def _set(value: float) -> Fault:
    def spoil(data: Columns, channel: str, rng: np.random.Generator, size: float) -> None:
        data[channel] = np.full(data[channel].size, value)

    return spoil


def _times(factor: float) -> Fault:
    def spoil(data: Columns, channel: str, rng: np.random.Generator, size: float) -> None:
        data[channel] = data[channel] * factor

    return spoil


def _offset(data: Columns, channel: str, rng: np.random.Generator, size: float) -> None:
    data[channel] = data[channel] + 10.0 ** (6.0 * size - 3.0)


FAULTS: dict[str, Fault] = {
    "NaN block": _block(np.nan),
    "infinite block": _block(np.inf),
    "zero block": _block(0.0),
    "sparse": _sparse,
    "held": _held,
    "spikes": _spikes,
    "permuted": _permuted,
    "swapped": _swapped,
    "late": _late,
    "quantised": _quantised,
    "noise": _noise,
    "offset": _offset,
    "constant zero": _set(0.0),
    "constant": _set(7.0),
    "all NaN": _set(np.nan),
    "standstill": _standstill,
    "reverse": _reverse,
    "time jitter": _time_jitter,
    "time repeats": _time_repeats,
    "time back": _time_back,
    "time jump": _time_jump,
    "rows lost": _rows_lost,
    **{f"times {factor:.4g}": _times(factor) for factor in UNIT_FACTORS},
}


@st.composite
def logs(
    draw: st.DrawFn,
    clean: st.SearchStrategy[Columns] | None = None,
    faults: Sequence[str] = tuple(FAULTS),
    max_faults: int = 3,
) -> Columns:
    """Columns of a drive with none to `max_faults` of the named `faults` put in, one on another."""
    speeds = st.one_of(st.floats(8.0, 50.0), st.floats(-10.0, 130.0))
    columns = draw(clean if clean is not None else clean_logs(speeds=speeds))
    chosen = draw(
        st.lists(
            st.tuples(
                st.sampled_from(sorted(faults)),
                st.sampled_from(CHANNELS),
                SEEDS,
                st.floats(0.0, 1.0),
            ),
            max_size=max_faults,
        )
    )
    with np.errstate(all="ignore"):
        for fault, channel, seed, size in chosen:
            if channel in columns:
                FAULTS[fault](columns, channel, np.random.default_rng(seed), size)
    return columns


@st.composite
def tyres(draw: st.DrawFn, extreme: bool = True) -> Tyre:
    """Tyres of cars; `extreme` adds those at the ends of what a vehicle file accepts."""
    plausible = st.builds(
        Tyre,
        B=st.floats(5.0, 25.0),
        C=st.floats(1.1, 1.8),
        D=st.floats(0.5, 1.8),
        E=st.floats(-2.0, 0.9),
    )
    strange = st.builds(
        Tyre,
        B=st.floats(1e-3, 200.0),
        C=st.floats(1e-3, 4.0),
        D=st.floats(1e-3, 5.0),
        E=st.floats(-50.0, 1.0),
    )
    return draw(st.one_of(plausible, strange) if extreme else plausible)


@st.composite
def vehicles(draw: st.DrawFn, extreme: bool = True) -> Vehicle:
    """Cars from a kart to a lorry; `extreme` adds those at the ends of what is accepted."""
    strange = extreme and draw(st.booleans())
    mass = draw(st.floats(1.0, 50000.0) if strange else st.floats(150.0, 12000.0))
    lengths = st.floats(1e-2, 20.0) if strange else st.floats(0.5, 3.0)
    lf, lr = draw(lengths), draw(lengths)
    gyration = draw(st.floats(0.1, 10.0) if strange else st.floats(0.7, 1.4))
    inertia = float(np.clip(gyration * mass * lf * lr, 1e-6, 1e7))
    fits = 0.1 <= inertia / (mass * lf * lr) <= 10.0
    shares = st.floats(0.0, 1.0)
    return Vehicle(
        mass_kg=mass,
        lf_m=lf,
        lr_m=lr,
        cg_height_m=draw(st.floats(0.0, 5.0 if strange else 1.0)),
        track_front_m=draw(st.floats(1e-2, 5.0) if strange else st.floats(1.0, 2.0)),
        track_rear_m=draw(st.floats(1e-2, 5.0) if strange else st.floats(1.0, 2.0)),
        drag_area_m2=draw(st.floats(0.0, 50.0) if strange else st.floats(0.3, 6.0)),
        brake_front_share=draw(shares),
        drive_front_share=draw(shares),
        tyre_front=draw(tyres(extreme=strange)),
        tyre_rear=draw(tyres(extreme=strange)),
        yaw_inertia_kgm2=inertia if fits and draw(st.booleans()) else None,
    )
