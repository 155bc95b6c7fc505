"""Sideslip of a real car by a twin of it: Ferrari 250 LM, Revs Program (Stanford), 100 Hz.

python benchmarks/twin/real_sideslip.py FOLDER [--trials 40]

FOLDER holds `revs_250lm_20140222_run1.csv`. The car's torques were not recorded: what the wheels
give is made of the measured longitudinal acceleration. The tyres are looked for on the first 180 s
of the run by how well lateral acceleration and yaw rate are predicted, never by the sideslip; they
are then held on the rest, where the measured sideslip judges them.
"""

import argparse
import csv
from pathlib import Path

import numpy as np

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

MASS, LF, LR, HEIGHT, DRAG = 982.0, 1.33, 1.07, 0.45, 0.55
LOAD = Load(MASS, 260.0, 1350.0, 1500.0, -LF, 0.0, HEIGHT)
DT = 1e-3
TRAIN_S = 180.0
YAW_PS = {"fitting": 10.0, "observing": 30.0}  # gain of the yaw rate: weak, so that tyres show
BOX = Box({"front": (8.0, 40.0), "rear": (8.0, 40.0), "friction": (0.9, 1.6)})


def car(g: dict[str, float]) -> TwinCar:
    """The car as far as it is known, with tyres that are looked for."""
    return TwinCar(
        LOAD,
        {
            "wheelbase_m": LF + LR,
            "drag_area_m2": DRAG,
            "both.track_m": 1.35,
            "both.unsprung_kg": 30.0,
            "both.radius_m": 0.33,
            "both.spring_npm": 30000.0,
            "both.anti_roll_npm": 8000.0,
            "both.tyre.nominal_load_n": 2400.0,
            "both.tyre.friction_x": g["friction"],
            "both.tyre.friction_y": g["friction"],
            "both.tyre.load_at_peak_stiffness": 2.0,
            "front.tyre.cornering_stiffness": g["front"],
            "rear.tyre.cornering_stiffness": g["rear"],
        },
        "250 LM",
    )


def read(path: Path) -> tuple[np.ndarray, Readings, np.ndarray]:
    """Inputs and readings every millisecond, and the measured sideslip."""
    with path.open(encoding="utf-8") as lines:
        rows = list(csv.DictReader(lines))
    t = np.array([float(r["t_s"]) for r in rows])
    t -= t[0]
    fine = np.arange(0.0, t[-1], DT)

    def at(name: str) -> np.ndarray:
        return np.interp(fine, t, [float(r[name]) for r in rows])

    vx = at("vx_mps")
    pull = MASS * at("axCGFilt_mps2") + 0.5 * 1.225 * DRAG * vx**2 + 0.011 * MASS * 9.81
    inputs = np.zeros((len(fine), len(INPUTS)))
    inputs[:, :2] = at("delta_rad")[:, None]
    inputs[:, 4:6] = (np.maximum(pull, 0.0) * 0.33 / 2.0)[:, None]
    inputs[:, 6:8] = (np.maximum(-pull, 0.0) * 0.6 * 0.33 / 2.0)[:, None]
    inputs[:, 8:10] = (np.maximum(-pull, 0.0) * 0.4 * 0.33 / 2.0)[:, None]
    values = np.full((len(fine), len(READINGS)), np.nan)
    for name, column in (
        ("ay_mps2", "ayCG_mps2"),
        ("yaw_rate_radps", "yawRate_radps"),
        ("vx_mps", "vx_mps"),
    ):
        values[:, READINGS.index(name)] = at(column)
    noise = {"ay_mps2": 0.5, "yaw_rate_radps": 0.01, "vx_mps": 0.05}
    return inputs, Readings(values, noise, DT), at("beta_rad")


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
        gains.append(StateGain("vx_mps", f"wheel_speed_{w}_radps", 20.0 / 0.33))
    seen = observe(car(g), LOAD, inputs, readings, Observer(gains=gains)).outputs
    return seen["sideslip_rad"], seen["ay_mps2"], seen["yaw_rate_radps"]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--trials", type=int, default=30)
    args = parser.parse_args()
    inputs, readings, sideslip = read(args.folder / "revs_250lm_20140222_run1.csv")
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
    rest = Readings(readings.values[n:], readings.noise, DT)
    mine = run(found.gains, inputs[n:], rest, YAW_PS["observing"])[0]
    true = sideslip[n::10]
    moving = (rest["vx_mps"][::10] > 8.0) & np.isfinite(true)
    error = np.degrees(mine - true)[moving]
    print(
        f"sideslip over {moving.sum() / 100.0:.0f} s not used to fit: rms "
        f"{np.degrees(np.std(true[moving])):.2f} deg in it, error "
        f"{np.sqrt(np.mean(error**2)):.3f} deg, mean {np.mean(error):+.3f} deg"
    )


if __name__ == "__main__":
    main()
