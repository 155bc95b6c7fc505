"""What is examined: every trial is one point of a grid of truths, severities and driving."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from itertools import product
from typing import Any, Literal, get_args

import numpy as np

import sysid_vehicle as sv

Kind = Literal[
    "null",
    "effect",
    "pair",
    "outside",
    "itself removed",
    "group removed",
    "one removed",
    "rivals",
]
KINDS: tuple[Kind, ...] = get_args(Kind)

SEVERITIES = (0.5, 1.0, 2.0)
ROADS = ("road", "hills")
MANOEUVRES = ("ramp", "sweep", "step", "lap", "all", *ROADS)
NOISES = ("nominal", "high", "coloured force", "coloured sensor")
VEHICLES = ("saloon", "hatchback")

PAIRS = (
    ("aero_drag", "steer_offset"),
    ("aero_downforce", "steer_lag"),
    ("tyre_load_sensitivity", "road_bank"),
    ("combined_slip", "yaw_inertia"),
    ("tyre_relaxation", "cg_position"),
    ("steer_lag", "imu_lever_arm"),
    ("steer_ratio", "gyro_bias"),
    ("road_grade", "lateral_load_transfer"),
    ("force_gain", "body_attitude"),
    ("speed_sensor_misalignment", "aligning_moment"),
)

# The first acts; a drive is asked for that tells it from the second.
RIVALS = (
    ("steer_lag", "tyre_relaxation"),
    ("aero_drag", "rolling_resistance"),
    ("steer_offset", "rear_toe"),
    ("yaw_inertia", "tyre_relaxation"),
    ("cg_position", "aligning_moment"),
    ("steer_ratio", "steer_compliance"),
    ("road_grade", "aero_drag"),
    ("aero_downforce", "tyre_load_sensitivity"),
)

OUTSIDE = (
    "rear tyre bump",
    "torque vectoring",
    "wing that opens",
    "crowned road",
    "braking moment",
    "cornering drag by temperature",
)

# What no force on the car can copy: they act on readings or on how readings come about.
KINEMATIC = (
    "road_bank",
    "road_grade",
    "sensor_delay",
    "speed_sensor_lever_arm",
    "speed_sensor_misalignment",
    "imu_lever_arm",
    "ins_lever_arm",
    "body_attitude",
    "body_roll",
    "accelerometer_bias",
    "gyro_scale",
    "gyro_bias",
    "accelerometer_scale",
)


@dataclass(frozen=True)
class Trial:
    """One car with something hidden in it, driven once and studied once.

    Attributes
    ----------
    kind : str
        One of `KINDS`.
    truth : tuple of str
        Ids of the hidden effects, or the name of one outside the catalogue.
    severity : float
        1 is the effects' typical size.
    driving, noise, vehicle : str
        One of `MANOEUVRES`, `NOISES`, `VEHICLES`.
    with_vy : bool
        Whether lateral speed is measured.
    repeat : int
        Counts trials that differ in nothing but their random numbers.
    course_mps2 : float
        Least lateral acceleration for which the validation course is made; usually that of the
        training data.
    """

    kind: Kind
    truth: tuple[str, ...]
    severity: float
    driving: str
    noise: str
    with_vy: bool
    vehicle: str
    repeat: int = 0
    course_mps2: float = 0.0

    @property
    def key(self) -> str:
        """Says which trial it is, in any order and any file."""
        what = "+".join(self.truth) or "-"
        sensor = "vy" if self.with_vy else "no vy"
        return (
            f"{self.kind}|{what}|{self.severity:g}|{self.driving}|{self.noise}|{sensor}"
            f"|{self.vehicle}|{self.repeat}"
            + (f"|course {self.course_mps2:g}" if self.course_mps2 else "")
        )

    @property
    def seed(self) -> int:
        """Seed of its own, the same in every selection of trials."""
        # Not hash(), which differs between processes.
        return int.from_bytes(self.key.encode(), "little") % (2**31 - 1)

    @property
    def removed(self) -> tuple[str, ...]:
        """Effects that are no candidates."""
        if self.kind == "itself removed":
            return self.truth
        if self.kind == "group removed":
            return (*self.truth, *(t for e in self.truth for t in sv.effect(e).confounded_with))
        if self.kind == "one removed":
            stays, goes = self.truth
            return (goes, *(e for e in sv.effect(goes).confounded_with if e != stays))
        return ()

    def to_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {**asdict(self), "truth": list(self.truth)}


def catalogue() -> tuple[sv.Effect, ...]:
    """Effects that are hidden, and looked for: none that is a candidate on request alone."""
    # Versions that are compared with this one may know no such effects.
    return tuple(e for e in sv.catalogue() if not getattr(e, "on_request", False))


def _truths() -> Iterator[tuple[Kind, tuple[str, ...], tuple[float, ...]]]:
    yield "null", (), (1.0,)
    for e in catalogue():
        yield "effect", (e.id,), SEVERITIES
        yield "itself removed", (e.id,), SEVERITIES
        yield "group removed", (e.id,), SEVERITIES
    for pair in PAIRS:
        yield "pair", pair, SEVERITIES
        yield "one removed", pair, SEVERITIES
        yield "one removed", (pair[1], pair[0]), SEVERITIES
    for rivals in RIVALS:
        yield "rivals", rivals, SEVERITIES
    for name in OUTSIDE:
        yield "outside", (name,), SEVERITIES


def full(repeats: int = 1, null_repeats: int = 25) -> tuple[Trial, ...]:
    """Every point of the grid.

    Parameters
    ----------
    repeats : int
        Of each point.
    null_repeats : int
        Of each point where nothing is hidden: 25 make 400 for each set of manoeuvres.
    """
    found = []
    for (kind, truth, severities), driving, noise, with_vy, vehicle in product(
        _truths(), MANOEUVRES, NOISES, (True, False), VEHICLES
    ):
        for severity in severities:
            for i in range(null_repeats if kind == "null" else repeats):
                found.append(Trial(kind, truth, severity, driving, noise, with_vy, vehicle, i))
    return tuple(found)


def stratified(
    trials: Sequence[Trial], each: dict[str, int], seed: int = 0, nominal: float = 0.5
) -> tuple[Trial, ...]:
    """Draw so many trials of each kind, its truths and severities in turn.

    Parameters
    ----------
    each : dict
        Trials by kind.
    nominal : float
        Share of the draws with nominal noise and measured lateral speed, on top of their own.
    """
    rng = np.random.default_rng(seed)
    chosen: list[Trial] = []
    for kind, count in each.items():
        cells: dict[tuple[object, ...], list[Trial]] = {}
        for t in trials:
            if t.kind == kind:
                # Where nothing is hidden the manoeuvre sets take the place of truths.
                what = t.driving if kind == "null" else t.truth
                cells.setdefault((what, t.severity), []).append(t)
        order = [cells[k] for k in sorted(cells, key=repr)]
        rng.shuffle(order)  # type: ignore[arg-type]
        for i in range(min(count, sum(map(len, order)))):
            cell = order[i % len(order)]
            easy = [t for t in cell if t.noise == "nominal" and t.with_vy]
            drawn = easy if easy and rng.random() < nominal else cell
            if drawn:
                trial = drawn[int(rng.integers(len(drawn)))]
                cell.remove(trial)
                chosen.append(trial)
    return tuple(chosen)


def small(seed: int = 0) -> tuple[Trial, ...]:
    """Few trials of every kind, cheap enough for continuous integration."""
    short = [t for t in full(null_repeats=1) if t.driving not in ("all", *ROADS)]
    counts = {"null": 4, "effect": 2, "pair": 1, "outside": 1, "group removed": 1}
    return stratified(short, counts, seed, nominal=1.0)
