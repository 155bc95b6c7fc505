"""Which of several refitted candidates the driving cannot tell from one another."""

from dataclasses import replace

import numpy as np
import pytest

from sysid_vehicle import Fit, Model, diagnose, drive, identify, manoeuvres
from sysid_vehicle._common.threads import Workers
from sysid_vehicle.diagnose.candidates.candidate import Candidate
from sysid_vehicle.diagnose.candidates.refits import finished, is_hidden_by_noise, refitted
from sysid_vehicle.diagnose.candidates.refitting import Refitting
from sysid_vehicle.diagnose.candidates.rivals import with_refit_rivals
from sysid_vehicle.diagnose.candidates.score import score_board
from sysid_vehicle.diagnose.unexplained.omnibus import omnibus
from sysid_vehicle.rules import USUAL


@pytest.fixture(scope="module")
def twice(truth: Model, start: Model) -> Fit:
    """The baseline, where a drag and a lag of the steering are missing."""
    car = truth.add("aero_drag", "steer_lag").with_values(
        {"aero_drag.drag_area_m2": 0.8, "steer_lag.time_constant_s": 0.05}
    )
    return identify(start, drive(car, manoeuvres.lap(15.0), seed=3, rate_hz=50.0), starts=1)


def weighing_the_same(fit: Fit, *names: str) -> list[Candidate]:
    """Candidates refitted with noise of their own, and said to gain as much as the first."""
    scored = {c.id: c for c in diagnose(fit, refits=0).ranking}
    found = [finished(fit, refitted(fit, fit.driving, scored[n])) for n in names]
    return [
        replace(c, statistic=found[0].statistic - 0.1 * i, indistinguishable_from=(), of_inputs=0.0)
        for i, c in enumerate(found)
    ]


def rivals(fit: Fit, *names: str, ends: float = np.inf) -> dict[str, tuple[str, ...]]:
    with Workers(2) as pool:
        found = with_refit_rivals(
            weighing_the_same(fit, *names), (), fit.driving, USUAL, pool, ends
        )
    return {c.id: c.indistinguishable_from for c in found}


def test_what_is_missing_twice_is_told_apart_though_it_weighs_the_same(twice: Fit) -> None:
    assert rivals(twice, "steer_lag", "aero_drag") == {"steer_lag": (), "aero_drag": ()}


def test_what_acts_alike_is_not_told_apart_by_what_both_gain(twice: Fit) -> None:
    found = rivals(twice, "steer_lag", "steer_delay", "aero_drag")
    assert found["steer_lag"] == ("steer_delay",)
    assert found["steer_delay"] == ("steer_lag",)
    assert found["aero_drag"] == ()


def test_a_second_name_for_the_same_gain_stays_a_rival(truth: Model, start: Model) -> None:
    """Neither is needed beside the other."""
    car = truth.add("yaw_inertia").with_values({"yaw_inertia.relative_error": 0.2})
    fit = identify(start, drive(car, manoeuvres.lap(15.0), seed=3, rate_hz=50.0), starts=1)
    found = rivals(fit, "yaw_inertia", "aero_drag")
    assert found == {"yaw_inertia": ("aero_drag",), "aero_drag": ("yaw_inertia",)}


def test_without_time_those_that_gain_as_much_stay_rivals(twice: Fit) -> None:
    assert rivals(twice, "steer_lag", "aero_drag", ends=0.0)["steer_lag"] == ("aero_drag",)


def test_a_rival_by_its_score_is_refitted_or_none(twice: Fit) -> None:
    """The score is of a fit that what is missing has bent."""
    scored = diagnose(twice, refits=0).ranking
    others = [c.id for c in scored if c.id != "steer_lag"][:5]
    lag = next(c for c in scored if c.id == "steer_lag")
    lag = replace(lag, indistinguishable_from=tuple(others))
    with Workers(2) as pool:
        these = Refitting(twice, twice.driving, USUAL, (), pool, np.inf, False)
        best = finished(twice, refitted(twice, twice.driving, lag))
        left = omnibus(twice, twice.driving)
        board = score_board(twice, twice.driving, twice.model.candidates)
        found, unfollowed = these.beside_the_leading(scored, [best], (), 2, left, board)
        assert not unfollowed
        assert all(c.finished and c.fit is not None for c in found)
        few, hidden = found[:2], found[2:]
        assert [c.id for c in few] == [c.id for c in scored if c.id in others][:2]
        assert all(is_hidden_by_noise(c.effect) for c in hidden)
        assert not {c.id for c in hidden} & {c.id for c in few}  # none twice
        again, _ = these.beside_the_leading(scored, [best], few, 2, left, board)
        assert not {c.id for c in again} & {c.id for c in few}
        late = replace(these, ends=0.0)
        assert late.beside_the_leading(scored, [best], (), 2, left, board) == ([], ())
        # Neither what is refitted and gains less, nor what is far behind, is a rival any more.
        told = with_refit_rivals([best, few[0]], few[1:], twice.driving, USUAL, pool, np.inf)
    assert not {c.id for c in few} & {*told[0].indistinguishable_from}
    assert {*told[0].indistinguishable_from} == {*others} - {c.id for c in few}
