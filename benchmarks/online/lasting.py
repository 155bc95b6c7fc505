"""Errors that last: the band of the sideslip observer with one thing at a time that it is not told.

Run: python benchmarks/online/lasting.py [--cars 4] [--seed 456971] [--json FILE]

Cars are those of `fleet.draw_car`, with generic tyres in the vehicle file; each drives the three
drives of `fleet.py` in the single track with one effect of the catalogue at its typical size (a
bank also at 0.02 rad), every other car to the other side.
"""

import argparse
import json
import sys
from pathlib import Path

import fleet
import numpy as np

import sysid_vehicle as sv
from sysid_vehicle.errors import SysidError
from sysid_vehicle.online import SideslipRun, estimate_sideslip

ROWS: dict[str, dict[str, float]] = {
    "nothing": {},
    "steering offset": {"steer_offset.offset_rad": 0.006},
    "bias of a_y": {"accelerometer_bias.ay_mps2": 0.25},
    "bias of the gyro": {"gyro_bias.bias_radps": 0.006},
    "steady wind": {"side_wind.side_force_n": 450.0, "side_wind.yaw_moment_nm": 250.0},
    "gusts of 2 s": {},
    "a third of that": {"side_wind.side_force_n": 150.0, "side_wind.yaw_moment_nm": 83.0},
    "rear toe": {"rear_toe.toe_rad": 0.004},
    "bank": {"road_bank.bank_rad": 0.02},
    "bank of 0.05 rad": {"road_bank.bank_rad": 0.05},
}


GUSTS = sv.RoadDisturbance(fy_n=200.0, mz_nm=120.0, correlation_time_s=2.0)


def logs_of(car: fleet.Car, key: list[int], row: str, turned: float) -> list[sv.Log]:
    """The drives of a car with a row's effect, which acts to the left or the right."""
    values, disturbance = ROWS[row], GUSTS if row.startswith("gusts") else None
    model = sv.Model(car.vehicle())
    for effect in dict.fromkeys(name.split(".")[0] for name in values):
        model = model.add(effect)
    model = model.with_values({name: turned * value for name, value in values.items()})
    logs = []
    for j, manoeuvre in enumerate(car.drives()):
        try:
            rng = np.random.default_rng([*key, j])
            noise = fleet.sensors_of(car)
            logs.append(sv.drive(model, manoeuvre, seed=rng, noise=noise, disturbance=disturbance))
        except SysidError:  # the driver loses the car
            continue
    return logs


def told(name: str, runs: list[SideslipRun]) -> dict[str, object]:
    errors = [run.error() for run in runs]
    rms = float(np.sqrt(np.mean([e.rms_deg**2 for e in errors])))
    width = float(np.degrees(np.mean([2.0 * np.mean(run.beta_std_rad) for run in runs])))
    held = 100.0 * float(np.mean([e.covered for e in errors]))
    print(f"{name:30s} {len(runs):3d} {rms:7.3f} {width:7.3f} {held:5.0f} %", flush=True)
    return {"row": name, "drives": len(runs), "rms_deg": rms, "width_deg": width, "held": held}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--cars", type=int, default=4)
    parser.add_argument("--seed", type=int, default=456971)
    parser.add_argument("--rows", help="some of the rows, divided by commas")
    parser.add_argument("--json", type=Path)
    args = parser.parse_args()
    cars = [fleet.draw_car(np.random.default_rng([args.seed, i])) for i in range(args.cars)]
    rows = []
    print(f"{'what it is not told':30s} {'n':>3s} {'rms':>7s} {'2 sigma':>7s} {'held':>5s}")
    for name in args.rows.split(",") if args.rows else ROWS:
        runs = []
        for i, car in enumerate(cars):
            generic = fleet.generic(car.vehicle())
            turned = 1.0 if i % 2 == 0 else -1.0
            for log in logs_of(car, [args.seed, i], name, turned):
                runs.append(estimate_sideslip(generic, log))
        rows.append(told(name, runs))
    if args.json:
        args.json.write_text(json.dumps(rows, indent=1))
    return 0


if __name__ == "__main__":
    sys.exit(main())
