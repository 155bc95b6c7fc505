"""Does the diagnosis name what is physically in a car of fourteen degrees of freedom?

python benchmarks/twin/diagnosis_truth.py [HIDDEN ...] [--driving SET ...] [--seeds 1] [--first 0]
    [--keep FILE]

A single track with the workshop's numbers against driving of the built-in sports car: as it is, and
with drag, downforce, payload or a steering lag that the baseline does not know of. Three sets of
manoeuvres. A claim is right if what it names is in the car; it is an effect that was added and that
the verdicts do not take back as a proxy or as negligible. Below each study stands what became of
what is hidden, and what the final model gains where it is given by hand (`lost.py`): what does not
make driving that no fit saw likelier is not testable. With --keep, what was done is added to a
file, line by line, and not done again.
"""

import argparse
import json
import warnings
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from lost import MISSING, lost, testable
from scipy.stats import binomtest

import sysid_vehicle as sv
from sysid_vehicle import manoeuvres
from sysid_vehicle.twin import SPORTS_CAR, PointMass, on_manoeuvre, single_track, to_log

# What the built-in car always has and the baseline lacks, and where it is.
ALWAYS = {
    "accelerometer_scale": "the accelerometer leans with the body: a_y + g roll, roll about a_y",
    "aero_downforce": "lift areas of -0.3 m2 and -0.4 m2",
    "body_attitude": "the body rolls and pitches on its springs, and the accelerometer with it",
    "body_roll": "roll about a_y: 1.9 deg/g at 3.9 Hz about the centre of mass, damping ratio 0.36",
    "combined_slip": "one slip for both directions, up to one limit",
    "lateral_load_transfer": "four wheel loads, and tyres that lose grip per load with load",
    "rolling_resistance": "0.011 of each wheel's load",
    "tyre_load_sensitivity": "friction falls by 0.12 per nominal load, stiffness bends over",
    **dict.fromkeys(
        ("tyre_relaxation", "front_tyre_relaxation", "rear_tyre_relaxation"),
        "side force waits for the body to roll and the wheel loads to build up",
    ),
}


@dataclass(frozen=True)
class Hidden:
    """What the car has and the baseline does not know: what names it, and what comes with it."""

    named: set[str]
    values: dict[str, float] = field(default_factory=dict)
    payload_kg: float = 0.0
    lag_s: float = 0.0
    besides: set[str] = field(default_factory=set)


CASES = {
    "nothing": Hidden(set()),
    "drag": Hidden({"aero_drag"}, {"drag_area_m2": 1.35}),
    "downforce": Hidden(
        {"aero_downforce"}, {"front.lift_area_m2": -1.0, "rear.lift_area_m2": -1.4}
    ),
    # The payload lies higher than the car's centre of mass.
    "payload": Hidden(
        {"mass", "cg_position", "yaw_inertia"},
        payload_kg=200.0,
        besides={"longitudinal_load_transfer"},
    ),
    "steering lag": Hidden({"steer_lag"}, lag_s=0.06),
}
_COURSE, _LANES = (
    manoeuvres.handling_course(),
    manoeuvres.double_lane_change((20.0, 26.0, 31.0)),
)
# What is fitted, and what judges.
SETS = {
    "lap, course": ((manoeuvres.lap(),), (_COURSE,)),
    "lanes, lap": ((_LANES,), (manoeuvres.lap(lateral_mps2=8.0),)),
    "lap and lanes, course": ((manoeuvres.lap(), _LANES), (_COURSE,)),
}
Done = dict[str, Any]


@dataclass(frozen=True)
class Truth:
    """A car whose equations are known: what it always has, what may be hidden, how it is driven.

    `improved` takes the name of what is hidden, that of the driving, and a seed.
    """

    always: dict[str, str]
    cases: Mapping[str, Hidden]
    driving: tuple[str, ...]
    improved: Callable[[str, str, int], sv.Study]

    def in_car(self, name: str) -> set[str]:
        """All that a claim may name and be right."""
        return set(self.always) | self.cases[name].named | self.cases[name].besides


def improved(name: str, which: str, seed: int) -> sv.Study:
    """Improve the single track on the driving of a set that is fitted; the rest judges."""
    case = CASES[name]
    car = SPORTS_CAR.replace(case.values)
    load = car.design
    if case.payload_kg:
        load = load.with_masses([PointMass(case.payload_kg, -1.9, 0.0, 0.6)])
    fitted, judging = SETS[which]
    logs = [
        to_log(car, on_manoeuvre(car, load, m), seed=2 * seed + i, steer_lag_s=case.lag_s)
        for i, m in enumerate((*fitted, *judging))
    ]
    train, test = logs[: len(fitted)], logs[len(fitted) :]
    return sv.improve(sv.Model(single_track(SPORTS_CAR)), train, test, seed=seed)


def study(truth: Truth, name: str, which: str, seed: int) -> Done:
    """One study, and what it said."""
    done = truth.improved(name, which, seed)
    return {
        "hidden": name,
        "driving": which,
        "seed": seed,
        "verdict": done.verdict,
        "error": [done.test[0].error, done.test[-1].error],
        "added": [a.id for a in done.added],
        "sizes": {e.name: [e.value, e.std] for a in done.added for e in a.parameters},
        "verdicts": {
            v.effect.id: [v.finding, list(v.group)]
            for v in done.verdicts.all
            if v.finding not in ("absent", "not testable")
        },
        "lost": lost(done, truth.cases[name].named),
    }


def claims_of(done: Done) -> dict[str, list[str]]:
    """What is named, each with what it is said not to be told from."""
    found = done["verdicts"]
    return {n: found[n][1] for n in done["added"] if found[n][0] in MISSING}


def line_of(truth: Truth, done: Done) -> str:
    """One study: wrong claims in brackets, rivals behind a stroke, what was taken back behind -."""
    right = truth.in_car(done["hidden"])
    claims = claims_of(done)
    shown = [
        (n if n in right else f"[{n}]") + "".join(f"|{rival}" for rival in group)
        for n, group in claims.items()
    ]
    shown += [f"-{n}" for n in done["added"] if n not in claims]
    before, after = done["error"]
    return (
        f"{done['hidden']:13s} {done['driving']:12s} {done['seed']:3d} {done['verdict']:17s} "
        f"{before:6.2f} -> {after:5.2f}  " + ", ".join(shown)
    )


def lost_lines(done: Done) -> list[str]:
    """What became of each name of what is hidden, and what the driving shows of it."""
    found = []
    for name, what in done.get("lost", {}).items():
        gains = "the model fails with it"
        if "training" in what:
            sizes = zip(what["value"], what["std"], strict=True)
            gains = ", ".join(f"{v:.3g} +- {s:.2g}" for v, s in sizes)
            gains += f": {what['training']:.0f} nats, {what['validation']:.0f} on validation data"
            gains += f", own share {' and '.join(x or 'unknown' for x in what['own'])}"
        found.append(f"    {name}: {what['fate']}; by hand {gains}")
    return found


def told(text: str, outcomes: Iterable[bool]) -> None:
    """Print a share with its 95 % interval by Wilson's score."""
    each = list(outcomes)
    if not each:
        return
    low, high = binomtest(sum(each), len(each)).proportion_ci(method="wilson")
    print(
        f"{text:62s} {sum(each):3d} of {len(each):3d}  {100 * sum(each) / len(each):5.1f} %  "
        f"({100 * low:.0f} .. {100 * high:.0f} %)"
    )


def summary(truth: Truth, all_done: list[Done]) -> None:
    """Print what the studies come to."""
    claims = [(d, n, g) for d in all_done for n, g in claims_of(d).items()]
    sought = [d for d in all_done if truth.cases[d["hidden"]].named]

    def names(d: Done, with_rivals: bool) -> bool:
        said = set(claims_of(d))
        if with_rivals:
            said |= {rival for group in claims_of(d).values() for rival in group}
        return bool(said & truth.cases[d["hidden"]].named)

    told("claims that are in the car", (n in truth.in_car(d["hidden"]) for d, n, _ in claims))
    told(
        "the same, rivals that are said not to be told apart counted",
        (bool({n, *g} & truth.in_car(d["hidden"])) for d, n, g in claims),
    )
    told("hidden effects named", (names(d, False) for d in sought))
    told("the same, rivals counted", (names(d, True) for d in sought))
    told("hidden effects that are testable", (testable(d.get("lost", {})) for d in sought))
    told("  of these named", (names(d, False) for d in sought if testable(d.get("lost", {}))))
    for name in truth.cases:
        told(f"  {name}", (names(d, True) for d in sought if d["hidden"] == name))
    said = [(d, n) for d in all_done for n, (f, _) in d["verdicts"].items() if f in MISSING]
    told(
        "all that the verdicts call missing, added or not",
        (n in truth.in_car(d["hidden"]) for d, n in said),
    )
    told(
        "hidden effects among all that",
        (bool({n for e, n in said if e is d} & truth.cases[d["hidden"]].named) for d in sought),
    )
    told(
        "of those not named: called unknown or partly explained",
        (
            d["verdict"] in ("unknown", "partly_explained")
            for d in sought
            if not names(d, with_rivals=True)
        ),
    )


def run(truth: Truth, says: str) -> None:
    """Do the studies that the command line asks for, and print them."""
    parser = argparse.ArgumentParser(description=says.split("\n")[0])
    parser.add_argument("hidden", nargs="*", metavar="HIDDEN", help=f"of {', '.join(truth.cases)}")
    parser.add_argument("--driving", nargs="*", metavar="SET", help=" | ".join(truth.driving))
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--first", type=int, default=0, help="seed")
    parser.add_argument("--keep", type=Path, help="file of what was done")
    args = parser.parse_args()
    warnings.simplefilter("ignore", sv.SysidWarning)
    kept: list[Done] = []
    if args.keep is not None and args.keep.exists():
        kept = [json.loads(line) for line in args.keep.read_text(encoding="utf-8").splitlines()]
    before = {(d["hidden"], d["driving"], d["seed"]): d for d in kept}
    print("always in the car:")
    for effect, where in truth.always.items():
        print(f"  {effect:22s} {where}")
    all_done = []
    for seed in range(args.first, args.first + args.seeds):
        for name in args.hidden or truth.cases:
            for which in args.driving or truth.driving:
                done = before.get((name, which, seed)) or study(truth, name, which, seed)
                if args.keep is not None and (name, which, seed) not in before:
                    with args.keep.open("a", encoding="utf-8") as file:
                        file.write(json.dumps(done) + "\n")
                all_done.append(done)
                print("\n".join([line_of(truth, done), *lost_lines(done)]), flush=True)
    summary(truth, all_done)


if __name__ == "__main__":
    run(Truth(ALWAYS, CASES, tuple(SETS), improved), __doc__)
