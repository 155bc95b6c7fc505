"""Cars that nobody has seen, driven before and after one change, two, or none."""

from __future__ import annotations

from copy import deepcopy
from dataclasses import dataclass, field, replace

import numpy as np

import sysid_vehicle as sv

KINDS = (
    "nothing",
    "grip",
    "friction",
    "front stiffness",
    "rear stiffness",
    "mass",
    "cg",
    "downforce",
    "drag",
    "relaxation",
    "steer ratio",
    "two",
)
"""What may change: `grip` is all side force of both axles, `friction` what they reach at most."""

ASKED = (*KINDS, "steering delay", "yaw inertia")
"""With those that are not drawn, but made where they are asked for."""

ROADS = ("road", "hills")
"""Every day's roads, a motorway, a country road and a town in each set; with slopes."""

DRIVING = ("lap", "handling", "sweep", "ramp", "step", *ROADS)

_RATE_HZ = 50.0
_SECONDS = 40.0
_SWEEP_S = 25.0
_ROAD_S = 40.0  # of each road
_KINDS_OF_ROADS: tuple[sv.manoeuvres.RoadKind, ...] = ("motorway", "country", "town")
_SLOPE_RAD = 0.015  # standard deviation of grade and of crossfall, on hills
_EASIER = (1.0, 0.85, 0.7, 0.55, 0.4)
_SHARES = {"limit": 0.88, "gentle": 0.45}  # of what the tyres give
_LACKING = ("", "", "body_attitude", "tyre_relaxation", "lateral_load_transfer", "steer_compliance")

Names = dict[str, float]
Drives = tuple[sv.Log, ...]


@dataclass(frozen=True)
class Truth:
    """What changed in one respect.

    Attributes
    ----------
    effects : tuple of str
        Ids that are right names; any one of them.
    name : str
        The parameter whose interval is judged, `stiffness` of tyres; empty for none.
    size : float
    """

    effects: tuple[str, ...]
    name: str
    size: float


@dataclass
class Pair:
    """Two sets of drives of a car, and what is between them.

    Attributes
    ----------
    alone : list of drives
        The second set after each of two changes without the other one, where they are asked for.
    """

    kind: str
    driving: str
    lacks: str
    road: bool
    truths: list[Truth]
    baseline: sv.Model
    before: Drives
    after: Drives
    alone: list[Drives] = field(default_factory=list)


def drawn(
    seed: int,
    number: int,
    kind: str = "",
    driving: str = "",
    *,
    apart: bool = False,
    with_vy: bool = True,
) -> Pair:
    """Pair `number` of a seed, of a kind and in driving that are drawn where none is given."""
    rng = np.random.default_rng([seed, number])
    drew = str(rng.choice(KINDS))
    kind = kind or drew
    car, baseline, lacks = _car(rng, kind)
    truths: list[Truth] = []
    changed = car
    order = rng.permutation([k for k in KINDS if k not in ("nothing", "two")])
    several = [k for k in order if k != "downforce"]  # of cars that have some
    first = [str(several[0])]
    others = [str(k) for k in several[1:] if not {first[0], str(k)} <= {"grip", "friction"}]
    todo = [*first, others[0]] if kind == "two" else [kind]
    singles: list[sv.Model] = []
    for what in todo:
        singles.append(_changed(car, what, deepcopy(rng), []))
        changed = _changed(changed, what, rng, truths)
    name = str(rng.choice(list(_SHARES)))
    road = bool(rng.random() < 0.5)
    courses = [str(rng.choice(("lap", "handling"))) for _ in range(2)]
    if rng.random() < 0.4:
        courses[1] = courses[0]
    if driving:
        courses = [driving, driving]
    noise = sv.SensorNoise().scaled(float(rng.choice((0.7, 1.0, 1.5))))
    seeds = [int(s) for s in rng.integers(2**31, size=2)]

    def driven(model: sv.Model, course: str, seed: int) -> Drives:
        several = [(course, seed)]
        if course in ROADS:
            several = [(f"{course} {of}", seed + i) for i, of in enumerate(_KINDS_OF_ROADS)]
        mps2 = _SHARES[name] * _limit(model)
        logs = (_driven(model, one, mps2, road, noise, s) for one, s in several)
        return tuple(log if with_vy else log.without("vy_mps") for log in logs)

    sets = [driven(m, c, s) for m, c, s in zip((car, changed), courses, seeds, strict=True)]
    alone = [driven(m, courses[1], seeds[1]) for m in (singles if apart else []) if len(todo) > 1]
    told = driving if driving in ROADS else f"{name} {'-'.join(courses)}"
    told += "" if with_vy else " no vy"
    return Pair(kind, told, lacks, road, truths, baseline, *sets, alone)


def _car(rng: np.random.Generator, kind: str) -> tuple[sv.Model, sv.Model, str]:
    """The true car, the model that is fitted to it, and what that lacks."""
    base = rng.uniform(2.3, 3.1)
    lf = base * rng.uniform(0.43, 0.54)
    mass = rng.uniform(900.0, 2200.0)
    vehicle = sv.Vehicle(
        name="drawn",
        mass_kg=mass,
        yaw_inertia_kgm2=mass * lf * (base - lf) * rng.uniform(0.85, 1.1),
        lf_m=lf,
        lr_m=base - lf,
        cg_height_m=rng.uniform(0.45, 0.65),
        track_front_m=rng.uniform(1.45, 1.65),
        track_rear_m=rng.uniform(1.45, 1.65),
        drag_area_m2=rng.uniform(0.55, 0.9),
        brake_front_share=rng.uniform(0.6, 0.72),
        drive_front_share=float(rng.choice((0.0, 0.4, 1.0))),
        tyre_front=sv.Tyre(*_tyre(rng, 8.0, 12.0)),
        tyre_rear=sv.Tyre(*_tyre(rng, 10.0, 15.0)),
    )
    vague = vehicle.replace(
        tyre_front=sv.Tyre(B=10.0, C=1.4, D=1.0, E=0.0),
        tyre_rear=sv.Tyre(B=12.0, C=1.4, D=1.0, E=0.0),
    )
    car, model = sv.Model(vehicle), sv.Model(vague)
    lacks = str(rng.choice(_LACKING))
    told = bool(rng.random() < 0.5)
    own: dict[str, Names] = {}
    if kind == "downforce":
        low, high = rng.uniform(0.8, 1.6), rng.uniform(0.8, 1.8)
        own["aero_downforce"] = {"cl_a_front_m2": low, "cl_a_rear_m2": high}
    if kind == "relaxation":
        own["tyre_relaxation"] = {"relaxation_length_m": rng.uniform(0.25, 0.5)}
    if lacks and lacks not in own:
        e = sv.effect(lacks)
        own[lacks] = {p.name: p.null_value + (p.typical - p.null_value) for p in e.parameters}
    for effect, values in own.items():
        car = car.add(effect).with_values({f"{effect}.{n}": v for n, v in values.items()})
        if effect != lacks and told:
            model = model.add(effect)
    return car, model, lacks


def _tyre(rng: np.random.Generator, low: float, high: float) -> tuple[float, float, float, float]:
    return (
        rng.uniform(low, high),
        rng.uniform(1.3, 1.55),
        rng.uniform(0.9, 1.15),
        rng.uniform(-0.4, 0.2),
    )


def _limit(model: sv.Model) -> float:
    return 9.81 * min(model.value("D_front"), model.value("D_rear"))


def _changed(car: sv.Model, what: str, rng: np.random.Generator, truths: list[Truth]) -> sv.Model:
    """The car with one change more."""

    def scaled(factors: Names) -> sv.Model:
        return car.with_values({n: f * car.value(n) for n, f in factors.items()})

    def shifted(name: str, by: float, *right: str) -> sv.Model:
        effect = name.split(".")[0]
        model = car if effect in car.effects else car.add(effect)
        truths.append(Truth((effect, *right), name.split(".")[1], by))
        return model.with_values({name: model.value(name) + by})

    sign = float(rng.choice((-1.0, 1.0)))
    if what in ("grip", "friction"):
        f = 1.0 - rng.uniform(0.15, 0.4)
        # Each direction of tyres of both axles may be told by any two changes that span it.
        truths.append(Truth(("friction_both_axles",), "relative_error", f - 1.0))
        names = {"D_front": f, "D_rear": f}
        if what == "friction":
            return scaled(names | {"B_front": 1.0 / f, "B_rear": 1.0 / f})
        truths.append(Truth(("stiffness_both_axles",), "relative_error", f - 1.0))
        return scaled(names)
    if what.endswith("stiffness"):
        axle, by = what.split()[0], sign * rng.uniform(0.10, 0.25)
        truths.append(Truth((f"tyre_{axle}",), "stiffness", by))
        return scaled({f"B_{axle}": 1.0 + by})
    if what == "mass":
        return shifted("mass.relative_error", rng.uniform(0.08, 0.2))
    if what == "cg":
        return shifted("cg_position.shift_rearward_m", sign * rng.uniform(0.05, 0.12))
    if what == "downforce":
        names = ("aero_downforce.cl_a_front_m2", "aero_downforce.cl_a_rear_m2")
        truths.append(Truth(("aero_downforce",), "", 0.0))
        return scaled(dict.fromkeys(names, 0.5))
    if what == "drag":
        return shifted("aero_drag.drag_area_m2", rng.uniform(0.15, 0.4))
    if what == "relaxation":
        name = "tyre_relaxation.relaxation_length_m"
        model = car if "tyre_relaxation" in car.effects else car.add("tyre_relaxation")
        by = max(model.value(name), 0.3)
        like = ("front_tyre_relaxation", "rear_tyre_relaxation")
        truths.append(Truth(("tyre_relaxation", *like), "relaxation_length_m", by))
        return model.with_values({name: model.value(name) + by})
    if what == "steer ratio":
        return shifted("steer_ratio.ratio_error", 0.03 * sign)
    if what == "steering delay":
        return shifted("steer_delay.delay_s", rng.uniform(0.03, 0.07))
    if what == "yaw inertia":
        return shifted("yaw_inertia.relative_error", sign * rng.uniform(0.15, 0.3))
    return car


def _driven(
    model: sv.Model, course: str, mps2: float, road: bool, noise: sv.SensorNoise, seed: int
) -> sv.Log:
    """A course, more easily where the car is lost."""
    pushes = sv.RoadDisturbance()
    if road:
        pushes = sv.RoadDisturbance(fx_n=120.0, fy_n=150.0, mz_nm=150.0, correlation_time_s=0.3)
    of, _, kind = course.partition(" ")
    if of == "hills":
        pushes = replace(pushes, slope_rad=_SLOPE_RAD)
    made = {
        **dict.fromkeys(ROADS, lambda _: sv.manoeuvres.usual_road(kind, _ROAD_S, seed)),
        "lap": lambda a: sv.manoeuvres.lap(_SECONDS, lateral_mps2=a),
        "handling": lambda a: sv.manoeuvres.handling_course(_SECONDS, lateral_mps2=a),
        "sweep": lambda a: sv.manoeuvres.sine_sweep(_SWEEP_S, lateral_mps2=a),
        "ramp": lambda a: sv.manoeuvres.ramp_steer(lateral_mps2=a, rise_s=4.0),
        "step": lambda a: sv.manoeuvres.step_steer((17.0, 27.0), (0.5 * a, a)),
    }[of]
    for ease in _EASIER:
        try:
            return sv.drive(
                model,
                made(ease * mps2),
                seed=seed,
                noise=noise,
                disturbance=pushes,
                rate_hz=_RATE_HZ,
            )
        except (sv.NumericalError, sv.InvalidInput):
            if ease == _EASIER[-1]:
                raise
    raise AssertionError("unreachable")
