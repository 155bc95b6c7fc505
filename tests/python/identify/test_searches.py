"""Local searches: the damping of their steps, and which of their ends are followed."""

from types import SimpleNamespace

import numpy as np
import pytest

from sysid_vehicle.identify.search.objective import Objective
from sysid_vehicle.identify.search.search import Box, _eased, minimise
from sysid_vehicle.identify.search.settle import risen
from sysid_vehicle.identify.search.starts import apart


def test_damping_follows_what_was_gained_of_what_was_promised() -> None:
    assert _eased(1.0, 2.0, 2.0) == pytest.approx(1.0 / 8.0)
    assert _eased(1.0, 1.0, 2.0) == pytest.approx(1.0)
    assert _eased(1.0, 1e-9, 0.0) == pytest.approx(1.0 / 8.0)  # at a bound nothing is promised


def test_ends_in_one_valley_are_followed_once() -> None:
    """Rear B, C, E of a drive where, with noise of its own, the second valley is 14 nats higher."""
    ends = np.array([[7.34, 1.86, 0.86], [7.41, 1.85, 0.85], [9.87, 1.39, 0.08], [8.1, 2.6, 1.0]])
    box = Box([0, 1, 2], np.array([1.0, 0.5, -10.0]), np.array([50.0, 3.0, 1.0]))
    values = np.array([20497.53, 20497.53, 20497.47, 20496.65])
    assert [end[0] for end in apart(ends, values, box)] == [7.34, 9.87]


class Bent:
    """A valley along log y = (log x)^2 that falls gently towards its end (Rosenbrock)."""

    steep, asked, samples = 100.0, 0, 2

    def half_sum_of_squares(self, p: np.ndarray, _: object) -> float:
        x, y = np.log(p)
        return 0.5 * float((self.steep * (y - x**2)) ** 2 + (1.0 - x) ** 2)

    def normal_equations(
        self, p: np.ndarray, gains: object, _: object
    ) -> tuple[float, np.ndarray, np.ndarray]:
        self.asked += 1
        x, y = np.log(p)
        by = np.array([[2.0 * self.steep * x, -self.steep], [1.0, 0.0]]) / p
        errors = np.array([self.steep * (y - x**2), 1.0 - x])
        return self.half_sum_of_squares(p, gains), by.T @ errors, by.T @ by


@pytest.mark.parametrize("begin", [-1.0, -2.0])
def test_a_bent_valley_is_followed_in_long_steps(begin: float) -> None:
    """Steps that may never leave it take 250 and 280 passes."""
    bent, box = Bent(), Box([0, 1], np.exp([-5.0, -9.0]), np.exp([5.0, 9.0]))
    start = np.exp([begin, begin**2])
    found = minimise(bent, start, None, box, rounds=200, tolerance=1e-8)  # type: ignore[arg-type]
    assert found.settled
    assert np.log(found.x) == pytest.approx([1.0, 1.0], abs=1e-4)
    assert bent.asked < 125


class Copying:
    """Two parameters of which the sum is told well, and the difference a thousandth as well."""

    def __init__(self, errors: tuple[float, float]) -> None:
        self.errors, self.asked, self.samples = np.array(errors), 0, 2
        self.by = np.array([[100.0, 100.0], [0.1, -0.1]])

    def half_sum_of_squares(self, p: np.ndarray, _: object) -> float:
        self.asked += 1
        return 0.5 * float(np.sum((self.errors - self.by @ p) ** 2))

    def normal_equations(
        self, p: np.ndarray, gains: object, _: object
    ) -> tuple[float, np.ndarray, np.ndarray]:
        errors = self.errors - self.by @ p
        return self.half_sum_of_squares(p, gains), self.by.T @ errors, self.by.T @ self.by


def test_steps_that_promise_next_to_nothing_are_not_tried() -> None:
    box = Box([0, 1], np.full(2, -100.0), np.full(2, 100.0))
    little = Copying((0.1, 0.1))
    found = minimise(little, np.zeros(2), None, box, tolerance=0.1)  # type: ignore[arg-type]
    assert found.settled
    assert (*found.x,) == (0.0, 0.0)
    assert little.asked == 1
    # A damped step promises as little where parameters copy each other, a whole one four nats.
    much = Copying((0.1, 3.0))
    found = minimise(much, np.zeros(2), None, box, tolerance=0.1)  # type: ignore[arg-type]
    assert found.x == pytest.approx([15.0, -15.0], abs=0.1)


def test_a_climb_ends_inside_the_box() -> None:
    """From some places to the bound and back adds up to more than the bound."""

    class Rising:
        samples = 1

        def freeze(self, p: np.ndarray, _: object) -> SimpleNamespace:
            return SimpleNamespace(log_likelihood=float(p[0]))

    box, noise = Box([0], np.array([-6.0]), np.ones(1)), np.empty(0)
    objective = Objective(Rising())  # type: ignore[arg-type]
    begun = -6.0 + 7.0 * np.arange(1, 400) / 400.0
    assert (begun + (1.0 - begun) > 1.0).any()
    for begin in begun:
        p = np.array([begin])
        reached, _ = risen(objective, p, objective.freeze(p, noise), np.ones(1), noise, box)
        assert reached[0] == pytest.approx(1.0)
        assert reached[0] <= 1.0
