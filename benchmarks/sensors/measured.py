"""What `sv.check` says of measured logs.

    python benchmarks/sensors/measured.py LOG... [--channels MAP] [--between T0 T1]
        [--level-ground]

Prints one line per fault for all logs together. `--steer-limit` makes larger steering angles
missing, because the check of a log refuses spikes that are no angle of a car.
"""

from __future__ import annotations

import argparse
import time
import warnings
from pathlib import Path

import numpy as np

import sysid_vehicle as sv


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("logs", nargs="+", type=Path)
    parser.add_argument("--channels", type=Path)
    parser.add_argument("--between", nargs=2, type=float)
    parser.add_argument("--level-ground", action="store_true", help="as of a test track")
    parser.add_argument("--steer-limit", type=float, default=np.inf)
    args = parser.parse_args()
    logs = [_read(path, args) for path in args.logs]
    began = time.perf_counter()
    found = sv.check(logs, level=args.level_ground)
    print(found)
    took = time.perf_counter() - began
    print(f"{took:.1f} s, {found.estimate.rounds} rounds, settled: {found.estimate.settled}")


def _read(path: Path, args: argparse.Namespace) -> sv.Log:
    channels = None if args.channels is None else sv.ChannelMap.from_toml(args.channels)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        if np.isfinite(args.steer_limit) and channels is not None:
            source = channels.sources["steer_rad"]
            table = np.genfromtxt(path, delimiter=",", names=True, deletechars="")
            columns = {name: np.array(table[name]) for name in table.dtype.names}
            steer = columns[source.column]
            steer[np.abs(source.factor * steer) > args.steer_limit] = np.nan
            log = sv.read_log(columns, channels, name=path.stem)
        else:
            log = sv.read_log(path, channels)
    return log if args.between is None else log.between(*args.between)


if __name__ == "__main__":
    main()
