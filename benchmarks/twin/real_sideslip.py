"""Sideslip of a real car by a twin of it: Ferrari 250 LM, Revs Program (Stanford), 100 Hz.

python benchmarks/twin/real_sideslip.py FOLDER [--trials 40]

FOLDER holds `revs_250lm_20140222_run1.csv`. The car's torques were not recorded: what the wheels
give is made of the measured longitudinal acceleration. The tyres are looked for on the first 180 s
of the run by how well lateral acceleration and yaw rate are predicted, never by the sideslip; they
are then held on the rest, where the measured sideslip judges them. Beside the twin stand the
sideslip filters of `online`, which look for their tyres as they go.
"""

import argparse
import warnings
from pathlib import Path

import numpy as np

import sysid_vehicle as sv
from sysid_vehicle.online import estimate_sideslip
from sysid_vehicle.twin import (
    INPUTS,
    READINGS,
    BayesianSearch,
    Box,
    Load,
    Observer,
    Readings,
    StateGain,
    TwinCar,
    calibrate,
    observe,
)

CARS = Path(__file__).resolve().parent.parent / "real_driving"
CAR = sv.Vehicle.from_toml(CARS / "revs_250lm.vehicle.toml")
LOAD = Load(CAR.mass_kg, 260.0, 1350.0, 1500.0, -CAR.lf_m, 0.0, CAR.cg_height_m)
RADIUS_M = 0.33
DT = 1e-3
TRAIN_S = 180.0
MOVING_MPS = 8.0
YAW_PS = {"fitting": 10.0, "observing": 30.0}  # gain of the yaw rate: weak, so that tyres show
BOX = Box({"front": (8.0, 40.0), "rear": (8.0, 40.0), "friction": (0.9, 1.6)})


def car(g: dict[str, float]) -> TwinCar:
    """The car as far as it is known, with tyres that are looked for."""
    return TwinCar(
        LOAD,
        {
            "wheelbase_m": CAR.lf_m + CAR.lr_m,
            "drag_area_m2": CAR.drag_area_m2,
            "both.track_m": CAR.track_front_m,
            "both.unsprung_kg": 30.0,
            "both.radius_m": RADIUS_M,
            "both.spring_npm": 30000.0,
            "both.anti_roll_npm": 8000.0,
            "both.tyre.nominal_load_n": 2400.0,
            "both.tyre.friction_x": g["friction"],
            "both.tyre.friction_y": g["friction"],
            "both.tyre.load_at_peak_stiffness": 2.0,
            "front.tyre.cornering_stiffness": g["front"],
            "rear.tyre.cornering_stiffness": g["rear"],
        },
        CAR.name,
    )


def read(log: sv.Log) -> tuple[np.ndarray, Readings]:
    """Inputs and readings every millisecond."""
    time_s = log["time_s"] - log["time_s"][0]
    fine = np.arange(0.0, time_s[-1], DT)

    def at(name: str) -> np.ndarray:
        return np.interp(fine, time_s, log[name])

    drag = 0.5 * CAR.air_density_kgpm3 * CAR.drag_area_m2 * at("vx_mps") ** 2
    pull = CAR.mass_kg * (at("ax_mps2") + 0.011 * 9.81) + drag
    torque = 0.5 * RADIUS_M * pull
    inputs = np.zeros((len(fine), len(INPUTS)))
    inputs[:, :2] = at("steer_rad")[:, None]
    inputs[:, 4:6] = np.maximum(torque, 0.0)[:, None]
    inputs[:, 6:8] = CAR.brake_front_share * np.maximum(-torque, 0.0)[:, None]
    inputs[:, 8:10] = (1.0 - CAR.brake_front_share) * np.maximum(-torque, 0.0)[:, None]
    values = np.full((len(fine), len(READINGS)), np.nan)
    for name in ("ay_mps2", "yaw_rate_radps", "vx_mps"):
        values[:, READINGS.index(name)] = at(name)
    noise = {"ay_mps2": 0.5, "yaw_rate_radps": 0.01, "vx_mps": 0.05}
    return inputs, Readings(values, noise, DT)


def run(
    g: dict[str, float], inputs: np.ndarray, readings: Readings, yaw: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Sideslip, lateral acceleration and yaw rate of the twin every 10 ms."""
    gains = [
        StateGain("vx_mps", "vx_mps", 20.0),
        StateGain("yaw_rate_radps", "yaw_rate_radps", yaw),
    ]
    for w in ("fl", "fr", "rl", "rr"):
        # Wheel speeds were not measured: the wheels follow the speed of the car.
        gains.append(StateGain("vx_mps", f"wheel_speed_{w}_radps", 20.0 / RADIUS_M))
    seen = observe(car(g), LOAD, inputs, readings, Observer(gains=gains)).outputs
    return seen["sideslip_rad"], seen["ay_mps2"], seen["yaw_rate_radps"]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--trials", type=int, default=30)
    args = parser.parse_args()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sv.SysidWarning)  # spikes in the steering, taken out
        log = sv.read_log(
            args.folder / "revs_250lm_20140222_run1.csv", CARS / "revs_250lm.channels.toml"
        )
    inputs, readings = read(log)
    n = round(TRAIN_S / DT)
    train = Readings(readings.values[:n], readings.noise, DT)

    def cost(g: dict[str, float]) -> float:
        _, ay, r = run(g, inputs[:n], train, YAW_PS["fitting"])
        off_ay = ay - train["ay_mps2"][::10]
        off_r = (r - train["yaw_rate_radps"][::10]) * 20.0
        return float(np.mean(off_ay**2) + np.mean(off_r**2))

    search = BayesianSearch(len(BOX.ranges), first=12, seed=0)
    found = calibrate(cost, BOX, trials=args.trials, optimiser=search)
    print(found)
    # Each is run over the whole drive: the filters learn as they go.
    time_s = log["time_s"] - log["time_s"][0]
    mine = run(found.gains, inputs, readings, YAW_PS["observing"])[0]
    true = np.arctan2(log["vy_mps"], log["vx_mps"])
    estimates = {"twin": np.interp(time_s, np.arange(len(mine)) * 10.0 * DT, mine)}
    for kind, name in (("dual", "dual UKF"), ("linear-ukf", "UKF, linear tyres")):
        estimates[name] = estimate_sideslip(CAR, log, kind=kind, judge=False).beta_rad
    judged = {
        f"after {TRAIN_S:.0f} s, above {MOVING_MPS:g} m/s": (time_s > TRAIN_S)
        & (log["vx_mps"] > MOVING_MPS),
        "all of the run": np.full(log.n, True),
    }
    for where, part in judged.items():
        of = np.degrees(np.std(true[part]))
        print(f"{where}: {part.sum() / log.rate_hz:.0f} s, rms of the sideslip {of:.2f} deg")
        for name, beta in estimates.items():
            error = np.degrees(beta - true)[part]
            print(
                f"  {name:20s} rms {np.sqrt(np.mean(error**2)):.3f} deg, "
                f"mean {np.mean(error):+.3f}, worst {np.abs(error).max():.2f}"
            )


if __name__ == "__main__":
    main()
