"""What the search for missing effects makes of driving that others measured.

    python benchmarks/real_driving/improve.py DATA [revs_250lm|carsim_like_handling|tum_devbot_sim]

DATA is the folder that holds the data sets; none is part of this project. Prints the held-out error
before and after, the effects added, and the verdict. Reports go beside this file if --report is
given.
"""

from __future__ import annotations

import argparse
import warnings
from pathlib import Path

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
    "tum_devbot_sim": (("data_to_train_2.csv", 0.0, 100.0), ("data_to_run.csv", 0.0, 1e9)),
}


def study_of(name: str, data: Path) -> sv.Study:
    channels = sv.ChannelMap.from_toml(HERE / f"{name}.channels.toml")
    model = sv.Model(sv.Vehicle.from_toml(HERE / f"{name}.vehicle.toml"))
    train, test = (
        sv.read_log(data / name / file, channels).between(begin, end)
        for file, begin, end in PARTS[name]
    )
    return sv.improve(model, train, test, tell=lambda text: print(f"  {text}", flush=True))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("data", type=Path)
    parser.add_argument("sets", nargs="*", metavar="SET", help=", ".join(PARTS))
    parser.add_argument("--report", action="store_true")
    args = parser.parse_args()
    warnings.simplefilter("ignore", sv.SysidWarning)
    for name in args.sets or PARTS:
        print(f"== {name}")
        study = study_of(name, args.data)
        print(study)
        print(f"  {study.seconds:.0f} s\n", flush=True)
        if args.report:
            study.report(HERE / f"{name}.html")


if __name__ == "__main__":
    main()
