"""What held-out driving says of two models, and how surely."""

import numpy as np
import pytest

from sysid_vehicle import Log
from sysid_vehicle.estimate import Driving
from sysid_vehicle.study.held_out import _with_error


@pytest.mark.parametrize("length_s", [60.0, 3.0])
def test_the_standard_error_is_that_of_a_sum_however_short_the_driving(
    length_s: float, course: Log, rng: np.random.Generator
) -> None:
    test = Driving.of(course.between(0.0, length_s))
    n = test.samples
    sums, errors = zip(
        *(_with_error(rng.normal(0.2, 1.0, n), test) for _ in range(300)), strict=True
    )
    assert np.mean(sums) == pytest.approx(0.2 * n, abs=4.0 * np.sqrt(n / 300.0))
    assert np.sqrt(np.mean(np.square(errors))) == pytest.approx(np.sqrt(n), rel=0.1)
    assert min(errors) > 0.0


def test_what_lasts_for_seconds_is_not_taken_for_many_pieces_of_evidence(
    course: Log, rng: np.random.Generator
) -> None:
    test = Driving.of(course)
    lasting = int(2.0 * course.rate_hz)
    drawn = [
        np.repeat(rng.standard_normal(test.samples // lasting + 1), lasting) for _ in range(300)
    ]
    sums, errors = zip(*(_with_error(d[: test.samples], test) for d in drawn), strict=True)
    assert np.sqrt(np.mean(np.square(errors))) == pytest.approx(np.std(sums), rel=0.25)
