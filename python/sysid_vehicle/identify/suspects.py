"""What in a car or in driving is likely to blame where its filter fails."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import wraps
from inspect import signature
from typing import ParamSpec, TypeVar

import numpy as np

from .._common.arguments import expect, whole
from .._common.progress import doing
from .._common.text import few
from .._common.threads import at_most, small_matrices
from ..errors import explained
from ..estimate import Driving
from ..log import Log
from ..model import Model
from ..vehicle import AXLES
from .fit import Fit

_P = ParamSpec("_P")
_T = TypeVar("_T")

# From a kart to a loaded truck.
_CARS = {
    "mass_kg": (80.0, 50000.0),
    "lf_m": (0.3, 8.0),
    "lr_m": (0.3, 8.0),
    "cg_height_m": (0.0, 2.5),
    "drag_area_m2": (0.0, 12.0),
}
_TYRES = {"B": (2.0, 50.0), "C": (0.5, 2.5), "D": (0.05, 2.5), "E": (-20.0, 1.0)}
_INERTIA_RATIO = (0.3, 3.0)  # over mass_kg * lf_m * lr_m
_READINGS = {
    "vx_mps": 120.0,
    "vy_mps": 30.0,
    "yaw_rate_radps": 5.0,
    "ax_mps2": 50.0,
    "ay_mps2": 50.0,
    "steer_rad": 1.2,
}


def suspects(model: Model | None, logs: Sequence[Log]) -> str:
    """Name physically implausible parameters, and channels that are constant or out of range."""
    found = [*(_of_car(model) if model is not None else ()), *_of_driving(logs)]
    if not found:
        return (
            "check the units and signs of the log, and the masses, lengths and tyres of the "
            "vehicle file"
        )
    return f"check {few(found)}"


def explaining(function: Callable[_P, _T]) -> Callable[_P, _T]:
    """A public function whose arguments are checked, and whose failures name what is to blame.

    Checked are a leading `Fit` or `Model`, and whatever is called `seed`, `starts` or `workers`.
    Numerical failures name the suspects among all arguments. Where somebody watches, a call that
    takes long says that it goes on. All its threads are those of `workers`.
    """
    told = signature(function)
    first = next(iter(told.parameters.values()))
    wanted = {"Fit": Fit, "Model": Model}.get(str(first.annotation))

    @wraps(function)
    def call(*args: _P.args, **kwargs: _P.kwargs) -> _T:
        by_name = told.bind(*args, **kwargs).arguments
        if wanted is not None:
            expect(by_name[first.name], wanted, function.__name__)
        for name, least in (("seed", 0), ("starts", 1), ("workers", 1)):
            if name in by_name and not (name == "workers" and by_name[name] is None):
                whole(by_name[name], name, least)
        given = (*args, *kwargs.values())
        shown = None if by_name.get("progress") is not False else False
        threads: object = by_name.get("workers")
        with (
            at_most(threads if isinstance(threads, int) else None),
            small_matrices,
            doing(function.__name__.replace("_", " "), shown),
            explained(
                lambda: ", ".join(log.name for log in _logs(given)),
                lambda: suspects(next(_models(given), None), _logs(given)),
            ),
        ):
            return function(*args, **kwargs)

    return call


def _models(arguments: Iterable[object]) -> Iterator[Model]:
    for x in arguments:
        if isinstance(x, Model):
            yield x
        elif isinstance(x, Fit):
            yield x.model


def _logs(arguments: Iterable[object]) -> list[Log]:
    """All logs among the arguments; those of a fit where no others are."""
    found: list[Log] = []
    fitted: list[Log] = []
    for x in arguments:
        if isinstance(x, Fit):
            fitted += x.driving.logs
        elif isinstance(x, Driving):
            found += x.logs
        elif isinstance(x, Log):
            found.append(x)
        elif isinstance(x, list | tuple):
            found += [y for y in x if isinstance(y, Log)]
    return list(dict.fromkeys(found or fitted))


def _of_car(model: Model) -> list[str]:
    car = model.vehicle
    values = [(n, getattr(car, n), low, high) for n, (low, high) in _CARS.items()]
    values += [
        (f"{letter}_{axle}", model.value(f"{letter}_{axle}"), low, high)
        for axle in AXLES
        for letter, (low, high) in _TYRES.items()
    ]
    low, high = (ratio * car.usual_inertia_kgm2 for ratio in _INERTIA_RATIO)
    values.append(("yaw_inertia_kgm2", model.value("yaw_inertia_kgm2"), low, high))
    return [
        f"{name} = {value:.4g} (cars: {low:.4g} to {high:.4g})"
        for name, value, low, high in values
        if not low <= value <= high
    ]


def _of_driving(logs: Sequence[Log]) -> list[str]:
    found = []
    for name in (*_READINGS, "fx_n"):
        for log in logs:
            if not log.has(name):
                continue
            y = np.abs(log[name])
            if not np.isfinite(y).any():
                continue
            k = int(np.nanargmax(y))
            if y[k] > _READINGS.get(name, np.inf):
                found.append(
                    f"{name}, which reaches {log[name][k]:.4g} at {log['time_s'][k]:.6g} s"
                    f" of {log.name}"
                )
            elif np.nanmin(log[name]) == np.nanmax(log[name]):
                found.append(f"{name}, which stays at {log[name][k]:.4g} in {log.name}")
    return found
