"""Is an identified parameter off by as much as the bias report says, when an effect is hidden?

    python benchmarks/finding_effects/bias.py [EFFECT ...] [--seed N] [--cars N] [--drives NAME ...]

Cars are drawn at random and driven without any effect; the report is made of that fit. Then each
effect is hidden in the car, with other noise and a driver who meets it as he can, and the baseline
is identified from tyres that are not the car's. What its cornering stiffness is off by then, as
the mean of some drives, is held against the report: met if the difference is below a fifth of it,
or one percent.
"""

from __future__ import annotations

import argparse
import time
import warnings
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress

import numpy as np
import numpy.typing as npt

import sysid_vehicle as sv
from sysid_vehicle.diagnose import Bias
from sysid_vehicle.simulate import drive_truth

DRIVES: dict[str, Callable[[float], sv.manoeuvres.Manoeuvre]] = {
    "lap": lambda most: sv.manoeuvres.lap(40.0, most),
    "course": lambda most: sv.manoeuvres.handling_course(40.0, most),
    "steps": lambda most: sv.manoeuvres.step_steer((17.0, 27.0), (0.4 * most, 0.7 * most)),
    "ramp": lambda most: sv.manoeuvres.ramp_steer((18.0, 27.0), most, 4.0),
    "sweep": lambda most: sv.manoeuvres.sine_sweep(25.0, 40.0, 0.5 * most),
    "lane changes": lambda most: sv.manoeuvres.double_lane_change(),
}
AXLES = ("front", "rear")
NAMES = ("stiffness_front", "stiffness_rear", "yaw_inertia_kgm2")
Array = npt.NDArray[np.float64]
NEAR, SHARE = 0.01, 0.2
RATE_HZ = 50.0
SLIDES_RAD = 0.12
OTHER = {
    "tyre_front": sv.Tyre(B=9.0, C=1.3, D=0.9, E=0.0),
    "tyre_rear": sv.Tyre(B=11.0, C=1.5, D=1.1, E=-0.2),
}


def drawn_car(rng: np.random.Generator, number: int) -> sv.Vehicle:
    """A car from a small hatchback to a large saloon; of every other one the inertia is unknown."""
    mass, wheelbase = rng.uniform(1000.0, 1900.0), rng.uniform(2.4, 3.0)
    front = wheelbase * rng.uniform(0.40, 0.52)
    track = rng.uniform(1.4, 1.6)

    def tyre(stiffer: float) -> sv.Tyre:
        return sv.Tyre(
            B=stiffer * rng.uniform(8.5, 11.5),
            C=rng.uniform(1.25, 1.55),
            D=rng.uniform(0.95, 1.1),
            E=rng.uniform(-0.4, 0.2),
        )

    return sv.Vehicle(
        name=f"drawn {number}",
        mass_kg=mass,
        yaw_inertia_kgm2=mass * front * (wheelbase - front) * rng.uniform(0.9, 1.1),
        lf_m=front,
        lr_m=wheelbase - front,
        cg_height_m=rng.uniform(0.45, 0.6),
        track_front_m=track,
        track_rear_m=track,
        drag_area_m2=rng.uniform(0.5, 0.8),
        brake_front_share=rng.uniform(0.6, 0.72),
        drive_front_share=float(rng.integers(2)),
        tyre_front=tyre(1.0),
        tyre_rear=tyre(1.2),
    )


def told(model: sv.Model) -> Array:
    """Logarithms of B C D of both axles and of the yaw inertia."""
    stiffness = [np.prod([model.value(f"{x}_{a}") for x in "BCD"]) for a in AXLES]
    return np.log([*stiffness, model.value("yaw_inertia_kgm2")])


def identified(
    truth: sv.Model, start: sv.Model, drive: sv.manoeuvres.Manoeuvre, seed: int
) -> Array:
    """What the baseline takes from driving the true car."""
    log = sv.drive(truth, drive, seed=seed, rate_hz=RATE_HZ)
    return told(sv.identify(start, log, starts=4, seed=seed, workers=1).model)


def hardest(truth: sv.Model, name: str) -> sv.manoeuvres.Manoeuvre:
    """The drive, as hard as the car can be driven without sliding."""
    for most in (7.5, 6.5, 5.5, 4.5, 3.5):
        drive = DRIVES[name](most)
        with suppress(sv.SysidError):
            v_x, v_y, _ = drive_truth(truth, drive, seed=0, rate_hz=RATE_HZ).states.T
            if np.abs(np.arctan2(v_y, v_x)).max() < SLIDES_RAD:
                return drive
    raise SystemExit(f"{truth.vehicle.name} spins in each {name}")


def hidden(truth: sv.Model, bias: Bias) -> sv.Model:
    """The car with the effect as large as the report has it."""
    sizes = zip(bias.effect.parameters, bias.size, strict=True)
    values = {f"{bias.effect.id}.{p.name}": p.null_value + v for p, v in sizes}
    return truth.add(bias.effect).with_values(values)


def judge(truth: sv.Model, start: sv.Model, name: str, args: argparse.Namespace) -> list[bool]:
    """Compare one car on one drive; one verdict for each figure that is stated."""
    drive = hardest(truth, name)
    seeds = [args.seed + 1 + i for i in range(args.repeats)]
    log = sv.drive(truth, drive, seed=args.seed + 1000, rate_hz=RATE_HZ)
    fit = sv.identify(start, log, starts=4, workers=1)
    began = time.process_time()
    report = sv.bias_report(fit, args.effects or None)
    print(
        f"{truth.vehicle.name}, {drive.name}: {fit.driving.usable_s:.0f} s, "
        f"the report took {time.process_time() - began:.0f} s of one processor"
    )
    without = [identified(truth, start, drive, seed) for seed in seeds]

    def compared(b: Bias) -> Array | str:
        try:
            each = [
                identified(hidden(truth, b), start, drive, seed) - w
                for seed, w in zip(seeds, without, strict=True)
            ]
        except sv.SysidError as failure:
            return str(failure)
        return np.asarray(np.expm1(np.mean(each, axis=0)), dtype=float)

    stated = [b for b in report.biases if not b.because]
    for b in report.biases:
        if b.because:
            print(f"  {b.effect.id:<26} not stated: {b.because}")
    with ThreadPoolExecutor(2) as pool:
        found = list(pool.map(compared, stated))
    met: list[bool] = []
    for b, actual in zip(stated, found, strict=True):
        if isinstance(actual, str):
            print(f"  {b.effect.id:<26} no drive to compare with: {actual}")
            continue
        names = [n for n in NAMES if n in b.relative]
        claimed = np.array([b.relative[n] for n in names])
        actual = actual[: len(names)]
        good = np.abs(claimed - actual) <= np.maximum(SHARE * np.abs(actual), NEAR)
        met += good.tolist()
        pairs = "   ".join(
            f"{100.0 * c:+6.1f} / {100.0 * a:+6.1f} %" for c, a in zip(claimed, actual, strict=True)
        )
        print(f"  {b.effect.id:<26} {pairs}{'' if good.all() else '   MISSED'}", flush=True)
    print(f"  {sum(met)} of {len(met)} figures met", flush=True)
    return met


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("effects", nargs="*", metavar="EFFECT", help="all if left out")
    parser.add_argument("--seed", type=int, default=0, help="of the cars and of all noise")
    parser.add_argument("--cars", type=int, default=2)
    parser.add_argument("--repeats", type=int, default=2, help="refits to compare with")
    parser.add_argument("--drives", nargs="+", choices=DRIVES, default=list(DRIVES)[:3])
    args = parser.parse_args()
    warnings.simplefilter("ignore", sv.SysidWarning)
    print("claimed / actual on front stiffness, rear stiffness, and yaw inertia if it is unknown")
    rng = np.random.default_rng(args.seed)
    met = []
    for number in range(args.cars):
        car = drawn_car(rng, number + 1)
        known = {} if number % 2 == 0 else {"yaw_inertia_kgm2": None}
        start = sv.Model(car.replace(**OTHER, **known))
        for name in args.drives:
            met += judge(sv.Model(car), start, name, args)
    print(
        f"{sum(met)} of {len(met)} figures ({100.0 * np.mean(met):.1f} %) are within a fifth of "
        "the bias, or one percent"
    )


if __name__ == "__main__":
    main()
