"""A verdict that training data by themselves cannot give: validation data show what they do not."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest
from contradictions import contradictions

from sysid_vehicle import Fit, Log, Model, RoadDisturbance, Study, drive, improve, manoeuvres
from sysid_vehicle.estimate import Driving
from sysid_vehicle.rules import USUAL
from sysid_vehicle.study.judge.foretold import Foretold, foretold

CANDIDATES = ("steer_lag", "aero_drag")


class Banked(RoadDisturbance):
    """Pushes sideways, to and fro, once in six seconds."""

    def sample(self, n: int, rate_hz: float, rng: np.random.Generator) -> npt.NDArray[np.float64]:
        road = super().sample(n, rate_hz, rng)
        road[:, 1] += 320.0 * np.sin(np.arange(n) / rate_hz)
        return road


def studied(
    start: Model, car: Model, road: RoadDisturbance | None = None, *, matters: bool = False
) -> Study:
    """Fitted to a sweep at constant speed; validation data accelerate and brake in corners."""
    drives = manoeuvres.sine_sweep(25.0, 25.0, 3.5), manoeuvres.handling_course(30.0, 3.0)
    train, test = (
        drive(car, m, seed=seed, disturbance=road, rate_hz=50.0)
        for seed, m in enumerate(drives, 41)
    )
    # A user to whom yaw rates count, and speeds do not.
    large = dict.fromkeys(("vx", "vy", "yaw_rate", "ax", "ay"), 1e3)
    return improve(
        start,
        train,
        test,
        candidates=CANDIDATES,
        sensors=False,
        starts=1,
        matters=large if matters else None,
    )


def pulling_aside(truth: Model) -> Model:
    """A car with a moment of brake and drive force, which is no candidate."""
    return truth.add("drive_yaw_moment").with_values(
        {"drive_yaw_moment.arm_m": 0.1, "drive_yaw_moment.cornering_arm_m": 0.0}
    )


@pytest.fixture(scope="module")
def hidden(start: Model, truth: Model) -> Study:
    """Of what shows when the car brakes, and the training data never do."""
    return studied(start, pulling_aside(truth))


def test_what_shows_in_validation_data_alone_is_not_adequate(hidden: Study) -> None:
    assert not hidden.omnibus.rejects
    assert not hidden.diagnoses[-1].significant
    assert hidden.train[-1].error < 1.1
    assert hidden.test[-1].error > 1.3
    assert hidden.verdict == "unknown"
    assert hidden.added == ()
    text = str(hidden)
    assert "shows in the validation data; it hardly shows in the training data" in text
    assert "the training data alone show no error that depends on the driving" in text
    assert "On all data together: an error that depends on the driving remains" in text
    assert "mostly in M_z" in text
    assert any("add driving like the validation data" in step for step in hidden.next_steps)
    assert contradictions(text) == []
    # Where disturbances make up much of the training error, nobody knows what is in them.
    noisy = replace(hidden, train=tuple(replace(c, error=7.0) for c in hidden.train))
    disturbed = "cannot be separated from disturbance in the training data (error 7 noise floors)"
    assert disturbed in noisy.meaning
    assert any(disturbed in step for step in noisy.next_steps)
    told = hidden.to_dict()["unknown"]
    assert told["together"]["p_value"] < USUAL.strict
    assert told["foretold"]["p_value"] < USUAL.strict


def test_where_its_size_does_not_matter_that_is_said(start: Model, truth: Model) -> None:
    found = studied(start, pulling_aside(truth), matters=True)
    assert found.verdict == "adequate"
    assert "an error remains" in found.meaning
    assert "below the errors that matter" in found.meaning
    assert "On all data together: an error that depends on the driving remains" in str(found)
    (step,) = found.next_steps
    assert step.startswith("where that matters to you, add driving like the validation data")
    assert contradictions(str(found)) == []


def test_an_uneven_road_is_no_reason_to_look_for_more(start: Model, truth: Model) -> None:
    """Validation data err by twice the noise floor: so do the training data, by disturbances."""
    road = RoadDisturbance(fx_n=120.0, fy_n=150.0, mz_nm=150.0, correlation_time_s=0.3)
    found = studied(start, truth, road)
    assert found.test[-1].error > 1.5
    assert found.verdict == "adequate"
    assert "from disturbances like those of the training data" in found.meaning
    assert found.next_steps == ()
    assert contradictions(str(found)) == []
    smooth = studied(start, truth)
    assert smooth.verdict == "adequate"
    assert "disturbances" not in smooth.meaning
    assert smooth.next_steps == ()


def test_tyres_that_no_training_data_showed_are_no_disturbance(start: Model, truth: Model) -> None:
    drives = manoeuvres.sine_sweep(25.0, 25.0, 4.0), manoeuvres.handling_course(30.0, 8.5)
    train, test = (drive(truth, m, seed=s, rate_hz=50.0) for s, m in enumerate(drives, 41))
    found = improve(start, train, test, candidates=CANDIDATES, sensors=False, starts=1)
    assert found.verdict == "adequate"
    assert found.train[-1].error < 1.05
    assert found.test[-1].error > 1.2
    assert found.foretold is not None
    assert found.foretold.error < 1.05
    assert "do not determine the tyres where these drive" in found.meaning
    assert "disturbances" not in found.meaning
    assert contradictions(str(found)) == []
    # Of a study that an earlier version wrote this is not known.
    old = replace(found, foretold=replace(found.foretold, error=np.nan))
    assert "do not determine" not in old.meaning


def test_a_slow_force_is_no_disturbance(start: Model, truth: Model) -> None:
    """A bank that comes and goes depends on the place: no function of the driving predicts it."""
    slow = Banked(fy_n=1.0, correlation_time_s=0.3)
    found = studied(start, truth, slow)
    (told,) = found.slow
    assert told.endswith("N sideways")
    assert 40.0 < float(told.split()[2]) < 250.0  # of 225 N, by how fast it changes
    assert found.verdict == "unknown"
    assert f"Too slow for a disturbance, so it has a cause: a {told}." in str(found)
    assert any(told in step and "both directions" in step for step in found.next_steps)
    assert contradictions(str(found)) == []
    assert found.to_dict()["unknown"]["slow"] == [told]


def test_driving_like_that_of_the_fit_errs_as_foretold(complete_fits: Sequence[Fit]) -> None:
    first, *others = complete_fits
    for other in others:
        found = foretold(first, other.driving)
        assert 0.9 < found.ratio < 1.1
        assert found.p_value > 1e-3
        assert not found.unforeseen


def test_errors_that_no_training_data_showed_are_not_foretold(fit: Fit, course: Log) -> None:
    pushed = {c: np.array(course[c]) for c in course.channels}
    at = slice(600, 660)
    pushed["yaw_rate_radps"][at] += 0.05 * np.hanning(60)
    other = Driving.of(Log.from_arrays(pushed, check=False))
    found = foretold(fit, other)
    assert found.ratio > foretold(fit, Driving.of(course)).ratio
    assert found.unforeseen


def test_what_is_foretold_in_words_and_figures() -> None:
    assert "error is 1.5 times the one that the training data predict" in str(Foretold(2.25, 1e-9))
    lost = Foretold(np.inf, 0.0)
    assert lost.unforeseen
    assert lost.to_dict() == {"ratio": None, "p_value": 0.0}
    assert "infinitely many times the one that the training data predict" in str(lost)
