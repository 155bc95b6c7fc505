"""The closed-loop logs made independently, as records for the observer."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from sysid_vehicle.lab import ObserverCar, ObserverRecord

CAR = ObserverCar(mass_kg=780.0, yaw_inertia_kgm2=1000.0, lf_m=1.4, lr_m=1.6, drag_nspm=0.3)
NOMINAL_STIFFNESS_PRAD = 63.36  # per load


@dataclass(frozen=True)
class Golden:
    """A record, and the truth to judge by: vx, vy, yaw rate, lateral acceleration."""

    record: ObserverRecord
    truth: npt.NDArray[np.float64]


def golden(folder: Path, stiffness_prad: float | tuple[float, float] | None = None) -> Golden:
    """Read the gentle log; `stiffness_prad` is that of the axles per load, front and rear."""
    path = folder / "identification_amp035.npz"
    if not path.is_file():
        raise SystemExit(f"there is no {path}; give the folder of the closed-loop logs")
    front, rear = np.broadcast_to(stiffness_prad or NOMINAL_STIFFNESS_PRAD, 2)
    with np.load(path) as data:
        record = ObserverRecord.from_arrays(
            rate_hz=100.0,
            force_x_n=data["u"][:, 0],
            steer_rad=data["u"][:, 1],
            stiffness_front_nprad=front * data["fz_front"],
            stiffness_rear_nprad=rear * data["fz_rear"],
            readings=data["measurements"],
            name=path.stem,
        )
        return Golden(record, np.column_stack([data["truth_gt"][:, 3:6], data["ay_true"]]))
