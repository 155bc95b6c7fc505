"""Time of a filter pass and of an EM iteration: `python speed.py LOGS [--quick]`.

The yardstick is the same computation in plain NumPy, in the same run; the published times are those
of GNU Octave on another machine. Times are of the processor, smallest of several.
"""

from __future__ import annotations

import argparse
import dataclasses
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from golden import CAR, golden
from plain_numpy import Plain

from sysid_vehicle import _core, published
from sysid_vehicle.lab import (
    READINGS,
    STATES,
    NoiseStructure,
    Observer,
    ObserverRecord,
)

OCTAVE_S = {"forward pass": 1.28, "EM iteration": 4.7}
TARGET = {"forward pass": 250, "EM iteration": 300}


def smallest(run: Callable[[], object], repeats: int) -> float:
    times = []
    for _ in range(repeats):
        begin = time.process_time()
        run()
        times.append(time.process_time() - begin)
    return min(times)


def first(record: ObserverRecord, samples: int) -> ObserverRecord:
    """The first samples of a record."""
    keys = [f.name for f in dataclasses.fields(record) if f.name not in ("rate_hz", "name")]
    return dataclasses.replace(record, **{key: getattr(record, key)[:samples] for key in keys})


def compare(record: ObserverRecord, observer: Observer, title: str) -> None:
    Q, R = observer.noise.process, observer.noise.sensors
    log = observer.core_log(record)
    n = len(record.readings)
    as_published = observer.form == published.OBSERVER_FORM
    if as_published:
        start = np.array([5.0, 0, 0, 0, 0, 0]), np.zeros((6, 6))
    else:
        start = _core.observer_start(CAR.vector(), record.readings[0], R)
    plain = Plain(CAR, record, as_published)
    structure = NoiseStructure(floor=1e-9)
    forms = (*structure.core(STATES), *structure.core(READINGS))

    def learn(iterations: int) -> dict[str, object]:
        return _core.learn_observer_noise([log], Q, R, *forms, iterations, 0.0, False, False)

    core = {
        "forward pass": smallest(lambda: log.log_likelihood(Q, R), 15),
        # A run of k iterations filters k + 1 times.
        "EM iteration": (smallest(lambda: learn(6), 5) - smallest(lambda: learn(1), 5)) / 5,
    }
    yardstick = {
        "forward pass": smallest(lambda: plain.forward(*start, Q, R, keep=False), 2),
        "EM iteration": smallest(lambda: plain.em_iteration(*start, Q, R), 1),
    }
    for what, seconds in core.items():
        octave = OCTAVE_S[what] * n / 14501 / seconds
        print(
            f"{what + ', ' + title:24s} {1e3 * seconds:9.2f}  {1e3 * yardstick[what]:10.0f}"
            f"  {yardstick[what] / seconds:5.0f}x  {octave:6.0f}x of {TARGET[what]}x"
        )
    # The two must be the same computation for the ratio to mean anything.
    found = learn(1)
    value, q, r = plain.em_iteration(*start, Q, R)
    off = max(
        abs(value / found["log_likelihood"][0] - 1.0),
        np.abs(q / np.diag(found["process"]) - 1.0).max(),
        np.abs(r / np.diag(found["sensors"]) - 1.0).max(),
    )
    print(f"  largest relative difference of log-likelihood, Q, R: {off:.1e}")
    if off > 1e-6:
        raise SystemExit("core and yardstick disagree")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("logs", type=Path, help="folder of the closed-loop logs")
    parser.add_argument("--quick", action="store_true", help="1500 samples instead of 14501")
    options = parser.parse_args()
    record = golden(options.logs).record
    if options.quick:
        record = first(record, 1500)
    print(f"{len(record.readings)} samples")
    print("what                     core [ms]  NumPy [ms]  ratio   of Octave's published, target")
    compare(record, published.observer(CAR), "published")
    compare(record, Observer(CAR, published.OBSERVER_NOISE), "corrected")


if __name__ == "__main__":
    main()
