"""Filter, smoother and learned noise on the closed-loop log: `python reproduce.py LOGS [--quick]`.

Prints the published figures, what must be reached, and what is reached. Leaves with an error where
something is missed. `--stiffness F R` gives a stiffness per load identified elsewhere.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from golden import CAR, Golden, golden

from sysid_vehicle import published
from sysid_vehicle.lab import (
    EMResult,
    NoiseStructure,
    Observer,
    learn_observer_noise,
)

PUBLISHED = published.observer(CAR)
CORRECTED = Observer(CAR, published.OBSERVER_NOISE)
TRUE_SENSORS = np.array([0.01, 1e-5, 1e-5, 1e-5])
FLOOR = NoiseStructure(floor=1e-9)
Row = tuple[str, str, str, str, bool]


def learn(observer: Observer, log: Golden, sensors: NoiseStructure = FLOOR) -> EMResult:
    return learn_observer_noise(
        observer,
        log.record,
        process=FLOOR,
        sensors=sensors,
        most_iterations=20,
        tolerance=0.0,
        never_fall=observer.form != published.OBSERVER_FORM,
        accelerate=False,
    )


def smoothed_errors(observer: Observer, result: EMResult, log: Golden) -> np.ndarray:
    """Rms errors of vx, vy, yaw rate, lateral acceleration after smoothing."""
    found = observer.with_noise(result.noise).smoothed(log.record)
    return np.sqrt(np.mean((found.reading - log.truth) ** 2, axis=0))


def published_rows(log: Golden) -> Iterator[Row]:
    first = PUBLISHED.log_likelihood(log.record)
    yield (
        "one forward pass, published form",
        "120432.7509",
        "same to 1e-3",
        f"{first:.4f}",
        abs(first - 120432.7509) <= 1e-3,
    )
    em = learn(PUBLISHED, log)
    # The publication counts passes of the filter: its twentieth follows 19 changes of the noise.
    twentieth, after = em.log_likelihood[19], em.log_likelihood[20]
    yield (
        "20 EM iterations, published form",
        "125624.68",
        "same to 0.05",
        f"{twentieth:.2f}",
        abs(twentieth - 125624.68) <= 0.05,
    )
    yield (
        "  after the 20th change of noise",
        "125637.8",
        "same to 0.05",
        f"{after:.2f}",
        abs(after - 125637.84) <= 0.05,
    )
    rms = smoothed_errors(PUBLISHED, em, log)
    yield ("  rms error vy, published form", ".00255", "", f"{rms[1]:.5f}", True)
    yield ("  rms error yaw rate", ".00135", "", f"{rms[2]:.5f}", True)
    yield ("  rms error ay", ".0140", "", f"{rms[3]:.4f}", True)


def corrected_rows(log: Golden, title: str, sensors: NoiseStructure = FLOOR) -> Iterator[Row]:
    em = learn(CORRECTED, log, sensors)
    yield (
        f"20 EM iterations, {title}",
        "125638",
        ">= 190433",
        f"{em.log_likelihood[-1]:.2f}",
        em.log_likelihood[-1] >= 190433,
    )
    yield ("  never falls", "", "monotone", "yes" if em.monotone else "no", em.monotone)
    off = np.diag(em.noise.sensors) / TRUE_SENSORS - 1.0
    for name, d in zip(("vx", "vy", "yaw rate"), off[:3], strict=True):
        yield (
            f"  R of {name} against truth",
            "",
            "within 5 %",
            f"{100 * d:+.1f} %",
            abs(d) <= 0.05,
        )
    yield ("  R of ay against truth", "", "", f"{100 * off[3]:+.1f} %", True)
    rms = smoothed_errors(CORRECTED, em, log)
    yield (
        "  rms error vy after smoothing",
        ".00255",
        "<= .00062",
        f"{rms[1]:.5f}",
        rms[1] <= 0.00062,
    )
    yield ("  rms error yaw rate", ".00135", "<= .00030", f"{rms[2]:.5f}", rms[2] <= 0.00030)
    yield ("  rms error ay", ".0140", "<= .0032", f"{rms[3]:.5f}", rms[3] <= 0.0032)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("logs", type=Path, help="folder of the closed-loop logs")
    parser.add_argument("--quick", action="store_true", help="the log of small amplitude alone")
    parser.add_argument("--stiffness", nargs=2, type=float, metavar=("F", "R"))
    options = parser.parse_args()
    log = golden(options.logs)
    rows = [*published_rows(log), *corrected_rows(log, "corrected, nominal stiffness")]
    both = NoiseStructure(correlated=(("yaw_rate_radps", "ay_mps2"),), floor=1e-9)
    if not options.quick:
        rows += corrected_rows(log, "yaw rate and ay correlated", both)
    if options.stiffness:
        other = golden(options.logs, tuple(options.stiffness))
        rows += corrected_rows(other, "corrected, identified stiffness")
    head = ("what", "published", "must reach", "reached", "")
    table = [head, *((*r[:4], "" if not r[2] else "met" if r[4] else "MISSED") for r in rows)]
    widths = [max(len(r[i]) for r in table) for i in range(5)]
    for r in table:
        print("  ".join(c.ljust(w) for c, w in zip(r, widths, strict=True)).rstrip())
    if not all(r[4] for r in rows):
        raise SystemExit("not everything is reached")


if __name__ == "__main__":
    main()
