"""An EM iteration of the published observer against GNU Octave: `python octave.py LOGS [--quick]`.

The same computation on the same log and machine, in Octave as one writes it well there
(`em_published.m`). Times are of the processor, smallest of several.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import tempfile
from pathlib import Path

import numpy as np
from golden import CAR, golden
from scipy.io import savemat
from speed import TARGET, first, smallest

from sysid_vehicle import _core, published
from sysid_vehicle.lab import (
    READINGS,
    STATES,
    NoiseStructure,
    ObserverRecord,
)

SCRIPT = Path(__file__).with_name("em_published.m")


def of_octave(program: str, record: ObserverRecord, repeats: int) -> tuple[np.ndarray, np.ndarray]:
    """Seconds of a forward pass and an iteration of both kinds; what each of these found."""
    noise = published.OBSERVER_NOISE
    car = {
        "m": CAR.mass_kg,
        "i": CAR.yaw_inertia_kgm2,
        "lf": CAR.lf_m,
        "lr": CAR.lr_m,
        "drag": CAR.drag_nspm,
        "dt": 1.0 / record.rate_hz,
    }
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "record.mat"
        content = {
            "car": car,
            "u": record.inputs(),
            "y": record.readings,
            "q": np.diag(noise.process)[:, None],
            "r": np.diag(noise.sensors)[:, None],
        }
        savemat(path, content)
        command = [program, "--norc", "--quiet", str(SCRIPT), str(path), str(repeats)]
        out = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    found = np.array(out.split(), dtype=float)
    return found[:3], found[3:].reshape(2, -1)


def of_core(record: ObserverRecord) -> tuple[np.ndarray, np.ndarray]:
    """The same of the core."""
    noise = published.OBSERVER_NOISE
    Q, R = noise.process, noise.sensors
    log = published.observer(CAR).core_log(record)
    structure = NoiseStructure(floor=1e-9)
    forms = (*structure.core(STATES), *structure.core(READINGS))

    def learn(iterations: int) -> dict[str, object]:
        return _core.learn_observer_noise([log], Q, R, *forms, iterations, 0.0, False, False)

    # A run of k iterations filters k + 1 times.
    iteration = (smallest(lambda: learn(6), 7) - smallest(lambda: learn(1), 7)) / 5
    forward = smallest(lambda: log.log_likelihood(Q, R), 15)
    found = learn(1)
    values = [found["log_likelihood"][0], *np.diag(found["process"]), *np.diag(found["sensors"])]
    return np.array([forward, iteration, iteration]), np.array(values)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("logs", type=Path, help="folder of the closed-loop logs")
    parser.add_argument("--quick", action="store_true", help="1500 samples instead of 14501")
    parser.add_argument("--repeats", type=int, default=3)
    options = parser.parse_args()
    program = shutil.which("octave-cli") or shutil.which("octave")
    if program is None:
        print("skipped: GNU Octave is not installed (apt-get install octave)")
        return
    record = golden(options.logs).record
    samples = 1500 if options.quick else len(record.readings)
    record = first(record, samples)
    theirs, their_values = of_octave(program, record, options.repeats)
    ours, our_values = of_core(record)
    print(f"{samples} samples; what      Octave [s]  core [ms]   ratio   target")
    forward, iteration = TARGET
    targets = {
        forward: TARGET[forward],
        f"{iteration}, all at once": TARGET[iteration],
        f"{iteration}, as published": TARGET[iteration],
    }
    for (what, target), slow, fast in zip(targets.items(), theirs, ours, strict=True):
        print(f"{what:26s} {slow:10.2f} {1e3 * fast:10.2f} {slow / fast:6.0f}x {target:6d}x")
    off = float(np.abs(their_values / our_values - 1.0).max())
    print(f"largest relative difference of log-likelihood, Q, R: {off:.1e}")
    if off > 1e-6:
        raise SystemExit("core and Octave disagree")


if __name__ == "__main__":
    main()
