"""What a step of the fourteen-degree-of-freedom car costs, its error straight on and in corners,
and how fast observers run.

python benchmarks/twin/speed.py
"""

import argparse
import time
from collections.abc import Callable

import numpy as np

from sysid_vehicle import manoeuvres
from sysid_vehicle.twin import (
    SPORTS_CAR,
    Observer,
    SideBySide,
    mass_law,
    measure,
    observe,
    on_manoeuvre,
    unknowns,
)


def seconds(work: Callable[[], object], times: int = 5) -> float:
    """Least processor time of a few: what others do on the machine is not ours."""
    best = float("inf")
    for _ in range(times):
        began = time.process_time()
        work()
        best = min(best, time.process_time() - began)
    return best


def main() -> None:
    argparse.ArgumentParser(description=__doc__.split("\n")[0]).parse_args()
    drive = on_manoeuvre(SPORTS_CAR, None, manoeuvres.lap(180.0, 12.0, 50.0))
    n = len(drive.inputs)
    core = SPORTS_CAR.core()
    start = np.concatenate([drive.states[0], np.zeros(8)])
    both = seconds(lambda: core.simulate(start, drive.inputs, drive.dt_s))
    print(f"step of 1 ms with all outputs: {both / n * 1e6:.2f} us")

    # Between two samples the input is held, so that a reference of 10 us can hold it too.
    lateral = np.abs(drive["plane_ay_mps2"])
    means = lateral[: n // 5000 * 5000].reshape(-1, 5000).mean(axis=1)
    for where, piece in (
        ("straightest", np.argmin(means)),
        ("hardest cornering", np.argmax(means)),
    ):
        short = slice(5000 * int(piece), 5000 * int(piece) + 5000)
        begin = np.concatenate([drive.states[short.start], np.zeros(8)])
        exact = core.simulate(begin, np.repeat(drive.inputs[short], 100, axis=0), 1e-5)[2]
        for dt, every in ((1e-3, 1), (5e-4, 2)):
            rough = core.simulate(begin, np.repeat(drive.inputs[short], every, axis=0), dt)[2]
            print(
                f"{where} 5 s of the lap, mean lateral acceleration {means[piece]:.1f} m/s2: error "
                f"of {dt * 1e3:g} ms steps at their end against 10 us: "
                f"vy {abs(rough[7] - exact[7]):.1e} m/s, yaw rate {abs(rough[11] - exact[11]):.1e} "
                f"rad/s, roll {abs(rough[3] - exact[3]):.1e} rad, place "
                f"{np.hypot(*(rough[:2] - exact[:2])):.1e} m"
            )

    readings = measure(drive, ["ax_mps2", "yaw_rate_radps"], snr=10.0)
    load = SPORTS_CAR.design.replace(mass_kg=1041.0)
    for name, observer in (
        ("published law", Observer(laws=[mass_law(150.0, around=SPORTS_CAR.design)])),
        (
            "two twins side by side",
            Observer(
                batch=SideBySide(
                    unknowns("mass_kg", around=SPORTS_CAR.design),
                    {"ax_mps2": 0.1},
                    input_std=0.0,
                    start_std=0.0,
                )
            ),
        ),
        (
            "a third for doubted torques",
            Observer(
                batch=SideBySide(
                    unknowns("mass_kg", around=SPORTS_CAR.design), {"ax_mps2": 0.1}, start_std=0.0
                )
            ),
        ),
    ):

        def run(observer: Observer = observer) -> object:
            speed = float(drive["vx_mps"][0])
            return observe(SPORTS_CAR, load, drive.inputs, readings, observer, speed_mps=speed)

        took = seconds(run, 3)
        print(f"observer, {name}: {took:.2f} s for 180 s, {180.0 / took:.0f} times real time")


if __name__ == "__main__":
    main()
