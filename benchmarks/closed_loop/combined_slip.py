"""Are tyres found under drive and brake force, and do the laboratory's quick intervals hold them?

    python benchmarks/closed_loop/combined_slip.py [--cars 6] [--seed 0]

Random cars weave under power and brakes (`weaving_car.py`), with a friction circle or none. Each
log is identified as the likelihood decides, and with combined slip left out. Quick intervals are
those of the information matrix; those that the fit itself calls bent count apart.
"""

from __future__ import annotations

import argparse
import math
import warnings

import numpy as np
from weaving_car import Car, Tyre, Wave, weave

from sysid_vehicle import Log, lab


def draw(rng: np.random.Generator) -> Car:
    base, mass = rng.uniform(2.3, 3.2), rng.uniform(900.0, 2200.0)
    l_f = base * rng.uniform(0.42, 0.54)
    l_r = base - l_f
    known = lab.GreyBoxVehicle(
        mass,
        mass * l_f * l_r * rng.uniform(0.9, 1.1),
        l_f,
        l_r,
        cg_height_m=rng.uniform(0.4, 0.65),
        brake_front_share=rng.uniform(0.55, 0.7),
        drive_front_share=float(rng.integers(2)),
    )
    grip, slope = rng.uniform(0.85, 1.1), rng.uniform(13.0, 20.0)
    tyres: list[Tyre] = []
    for d, stiff in ((grip, slope), (1.1 * grip, 1.2 * slope)):
        c = rng.uniform(1.35, 1.55)
        tyres.append((stiff / (c * d), c, d, rng.uniform(-0.3, 0.5)))
    return Car(known, tyres)


def drive(car: Car, rng: np.random.Generator, ellipse: float, steered: float) -> Log | None:
    """The log of random waves, or none where the car is lost."""
    f, g = rng.uniform(0.15, 0.6, 2), rng.uniform(0.1, 0.4, 2)
    p, q = rng.uniform(0.0, 2.0 * math.pi, (2, 2))
    waves = [Wave(*wave) for wave in zip(f, g, p, q, strict=True)]
    return weave(car, waves, rng, ellipse=ellipse, steered=steered)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--cars", type=int, default=6)
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    warnings.simplefilter("ignore")
    rng = np.random.default_rng(args.seed)
    held: dict[str, list[bool]] = {"trusted": [], "bent": []}
    for number in range(args.cars):
        car = draw(rng)
        for ellipse in (1.0, 0.0):
            drives = (drive(car, rng, ellipse, s) for s in (0.06, 0.05, 0.04, 0.03, 0.02))
            log = next(found for found in drives if found is not None)
            logs = lab.TyreLog.from_log(log, car.known)
            print(f"car {number}, ellipse {ellipse:g}: {logs[0]}")
            for chosen in (None, False) if ellipse else (None,):
                fit = lab.identify_tyres(
                    car.known, logs, combined_slip=chosen, starts=4, profiles=False
                )
                told = [e.size for e in fit.estimates if "ellipse" in e.name]
                line = []
                for axle, (b, c, d, e) in zip(("front", "rear"), car.tyres, strict=True):
                    truth = dict(zip("BCDE", (b, c, d, e), strict=True)) | {"BCD": b * c * d}
                    for letter in ("D", "BCD"):
                        name = f"{letter}_{axle}"
                        off = 100.0 * (fit[name].value / truth[letter] - 1.0)
                        line.append(f"{name} {off:+.2f} %")
                    for letter, value in truth.items() if chosen is None else ():
                        name = f"{letter}_{axle}"
                        low, high = fit.interval(name)
                        skipped = name in (*fit.bent, *fit.undetermined)
                        held["bent" if skipped else "trusted"].append(low <= value <= high)
                way = "left out" if chosen is False else f"ellipse {told[0] if told else 'none'}"
                print(f"  {way}: {', '.join(line)}", flush=True)
    for kind, hits in held.items():
        print(f"intervals of B, C, D, E, BCD, {kind}: {sum(hits)} of {len(hits)} hold the truth")


if __name__ == "__main__":
    main()
