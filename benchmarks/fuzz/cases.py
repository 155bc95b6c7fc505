"""Cases of driving data and cars, drawn from a number, kept as a few words of JSON."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

TESTS = Path(__file__).resolve().parents[2] / "tests" / "python"
if str(TESTS) not in sys.path:
    sys.path.insert(0, str(TESTS))

from strategies import CHANNELS, FAULTS, OPTIONAL, car_columns  # noqa: E402

from sysid_vehicle import Tyre, Vehicle  # noqa: E402

Case = dict[str, Any]

# Half of the cars are such as drive; the others lie at the ends of what a vehicle file accepts.
_PLAUSIBLE: Mapping[str, tuple[float, float]] = {
    "mass_kg": (150.0, 12000.0),
    "lf_m": (0.5, 3.0),
    "lr_m": (0.5, 3.0),
    "cg_height_m": (0.05, 1.5),
    "track_front_m": (1.0, 2.0),
    "track_rear_m": (1.0, 2.0),
    "drag_area_m2": (0.3, 6.0),
}
_STRANGE: Mapping[str, tuple[float, float]] = {
    "mass_kg": (1.0, 50000.0),
    "lf_m": (1e-2, 20.0),
    "lr_m": (1e-2, 20.0),
    "cg_height_m": (1e-3, 5.0),
    "track_front_m": (1e-2, 5.0),
    "track_rear_m": (1e-2, 5.0),
    "drag_area_m2": (1e-3, 50.0),
}
_TYRE = {"B": (5.0, 25.0), "C": (1.1, 1.8), "D": (0.5, 1.8)}
_STRANGE_TYRE = {"B": (1e-3, 200.0), "C": (1e-3, 4.0), "D": (1e-3, 5.0)}


def draw(number: int) -> Case:
    """Give the case of this number."""
    rng = np.random.default_rng([number, 20])

    def logarithmic(low: float, high: float) -> float:
        return float(np.exp(rng.uniform(np.log(low), np.log(high))))

    strange = bool(rng.random() < 0.5)
    tyre = _STRANGE_TYRE if strange else _TYRE
    vehicle = {n: logarithmic(*box) for n, box in (_STRANGE if strange else _PLAUSIBLE).items()}
    vehicle["brake_front_share"], vehicle["drive_front_share"] = map(float, rng.random(2))
    return {
        "columns": {
            "n": int(rng.choice([0, 1, 5, 50, 200, 600, 1500])) + int(rng.integers(0, 3)),
            "rate_hz": float(rng.choice([5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 1000.0])),
            "seed": int(rng.integers(2**31)),
            "speed_mps": float(
                rng.uniform(8.0, 50.0) if rng.random() < 0.7 else rng.uniform(-10, 130)
            ),
            "lateral_mps2": float(rng.uniform(0.0, 9.0)),
            "noise": float(rng.choice([0.0, 1.0, 1.0, 5.0])),
        },
        "without": sorted(map(str, rng.choice(OPTIONAL, rng.integers(0, 3), replace=False))),
        "faults": [
            [
                str(rng.choice(sorted(FAULTS))),
                str(rng.choice(CHANNELS)),
                int(rng.integers(2**31)),
                float(rng.random()),
            ]
            for _ in range(rng.integers(0, 4))
        ],
        "vehicle": vehicle,
        "tyres": [
            {n: logarithmic(*box) for n, box in tyre.items()} | {"E": float(rng.uniform(-2, 0.9))}
            for _ in range(2)
        ],
    }


def build(case: Case) -> tuple[dict[str, np.ndarray], Vehicle]:
    """Columns and car of a case."""
    columns = car_columns(**case["columns"])
    for channel in case["without"]:
        del columns[channel]
    with np.errstate(all="ignore"):
        for fault, channel, seed, size in case["faults"]:
            if channel in columns:
                FAULTS[fault](columns, channel, np.random.default_rng(seed), size)
    front, rear = (Tyre(**tyre) for tyre in case["tyres"])
    return columns, Vehicle(**case["vehicle"], tyre_front=front, tyre_rear=rear)
