"""The same computations by libraries that users would take otherwise: ratios of processor time.

    pip install '.[peers]' && python benchmarks/peers [--rounds N]

Each round runs ours and theirs one after the other, so that what else the machine does falls on
both. A row has the median ratio and its quartiles. Before anything is timed both results are
compared; the largest relative difference is printed. Peers that are not installed are left out.
"""

from __future__ import annotations

import argparse
import importlib.util
import sys
import time
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
import regression

import sysid_vehicle as sv
from sysid_vehicle import _core, lab, published
from sysid_vehicle.online import SideslipObserver, SideslipSettings

BENCHMARKS = Path(__file__).resolve().parents[1]
sys.path += [str(BENCHMARKS / "closed_loop"), str(BENCHMARKS / "online")]

import plain_numpy  # noqa: E402
import sideslip  # noqa: E402

_LEAST_S = 0.02  # of processor time, for one reading of the clock


class Row(NamedTuple):
    """One computation by us and by a peer; `agree` is how far the results are apart."""

    what: str
    peer: str
    ours: Callable[[], object]
    theirs: Callable[[], object]
    agree: float
    of_theirs: int = 1  # as many samples of ours stand for one of theirs


def regressions() -> Iterator[Row]:
    """Residuals, Jacobian and normal equations of a tyre regression."""
    data = regression.Data.random(20_000)
    ours = data.core()
    wanted = ours()
    for name, make in regression.PEERS.items():
        if importlib.util.find_spec(name) is None:
            continue
        theirs = make(data)
        found = theirs()
        off = max(
            float(np.max(np.abs(np.asarray(a) - b)) / np.max(np.abs(b)))
            for a, b in zip(found, wanted, strict=True)
        )
        yield Row("tyre regression, normal equations", name, ours, theirs, off)


def filters() -> Iterator[Row]:
    """The laboratory's observer and its EM in NumPy, and a UKF of three states in filterpy."""
    car = lab.ObserverCar.of(sv.example_vehicle())
    t = 0.01 * np.arange(1500)
    steer, some = 0.02 * np.sin(1.5 * t), np.random.default_rng(1).standard_normal((len(t), 4))
    readings = np.column_stack([15.0 + 0.0 * t, 0.3 * steer, 5.0 * steer, 70.0 * steer])
    record = lab.ObserverRecord.from_arrays(
        rate_hz=100.0,
        force_x_n=0.0 * t,
        steer_rad=steer,
        stiffness_front_nprad=8e4,
        stiffness_rear_nprad=9e4,
        readings=readings + 0.05 * some,
    )
    observer = lab.Observer(car, published.OBSERVER_NOISE)
    noise = observer.noise.process, observer.noise.sensors
    log = observer.core_log(record)
    plain = plain_numpy.Plain(car, record, False)
    start = _core.observer_start(car.vector(), record.readings[0], noise[1])
    structure = lab.NoiseStructure(floor=1e-9)
    forms = (*structure.core(lab.STATES), *structure.core(lab.READINGS))

    def iterate() -> dict[str, object]:
        # It filters once more at the end, which counts against us.
        return _core.learn_observer_noise([log], *noise, *forms, 1, 0.0, False, False)

    value, process, sensors = plain.em_iteration(*start, *noise)
    found = iterate()
    ll = found["log_likelihood"][0]
    off = max(
        abs(ll / value - 1.0),
        float(np.abs(np.diag(found["process"]) / process - 1.0).max()),
        float(np.abs(np.diag(found["sensors"]) / sensors - 1.0).max()),
    )
    yield Row(
        "EKF of 6 states, likelihood",
        "numpy",
        lambda: log.log_likelihood(*noise),
        lambda: plain.forward(*start, *noise, keep=False),
        abs(log.log_likelihood(*noise) / value - 1.0),
    )
    yield Row("its EM iteration", "numpy", iterate, lambda: plain.em_iteration(*start, *noise), off)
    if importlib.util.find_spec("filterpy") is not None:
        vehicle = sv.example_vehicle()
        lap = sv.drive(sv.Model(vehicle), sv.manoeuvres.lap(20.0), seed=1)
        settings = SideslipSettings.of(lap)
        ukf = SideslipObserver(vehicle, settings, "linear-ukf")
        columns = ("steer_rad", "vx_mps", "yaw_rate_radps", "ax_mps2", "ay_mps2")
        sensed, dt = np.column_stack([lap[c] for c in columns]), np.full(lap.n, 0.01)
        few = 400
        yield Row(
            "UKF of 3 states",
            "filterpy",
            lambda: ukf.run(dt, sensed),
            lambda: sideslip.filterpy_time(vehicle, lap, settings, samples=few),
            float("nan"),  # other weights of the sigma points; sizes are the same
            of_theirs=round(lap.n / few),
        )


def seconds(work: Callable[[], object]) -> float:
    """Processor time of one call, of as many as the clock needs."""
    calls, began = 0, time.process_time()
    while time.process_time() - began < _LEAST_S:
        work()
        calls += 1
    return (time.process_time() - began) / calls


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--rounds", type=int, default=9)
    args = parser.parse_args()
    warnings.simplefilter("ignore")
    print(f"{'computation':36s}{'peer':10s}{'times slower':>13s}{'quartiles':>16s}{'apart':>10s}")
    for row in (*regressions(), *filters()):
        ratios = [
            row.of_theirs * seconds(row.theirs) / seconds(row.ours) for _ in range(args.rounds)
        ]
        low, middle, high = np.quantile(ratios, (0.25, 0.5, 0.75))
        apart = "" if np.isnan(row.agree) else f"{row.agree:.0e}"
        between = f"{low:.3g} .. {high:.3g}"
        print(f"{row.what:36s}{row.peer:10s}{middle:13.3g}{between:>16s}{apart:>10s}", flush=True)


if __name__ == "__main__":
    main()
