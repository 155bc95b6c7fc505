"""What ends far below the best effect is not followed, and asked for where that does not hold."""

from dataclasses import replace

import numpy as np
import pytest

from sysid_vehicle import Diagnosis, Fit, Model, diagnose, drive, identify, manoeuvres
from sysid_vehicle.diagnose import with_unfollowed
from sysid_vehicle.diagnose.candidates import refitting
from sysid_vehicle.diagnose.candidates.candidate import Candidate
from sysid_vehicle.diagnose.candidates.refits import finished, refitted
from sysid_vehicle.identify import far_below, refine_above
from sysid_vehicle.study.search import steps

BEST, POORER, HIDDEN = "speed_sensor_misalignment", "side_wind", "tyre_relaxation"


@pytest.fixture(scope="module")
def lacking(truth: Model, start: Model) -> Fit:
    """The baseline on so many samples, of a car whose speed sensor is turned, that fewer lead."""
    car = truth.add(BEST).with_values({f"{BEST}.angle_rad": 0.03})
    return identify(start, drive(car, manoeuvres.lap(32.0), seed=8), starts=1)


@pytest.fixture(scope="module")
def dx(lacking: Fit) -> Diagnosis:
    return diagnose(lacking, candidates=(BEST, POORER))


@pytest.fixture(scope="module")
def best(dx: Diagnosis) -> Fit:
    assert dx.ranking[0].id == BEST
    fit = dx.ranking[0].fit
    assert fit is not None
    assert fit.converged
    return fit


@pytest.fixture(scope="module")
def left(lacking: Fit, dx: Diagnosis, best: Fit) -> Candidate:
    """The poorer candidate, as a diagnosis leaves it."""
    (c,) = (c for c in dx.ranking if c.id == POORER)
    begun = refitted(lacking, lacking.driving, c)
    return finished(lacking, begun, best.log_likelihood)


def test_what_is_left_says_that_it_has_not_converged(
    lacking: Fit, best: Fit, left: Candidate
) -> None:
    whole = finished(lacking, left)
    assert left.finished
    assert left.fit is not None
    assert whole.fit is not None
    assert not left.fit.converged
    assert whole.fit.converged
    assert lacking.log_likelihood < left.fit.log_likelihood <= whole.fit.log_likelihood
    assert far_below(whole.fit.log_likelihood, best.log_likelihood)


def test_a_candidate_that_was_left_is_judged_at_its_maximum(
    dx: Diagnosis, left: Candidate, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where validation data refuse the best effect they are asked of the next one."""
    judged: list[Fit] = []

    def refuses(fit: Fit, found: Fit, *args: object) -> None:
        judged.append(found)

    monkeypatch.setattr(steps, "speaks_for", refuses)
    both = replace(dx, ranking=(dx.ranking[0], replace(left, p_value=0.0)))
    assert steps.first_that_holds(both, dx.fit, dx.driving) is None
    assert [f.model.effects for f in judged] == [(BEST,), (POORER,)]
    assert all(f.converged for f in judged)


def test_the_best_alone_is_followed_in_any_case(
    lacking: Fit, best: Fit, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[tuple[str, float]] = []

    def noted(fit: Fit, c: Candidate, least: float = -np.inf) -> Candidate:
        asked.append((c.id, least))
        return finished(fit, c, least)

    monkeypatch.setattr(refitting, "finished", noted)
    monkeypatch.setattr(refitting, "_NEAR", 0.0)
    monkeypatch.setattr(refitting, "_HOPELESS", 0.0)
    diagnose(lacking, candidates=(BEST, POORER), workers=1)
    assert asked == [(BEST, -np.inf), (POORER, best.log_likelihood)]


def test_a_lag_below_a_rival_ends_on_few_samples(
    lacking: Fit, best: Fit, settled_on: list[int]
) -> None:
    model = lacking.model.add(HIDDEN).with_values({f"{HIDDEN}.relaxation_length_m": 0.5})
    found = refine_above(model, lacking.driving, lacking, rival=best)
    assert max(settled_on) < lacking.driving.samples
    assert found is not None
    assert not found.converged
    assert far_below(found.log_likelihood, best.log_likelihood)
    # Without a rival it is followed to where it has gained what it can.
    assert refine_above(model, lacking.driving, lacking) is not None
    assert max(settled_on) == lacking.driving.samples


def test_a_hidden_lag_that_was_not_followed_is_found_when_asked_for(
    truth: Model, start: Model
) -> None:
    car = truth.add(HIDDEN).with_values({f"{HIDDEN}.relaxation_length_m": 0.7})
    fit = identify(start, drive(car, manoeuvres.lap(15.0), seed=3), starts=1)
    scored = diagnose(fit, candidates=("aero_drag", HIDDEN), refits=0)
    found = with_unfollowed(replace(scored, unfollowed=(HIDDEN,)))
    assert not found.unfollowed
    assert [c.id for c in found.significant] == [HIDDEN]
    assert {c.id for c in found.ranking} == {"aero_drag", HIDDEN}
    assert found.ranking[0].finished
    assert abs(found.ranking[0].value[0] - 0.7) < 4.0 * found.ranking[0].std[0]
    # What is not there leaves the diagnosis as it was.
    none = with_unfollowed(replace(scored, unfollowed=("steer_lag",)))
    assert none.ranking == scored.ranking


def test_a_search_names_what_it_has_not_followed(
    truth: Model, start: Model, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A lag that comes nowhere near the best effect, and that noise may hide."""
    fit = identify(start, drive(truth, manoeuvres.lap(15.0), seed=3), starts=1)
    names = ("aero_drag", "steer_lag")
    followed = diagnose(fit, candidates=names, follow_all=True)
    assert not followed.unfollowed
    (drag,) = (c for c in followed.ranking if c.id == "aero_drag")
    above = replace(fit, log_likelihood=fit.log_likelihood + 500.0)
    led = replace(drag, fit=above, finished=True, p_value=0.0)

    def leading(*args: object) -> tuple[list[Candidate], list[Candidate]]:
        return [led], []

    monkeypatch.setattr(refitting.Refitting, "leading", leading)
    monkeypatch.setattr(refitting.Refitting, "_leaves_more", lambda *args: True)
    assert diagnose(fit, candidates=names, follow_all=False).unfollowed == ("steer_lag",)
    assert diagnose(fit, candidates=names).unfollowed == ()


def test_beside_tyres_that_no_car_has_what_hardly_scores_is_found(
    truth: Model, start: Model
) -> None:
    """All motion read far from the centre of gravity leaves the rear axle without stiffness."""
    names = ("forward_m", "left_m")
    hidden = dict(zip((f"ins_lever_arm.{n}" for n in names), (1.6, 0.8), strict=True))
    car = truth.add("ins_lever_arm").with_values(hidden)
    sweep = manoeuvres.sine_sweep(15.0, 25.0, 3.5)
    fit = identify(start, drive(car, sweep, seed=6, rate_hz=50.0), starts=3)
    assert fit["cornering stiffness rear"].value < 1e3
    candidates = ("steer_ratio", "mass", "yaw_inertia", "ins_lever_arm")
    by_search = diagnose(fit, candidates=candidates, follow_all=False)
    assert by_search.ranking[0].id == "steer_ratio"
    assert not by_search.ranking[0].can_be()
    assert "ins_lever_arm" in by_search.unfollowed
    for dx in (diagnose(fit, candidates=candidates), with_unfollowed(by_search)):
        best = dx.ranking[0]
        assert best.id == "ins_lever_arm"
        assert np.all(np.abs(np.subtract(best.value, (1.6, 0.8))) < 4.0 * np.array(best.std))
        assert not dx.unfollowed
