"""Lags far shorter than their usual size are fitted as they are."""

import pytest

from sysid_vehicle import Model, drive, effect, identify, manoeuvres


@pytest.mark.parametrize(
    ("name", "true_s"), [("force_lag.time_constant_s", 0.009), ("steer_lag.time_constant_s", 0.004)]
)
def test_a_lag_below_a_tenth_of_its_usual_size(truth: Model, name: str, true_s: float) -> None:
    lag = effect(name.partition(".")[0])
    typical = lag.parameters[0].typical
    assert true_s < 0.1 * typical
    lagging = truth.add(lag.id)
    log = drive(lagging.with_values({name: true_s}), manoeuvres.lap(30.0), seed=8)
    found = identify(lagging.with_values({name: typical}), log, starts=1)[name]
    assert found.note == ""
    assert abs(found.value - true_s) < 3.0 * found.std
    assert found.std < 0.25 * true_s
