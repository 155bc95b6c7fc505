"""Are tyres found under drive and brake force, and do the laboratory's quick intervals hold them?

    python benchmarks/closed_loop/combined_slip.py [--cars 6] [--seed 0]

Random cars weave under power and brakes, open loop, in equations that share nothing with the
package: Runge-Kutta of second order in quarters of a sample, a friction circle or none. Each log is
identified as the likelihood decides, and with combined slip left out. Quick intervals are those of
the information matrix; those that the fit itself calls bent count apart.
"""

from __future__ import annotations

import argparse
import math
import warnings
from dataclasses import dataclass

import numpy as np

from sysid_vehicle import Log, lab

STEP_S, PARTS, SAMPLES, PULLED_G = 0.01, 4, 2500, 0.25
SENSORS = {"vx_mps": 0.03, "vy_mps": 0.01, "yaw_rate_radps": 0.002, "ay_mps2": 0.03}
G = 9.80665


@dataclass
class Car:
    known: lab.GreyBoxVehicle
    tyres: list[tuple[float, float, float, float]]


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
    tyres = []
    for d, stiff in ((grip, slope), (1.1 * grip, 1.2 * slope)):
        c = rng.uniform(1.35, 1.55)
        tyres.append((stiff / (c * d), c, d, rng.uniform(-0.3, 0.5)))
    return Car(known, tyres)


def rates(car: Car, x: np.ndarray, steer: float, along: float, a_x: float, ellipse: float):
    of, (v_x, v_y, r) = car.known, x
    base, weight = of.lf_m + of.lr_m, of.mass_kg * G
    moved = of.mass_kg * a_x * of.cg_height_m / base
    share = of.brake_front_share if along < 0.0 else of.drive_front_share
    slips = (steer - math.atan2(v_y + of.lf_m * r, v_x), -math.atan2(v_y - of.lr_m * r, v_x))
    pulls = (along * share, along * (1.0 - share))
    loads = (weight * of.lr_m / base - moved, weight * of.lf_m / base + moved)
    front, rear = (
        load
        * d
        * math.sin(c * math.atan(b * s - e * (b * s - math.atan(b * s))))
        * math.sqrt(max(1.0 - ellipse * (pull / (d * load)) ** 2, 0.04))
        for s, pull, load, (b, c, d, e) in zip(slips, pulls, loads, car.tyres, strict=True)
    )
    ahead = pulls[0] * math.cos(steer) - front * math.sin(steer) + pulls[1]
    across = pulls[0] * math.sin(steer) + front * math.cos(steer)
    return np.array(
        [
            ahead / of.mass_kg + v_y * r,
            (across + rear) / of.mass_kg - v_x * r,
            (of.lf_m * across - of.lr_m * rear) / of.yaw_inertia_kgm2,
        ]
    )


def drive(car: Car, rng: np.random.Generator, ellipse: float, steered: float) -> Log | None:
    """The log, or none where the car is lost."""
    f, g = rng.uniform(0.15, 0.6, 2), rng.uniform(0.1, 0.4, 2)
    p, q = rng.uniform(0.0, 2.0 * math.pi, (2, 2))
    weight, x, a_x = car.known.mass_kg * G, np.array([22.0, 0.0, 0.0]), 0.0

    def inputs(t: float, v_x: float) -> tuple[float, float]:
        rise = min(t, 1.0) * (0.5 + 0.5 * t / (SAMPLES * STEP_S))
        pull = 0.7 * PULLED_G * np.sin(2.0 * math.pi * g * t + q).sum() + 0.1 * (22.0 - v_x)
        return (
            steered * rise * float(np.sin(2.0 * math.pi * f * t + p).sum()),
            weight * min(max(float(pull), -PULLED_G), PULLED_G),
        )

    rows, h = np.empty((SAMPLES, 7)), STEP_S / PARTS
    for k in range(SAMPLES):
        for part in range(PARTS):
            steer, along = inputs(k * STEP_S + part * h, x[0])
            slope = rates(car, x, steer, along, a_x, ellipse)
            a_x = slope[0] - x[1] * x[2]
            if part == 0:
                rows[k] = (steer, along, *x, a_x, slope[1] + x[0] * x[2])
            steer, along = inputs(k * STEP_S + (part + 0.5) * h, x[0])
            x = x + h * rates(car, x + 0.5 * h * slope, steer, along, a_x, ellipse)
        if x[0] < 8.0 or abs(x[1]) > 0.4 * x[0]:
            return None
    names = ("steer_rad", "fx_n", "vx_mps", "vy_mps", "yaw_rate_radps", "ax_mps2", "ay_mps2")
    columns = dict(zip(names, rows.T.copy(), strict=True))
    for name, std in SENSORS.items():
        columns[name] += std * rng.standard_normal(SAMPLES)
    return Log.from_arrays({"time_s": STEP_S * np.arange(SAMPLES), **columns}, name="weaving")


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
