"""Is a fault of the steering or of the vehicle file named by the study of a measured drive?

    python benchmarks/injected/study.py DATA SET [--fetched FOLDER] [--only WORD] [--time-limit S]

The drive is studied as it is, then once for each injection (`falsify.py`): `improve` with the
sensors put right. Named: the effect that undoes the injection is in the model, and either was not
before or has moved. Size: the difference of its parameter to the study of the drive as it was lies
in the 95 % interval. Wrong name: another effect is named as missing that was not before.
"""

from __future__ import annotations

import argparse
import sys
import time
import warnings
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "real_driving"))

from cars import NAMES, logs, vehicle
from falsify import DYNAMIC, falsified

import sysid_vehicle as sv

_SIDES = 1.959964


def size(study: sv.Study, parameter: str) -> tuple[float, float]:
    """Value and standard error; nothing where the effect is not in the model."""
    if parameter.split(".")[0] not in study.model.effects:
        return 0.0, 0.0
    found = study.fit[parameter]
    return found.value, found.std


def named(study: sv.Study) -> set[str]:
    return {a.id for a in study.added if not a.stands_in}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("data", type=Path)
    parser.add_argument("set", choices=NAMES)
    parser.add_argument("--fetched", type=Path, metavar="FOLDER", help="logs without a licence")
    parser.add_argument("--only", default="", metavar="WORD", help="injections with this word")
    parser.add_argument("--time-limit", type=float, metavar="S", help="of each search")
    args = parser.parse_args()
    warnings.simplefilter("ignore", sv.SysidWarning)
    train, test = logs(args.set, args.data, args.fetched)
    car = vehicle(args.set, args.data)
    check = sv.check([*train, *test], car)

    def study(train: list[sv.Log], test: list[sv.Log], car: sv.Vehicle) -> sv.Study:
        limit = args.time_limit
        return sv.improve(sv.Model(car), train, test, sensors=check, time_limit_s=limit, starts=4)

    before = study(train, test, car)
    print(f"as it is: {before.verdict}; {'; '.join(map(str, before.added))}", flush=True)
    for injection in (f for f in DYNAMIC if args.only in f.what):
        began = time.perf_counter()
        act, change = injection.act, injection.car
        logs_now = [
            [log if act is None else falsified(log, act) for log in of] for of in (train, test)
        ]
        after = study(*logs_now, car if change is None else change(car))
        (was, _), (now, std) = (size(s, injection.effect) for s in (before, after))
        difference = now - was
        found = abs(difference) > _SIDES * std and std > 0.0
        inside = std > 0.0 and abs(difference - injection.size) < _SIDES * std
        wrong = named(after) - named(before) - {injection.effect.split(".")[0]}
        print(
            f"{injection.what:24s} {difference:+.4f} of {injection.size:+.4f} +- {std:.2g}"
            f"{'  in the model' if found else ''}{'  inside' if inside else ''}"
            f"{'  WRONG: ' + ', '.join(sorted(wrong)) if wrong else ''}; {after.verdict}: "
            f"{'; '.join(map(str, after.added))} ({time.perf_counter() - began:.0f} s)",
            flush=True,
        )


if __name__ == "__main__":
    main()
