"""What the search for missing effects asks of its steps."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import pytest

from sysid_vehicle import Diagnosis, Effect, Fit, diagnose
from sysid_vehicle.diagnose import refining
from sysid_vehicle.identify import refit
from sysid_vehicle.rules import UNKNOWN, USUAL, Share
from sysid_vehicle.study.judge.cautions import cautions
from sysid_vehicle.study.search.search import Search
from sysid_vehicle.study.search.trail import Trail

AGAINST = ["aero_drag", "rolling_resistance", "head_wind"]


def test_what_is_in_the_model_beside_an_effect_is_no_rival_of_it(
    hidden_fit: Callable[[str, float], Fit],
) -> None:
    """A rolling resistance was nearly chosen for a drag, and was needed beside it later."""
    drag = hidden_fit("aero_drag.drag_area_m2", 0.6)
    both = replace(drag, model=drag.model.add("aero_drag", "rolling_resistance"))
    rivals = {"rolling_resistance": ("aero_drag", "head_wind"), "head_wind": ("aero_drag",)}
    trail = Trail([drag, both], rivals=rivals)
    assert trail.confounded == {"rolling_resistance": ("head_wind",)}


def test_what_refines_an_effect_is_a_candidate_beside_it(
    hidden_fit: Callable[[str, float], Fit],
    searching: Callable[..., Search],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    fit = hidden_fit("body_attitude.roll_per_g_rad", 0.06)
    lean = refit(fit.model.add("body_attitude"), fit.driving, fit.noise)
    asked: list[list[str]] = []

    def noted(of: Fit, *, candidates: Sequence[str | Effect], **__: object) -> Diagnosis:
        asked.append([str(getattr(c, "id", c)) for c in candidates])
        return replace(diagnose(of, candidates=AGAINST, refits=0), ranking=())

    monkeypatch.setattr("sysid_vehicle.study.search.search.diagnose", noted)
    one = searching(fit.driving, candidates=AGAINST, most_effects=1, finer=refining())
    one.follow(Trail([fit]))
    one.follow(Trail([fit, lean]))
    assert asked == [AGAINST, [*AGAINST, "body_roll"]]


def test_what_was_near_the_best_is_refitted_in_the_next_step_too(
    hidden_fit: Callable[[str, float], Fit],
    searching: Callable[..., Search],
    monkeypatch: pytest.MonkeyPatch,
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
    searching(fit.driving, candidates=AGAINST, most_effects=1).follow(trail)
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


def test_an_effect_with_which_errors_are_larger_where_it_acts_is_taken_out(
    hidden_fit: Callable[[str, float], Fit],
    searching: Callable[..., Search],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    baseline = hidden_fit("aero_drag.drag_area_m2", 0.6)
    dx = diagnose(baseline, candidates=["aero_drag"])
    assert dx.omnibus.rejects
    good = dx.ranking[0].fit
    assert good is not None
    windy = good.model.add("head_wind").with_values({"head_wind.speed_mps": 8.0})
    fits = [baseline, refit(windy, good.driving, good.noise)]
    shares = {"aero_drag": Share(0.8, 0.7, 0.9), "head_wind": Share(-0.5, -0.7, -0.3)}

    def own(_: Fit, added: Sequence[str], *__: object) -> dict[str, tuple[Share, Share]]:
        return {e: (shares[e], UNKNOWN) for e in added}

    def again(fit: Fit, **_: object) -> Diagnosis:
        return replace(dx, fit=fit)

    monkeypatch.setattr("sysid_vehicle.study.search.search.own_shares", own)
    monkeypatch.setattr("sysid_vehicle.study.search.search.diagnose", again)

    def left(last: Diagnosis = dx) -> Trail:
        trail = Trail(list(fits), [replace(last, fit=f) for f in fits])
        searching(baseline.driving, candidates=AGAINST, most_effects=2).take_out_harmful(trail)
        return trail

    trail = left()
    assert trail.fit.model.effects == ("aero_drag",)
    assert trail.diagnoses[-1].fit is trail.fit
    assert trail.harmful == ("head_wind",)
    (said,) = (text for text in cautions(trail, (), baseline.driving) if "removed again" in text)
    assert said.startswith("head_wind removed again: where such an effect acts, errors 1 to 5 s")
    # Where nothing is left shares are noise.
    complete = replace(dx, omnibus=replace(dx.omnibus, p_value=0.5))
    assert left(complete).fits == fits
    # A little, or what is not shown, does no harm; where nothing stays the baseline is the last.
    shares["head_wind"] = Share(-0.03, -0.04, -0.01)
    assert left().harmful == ()
    shares["head_wind"] = Share(-0.5, -0.9, 0.1)
    assert left().harmful == ()
    shares |= {"aero_drag": Share(-0.2, -0.3, -0.1), "head_wind": Share(-0.5, -0.7, -0.3)}
    assert left().fits == [baseline]


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
        "sysid_vehicle.study.search.trail.serving", lambda fit, _: served.get(id(fit), fit)
    )
    trail.without_harm(baseline.driving, USUAL)
    assert trail.fit is lost
    assert trail.taken_back == ()
    served.clear()
    trail.without_harm(baseline.driving, USUAL)
    assert trail.fits == [baseline]
