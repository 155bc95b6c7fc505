"""Drives of one measured car, between which nothing was changed: what is claimed of them?"""

from __future__ import annotations

import argparse
import sys
import warnings
from pathlib import Path

import sysid_vehicle as sv

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "real_driving"))

import cars

REVS = "revs_250lm_20140222_run1.csv"
Part = tuple[str, float, float]  # log, and its part [s]
# Car, the reference, and the later drives.
PAIRS: tuple[tuple[str, tuple[Part, ...], tuple[Part, ...]], ...] = (
    (
        "v40",
        (("Slalom_35kph.csv", *cars.WHOLE), ("Step_Steer_left_80kph.csv", *cars.WHOLE)),
        (("SWD_80kph.csv", *cars.WHOLE),),
    ),
    ("v40", (("SWD_80kph.csv", *cars.WHOLE),), (("Step_Steer_left_80kph.csv", *cars.WHOLE),)),
    ("v40", (("Step_Steer_left_80kph.csv", *cars.WHOLE),), (("SWD_80kph.csv", *cars.WHOLE),)),
    ("gti", (("High_Speed.csv", *cars.WHOLE),), (("Low_Speed.csv", *cars.WHOLE),)),
    ("revs_250lm", ((REVS, 200.0, 300.0),), ((REVS, 400.0, 500.0),)),
    ("revs_250lm", ((REVS, 100.0, 160.0),), ((REVS, 200.0, 260.0),)),
    (
        "tum_devbot_sim",
        (("data_to_train_2.csv", 0.0, 100.0),),
        (("data_to_train_2.csv", 100.0, 1e9),),
    ),
    (
        "carsim_like_handling",
        (("handling_course.csv", 0.0, 75.0),),
        (("handling_course.csv", 75.0, 1e9),),
    ),
)


def logs(name: str, parts: tuple[Part, ...], data: Path, fetched: Path) -> list[sv.Log]:
    """The logs of some parts; commanded wheel force is left out, it is late."""
    home = data / "fetched" if name in cars.FETCHED else cars.HERE
    channels = sv.ChannelMap.from_toml(home / f"{name}.channels.toml")
    folder = (fetched if name in cars.FETCHED else data) / name
    return [
        cars.without_force(cars.read(folder / file, channels)).between(begin, end)
        for file, begin, end in parts
    ]


def main() -> None:
    """Compare, and print what is said."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", type=Path, required=True)
    parser.add_argument("--fetched", type=Path, required=True)
    args = parser.parse_args()
    warnings.simplefilter("ignore", sv.SysidWarning)
    for name, before, after in PAIRS:
        model = sv.Model(cars.vehicle(name, args.data))
        reference = sv.identify(model, logs(name, before, args.data, args.fetched))
        change = sv.changed(reference, logs(name, after, args.data, args.fetched))
        told = ", ".join(f"{file} from {begin:g} s" for file, begin, _ in (*before, *after))
        print(f"{name} ({told})\n  nothing {change.nothing:.2g}, lacks {change.lacks}\n{change}\n")


if __name__ == "__main__":
    main()
