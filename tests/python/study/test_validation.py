"""Validation data: what is set aside, what it says of two models, and how surely."""

import threading
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from sysid_vehicle import Fit, Log, Model, improve
from sysid_vehicle._common.threads import at_most
from sysid_vehicle.errors import InvalidInput, SysidWarning
from sysid_vehicle.estimate import MEASURED, Driving
from sysid_vehicle.study import validation
from sysid_vehicle.study.ahead.beyond import Beyond
from sysid_vehicle.study.validation import _with_error, set_aside, together


@pytest.mark.parametrize("length_s", [60.0, 3.0])
def test_the_standard_error_is_that_of_a_sum_however_short_the_driving(
    length_s: float, course: Log, rng: np.random.Generator
) -> None:
    test = Driving.of(course.between(0.0, length_s))
    n = test.samples
    gains = [_with_error(rng.normal(0.2, 1.0, n), test) for _ in range(300)]
    sums, errors = [g.value for g in gains], [g.error for g in gains]
    assert np.mean(sums) == pytest.approx(0.2 * n, abs=4.0 * np.sqrt(n / 300.0))
    assert np.sqrt(np.mean(np.square(errors))) == pytest.approx(np.sqrt(n), rel=0.1)
    assert min(errors) > 0.0
    trimmed = [g.typical for g in gains]
    assert np.mean(trimmed) == pytest.approx(0.2 * n, abs=4.0 * np.sqrt(n / 300.0))
    expected = np.sqrt(np.mean([g.typical_error**2 for g in gains]))
    assert expected == pytest.approx(np.std(trimmed), rel=0.15)


def test_one_spin_does_not_hide_what_all_other_pieces_show(
    fine_course: Log, rng: np.random.Generator
) -> None:
    test = Driving.of(fine_course)
    steady = rng.normal(0.2, 1.0, test.samples)
    expected = _with_error(steady, test)
    for spin in (-1e6, 1e6):
        difference = steady.copy()
        difference[:50] += spin
        found = _with_error(difference, test)
        assert abs(found.value) < 1.1 * found.error  # one piece is its own standard error
        assert found.typical == pytest.approx(expected.typical, rel=0.2)
        assert found.typical > 4.0 * found.typical_error


def test_what_lasts_for_seconds_is_not_taken_for_many_pieces_of_evidence(
    course: Log, rng: np.random.Generator
) -> None:
    test = Driving.of(course)
    lasting = int(2.0 * course.rate_hz)
    drawn = [
        np.repeat(rng.standard_normal(test.samples // lasting + 1), lasting) for _ in range(300)
    ]
    gains = [_with_error(d[: test.samples], test) for d in drawn]
    sums, errors = [g.value for g in gains], [g.error for g in gains]
    assert np.sqrt(np.mean(np.square(errors))) == pytest.approx(np.std(sums), rel=0.25)


def test_the_end_of_the_only_log_is_set_aside(lap: Log) -> None:
    with pytest.warns(SysidWarning, match="'lap' is fitted up to 28.0 s and the rest taken"):
        train, test = set_aside(lap, None)
    assert train.logs[0]["time_s"][-1] == pytest.approx(28.0)
    assert test.logs[0]["time_s"][-1] == lap["time_s"][-1]
    assert abs(train.samples + test.samples - lap.n) <= 1


def test_the_last_of_several_logs_is_set_aside(lap: Log, course: Log) -> None:
    with pytest.warns(SysidWarning, match="'handling_course' is taken for them"):
        train, test = set_aside([lap, course], None)
    assert train.logs == (lap,)
    assert test.logs == (course,)


def test_logs_given_are_taken_as_they_are(lap: Log, course: Log) -> None:
    train, test = set_aside([lap], course)
    assert (train.logs, test.logs) == ((lap,), (course,))
    with pytest.raises(InvalidInput, match="no log was given"):
        set_aside([], None)


def test_two_models_are_judged_side_by_side(
    course: Log, fit: Fit, monkeypatch: pytest.MonkeyPatch
) -> None:
    test, begin = Driving.of(course.between(0.0, 10.0)), threading.Barrier(2)

    def waiting(one: object, *rest: object) -> object:
        begin.wait(timeout=30.0)  # in a loop the first one would wait for the second for ever
        return one

    for name in ("at_its_best", "_prediction"):
        monkeypatch.setattr(validation, name, waiting)
    asked = []
    none = Beyond((1.0, 1.0), 0.0, 0.0, 0.0)
    monkeypatch.setattr(validation, "changes_of", lambda *told, **_: told)
    monkeypatch.setattr(
        validation, "beyond_noise", lambda fits, *_, **__: asked.append(fits) or none
    )
    # Where no prediction stays within what was fitted all of them count, and nothing is left out.
    monkeypatch.setattr(validation, "counted_in_shares", lambda *_: np.ones(1, dtype=bool))
    monkeypatch.setattr(validation, "fitted", lambda *_: np.zeros(1, dtype=bool))
    richer = replace(fit)
    with at_most(2):
        assert validation.changes_ahead(fit, richer, test)[:2] == (fit, richer)
        assert validation.beyond_noise_ahead([fit, richer], test) == none
        assert asked == [[fit, richer]]
        with pytest.raises(AttributeError, match="sureness"):
            validation.as_sure(fit, richer, test)
    monkeypatch.undo()
    told = []
    for threads in (1, 2):
        validation._prediction.cache_clear()
        with at_most(threads):
            told.append(validation.gain_in_log_likelihood(fit, richer, test))
            told.append(validation.fall_in_error(fit, richer, test))
    assert told[:2] == told[2:]


def test_of_logs_of_single_manoeuvres_more_than_the_last_are_set_aside(course: Log) -> None:
    pieces = [course.between(3.0 * i, 3.0 * i + 3.0) for i in range(10)]
    with pytest.warns(SysidWarning, match=r"'.*21 to 24.*', '.*, '.*27 to 30.*' are taken"):
        train, test = set_aside(pieces, None)
    assert train.logs == tuple(pieces[:7])
    assert test.logs == tuple(pieces[7:])


def test_training_and_validation_data_are_driven_by_the_same_input(
    lap: Log, course: Log, altered: Callable[..., Log]
) -> None:
    blind = altered(course, without=("fx_n",))
    for train, test in ((lap, blind), (blind, lap)):
        with pytest.warns(SysidWarning, match="course has no fx_n: the wheel force of lap is not"):
            assert [d.force_known for d in set_aside(train, test)] == [False, False]
    assert [d.force_known for d in set_aside(lap, course)] == [True, True]


def test_a_log_that_is_in_training_and_validation_data_is_noticed(
    lap: Log, course: Log, altered: Callable[..., Log]
) -> None:
    """By its readings, whatever it is called."""
    again = Log.from_arrays({c: lap[c] for c in lap}, name="again")
    with pytest.warns(SysidWarning, match="again is training and validation data; the validation"):
        set_aside([lap, course], again)
    changed = altered(lap, vx_mps=lap["vx_mps"] + 1e-9)
    assert [d.logs[0].name for d in set_aside(lap, changed)] == ["lap", "lap"]


def test_a_log_that_is_both_counts_once_on_all_data(lap: Log, course: Log) -> None:
    """Twice its evidence would say that something is left of a model that is the car."""
    again = Log.from_arrays({c: lap[c] for c in lap}, name="again")
    every = together(Driving.of(lap), Driving.of([again, course]))
    assert [log.name for log in every.logs] == [lap.name, course.name]
    assert together(Driving.of(lap), Driving.of(lap)).samples == Driving.of(lap).samples


def test_validation_data_that_are_training_data_are_among_the_warnings(
    start: Model, lap: Log
) -> None:
    """A study that is printed or loaded later says so too."""
    one = lap.between(0.0, 25.0)
    told = f"{one.name} is training and validation data; the validation error then proves nothing"
    with pytest.warns(SysidWarning, match="is training and validation data"):
        found = improve(start, one, one, starts=1, most_effects=0, sensors=False)
    assert found.warnings[0] == told
    assert f"Warning: {told}" in str(found)


def test_channels_whose_noise_was_not_learned_are_left_out_of_validation_data(
    lap: Log, course: Log
) -> None:
    with pytest.warns(SysidWarning, match="vy_mps, ax_mps2 of handling_course is not used: lap"):
        train, test = set_aside(lap.without("vy_mps", "ax_mps2"), course)
    assert train.present == test.present == ("vx_mps", "yaw_rate_radps", "ay_mps2")
    # Where it drives the model, the acceleration is nothing that is predicted.
    blind = [log.without("fx_n") for log in (lap, course)]
    assert all(log.has("ax_mps2") for d in set_aside(*blind) for log in d.logs)
    # One training log that has it is enough.
    both = set_aside([lap.without("vy_mps"), lap.between(0.0, 20.0)], course)
    assert both[1].present == MEASURED
