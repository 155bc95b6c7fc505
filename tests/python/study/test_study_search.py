"""What the search for missing effects asks of its steps."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest

from sysid_vehicle import Diagnosis, Fit, diagnose
from sysid_vehicle.rules import USUAL
from sysid_vehicle.study.search.search import Search, Trail

AGAINST = ["aero_drag", "rolling_resistance", "head_wind"]


def test_what_was_near_the_best_is_refitted_in_the_next_step_too(
    hidden_fit: Callable[[str, float], Fit], monkeypatch: pytest.MonkeyPatch
) -> None:
    fit = hidden_fit("aero_drag.drag_area_m2", 0.6)
    dx = diagnose(fit, candidates=AGAINST)
    asked: list[set[str]] = []

    def noted(_: Fit, *, again: Sequence[str], **__: object) -> Diagnosis:
        asked.append(set(again))
        few = dx.ranking if len(asked) == 1 else ()
        return replace(dx, ranking=few, proposed=replace(dx.proposed, known=()))

    monkeypatch.setattr("sysid_vehicle.study.search.search.diagnose", noted)
    trail = Trail([fit])
    Search(
        fit.driving,
        candidates=AGAINST,
        most_effects=1,
        ends=np.inf,
        rules=USUAL,
        seed=0,
        progress=False,
        say=lambda _: None,
    ).follow(trail)
    assert trail.fit is not fit
    assert asked == [set(), {c.id for c in dx.significant if c.finished}]
    assert len(asked[1]) > 1


def test_steps_with_which_the_model_errs_more_ahead_than_the_baseline_are_taken_back(
    hidden_fit: Callable[[str, float], Fit],
) -> None:
    baseline = hidden_fit("aero_drag.drag_area_m2", 0.6)
    dx = diagnose(baseline, candidates=["aero_drag"])
    good = dx.ranking[0].fit
    assert good is not None
    windy = good.model.add("head_wind").with_values({"head_wind.speed_mps": 30.0})
    bad = replace(good, model=windy)
    told = [replace(dx, fit=f) for f in (baseline, good, bad)]
    trail = Trail([baseline, good, bad], list(told))
    trail.without_harm(baseline.driving, USUAL)
    assert trail.fits == [baseline, good]
    assert trail.diagnoses == told[:2]
    assert trail.taken_back == ("head_wind",)
    trail.without_harm(baseline.driving, USUAL)
    assert trail.fits == [baseline, good]
    assert trail.taken_back == ()


def test_what_a_fit_left_open_does_not_speak_against_a_step(
    hidden_fit: Callable[[str, float], Fit], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Parameters that serve validation data count, as far as the fit left them unsure."""
    baseline = hidden_fit("aero_drag.drag_area_m2", 0.6)
    dx = diagnose(baseline, candidates=["aero_drag"])
    good = dx.ranking[0].fit
    assert good is not None
    windy = good.model.add("head_wind").with_values({"head_wind.speed_mps": 30.0})
    lost = replace(good, model=windy)
    trail = Trail([baseline, lost], [replace(dx, fit=f) for f in (baseline, lost)])
    served = {id(lost): good}
    monkeypatch.setattr(
        "sysid_vehicle.study.search.search.serving", lambda fit, _: served.get(id(fit), fit)
    )
    trail.without_harm(baseline.driving, USUAL)
    assert trail.fit is lost
    assert trail.taken_back == ()
    served.clear()
    trail.without_harm(baseline.driving, USUAL)
    assert trail.fits == [baseline]
