"""The wheel force at the time at which the car feels it."""

import re

import numpy as np

from sysid_vehicle import Driving, Fit, Log, diagnose
from sysid_vehicle.diagnose import Diagnosis
from sysid_vehicle.diagnose.unexplained.delay import delayed
from sysid_vehicle.identify import refine
from sysid_vehicle.study.search.clock import in_time


def written(log: Log, early_samples: int) -> Log:
    """A log whose wheel force was written before the car felt it."""
    force = np.roll(log["fx_n"], -early_samples)
    return log.corrected({"fx_n": force}, ()).between(0.0, 20.0)


def diagnosed(fit: Fit, log: Log) -> Diagnosis:
    again = refine(fit.model, Driving.of(log), fit.noise)
    return diagnose(again, candidates=["steer_offset"], refits=0)


def test_a_clock_that_is_right_is_left_alone(fit: Fit, lap: Log, course: Log) -> None:
    assert in_time(diagnosed(fit, written(lap, 0)), Driving.of(written(course, 0))) is None


def test_the_clock_of_the_wheel_force_is_put_right(fit: Fit, lap: Log, course: Log) -> None:
    early = 3
    dx = diagnosed(fit, written(lap, early))
    found = in_time(dx, Driving.of(written(course, early)))
    assert found is not None
    for driving, right in zip(found, (lap, course), strict=True):
        (log,) = driving.logs
        (said,) = log.corrections
        told = re.fullmatch(r"fx_n: the car feels it (\S+) ms later than the log says.*", said)
        assert told is not None
        by_s = 1e-3 * float(told[1])
        assert abs(by_s - early / right.rate_hz) < 0.25 * early / right.rate_hz
        # And that is done, but for the ends, beyond which nothing is known.
        wanted = delayed(written(right, early)["fx_n"], right.rate_hz, by_s)
        off = (log["fx_n"] - wanted)[50:-50]
        assert np.std(off) < 0.1 * np.std(log["fx_n"] - written(right, early)["fx_n"])
    # What validation data deny is left alone.
    assert in_time(dx, Driving.of(written(course, 0))) is None
