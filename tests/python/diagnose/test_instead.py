"""Whether something unknown would do in place of an effect."""

from dataclasses import replace

import numpy as np
import pytest

from sysid_vehicle import (
    Driving,
    Fit,
    Model,
    SensorNoise,
    drive,
    example_vehicle,
    identify,
    manoeuvres,
)
from sysid_vehicle.diagnose import instead
from sysid_vehicle.diagnose.candidates.instead import _hats, _remembered


@pytest.fixture(scope="module")
def wrong_gyro(fit: Fit, truth: Model) -> tuple[Fit, Driving]:
    """A fit of a car whose gyro was right, and driving where it is not."""
    car = truth.add("gyro_bias").with_values({"gyro_bias.bias_radps": 0.004})
    return fit, Driving.of(drive(car, manoeuvres.lap(20.0), seed=5, rate_hz=50.0))


@pytest.mark.parametrize(
    ("effects", "away"),
    [
        (("gyro_bias",), set()),
        (("side_wind",), {"side_wind"}),
        # One that does nothing beside the cause is for other tests: nothing unknown is there.
        (("gyro_bias", "mass"), set()),
    ],
)
def test_what_stands_in_for_a_wrong_gyro_is_explained_away(
    wrong_gyro: tuple[Fit, Driving], effects: tuple[str, ...], away: set[str]
) -> None:
    """The effects need no values: their scores tell what they would do."""
    fit, driving = wrong_gyro
    found = instead(replace(fit, model=fit.model.add(*effects)), driving, effects)
    assert set(found.away) == away
    assert (found.omnibus.p_value < 1e-6) == bool(away)
    assert all(what == "error of r" for what in found.away.values())


def test_what_is_missing_beside_an_effect_does_not_take_its_place(fit: Fit, truth: Model) -> None:
    """A drag is no part of what a wrong gyro does."""
    values = {"gyro_bias.bias_radps": 0.004, "aero_drag.drag_area_m2": 0.45}
    car = truth.add("gyro_bias", "aero_drag").with_values(values)
    driving = Driving.of(drive(car, manoeuvres.lap(20.0), seed=5, rate_hz=50.0))
    found = instead(replace(fit, model=fit.model.add("gyro_bias")), driving, ["gyro_bias"])
    assert found.omnibus.p_value < 1e-6
    assert found.omnibus.strongest in ("F_x", "dv_x/dt")
    assert found.away == {}


@pytest.mark.parametrize(
    ("hidden", "away"),
    [
        ({"aero_drag.drag_area_m2": 0.45, "force_gain.drive_error": 0.03}, {}),
        ({"force_gain.drive_error": 0.1}, {"aero_drag": "F_x"}),
    ],
)
def test_forces_that_contain_an_effect_explain_more_by_what_they_add(
    fit: Fit, truth: Model, hidden: dict[str, float], away: dict[str, str]
) -> None:
    """Forces along the car that depend on the driving contain a drag, whatever else is missing."""
    car = truth.add(*(name.split(".")[0] for name in hidden)).with_values(hidden)
    driving = Driving.of(drive(car, manoeuvres.lap(20.0), seed=5, rate_hz=50.0))
    found = instead(replace(fit, model=fit.model.add("aero_drag")), driving, ["aero_drag"])
    assert found.omnibus.p_value < 1e-3
    assert found.omnibus.strongest in ("F_x", "dv_x/dt", "a_x")
    assert found.away == away


def test_signals_of_unknown_forces() -> None:
    slip = np.linspace(-0.2, 0.2, 401)
    curves = _hats(slip)
    np.testing.assert_allclose(curves, -curves[::-1], atol=1e-15)
    # At each knot one curve is 1 and the others nothing; beyond the last one it stays.
    for k, knot in enumerate((0.01, 0.02, 0.04, 0.08, 0.16)):
        here = curves[np.argmin(np.abs(slip - knot))]
        np.testing.assert_allclose(here, np.eye(5)[k], atol=1e-12)
    np.testing.assert_allclose(curves[-1], np.eye(5)[4], atol=1e-12)
    # A step is remembered as a low-pass does, anew in each stretch, whatever its rate.
    rate = np.repeat([100.0, 50.0], 400)
    memory = _remembered(np.ones((800, 1)), np.array([0, 400]), rate)
    for seconds, column in zip((0.5, 2.0, 8.0), memory.T, strict=True):
        t = np.concatenate([np.arange(1, 401) / 100.0, np.arange(1, 401) / 50.0])
        np.testing.assert_allclose(column, 1.0 - np.exp(-t / seconds), rtol=1e-9)


def test_noise_of_the_steering_is_no_unknown_force() -> None:
    """It stands in the directions and in the residuals: their product does not average out."""
    model, noise = Model(example_vehicle()), SensorNoise(steer_rad=1e-3)
    road = manoeuvres.Manoeuvre(
        *("road", "bends", 100.0),
        *(lambda t: 20.0 + 4.0 * np.sin(0.1 * t), lambda t: 3.0 * np.sin(0.35 * t) ** 3),
        tracks_path=True,
    )
    fit = identify(model, drive(model, road, seed=563, rate_hz=50.0, noise=noise), starts=1)
    assert instead(fit, fit.driving, ()).omnibus.p_value > 0.01
