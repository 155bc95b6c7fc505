"""Longitudinal and lateral speed in each other's columns, of whatever sign."""

import numpy as np
import pytest

import sysid_vehicle as sv
from sysid_vehicle.log.laws.plausibility import contradictions

Columns = dict[str, np.ndarray]
_SWAPPED = (
    "vx_mps and vy_mps: seem to be swapped: .* in the channel map name the column of vy_mps for "
    "vx_mps and that of vx_mps for vy_mps"
)


@pytest.fixture(scope="module")
def right(truth: sv.Model) -> sv.Log:
    return sv.drive(truth, sv.manoeuvres.handling_course(40.0), seed=562201)


@pytest.fixture
def data(right: sv.Log) -> Columns:
    return {name: np.array(right[name]) for name in right.channels}


def mapped(data: Columns, signs: tuple[float, float]) -> sv.Log:
    """What the log is with the map that the message asks for."""
    x, y = signs
    swapped = {"vx_mps": x * data["vy_mps"], "vy_mps": y * data["vx_mps"]}
    return sv.Log.from_arrays({**data, **swapped}, name="course")


@pytest.mark.parametrize("mirrored", [False, True], ids=["ISO 8855", "SAE J670"])
@pytest.mark.parametrize(
    ("signs", "words"),
    [
        ((1.0, 1.0), ""),
        ((-1.0, 1.0), ", with factor = -1 for vx_mps"),
        ((1.0, -1.0), ", with factor = -1 for vy_mps"),
        ((-1.0, -1.0), ", with factor = -1 for vx_mps and vy_mps"),
    ],
)
def test_the_swap_is_named_with_the_signs_that_mend_it(
    right: sv.Log, data: Columns, signs: tuple[float, float], words: str, mirrored: bool
) -> None:
    if mirrored:
        for name in ("vy_mps", "yaw_rate_radps", "ay_mps2", "steer_rad"):
            data[name] = -data[name]
    x, y = signs
    wrong = {**data, "vx_mps": y * data["vy_mps"], "vy_mps": x * data["vx_mps"]}
    with pytest.raises(sv.InvalidInput, match=f"^course: {_SWAPPED}{words}$"):
        sv.Log.from_arrays(wrong, name="course")
    again = mapped(wrong, signs)
    np.testing.assert_array_equal(again["vx_mps"], right["vx_mps"])


def test_so_it_is_of_a_unit_that_is_turned_as_a_whole(data: Columns) -> None:
    wrong = {
        **data,
        "vx_mps": data["vy_mps"],
        "vy_mps": -data["vx_mps"],
        "ax_mps2": data["ay_mps2"],
        "ay_mps2": -data["ax_mps2"],
    }
    with pytest.raises(sv.InvalidInput, match=f"{_SWAPPED}, with factor = -1 for vx_mps$"):
        sv.Log.from_arrays(wrong, name="course")


def test_speeds_over_ground_are_not_swapped(data: Columns) -> None:
    """Whichever of them is the larger one."""
    heading = np.cumsum(data["yaw_rate_radps"]) / 100.0
    turned = (data["vx_mps"] + 1j * data["vy_mps"]) * np.exp(1j * heading)
    larger = np.sort([np.abs(turned.real).mean(), np.abs(turned.imag).mean()])
    assert larger[0] > 0.1 * larger[1]
    for east in (turned, 1j * turned):
        wrong = {**data, "vx_mps": east.real, "vy_mps": east.imag}
        with pytest.raises(sv.InvalidInput, match="are speeds over ground"):
            sv.Log.from_arrays(wrong, name="course")


def test_a_car_that_drives_straight_on_is_not_asked(truth: sv.Model) -> None:
    """Speeds over ground are swapped for a car that drives to the north."""
    log = sv.drive(truth, sv.manoeuvres.straight_acceleration(), seed=562202)
    data = {name: np.array(log[name]) for name in log.channels}
    north = {**data, "vx_mps": data["vy_mps"], "vy_mps": data["vx_mps"]}
    assert not any("swapped" in c.text for c in contradictions(north, 100.0))


def test_a_slide_is_no_swap(data: Columns) -> None:
    """For a third of the drive the car goes sideways."""
    some = np.arange(data["vx_mps"].size) % 900 < 300
    speed = np.hypot(data["vx_mps"], data["vy_mps"])
    data["vx_mps"], data["vy_mps"] = (
        np.where(some, 0.6 * speed, data["vx_mps"]),
        np.where(some, 0.8 * speed, data["vy_mps"]),
    )
    assert not any("swapped" in c.text for c in contradictions(data, 100.0))
