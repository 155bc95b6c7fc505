"""The time of a change is the likeliest of many, wherever a search begins."""

from __future__ import annotations

import pytest

import sysid_vehicle as sv
from sysid_vehicle.identify import refit

CAR = sv.example_vehicle()
SLIPPERY = {"friction_change.drop": 0.4, "friction_change.at_s": 14.0}


@pytest.fixture(scope="module")
def baseline() -> sv.Fit:
    """Of a car on a road that turns slippery in a bend, which the model does not know."""
    truth = sv.Model(CAR).add("friction_change").with_values(SLIPPERY)
    pushes = sv.RoadDisturbance(fx_n=120.0, fy_n=150.0, mz_nm=150.0)
    road = sv.manoeuvres.usual_road("country", 50.0, seed=9)
    log = sv.drive(truth, road, seed=4, disturbance=pushes, rate_hz=50.0)
    return sv.identify(sv.Model(CAR), log, starts=1, seed=0, progress=False)


@pytest.mark.parametrize("begin_s", [6.25, 25.0, 43.75])
def test_the_time_of_a_change_is_found_from_anywhere(baseline: sv.Fit, begin_s: float) -> None:
    effect = sv.effect("friction_change")
    model = baseline.model.add(effect).with_values(
        {"friction_change.drop": 0.1, "friction_change.at_s": begin_s}
    )
    found = refit(model, baseline.driving, baseline.noise, scanned=(effect,))
    stuck = refit(model, baseline.driving, baseline.noise)
    assert found.model.value("friction_change.at_s") == pytest.approx(14.0, abs=0.5)
    assert found.log_likelihood >= stuck.log_likelihood


def test_no_slope_leads_there(baseline: sv.Fit) -> None:
    """The test above would otherwise show nothing."""
    model = baseline.model.add("friction_change").with_values(
        {"friction_change.drop": 0.1, "friction_change.at_s": 43.75}
    )
    stuck = refit(model, baseline.driving, baseline.noise)
    assert abs(stuck.model.value("friction_change.at_s") - 14.0) > 5.0
