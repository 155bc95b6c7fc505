"""Lags far shorter than their usual size are fitted as they are."""

import pytest

from sysid_vehicle import (
    Model,
    define_effect,
    drive,
    effect,
    forget_effect,
    identify,
    manoeuvres,
    parameter,
)
from sysid_vehicle.identify import free_box


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


@pytest.mark.parametrize(("typical", "bounds"), [(-2.0, (-5.0, 0.0)), (2.0, (-5.0, 5.0))])
def test_only_what_cannot_be_negative_is_kept_from_zero(
    truth: Model, typical: float, bounds: tuple[float, float]
) -> None:
    low, high = bounds
    gain = parameter("gain", "N s/m", typical=typical, lower=low, upper=high)
    steep = define_effect(
        "steep",
        title="a force that hardly begins",
        parameters=[gain],
        force_y=lambda d, p: p.gain**3 * d.v_y,
    )
    try:
        assert steep.scored_at_typical
        box = free_box(truth.add("steep"))
        assert (box.lower[-1], box.upper[-1]) == bounds
    finally:
        forget_effect("steep")
