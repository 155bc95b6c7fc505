"""A law that knows no car may doubt the time of the steering; the fitted model tells."""

from collections.abc import Callable

import numpy as np
import pytest

from sysid_vehicle import Fit, Log, Model, compare, drive, identify
from sysid_vehicle import manoeuvres as drives
from sysid_vehicle.compare.clock import steering_on_time
from sysid_vehicle.estimate import Driving
from sysid_vehicle.log import Contradiction

DOUBT_S = 0.06


@pytest.fixture(scope="module")
def late(course: Log, altered: Callable[..., Log]) -> Callable[[float], Log]:
    def make(by_s: float) -> Log:
        then = np.interp(course["time_s"] - by_s, course["time_s"], course["steer_rad"])
        return altered(course, steer_rad=then)

    return make


@pytest.mark.parametrize("by_s", [DOUBT_S, -DOUBT_S])
def test_what_is_late_is_not_called_on_time(
    fit: Fit, late: Callable[[float], Log], start: Model, by_s: float
) -> None:
    log = late(by_s)
    for fitted in (fit, identify(start, log, starts=1)):  # of the lap, which is on time, and of it
        doubted = Driving.of(log), fitted.model, fitted.noise
        assert not steering_on_time(*doubted, DOUBT_S)
        assert not steering_on_time(*doubted, -DOUBT_S)


def test_what_is_on_time_is_found_so_where_that_shows(fit: Fit, course: Log, truth: Model) -> None:
    assert steering_on_time(Driving.of(course), fit.model, fit.noise, DOUBT_S)
    assert steering_on_time(Driving.of(course), fit.model, fit.noise, -DOUBT_S)
    assert not steering_on_time(Driving.of(course), fit.model, fit.noise, 1e-4)
    straight = drive(truth, drives.straight_acceleration(), seed=3, rate_hz=50.0)
    assert not steering_on_time(Driving.of(straight), fit.model, fit.noise, DOUBT_S)


def test_a_doubt_that_the_likelihood_does_not_share_is_no_contradiction(
    fit: Fit, course: Log, late: Callable[[float], Log], monkeypatch: pytest.MonkeyPatch
) -> None:
    doubt = Contradiction("steer_rad", "steer_rad: lags behind", DOUBT_S)
    monkeypatch.setattr(Log, "contradictions", property(lambda _: (doubt,)))
    assert compare(fit, course).unrelated == {}
    assert compare(fit, late(DOUBT_S)).unrelated == {"steer_rad": doubt.text}
    other = Contradiction("yaw_rate_radps", "yaw_rate_radps: lags behind", DOUBT_S)
    monkeypatch.setattr(Log, "contradictions", property(lambda _: (other,)))
    assert compare(fit, course).unrelated == {"yaw_rate_radps": other.text}
