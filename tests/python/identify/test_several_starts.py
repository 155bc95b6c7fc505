"""The likeliest of several starts."""

from typing import Any

import pytest

from sysid_vehicle import Fit, Model, NumericalError, drive, identify, manoeuvres
from sysid_vehicle.identify import refine, refine_from, settle, several_starts

DELAY = "steer_delay.delay_s"


@pytest.fixture(scope="module")
def without(truth: Model, start: Model) -> Fit:
    car = truth.add("steer_delay").with_values({DELAY: 0.05})
    log = drive(car, manoeuvres.step_steer((17.0, 27.0), (3.0, 6.0)), seed=5, rate_hz=50.0)
    return identify(start, log, starts=1)


def test_the_likeliest_start_leads(without: Fit) -> None:
    nothing = without.model.add("steer_delay")
    there = nothing.with_values({DELAY: 0.05})
    best = refine_from([nothing, there], without.driving, without.noise)
    alone = [refine(m, without.driving, without.noise) for m in (nothing, there)]
    assert best is not None
    assert best.log_likelihood == pytest.approx(max(f.log_likelihood for f in alone), abs=0.5)
    assert best[DELAY].value == pytest.approx(0.05, abs=3.0 * best[DELAY].std)
    assert best.log_likelihood > without.log_likelihood + 20.0


def test_a_start_that_fails_is_passed_over(without: Fit, monkeypatch: pytest.MonkeyPatch) -> None:
    fails = iter([True, False, True, True])

    def failing(*args: Any, **others: Any) -> Any:
        if next(fails):
            raise NumericalError("the model fails there")
        return settle(*args, **others)

    monkeypatch.setattr(several_starts, "settle", failing)
    begins = [without.model.add("steer_delay")] * 2
    best = refine_from(begins, without.driving, without.noise)
    assert best is not None
    assert best.log_likelihood > without.log_likelihood + 20.0
    assert refine_from(begins, without.driving, without.noise) is None
