"""Is an event told, a moment that holds most of the error, and none where nothing happened?

    python benchmarks/finding_effects/events.py [--seed 1] [--drives 10]

In each of three kinds of event and without one as many drives are drawn: car, manoeuvre, what the
model lacks (nothing, or one or two effects of the catalogue at half, once or twice their usual
size), pushes of the road, rate, with or without v_y. The event lies in the log that is fitted
(`fitted`), or in a course or lap that a fit to the clean log is compared with (`later`). Told: the
comparison names an event that overlaps it. Most: of drives in which the second after its beginning
holds more than half of the squared error above the noise floor, and those of them that are told.
"""

from __future__ import annotations

import argparse
import sys
import warnings
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import sysid_vehicle as sv
from sysid_vehicle.manoeuvres import Manoeuvre

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "exam"))
import truths

_LATERAL_N, _PUSH_S = 2500.0, 0.3  # a contact from the side
_BRAKED, _BRAKED_S = 0.35, 0.5  # rear wheels that a hand brake holds, share of their side force
_JUMP_RADPS, _JUMP_S = 0.1, 0.3  # a gyro that reads too much
_KINDS = {"hand brake": _BRAKED_S, "push": _PUSH_S, "jump": _JUMP_S, "none": 0.0}
_HALF = 0.5
_COLUMNS = ("drives", "told", "most", "told of these")

_ROAD = {"fx_n": 120.0, "fy_n": 150.0, "mz_nm": 150.0, "correlation_time_s": 0.3}

_EVEN = {"fx_n": 0.0, "fy_n": 0.0, "mz_nm": 0.0}


def _manoeuvres(ease: float) -> dict[str, Manoeuvre]:
    m = sv.manoeuvres
    return {
        "ramp": m.ramp_steer((18.0, 27.0), 8.6 * ease, 4.0),
        "sweep": m.sine_sweep(25.0, 25.0, 3.5 * ease),
        "step": m.step_steer((17.0, 27.0), (3.0 * ease, 6.0 * ease)),
        "lap": m.lap(50.0, 8.0 * ease),
        "slalom": m.slalom(),
        "brake": m.brake_in_turn(),
        "course": m.handling_course(40.0, 7.5 * ease),
    }


@dataclass(frozen=True)
class Pushed(sv.RoadDisturbance):
    """A road, and a contact from the side."""

    at_s: float = 0.0

    def sample(self, n: int, rate_hz: float, rng: np.random.Generator) -> np.ndarray:
        force = super().sample(n, rate_hz, rng)
        t = np.arange(n) / rate_hz
        force[(t >= self.at_s) & (t < self.at_s + _PUSH_S), 1] += _LATERAL_N
        return force


@dataclass(frozen=True)
class Drive:
    """What is drawn: a car whose model lacks something, and how it is driven."""

    model: sv.Model
    truth: sv.Model
    manoeuvre: str
    road: dict[str, float]
    rate_hz: float
    at_s: float
    without: tuple[str, ...]

    def log(self, seed: int, event: str, manoeuvre: str = "") -> sv.Log:
        """Drive it, more gently where the car would spin."""
        truth, road = self.truth, sv.RoadDisturbance(**self.road) if self.road else None
        if event == "hand brake":
            truth = truth.add("hand_brake").with_values({"hand_brake.share": _BRAKED})
        if event == "push":
            road = Pushed(**(self.road or _EVEN), at_s=self.at_s)
        name = manoeuvre or self.manoeuvre
        for ease in (1.0, 0.85, 0.7, 0.55):
            try:
                driven = sv.drive(
                    truth,
                    _manoeuvres(ease)[name],
                    seed=seed,
                    rate_hz=self.rate_hz,
                    disturbance=road,
                    channels={"held_1": self._held} if event == "hand brake" else None,
                )
                break
            except sv.NumericalError as spun:
                failure = spun
        else:
            raise failure
        left_out = (*self.without, "held_1")
        channels = {c: np.array(driven[c]) for c in driven.channels if c not in left_out}
        if event == "jump":
            t = channels["time_s"]
            channels["yaw_rate_radps"][(t >= self.at_s) & (t < self.at_s + _JUMP_S)] += _JUMP_RADPS
        return sv.Log.from_arrays(channels, name=name, check=False)

    def _held(self, t: np.ndarray) -> np.ndarray:
        return np.where((t > self.at_s) & (t < self.at_s + _BRAKED_S), 1.0, 0.0)


def drawn(rng: np.random.Generator) -> Drive:
    model = sv.Model(truths.vehicle(("saloon", "hatchback")[int(rng.integers(2))]))
    effects = [e for e in sv.effects.catalogue() if e.id != "hand_brake"]
    lacked = [effects[i] for i in rng.choice(len(effects), int(rng.integers(3)), replace=False)]
    severity, values = float(rng.choice([0.5, 1.0, 2.0])), {}
    for e in lacked:
        for name, p in e.named.items():
            size = (
                20.0 if p.scan == "time" else p.null_value + severity * (p.typical - p.null_value)
            )
            values[name] = float(np.clip(size, p.lower, p.upper))
    return Drive(
        model,
        model.add(*lacked).with_values(values),
        str(rng.choice(list(_manoeuvres(1.0)))),
        _ROAD if rng.integers(2) else {},
        float(rng.choice([50.0, 100.0])),
        float(rng.uniform(6.0, 17.0)),
        () if rng.integers(2) else ("vy_mps",),
    )


def _told(comparison: sv.Comparison, begin: float, lasts: float) -> bool:
    event = comparison.event
    if event is None:
        return False
    return lasts == 0.0 or (event.from_s < begin + lasts + 1.0 and event.until_s > begin)


def _share(comparison: sv.Comparison, begin: float) -> float:
    """Of the squared error above the floor, in the second after the event began."""
    above = np.nansum(comparison.residual**2 - 1.0, axis=1)
    t = comparison.time_s
    return float(above[(t >= begin) & (t < begin + 1.0)].sum() / above.sum())


def ask(drive: Drive, kind: str, seed: int, counts: Counter[tuple[str, str]]) -> None:
    """Compare once with the event in what is fitted, and once in later driving."""
    fitted = drive.log(seed, kind)
    fit = sv.identify(drive.model, fitted)
    clean = fit if kind == "none" else sv.identify(drive.model, drive.log(seed + 1, "none"))
    other = "lap" if drive.manoeuvre == "course" else "course"
    later = drive.log(seed + 2, kind, other)
    for what, comparison in (
        ("fitted", sv.compare(fit, fitted)),
        ("later", sv.compare(clean, later, noise=clean.noise)),
    ):
        told = _told(comparison, drive.at_s, _KINDS[kind])
        most = kind != "none" and _share(comparison, drive.at_s) > _HALF
        row = f"{kind}, {what}"
        counts[row, "drives"] += 1
        counts[row, "told"] += told
        counts[row, "most"] += most
        counts[row, "told of these"] += told and most


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--drives", type=int, default=10, help="of each kind")
    args = parser.parse_args()
    warnings.simplefilter("ignore", sv.SysidWarning)
    sv.define_effect(
        "hand_brake",
        title="rear wheels that are locked for a moment",
        parameters=[sv.parameter("share", "1", typical=0.3, lower=-1.0, upper=1.0)],
        channels={"held_1": (0.0, 1.0)},
        force_y_rear=lambda d, p: -p.share * d.held_1 * d.F_yr,
    )
    counts: Counter[tuple[str, str]] = Counter()
    for at, kind in enumerate(_KINDS):
        for n in range(args.drives):
            seeds = np.random.SeedSequence([args.seed, at, n])
            drive = drawn(np.random.default_rng(seeds))
            ask(drive, kind, int(seeds.generate_state(1)[0]), counts)
        for what in ("fitted", "later"):
            row = f"{kind}, {what}"
            told = ", ".join(f"{w} {counts[row, w]}" for w in _COLUMNS)
            print(f"{row:20s} {told}", flush=True)


if __name__ == "__main__":
    main()
