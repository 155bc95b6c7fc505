"""A fit that has no time to be finished is the likeliest that was seen, and says so."""

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sysid_vehicle import Fit, InvalidInput, Log, Model, SysidWarning, drive, identify, load
from sysid_vehicle import manoeuvres as drives
from sysid_vehicle._common.threads import TimeUp

ENDED = "the time limit ended the fit: the likelihood was not followed to its maximum"
WITH_TIME = 1e5


@pytest.fixture(scope="module")
def short(truth: Model) -> Log:
    return drive(truth, drives.lap(20.0), seed=1, rate_hz=50.0)


@pytest.fixture(scope="module")
def ended(start: Model, short: Log) -> Fit:
    with pytest.warns(SysidWarning, match=ENDED):
        return identify(start, short, starts=3, time_limit_s=1e-6)


@pytest.fixture(scope="module")
def whole(start: Model, short: Log) -> Fit:
    return identify(start, short, starts=1)


def test_a_fit_that_was_broken_off_says_so_and_tells_no_intervals(ended: Fit, whole: Fit) -> None:
    assert ended.broken_off
    assert not ended.converged
    assert not whole.broken_off
    assert ended.log_likelihood < whole.log_likelihood
    assert all(np.isfinite(e.value) for e in ended.estimates)
    assert not any(e.has_interval for e in (*ended.estimates, *ended.derived))
    assert any(e.has_interval for e in whole.estimates)
    for text in (str(ended), ended._repr_html_()):
        assert "NOT CONVERGED" in text
        assert ENDED in text
        assert "no intervals are told" in text
    assert "time limit" not in str(whole)
    assert " .. " not in str(ended)
    with pytest.raises(InvalidInput, match="time_limit_s"):
        ended.posterior(10)


def test_a_saved_fit_remembers_what_a_time_limit_left_out(ended: Fit, tmp_path: Path) -> None:
    ended.save(tmp_path / "ended.fit")
    again = load(tmp_path / "ended.fit")
    assert again.late_facts == ended.late_facts
    assert str(again) == str(ended)


def test_with_time_enough_a_limit_changes_no_fit(start: Model, short: Log, whole: Fit) -> None:
    limited = identify(start, short, starts=1, time_limit_s=WITH_TIME)
    assert limited.late_facts == ()
    assert str(limited) == str(whole)


def test_starts_that_were_not_searched_are_told(
    start: Model, short: Log, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What the best start led to is the maximum of the likelihood all the same."""
    where = sys.modules[identify.__module__]
    minimise, done = where.minimise, []

    def only_one(*args: Any, **kwargs: Any) -> Any:
        done.append(args)
        if len(done) > 1:
            raise TimeUp
        return minimise(*args, **kwargs)

    monkeypatch.setattr(where, "minimise", only_one)
    with pytest.warns(SysidWarning, match="2 of 3 starts were not searched to their ends"):
        fit = identify(start, short, starts=3, workers=1, time_limit_s=WITH_TIME)
    assert fit.converged
    assert any(e.has_interval for e in fit.estimates)


@pytest.mark.parametrize(
    ("work", "asked", "fact"),
    [
        ("profile_fit", {"intervals": "profile"}, "intervals are those of the information matrix"),
        ("predicting_ahead", {"horizon_s": 2.0}, "not fitted to predictions 2 s ahead"),
    ],
)
def test_what_comes_after_the_search_is_left_out_and_told(
    start: Model,
    short: Log,
    whole: Fit,
    monkeypatch: pytest.MonkeyPatch,
    work: str,
    asked: dict[str, Any],
    fact: str,
) -> None:
    def never_done(*_: Any, **__: Any) -> None:
        raise TimeUp

    monkeypatch.setattr(sys.modules[identify.__module__], work, never_done)
    with pytest.warns(SysidWarning, match=fact):
        fit = identify(start, short, starts=1, time_limit_s=WITH_TIME, **asked)
    assert fit.converged
    assert fit.estimates == whole.estimates
    assert not fit.profiles
    assert fit.horizon_s == 0.0
    assert fact in str(fit)


@pytest.mark.parametrize("seconds", [0.0, -1.0, float("nan"), True])
def test_the_limit_of_a_fit_is_seconds_above_zero(start: Model, short: Log, seconds: float) -> None:
    with pytest.raises(InvalidInput, match="time_limit_s"):
        identify(start, short, time_limit_s=seconds)
