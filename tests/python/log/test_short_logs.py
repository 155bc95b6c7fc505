"""Logs of single manoeuvres: several are enough together, whose sum is asked for in a fit."""

import warnings

import numpy as np
import pytest

from sysid_vehicle import InvalidInput, Log, Model, SysidWarning, drive, manoeuvres
from sysid_vehicle.log import check_excitation


@pytest.fixture(scope="module")
def lap(truth: Model) -> Log:
    return drive(truth, manoeuvres.lap(40.0), seed=1)


def columns(log: Log, n: int, first: int = 0) -> dict[str, np.ndarray]:
    return {channel: log[channel][first : first + n].copy() for channel in log}


def test_the_log_of_a_single_manoeuvre_is_read_without_a_word(lap: Log) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert Log.from_arrays(columns(lap, 300, 1500)).duration_s == pytest.approx(2.99)


def test_a_short_straight_is_no_want_of_corners(lap: Log) -> None:
    """Others of the same car hold them; a fit to all of them asks."""
    straight = columns(lap, 300)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        log = Log.from_arrays(straight)
    with pytest.warns(SysidWarning, match=r"not excited.*drive corners"):
        assert not check_excitation(log)


def test_less_than_a_stretch_that_is_used_is_refused(lap: Log) -> None:
    said = r"only 0.9 s of the log .*samples 0 to 89.*at least 1 s of each log and 5 s of all"
    with pytest.raises(InvalidInput, match=said):
        Log.from_arrays(columns(lap, 90))


def test_a_log_of_which_little_is_driving_is_told(lap: Log) -> None:
    parked = columns(lap, lap.n)
    parked["vx_mps"][300:] = 0.0
    with pytest.warns(SysidWarning) as caught:
        Log.from_arrays(parked)
    said = "only 3 s of the log can be used (samples 0 to 4000, t = 0 to 40 s, car moving"
    assert any(said in str(warning.message) for warning in caught)
