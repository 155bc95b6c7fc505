"""Effects of which none holds alone."""

from collections.abc import Callable

import pytest

from sysid_vehicle import Diagnosis, Fit, Model, diagnose, drive, identify, manoeuvres
from sysid_vehicle.estimate import Driving
from sysid_vehicle.study.search.search import Search
from sysid_vehicle.study.search.steps import likeliest
from sysid_vehicle.study.search.trail import Trail

BOTH = ("aero_drag", "steer_lag")


@pytest.fixture(scope="module")
def baseline(truth: Model, start: Model) -> Fit:
    values = {"aero_drag.drag_area_m2": 0.6, "steer_lag.time_constant_s": 0.08}
    car = truth.add(*BOTH).with_values(values)
    return identify(start, drive(car, manoeuvres.lap(20.0), seed=61, rate_hz=50.0), starts=1)


@pytest.mark.parametrize(
    ("confirmed_after", "better"), [(1, True), (2, True), (2, False), (None, True)]
)
def test_training_data_lead_on_until_validation_data_confirm_the_whole(
    baseline: Fit,
    monkeypatch: pytest.MonkeyPatch,
    confirmed_after: int | None,
    searching: Callable[..., Search],
    better: bool,
) -> None:
    """Of two that are not even predicted better one step ahead no third one is sought."""
    asked: list[tuple[str, ...]] = []

    def diagnosis(_: Search, fit: Fit, *__: object, **___: object) -> Diagnosis:
        asked.append(fit.model.effects)
        left = [e for e in BOTH if e not in fit.model.effects]
        return diagnose(fit, candidates=left or ["head_wind"])

    def holds(dx: Diagnosis, of: Fit, *_: object) -> object:
        assert of is baseline  # whatever was added, validation data are asked for all of it
        last = likeliest(dx) or dx.ranking[0]
        return (last, last.fit or dx.fit) if len(asked) == confirmed_after else None

    monkeypatch.setattr(Search, "_diagnosis", diagnosis)
    monkeypatch.setattr("sysid_vehicle.study.search.search.first_that_holds", holds)
    monkeypatch.setattr("sysid_vehicle.study.search.search.foretold_better", lambda *_: better)
    looking = searching(baseline.driving, candidates=BOTH)
    trail = Trail([baseline])
    found = looking._beside_others(diagnose(baseline, candidates=BOTH), trail)
    assert set(asked[0]) < set(BOTH)
    if confirmed_after is None or not better:
        assert found is None
        assert better or len(asked) == 1
        assert not trail.p_values
        return
    assert found is not None
    names, fit = found
    assert set(names) == set(fit.model.effects) == set(BOTH)
    assert len(asked) == confirmed_after
    assert trail.p_values.keys() >= set(BOTH)


@pytest.mark.parametrize("late_in", ["first_that_holds", "_beside_others", None])
def test_what_the_time_limit_left_untried_is_not_what_was_refused(
    baseline: Fit,
    monkeypatch: pytest.MonkeyPatch,
    searching: Callable[..., Search],
    late_in: str | None,
) -> None:
    """Effects that validation data refused in time are not said to be left untried."""
    dx, now = diagnose(baseline, candidates=BOTH), [0.0]
    assert all(c.fit is not None for c in dx.significant)

    def refusing(name: str) -> Callable[..., None]:
        def asked(*_: object) -> None:
            now[0] += 2.0 * (name == late_in)

        return asked

    at = "sysid_vehicle.study.search.search."
    monkeypatch.setattr("time.perf_counter", lambda: now[0])
    monkeypatch.setattr(Search, "_diagnosis", lambda *_: dx)
    monkeypatch.setattr(Search, "_beside_others", refusing("_beside_others"))
    monkeypatch.setattr(f"{at}first_that_holds", refusing("first_that_holds"))
    monkeypatch.setattr(f"{at}first_together", refusing("first_together"))
    monkeypatch.setattr(f"{at}with_unfollowed", lambda found, _: found)
    trail = Trail([baseline])
    searching(baseline.driving, candidates=BOTH, ends=1.0).follow(trail)
    untried = {c.id for c in dx.significant} if late_in == "first_that_holds" else set()
    assert set(trail.stopped) == untried
    assert trail.unpaired is (late_in == "_beside_others")


def test_what_fits_as_well_in_the_place_of_one_of_several_is_tried_there(
    truth: Model,
    start: Model,
    searching: Callable[..., Search],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Subsets with either score alike, and one of them is refitted: that with a side wind."""
    car = truth.add("steer_offset").with_values({"steer_offset.offset_rad": 0.012})
    train, test = (
        drive(car, manoeuvres.lap(20.0), seed=seed, rate_hz=50.0) for seed in (995881, 995882)
    )
    baseline = identify(start, train, starts=1)
    both = ("steer_offset", "side_wind")
    dx = diagnose(baseline, candidates=both)
    windy = next(c.fit for c in dx.ranking if c.id == "side_wind")
    assert windy is not None
    at = "sysid_vehicle.study.search.search."
    wind = [(("side_wind",), windy)]
    monkeypatch.setattr(f"{at}first_that_holds", lambda *_: None)
    monkeypatch.setattr(f"{at}first_together", lambda *_: wind.pop() if wind else None)
    looking = searching(Driving.of(test), candidates=both)
    trail = Trail([baseline])
    looking.follow(trail)
    assert [f.model.effects for f in trail.fits] == [(), ("steer_offset",)]
    assert "steer_offset" in {c.id for c in trail.nearly["side_wind"]}
