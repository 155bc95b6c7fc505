"""What the search for missing effects makes of driving that others measured.

    python benchmarks/real_driving/improve.py DATA [SET ...] [--report FOLDER]

DATA is the folder that holds the data sets; none is part of this project. Prints the validation
error before and after, the effects added, the verdicts that name something, and the waterfall. What
the data's authors know of their cars, and whether it agrees, is in README.md beside this file.
"""

from __future__ import annotations

import argparse
import warnings
from pathlib import Path

import numpy as np

import sysid_vehicle as sv

HERE = Path(__file__).resolve().parent
# Training and held-out parts [s]; a whole log where no times are given.
PARTS = {
    "revs_250lm": (
        ("revs_250lm_20140222_run1.csv", 200.0, 300.0),
        ("revs_250lm_20140222_run1.csv", 400.0, 500.0),
    ),
    "carsim_like_handling": (
        ("handling_course.csv", 0.0, 75.0),
        ("handling_course.csv", 75.0, 1e9),
    ),
    "tum_devbot_sim": (
        ("data_to_train_2.csv", 0.0, 100.0),
        ("data_to_train_2.csv", 100.0, 1e9),
    ),
}
SHORT = "bmw_m8_roadview"  # one lane change: too short to name anything


def study_of(name: str, data: Path) -> sv.Study:
    if name == SHORT:
        return _study(name, lane_change(data / name).between(5.0, 16.5), None)
    channels = sv.ChannelMap.from_toml(HERE / f"{name}.channels.toml")
    train, test = (
        sv.read_log(data / name / file, channels).between(begin, end)
        for file, begin, end in PARTS[name]
    )
    return _study(name, train, test)


def lane_change(folder: Path) -> sv.Log:
    """The double lane change: motion and steering are in two files, at two rates, of one clock."""
    car, inputs = (
        np.genfromtxt(folder / f"m8_double_lane_change_{part}.csv", delimiter=",", names=True)
        for part in ("car_100Hz", "inputs_1kHz")
    )
    time = car["car_time"]
    # Normalised steering; the authors divide 20 rad by the ratio of the steering gear.
    steer = np.interp(time, inputs["time"], inputs["steering"]) * 20.0 / 14.3
    return sv.Log.from_arrays(
        {
            "time_s": time,
            "vx_mps": car["Velocity_X"],
            "vy_mps": car["Velocity_Y"],
            "yaw_rate_radps": car["Yaw_Velocity"],
            "ax_mps2": car["Acceleration_X"],
            "ay_mps2": car["Acceleration_Y"],
            "steer_rad": steer,
        },
        name="double lane change",
    )


def _study(name: str, train: sv.Log, test: sv.Log | None) -> sv.Study:
    model = sv.Model(sv.Vehicle.from_toml(HERE / f"{name}.vehicle.toml"))
    return sv.improve(model, train, test, tell=lambda text: print(f"  {text}", flush=True))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("data", type=Path)
    parser.add_argument("sets", nargs="*", metavar="SET", help=", ".join((*PARTS, SHORT)))
    parser.add_argument("--report", type=Path, metavar="FOLDER", help="where reports go")
    args = parser.parse_args()
    warnings.simplefilter("ignore", sv.SysidWarning)
    for name in args.sets or (*PARTS, SHORT):
        print(f"== {name}")
        study = study_of(name, args.data)
        print(study)
        for v in study.verdicts.all:
            if v.finding in ("missing", "one of a group", "proxy"):
                print(f"  {v}")
        print(f"{study.waterfall()}\n  {study.seconds:.0f} s\n", flush=True)
        if args.report is not None:
            study.report(args.report / f"{name}.html")


if __name__ == "__main__":
    main()
