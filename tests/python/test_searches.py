"""Local searches: the damping of their steps, and which of their ends are followed."""

import numpy as np
import pytest

from sysid_vehicle.identify.identify import _apart
from sysid_vehicle.identify.search import Box, eased


def test_damping_follows_what_was_gained_of_what_was_promised() -> None:
    assert eased(1.0, 2.0, 2.0) == pytest.approx(1.0 / 8.0)
    assert eased(1.0, 1.0, 2.0) == pytest.approx(1.0)
    assert eased(1.0, 1e-9, 0.0) == pytest.approx(1.0 / 8.0)  # at a bound nothing is promised


def test_ends_in_one_valley_are_followed_once() -> None:
    """Rear B, C, E of a drive where, with noise of its own, the second valley is 14 nats higher."""
    ends = np.array([[7.34, 1.86, 0.86], [7.41, 1.85, 0.85], [9.87, 1.39, 0.08], [8.1, 2.6, 1.0]])
    box = Box([0, 1, 2], np.array([1.0, 0.5, -10.0]), np.array([50.0, 3.0, 1.0]))
    values = np.array([20497.53, 20497.53, 20497.47, 20496.65])
    assert [end[0] for end in _apart(ends, values, box)] == [7.34, 9.87]
