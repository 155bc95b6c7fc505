"""Whether what was found is a slip of the vehicle file: lengths or shares of axles exchanged.

Lengths that are exchanged put the centre of gravity elsewhere and, with it, the instruments; the
wrong driven axle is beyond any error of a share. Each is several effects, rightly by the data,
where one line of a file is wrong.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from ..._common.text import few
from ...errors import NumericalError
from ...identify import Fit, refine
from ...vehicle import Vehicle
from ..search.steps import merit

_PLACES = ("cg_position", "imu_lever_arm", "speed_sensor_lever_arm", "ins_lever_arm")
_SHARES = ("brake_front_share", "drive_front_share")


def slip_of_the_file(final: Fit, added: Sequence[str]) -> str:
    """Say which slip of the vehicle file explains effects that were added.

    With the line put right, and fewer effects, the training data have to be as likely by the BIC.

    Parameters
    ----------
    final : Fit
    added : sequence of str
        Effects that the baseline lacks.

    Returns
    -------
    str
        A sentence; empty where there is no such slip.
    """
    found: list[tuple[float, str, list[str]]] = []
    for said, car, seen_as in _slips(final.model.vehicle):
        acting = [e for e in added if e in seen_as]
        if not acting or car == final.model.vehicle:
            continue
        # Instruments may be elsewhere all the same, and others may have stood in for the slip.
        for gone in dict.fromkeys(
            (tuple(acting), tuple(acting[:1]), tuple(acting[-1:]), tuple(added))
        ):
            with suppress(NumericalError, np.linalg.LinAlgError):
                model = replace(final.model, vehicle=car).drop(*gone)
                fit = refine(model, final.driving, final.noise)
                found.append((merit(fit), said, [e for e in added if e in gone]))
    best, said, needless = max(found, default=(-np.inf, "", []))
    if best < merit(final):
        return ""
    them = "it" if len(needless) == 1 else "them"
    return (
        f"{few(needless)} may be a mistake in the vehicle file: with {said} the training data are "
        f"as likely without {them}; where that is the car, correct the file, and study again"
    )


def _slips(car: Vehicle) -> list[tuple[str, Vehicle, tuple[str, ...]]]:
    """Slips in words, the car without each, and the effects that look like it."""
    found: list[tuple[str, Vehicle, tuple[str, ...]]] = [
        (
            f"lf_m = {car.lr_m:g} and lr_m = {car.lf_m:g}, exchanged,",
            car.replace(lf_m=car.lr_m, lr_m=car.lf_m),
            _PLACES,
        )
    ]
    for key in _SHARES:
        other = 1.0 - getattr(car, key)
        found.append((f"{key} = {other:g}", car.replace(**{key: other}), ("force_split",)))
    return found
