"""Units told by the laws of motion and by magnitude: what looks alike is named beside the usual."""

import numpy as np
import pytest
from single_track import Change, drive, times

from sysid_vehicle.errors import InvalidInput
from sysid_vehicle.log import Log

G = 9.80665
WRONG: dict[str, tuple[Change, list[str]]] = {
    "vx in knots": (
        times(vx_mps=1 / 0.514444),
        ["vx_mps: seems to be in knots or miles", "factor = 0.5144444 or factor = 0.44704 for vx"],
    ),
    "vx in ft/s": (
        times(vx_mps=1 / 0.3048),
        ["vx_mps: seems to be in feet per second or", "factor = 0.3048 or", "0.2777778 for vx"],
    ),
    "vx in rad/s of wheels": (
        times(vx_mps=1 / 0.325),
        ["vx_mps: seems to be in rad/s of a wheel or", "factor = the radius of the tyre [m] or"],
    ),
    "vx in rpm of wheels": (
        times(vx_mps=60.0 / (2.0 * np.pi * 0.32)),
        ["seems to be in rpm of a wheel, or ay", "0.1047198 times the radius of the tyre"],
    ),
    "vx in mph, ay in g": (
        times(vx_mps=1 / 0.44704, ay_mps2=1 / G),
        ["ay_mps2: seems to be in g and vx_mps: seems to be in miles per hour: ay_mps2 /"],
    ),
    "vx in knots, ay in g": (
        times(vx_mps=1 / 0.514444, ay_mps2=1 / G),
        ["g and vx_mps: seems to be in knots, or", "9.80665 for ay_mps2 and factor = 0.5144444"],
    ),
    "vx in rpm of a lorry's wheels": (
        times(vx_mps=60.0 / (2.0 * np.pi * 0.48)),
        ["vx_mps: seems to be in rpm of a wheel, or", "0.1047198 times the radius of the tyre"],
    ),
    "vx in mm/s": (times(vx_mps=1e3), ["vx_mps: ", "if it is in mm/s, put factor = 0.001 in"]),
    "vx in cm/s": (times(vx_mps=1e2), ["vx_mps: ", "if it is in cm/s, put factor = 0.01 in"]),
    "ay in ft/s2": (
        times(ay_mps2=1 / 0.3048),
        ["ay_mps2: seems to be in ft/s2: ", "factor = 0.3048 for ay_mps2"],
    ),
    "ax in ft/s2": (
        times(ax_mps2=1 / 0.3048),
        ["ax_mps2: seems to be in ft/s2: ", "factor = 0.3048 for ax_mps2"],
    ),
    "yaw rate in rpm": (
        times(yaw_rate_radps=30.0 / np.pi),
        ["yaw_rate_radps: seems to be in rpm", "factor = 0.1047198 for yaw_rate_radps"],
    ),
    "yaw rate times 6": (
        times(yaw_rate_radps=6.0),
        ["is 0.167 instead of about 1", "check the units of these channels and put their factors"],
    ),
    "yaw rate in turns": (
        times(yaw_rate_radps=0.5 / np.pi),
        ["yaw_rate_radps: seems to be in turns per second: ", "factor = 6.283185 for yaw"],
    ),
    "ay in mg": (
        times(ay_mps2=1e3 / G),
        ["if it is in mg, put factor = 0.00980665; if it is in cm/s2, put factor = 0.01 in"],
    ),
    "straight, vx in knots": (
        lambda data: data.update(drive(0.0), vx_mps=drive(0.0)["vx_mps"] / 0.514444),
        ["vx_mps: seems to be in knots or miles", "0.5144444"],
    ),
    "straight, vx in rpm of wheels": (
        lambda data: data.update(drive(0.0), vx_mps=drive(0.0)["vx_mps"] / 0.0325),
        ["seems to be in rpm of a wheel, or ax", "0.1047198 times the radius"],
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_the_unit_is_named(case: str) -> None:
    change, words = WRONG[case]
    data = drive()
    change(data)
    with pytest.raises(InvalidInput) as caught:
        Log.from_arrays(data, name="lap 3")
    for word in ["lap 3: ", *words]:
        assert word in str(caught.value)


@pytest.mark.parametrize(
    ("factor", "words"),
    [
        (3.6, "vx_mps: seems to be in km/h: "),
        (1 / 0.44704, "vx_mps: seems to be in miles per hour: "),
    ],
)
def test_usual_units_are_named_alone(factor: float, words: str) -> None:
    data = drive()
    data["vx_mps"] *= factor
    with pytest.raises(InvalidInput, match=words):
        Log.from_arrays(data)
