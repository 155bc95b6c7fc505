"""Readings that were put at another time by an estimate: intervals count its error."""

from pathlib import Path

import numpy as np
import pytest

from sysid_vehicle import Fit, Log, Model, drive, example_vehicle, identify, load, manoeuvres
from sysid_vehicle._common.arrays import FloatArray
from sysid_vehicle.estimate import Driving
from sysid_vehicle.identify import predicting_ahead
from sysid_vehicle.identify.intervals.retimed import pushes_of_time
from sysid_vehicle.log import Retimed
from sysid_vehicle.sensors.apply import shifted

MOTION = ("vx_mps", "vy_mps", "yaw_rate_radps", "ax_mps2", "ay_mps2")
LENGTH = "tyre_relaxation.relaxation_length_m"
STD_S = 0.002


@pytest.fixture(scope="module")
def model() -> Model:
    return Model(example_vehicle()).add("tyre_relaxation").with_values({LENGTH: 0.45})


@pytest.fixture(scope="module")
def log(model: Model) -> Log:
    return drive(model, manoeuvres.slalom(), seed=4, rate_hz=25.0)


@pytest.fixture(scope="module")
def sure(model: Model, log: Log) -> Fit:
    return identify(model, log, starts=1)


def earlier(log: Log, by_s: float) -> Log:
    """The same readings, those of the motion by some time earlier in the file."""
    time_s = log["time_s"]
    return log.corrected({c: shifted(time_s, log[c], by_s) for c in MOTION}, ())


def test_a_fit_goes_with_the_time_of_its_readings(model: Model, log: Log, sure: Fit) -> None:
    fit = identify(model, log.corrected({}, (), [Retimed(MOTION, STD_S)]), starts=1)
    assert [e.value for e in fit.estimates] == [e.value for e in sure.estimates]
    np.testing.assert_allclose(fit.by_noise, sure.covariance, rtol=1e-9, atol=1e-14)
    moved = identify(model, earlier(log, STD_S), starts=1)
    place = [e.name for e in fit.estimates].index(LENGTH)
    expected = moved[LENGTH].value - sure[LENGTH].value
    # At the speed of the slalom 2 ms are about 0.05 m.
    assert abs(expected) > 2.0 * sure[LENGTH].std
    assert fit.pushed[place, 0] == pytest.approx(expected, rel=0.1)
    assert fit[LENGTH].std == pytest.approx(np.hypot(sure[LENGTH].std, expected), rel=0.15)
    stiffness = "cornering stiffness front"
    assert fit[stiffness].std > sure[stiffness].std


def test_so_does_a_fit_to_predictions(model: Model) -> None:
    sweep = drive(model, manoeuvres.sine_sweep(), seed=4, rate_hz=25.0)
    unsure = sweep.corrected({}, (), [Retimed(MOTION, STD_S)])
    fit, without, moved = (
        predicting_ahead(identify(model, log, starts=1))
        for log in (unsure, sweep, earlier(sweep, STD_S))
    )
    assert [e.value for e in fit.estimates] == [e.value for e in without.estimates]
    np.testing.assert_allclose(fit.by_noise, without.covariance, rtol=1e-9, atol=1e-12)
    place = [e.name for e in fit.estimates].index(LENGTH)
    expected = moved[LENGTH].value - without[LENGTH].value
    assert abs(expected) > 2.0 * without[LENGTH].std
    assert fit.pushed[place, 0] == pytest.approx(expected, rel=0.15)


def test_times_of_their_own_add_up_as_squares(model: Model, log: Log, sure: Fit) -> None:
    two = [Retimed((c,), STD_S) for c in ("yaw_rate_radps", "ay_mps2")]
    fit = identify(model, log.corrected({}, (), two), starts=1)
    assert fit.pushed.shape == (len(fit.estimates), 2)
    squares = np.diag(sure.covariance) + np.sum(fit.pushed**2, axis=1)
    np.testing.assert_allclose(np.diag(fit.covariance), squares, rtol=1e-9)


def test_one_time_of_several_logs_is_one_error(model: Model, log: Log, sure: Fit) -> None:
    """More driving does not average it, as it does noise."""
    unsure = log.corrected({}, (), [Retimed(MOTION, STD_S)])
    one = identify(model, unsure, starts=1)
    half = log.n // 2 / log.rate_hz
    both = identify(model, [unsure.between(0.0, half), unsure.between(half, 1e9)], starts=1)
    assert both.pushed.shape[1] == 1
    place = [e.name for e in one.estimates].index(LENGTH)
    assert both.pushed[place, 0] == pytest.approx(one.pushed[place, 0], rel=0.15)


def test_stretches_stay_where_a_moved_speed_crosses_the_least(
    model: Model, log: Log, sure: Fit
) -> None:
    """A car that slows down through the speed below which no model is run."""
    time_s, vx = log["time_s"], np.array(log["vx_mps"])
    first = int(0.8 * log.n)
    slows = log.least_speed_mps + 1e-4 - 2.0 * (time_s - time_s[first])
    vx = np.minimum(vx, np.maximum(slows, 0.5))
    driven = log.corrected({"vx_mps": vx}, (), [Retimed(MOTION, STD_S)])
    driving = Driving.of(driven)
    moved = driving.read_otherwise([earlier(driven, STD_S)])
    assert Driving.of(earlier(driven, STD_S)).stretches != driving.stretches
    assert moved.stretches == driving.stretches
    p, columns = model.vector(), sure.columns
    gains = driving.problem(model).freeze(p, sure.noise.vector())

    def slope(of: Driving) -> FloatArray:
        return of.problem(model).normal_equations(p, gains, columns)[1]

    assert pushes_of_time(driving, slope).shape == (len(columns), 1)


def test_it_stands_in_files(tmp_path: Path, model: Model, log: Log) -> None:
    fit = identify(model, log.corrected({}, (), [Retimed(MOTION, STD_S)]), starts=1)
    fit.save(tmp_path / "fit.npz")
    again = load(tmp_path / "fit.npz")
    assert isinstance(again, Fit)
    assert again.driving.logs[0].retimed == (Retimed(MOTION, STD_S),)
    np.testing.assert_array_equal(again.pushed, fit.pushed)
    assert log.corrected({}, (), [Retimed(MOTION, 0.1)]).between(1.0, 5.0).retimed[0].std_s == 0.1
