"""Public functions and methods of the laboratory and the online estimators name bad arguments."""

import dataclasses
import inspect
from collections.abc import Callable, Iterator
from types import ModuleType
from typing import Any

import numpy as np
import pytest

import sysid_vehicle as sv
from sysid_vehicle import lab, online

CAR = sv.example_vehicle()
RECORD: dict[str, Any] = {
    "rate_hz": 100.0,
    "force_x_n": 0.0,
    "steer_rad": 0.0,
    "stiffness_front_nprad": 1e5,
    "stiffness_rear_nprad": 1e5,
    "readings": np.ones((9, 4)),
}


def taking(module: ModuleType) -> Iterator[tuple[str, Callable[..., object]]]:
    """Functions, methods and checks of dataclasses with arguments of their own."""
    for name in module.__all__:
        it = getattr(module, name)
        if inspect.isfunction(it):
            yield name, it
        for key, value in vars(it).items() if inspect.isclass(it) else ():
            method = value.__func__ if isinstance(value, classmethod) else value
            own = key != "__init__" or not dataclasses.is_dataclass(it)
            public = own and (not key.startswith("_") or key in ("__init__", "__post_init__"))
            if public and inspect.isfunction(method):
                yield f"{name}.{key}", method


@pytest.mark.parametrize("module", [lab, online], ids=["lab", "online"])
def test_each_is_typed(module: ModuleType) -> None:
    left = [
        name
        for name, it in taking(module)
        if (name.endswith("__post_init__") or len(inspect.signature(it).parameters) > 1)
        and not hasattr(it, "__wrapped__")
    ]
    assert not left


@pytest.mark.parametrize("name", RECORD)
def test_the_array_of_a_record_is_named(name: str) -> None:
    wanted = "a number" if name == "rate_hz" else "a number or an array of numbers"
    with pytest.raises(sv.InvalidInput, match=rf"{name} = 'abc' \(str\); give {wanted}"):
        lab.ObserverRecord.from_arrays(**{**RECORD, name: "abc"})


CALLS: dict[str, Callable[[Any], object]] = {
    "CorneringRls.step: alpha_f_rad": lambda x: online.CorneringRls(CAR).step(x, 0.0, 0.0, 0.0),
    "CorneringRls.run: readings": lambda x: online.CorneringRls(CAR).run(x),
    "MuSlipFilter.update: slip": lambda x: online.MuSlipFilter(0.04).update(x, 0.1),
    "MuSlipFilter.update: mu": lambda x: online.MuSlipFilter(0.04).update(0.1, x),
    "MuSlipCurve.vector: values": lambda x: online.TWO_PARAMETER.vector(x),
    "simulate_mu_slip: slip": lambda x: online.simulate_mu_slip(slip=x),
    "ObserverCar: mass_kg": lambda x: lab.ObserverCar(x, 1.0, 1.0, 1.0),
    "ObserverCar.of: vehicle": lab.ObserverCar.of,
    "Limits: road_width_m": lambda x: lab.Limits(road_width_m=x),
    "Setup.of: plant": lab.Setup.of,
    "Nominal.of: vehicle": lab.Nominal.of,
    "Tyre.friction: slip": sv.Tyre(10.0, 1.4, 1.0, 0.0).friction,
}


@pytest.mark.parametrize("argument", CALLS)
@pytest.mark.parametrize("given", ["a", object()], ids=["text", "object"])
def test_arguments_of_methods_are_named(argument: str, given: object) -> None:
    with pytest.raises(sv.InvalidInput, match=argument.rpartition(": ")[2]):
        CALLS[argument](given)
