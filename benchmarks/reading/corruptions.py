"""How many corruptions of a log are noticed when it is read, and how often a good one is blamed.

    python benchmarks/reading/corruptions.py [--seeds 3] [--first 1000] [--data DATA]

Every manoeuvre of the package is driven with no effect and with each of the catalogue at its
typical size, by two cars, with white and with coloured noise of the sensors. Each log is read as
it is, and with each corruption. A corruption that moves the channel by less than five times its
noise changes nothing that could be noticed, and does not count. `--data` adds logs of others,
read as they are.
"""

from __future__ import annotations

import argparse
import sys
import warnings
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

sys.path += [str(Path(__file__).resolve().parents[1] / other) for other in ("exam", "real_driving")]

from cars import lane_change_columns
from design import VEHICLES
from truths import vehicle

import sysid_vehicle as sv

Columns = dict[str, np.ndarray]
Corruption = Callable[[Columns, np.random.Generator], Columns]

RATE_HZ = 100.0
NOISE = {
    "vx_mps": 0.03,
    "vy_mps": 0.03,
    "yaw_rate_radps": 0.0025,
    "ax_mps2": 0.06,
    "ay_mps2": 0.06,
    "steer_rad": 2e-4,
    "fx_n": 50.0,
}
# What is true of a drive and no sign of a wrong log.
TRUE_NOTES = ("not excited", "the rate is only", "constant (", "one-sample spike")


def scaled(channel: str, factor: float) -> Corruption:
    return lambda data, _: {**data, channel: data[channel] * factor}


def permuted(channel: str) -> Corruption:
    return lambda data, rng: {**data, channel: rng.permutation(data[channel])}


def late(channel: str, seconds: float) -> Corruption:
    def change(data: Columns, _: np.random.Generator) -> Columns:
        time_s = data["time_s"]
        return {**data, channel: np.interp(time_s - seconds, time_s, data[channel])}

    return change


def swapped(data: Columns, _: np.random.Generator) -> Columns:
    return {**data, "ax_mps2": data["ay_mps2"], "ay_mps2": data["ax_mps2"]}


MEASURED = ("vx_mps", "vy_mps", "yaw_rate_radps", "ax_mps2", "ay_mps2")
CORRUPTIONS: dict[str, dict[str, Corruption]] = {
    "factor 1000": {
        c: scaled(c, 1e3) for c in ("yaw_rate_radps", "ay_mps2", "ax_mps2", "vy_mps", "fx_n")
    },
    "random permutation": {c: permuted(c) for c in (*MEASURED, "steer_rad", "fx_n")},
    "0.1 s late": {c: late(c, 0.1) for c in (*MEASURED, "steer_rad", "fx_n")},
    "a_x and a_y swapped": {"ax_mps2": swapped},
    "wheel force in kN": {"fx_n": scaled("fx_n", 1e-3)},
    "mirrored sign": {c: scaled(c, -1.0) for c in (*MEASURED, "steer_rad", "fx_n")},
    "wrong unit": {
        "vx_mps": scaled("vx_mps", 3.6),
        "yaw_rate_radps": scaled("yaw_rate_radps", 180.0 / np.pi),
        "ay_mps2": scaled("ay_mps2", 1.0 / 9.80665),
        "ax_mps2": scaled("ax_mps2", 1.0 / 9.80665),
        "steer_rad": scaled("steer_rad", 180.0 / np.pi),
    },
    "hand wheel": {"steer_rad": scaled("steer_rad", 16.0)},
}


def clean(first: int, seeds: int) -> Iterator[tuple[str, Columns]]:
    """Drive every manoeuvre with every effect; car and noise are drawn."""
    drivable = [vehicle(name) for name in VEHICLES]
    for seed in range(first, first + seeds):
        for effect in (None, *(e.id for e in sv.catalogue())):
            for name, manoeuvre in sv.manoeuvres.all().items():
                rng = np.random.default_rng([seed, len(name), hash_of(f"{effect}{name}")])
                model = sv.Model(drivable[int(rng.integers(2))])
                if effect is not None:
                    sizes = {f"{effect}.{p.name}": p.typical for p in sv.effect(effect).parameters}
                    model = model.add(effect).with_values(sizes)
                try:
                    log = sv.drive(model, manoeuvre, seed=rng, rate_hz=RATE_HZ)
                except sv.NumericalError:  # the car spun
                    continue
                data = {c: np.array(log[c]) for c in log.channels}
                if rng.random() < 0.3:
                    coloured(data, rng)
                yield f"{effect or 'no effect'}, {name}, seed {seed}", data


def hash_of(text: str) -> int:
    return int.from_bytes(text.encode(), "big") % 2**31


def coloured(data: Columns, rng: np.random.Generator, rate_hz: float = RATE_HZ) -> None:
    n = data["time_s"].size
    for channel, deviation in (("ay_mps2", 0.12), ("yaw_rate_radps", 0.003)):
        wander = sv.RoadDisturbance(fx_n=deviation, correlation_time_s=0.05)
        data[channel] = data[channel] + wander.sample(n, rate_hz, rng)[:, 0]


def heard(data: Columns) -> list[str]:
    """Return what reading says, but for what is true of the drive."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            sv.Log.from_arrays(data)
        except sv.InvalidInput as error:
            return [f"refused: {error}"]
    told = [str(w.message) for w in caught]
    return [text for text in told if not any(note in text for note in TRUE_NOTES)]


def matters(before: Columns, after: Columns) -> bool:
    """Whether any channel is moved by more than five times its noise, root mean square."""
    return any(
        np.sqrt(np.mean((after[c] - before[c]) ** 2)) > 5.0 * NOISE[c] for c in NOISE if c in before
    )


def real(data: Path) -> Iterator[tuple[str, Columns]]:
    """Read the logs of others as the benchmarks of real driving do."""
    maps = Path(__file__).resolve().parents[1] / "real_driving"
    for file, car in (
        ("carsim_like_handling/handling_course.csv", "carsim_like_handling"),
        ("tum_devbot_sim/data_to_train_2.csv", "tum_devbot_sim"),
        ("tum_devbot_sim/data_to_train_12.csv", "tum_devbot_sim"),
        ("tum_devbot_sim/data_to_run.csv", "tum_devbot_sim"),
        ("revs_250lm/revs_250lm_20140222_run1.csv", "revs_250lm"),
    ):
        log = sv.read_log(data / file, maps / f"{car}.channels.toml", check=False)
        yield file, {c: np.array(log[c]) for c in log.channels}
    yield "bmw_m8_roadview, double lane change", lane_change_columns(data / "bmw_m8_roadview")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=1, help="drives of each kind")
    parser.add_argument("--first", type=int, default=1000, help="first seed")
    parser.add_argument("--every", type=int, default=1, help="take each so-manieth drive only")
    parser.add_argument("--data", type=Path, help="folder of the logs of others")
    parser.add_argument("--show", type=int, default=3, help="examples of false alarms to print")
    args = parser.parse_args()

    total, noticed = Counter[tuple[str, str]](), Counter[tuple[str, str]]()
    missed: defaultdict[tuple[str, str], Counter[str]] = defaultdict(Counter)
    blamed: list[str] = []
    logs = 0
    for k, (name, data) in enumerate(clean(args.first, args.seeds)):
        if k % args.every:
            continue
        logs += 1
        blamed += [f"{name}: {text}" for text in heard(data)]
        rng = np.random.default_rng([args.first, k])
        for kind, channels in CORRUPTIONS.items():
            for channel, corrupt in channels.items():
                spoilt = corrupt(data, rng)
                if not matters(data, spoilt):
                    continue
                key = (kind, channel)
                total[key] += 1
                if heard(spoilt):
                    noticed[key] += 1
                else:
                    missed[key][name.split(", ")[1]] += 1

    print(f"{logs} logs of own drives: {len(blamed)} false alarms")
    for text in blamed[: args.show]:
        print(f"  {text}")
    if args.data is not None:
        for name, data in real(args.data):
            print(f"{name}: {'; '.join(heard(data)) or 'read without a word'}")
    print(f"\n{'corruption':22}{'channel':16}{'of':>6}{'noticed':>9}  missed most in")
    for kind, channels in CORRUPTIONS.items():
        for channel in channels:
            key = (kind, channel)
            if total[key]:
                where = ", ".join(f"{m} {c}" for m, c in missed[key].most_common(3))
                rate = f"{noticed[key] / total[key]:.1%}"
                print(f"{kind:22}{channel:16}{total[key]:6}{rate:>9}  {where}")
    for kind in CORRUPTIONS:
        of = sum(count for key, count in total.items() if key[0] == kind)
        if of:
            right = sum(count for key, count in noticed.items() if key[0] == kind)
            print(f"{kind:38}{of:6}{right / of:9.1%}")
    every, right = sum(total.values()), sum(noticed.values())
    print(f"{'all':38}{every:6}{right / max(every, 1):9.1%}")


if __name__ == "__main__":
    main()
