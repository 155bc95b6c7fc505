"""Arguments of another kind than annotated are named, by one rule for all public functions."""

import dataclasses
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest

import sysid_vehicle as sv
from sysid_vehicle import manoeuvres, online, twin
from sysid_vehicle._common.arrays import FloatArray, as_float64
from sysid_vehicle._common.typed import typed, typed_fields

CAR = sv.example_vehicle()
MODEL = sv.Model(CAR)


@typed
def takes(
    count: int = 1,
    size: float = 1.0,
    names: Sequence[str] = (),
    shares: Mapping[str, float] | Iterable[str] = (),
    kind: Literal["a", "b"] = "a",
    path: str | Path | None = None,
    values: FloatArray | None = None,
    told: Callable[[], None] | None = None,
    pair: tuple[float, float] = (0.0, 1.0),
    *,
    fails: type[Exception] = TypeError,
) -> None:
    """Fail as NumPy would."""
    raise fails("no words for people")


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"count": 1.5}, r"takes: count = 1.5 \(float\); give a whole number"),
        ({"count": True}, "give a whole number"),
        ({"size": "x"}, r"takes: size = 'x' \(str\); give a number"),
        ({"size": None}, "give a number"),
        ({"names": "abc"}, r"takes: names = 'abc' \(str\); give a list of strings"),
        ({"names": ["a", 3]}, "give a list of strings"),
        ({"shares": {"a": "b"}}, "give a mapping from a string to a number or a list of strings"),
        ({"kind": "c"}, "give 'a' or 'b'"),
        ({"path": 3}, "give a string or a path or None"),
        ({"values": ["x"]}, "give an array of numbers or None"),
        ({"told": 3}, "give a function or None"),
        ({"pair": (1.0, 2.0, 3.0)}, "give a list of numbers"),
    ],
)
@pytest.mark.parametrize("fails", [TypeError, AttributeError, ValueError, KeyError, IndexError])
def test_the_argument_is_named(given: dict[str, Any], message: str, fails: type[Exception]) -> None:
    with pytest.raises(sv.InvalidInput, match=message) as caught:
        takes(**given, fails=fails)
    assert isinstance(caught.value.__cause__, fails)


@pytest.mark.parametrize(
    "given",
    [
        {},
        {"count": np.int64(3), "size": np.float32(2.0), "names": ("a",), "shares": ["a"]},
        {"shares": {"a": 1}, "path": Path("x"), "values": [1, 2], "told": print, "pair": [0, 1]},
    ],
)
def test_an_error_that_no_argument_causes_stays(given: dict[str, Any]) -> None:
    with pytest.raises(TypeError, match="no words for people"):
        takes(**given)
    with pytest.raises(TypeError, match="unexpected keyword"):
        takes(unknown=3)  # type: ignore[call-arg]
    with pytest.raises(sv.NumericalError, match="no words"):
        takes(count="x", fails=sv.NumericalError)  # type: ignore[arg-type]


def test_fields_of_a_dataclass_are_named() -> None:
    @dataclasses.dataclass(frozen=True)
    class Sized:
        size: float

        @typed_fields
        def __post_init__(self) -> None:
            if self.size < 0.0:
                raise sv.InvalidInput("negative")

    with pytest.raises(sv.InvalidInput, match=r"Sized: size = 'x' \(str\); give a number"):
        Sized("x")  # type: ignore[arg-type]
    with pytest.raises(sv.InvalidInput, match="negative"):
        Sized(-1.0)


LOAD: Any = dataclasses.asdict(twin.NOMINAL_SUV)
ANYTHING: dict[str, Callable[[Any], object]] = {
    "Model.with_values: values": MODEL.with_values,
    "drive: noise": lambda x: sv.drive(MODEL, manoeuvres.lap(duration_s=1.0), seed=1, noise=x),
    "estimate_sideslip: log": lambda x: online.estimate_sideslip(CAR, x),
    "SideslipObserver: settings": lambda x: online.SideslipObserver(CAR, x),
    "SideslipObserver.step: dt_s": lambda x: online.SideslipObserver(CAR).step(x, 0, 9, 0, 0, 0),
    "observe: load": lambda x: twin.observe(
        twin.TwinCar(),
        x,
        np.zeros((9, 24)),
        twin.Readings(np.zeros((9, 16)), {}, 1e-3),
        twin.Observer(),
        speed_mps=9.0,
    ),
    "Load: mass_kg": lambda x: twin.Load(**{**LOAD, "mass_kg": x}),
    "SideBySide: unknowns": lambda x: twin.SideBySide(x, {"ax_mps2": 0.1}),
    "drive14: references": lambda x: twin.drive14(twin.TwinCar(), None, x),
    "DriveLimits: speed_mps": lambda x: sv.DriveLimits(speed_mps=x),
    "define_effect: title": lambda x: sv.define_effect("it", title=x, parameters=[]),
    "load_effects: path": sv.load_effects,
    "forget_effect: id": sv.forget_effect,
}


@pytest.mark.parametrize(
    "given", [object(), ["x"], {"B_front": None}], ids=["object", "list", "mapping"]
)
@pytest.mark.parametrize("argument", ANYTHING)
def test_public_functions_name_what_is_of_another_kind(argument: str, given: object) -> None:
    with pytest.raises(sv.InvalidInput) as caught:
        ANYTHING[argument](given)
    # A mapping is of the right kind there, its value is not.
    of_values = argument.startswith("Model.with_values") and isinstance(given, dict)
    assert ("B_front" if of_values else argument.rpartition(" ")[2]) in str(caught.value)


def test_functions_of_effects_say_how_they_fail() -> None:
    share = sv.parameter("share", "-", typical=0.1, lower=0.0, upper=1.0)
    with pytest.raises(sv.InvalidInput, match=r"the function fails .*one of two arguments"):
        sv.define_effect("mine", title="t", parameters=[share], force_x=lambda p: p)  # type: ignore


def test_references_and_times_of_the_twins_drives_are_checked() -> None:
    car = twin.TwinCar()
    with pytest.raises(sv.InvalidInput, match=r"references have shape \(5,\); give \(n, 3\)"):
        twin.drive14(car, None, as_float64(np.zeros(5)))
    with pytest.raises(sv.InvalidInput, match="duration_s = nan: give seconds"):
        twin.urban_cycle(car, duration_s=float("nan"))
    with pytest.raises(sv.InvalidInput, match="dt_s = nan; give seconds"):
        twin.urban_cycle(car, dt_s=float("nan"))
