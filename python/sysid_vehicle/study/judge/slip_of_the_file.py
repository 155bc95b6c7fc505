"""Whether what was found is a slip of the vehicle file: lengths or shares of axles exchanged.

Lengths that are exchanged put the centre of gravity elsewhere and, with it, the instruments; the
wrong driven axle is beyond any error of a share. Each is several effects, rightly by the data,
where one line of a file is wrong. The wheelbase in place of one of its parts is like no effect at
all: whatever is added to the car explains some of it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ..._common.text import few
from ...errors import NumericalError
from ...identify import Fit, refine
from ...rules import USUAL, Rules
from ...vehicle import Vehicle
from ..search.steps import merit

_PLACES = ("cg_position", "imu_lever_arm", "speed_sensor_lever_arm", "ins_lever_arm")
_SHARES = ("brake_front_share", "drive_front_share")


class _Slip(NamedTuple):
    """A slip in words, the car without it, and groups of effects that may go with it."""

    said: str
    car: Vehicle
    gone: tuple[tuple[str, ...], ...]


def slip_of_the_file(final: Fit, added: Sequence[str], rules: Rules = USUAL) -> str:
    """Say which slip of the vehicle file explains effects that were added, or that any are missing.

    With the line put right, and fewer effects, the training data have to be as likely by the BIC;
    where nothing was added, likelier by as much as an effect of one parameter has to make them.

    Parameters
    ----------
    final : Fit
    added : sequence of str
        Effects that the baseline lacks.
    rules : Rules

    Returns
    -------
    str
        A sentence; empty where there is no such slip.
    """
    found: list[tuple[float, str, list[str]]] = []
    for slip in (*_exchanged(final.model.vehicle, added), *_wheelbase(final.model.vehicle, added)):
        if slip.car == final.model.vehicle:
            continue
        for gone in dict.fromkeys(slip.gone):
            with suppress(NumericalError, np.linalg.LinAlgError):
                model = replace(final.model, vehicle=slip.car).drop(*gone)
                fit = refine(model, final.driving, final.noise)
                found.append((merit(fit), slip.said, [e for e in added if e in gone]))
    best, said, needless = max(found, default=(-np.inf, "", []))
    gained = best - merit(final)
    then = "where that is the car, correct the file, and study again"
    if not needless:
        if gained < 0.5 * rules.price * float(np.log(final.driving.samples)):
            return ""
        return (
            f"what is missing may be a mistake in the vehicle file: with {said} the training data "
            f"are likelier; {then}"
        )
    if gained < 0.0:
        return ""
    them = "it" if len(needless) == 1 else "them"
    return (
        f"{few(needless)} may be a mistake in the vehicle file: with {said} the training data are "
        f"as likely without {them}; {then}"
    )


def _exchanged(car: Vehicle, added: Sequence[str]) -> Iterator[_Slip]:
    """Lengths or shares of the axles that are exchanged, which look like effects of their own."""
    lengths = f"lf_m = {car.lr_m:g} and lr_m = {car.lf_m:g}, exchanged,"
    shares = {key: 1.0 - getattr(car, key) for key in _SHARES}
    slips: tuple[tuple[str, Vehicle, tuple[str, ...]], ...] = (
        (lengths, car.replace(lf_m=car.lr_m, lr_m=car.lf_m), _PLACES),
        *((f"{k} = {v:g}", car.replace(**{k: v}), ("force_split",)) for k, v in shares.items()),
    )
    for said, right, seen_as in slips:
        acting = tuple(e for e in added if e in seen_as)
        if acting:
            # Instruments may be elsewhere all the same, and others may have stood in for the slip.
            yield _Slip(said, right, (acting, acting[:1], acting[-1:], tuple(added)))


def _wheelbase(car: Vehicle, added: Sequence[str]) -> Iterator[_Slip]:
    """The wheelbase in place of the longer length, where the rest puts the mass nearer the middle.

    It does where one length is more than 1.6 times the other. Few cars are so: for all others there
    is no search.
    """
    shorter, longer = sorted((car.lf_m, car.lr_m))
    if abs(shorter / longer - 0.5) < abs(shorter / car.wheelbase_m - 0.5):
        key = "lf_m" if car.lf_m == longer else "lr_m"
        said = f"{key} = {longer - shorter:g} ({longer:g} being the wheelbase)"
        yield _Slip(said, car.replace(**{key: longer - shorter}), (tuple(added),))
