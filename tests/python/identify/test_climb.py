"""The climb of parameters and noise together, and the curvature that it learns."""

from types import SimpleNamespace

import numpy as np
import pytest

from sysid_vehicle.errors import NumericalError
from sysid_vehicle.identify.search.climb import to_the_top
from sysid_vehicle.identify.search.objective import Objective
from sysid_vehicle.identify.search.quasi_newton import Met
from sysid_vehicle.identify.search.search import Box

_BOUND = 0.99  # correlation of parameter and noise: moved in turn, each round leaves 98 %


class Coupled:
    """A parameter and a noise that nearly copy each other; gains that see nothing of either."""

    samples, size = 1, 4e4
    top = np.array([3.0, np.log(2.5)])

    def __init__(self, spins_beyond: float = np.inf) -> None:
        self.asked = 0
        self.spins_beyond = spins_beyond

    def off(self, p: np.ndarray, noise: np.ndarray) -> np.ndarray:
        return np.array([p[0], np.log(noise[0])]) - self.top

    def freeze(self, p: np.ndarray, noise: np.ndarray) -> SimpleNamespace:
        self.asked += 1
        if p[0] > self.spins_beyond:
            raise NumericalError("the car spins")
        a, b = self.off(p, noise)
        square = a * a + b * b - 2.0 * _BOUND * a * b
        return SimpleNamespace(log_likelihood=-0.5 * self.size * square)

    def half_sum_of_squares(self, p: np.ndarray, gains: object) -> float:
        return 0.0

    def normal_equations(
        self, p: np.ndarray, gains: object, columns: object
    ) -> tuple[float, np.ndarray, np.ndarray]:
        return 0.0, np.zeros(1), np.array([[self.size]])

    def noise_score(self, p: np.ndarray, noise: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
        a, b = self.off(p, noise)
        slope = np.array([-self.size * (b - _BOUND * a)])
        return self.freeze(p, noise).log_likelihood, slope, np.array([[self.size]])


def begun(problem: Coupled) -> tuple[Objective, Box]:
    limits = np.array([1e-3]), np.array([1e3])
    objective = Objective(problem, (), *limits)  # type: ignore[arg-type]
    return objective, Box([0], np.array([-20.0]), np.array([20.0]))


def test_parameters_and_noise_that_copy_each_other_are_climbed_together() -> None:
    problem = Coupled()
    objective, box = begun(problem)
    p, noise = to_the_top(objective, np.zeros(1), np.ones(1), box)
    begin = objective.log_likelihood(np.zeros(1), np.ones(1))
    assert begin < -8e4
    assert objective.log_likelihood(p, noise) > -0.05
    # In turn, so many steps of either leave a half of what they begin with.
    assert problem.asked < 60


def test_a_climb_goes_no_further_than_is_worth_it() -> None:
    objective, box = begun(Coupled())
    seen: list[float] = []

    def goes_on(p: np.ndarray, noise: np.ndarray) -> bool:
        seen.append(objective.log_likelihood(p, noise))
        return False

    end = to_the_top(objective, np.array([-9.0]), np.ones(1), box, goes_on)
    assert seen == [objective.log_likelihood(*end)]
    further = to_the_top(objective, np.array([-9.0]), np.ones(1), box)
    assert objective.log_likelihood(*further) > seen[0] + 1.0


def test_a_climb_stops_where_what_is_asked_for_is_out_of_reach() -> None:
    asked, reached = [], []
    for least in (-np.inf, -1.0, 1e7):
        problem = Coupled()
        objective, box = begun(problem)
        end = to_the_top(objective, np.array([-9.0]), np.ones(1), box, least=least)
        asked.append(problem.asked)
        reached.append(objective.log_likelihood(*end))
    assert reached[0] == reached[1] > -0.05  # the top can be had: the climb is the same
    assert reached[2] < -1.0
    assert asked[2] < 0.25 * asked[0]


def test_a_climb_stays_where_the_model_does_not_fail() -> None:
    objective, box = begun(Coupled(spins_beyond=1.5))
    p, noise = to_the_top(objective, np.zeros(1), np.ones(1), box)
    assert p[0] <= 1.5
    assert objective.log_likelihood(p, noise) > objective.log_likelihood(np.zeros(1), np.ones(1))


def test_noise_that_is_not_there_or_cannot_move_stays() -> None:
    class Two(Coupled):
        def noise_score(
            self, p: np.ndarray, noise: np.ndarray
        ) -> tuple[float, np.ndarray, np.ndarray]:
            value, slope, _ = super().noise_score(p, noise)
            return value, np.r_[slope, 5.0, 5.0], self.size * np.eye(3)

    lowest, highest = np.array([1e-3, 1e-3, 2.0]), np.array([1e3, 1.0, 2.0])
    objective = Objective(Two(), (), lowest, highest)  # type: ignore[arg-type]
    box = Box([0], np.array([-20.0]), np.array([20.0]))
    _, noise = to_the_top(objective, np.zeros(1), np.array([1.0, 0.0, 2.0]), box)
    assert list(noise[1:]) == [0.0, 2.0]
    assert noise[0] > 1.5


@pytest.mark.parametrize("seed", range(5))
def test_the_curvature_changes_slopes_as_they_were_seen_to_change(seed: int) -> None:
    """The secant equation, of the slopes met last; the curvature stays positive."""
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(4, 4))
    true, begin = root @ root.T + np.eye(4), np.diag(rng.uniform(0.5, 2.0, 4))
    met, at = Met(), rng.normal(size=4)
    for _ in range(3):
        met.meet(at, -true @ at)
        before, at = at, at + rng.normal(size=4)
    met.meet(at, -true @ at)
    scale = np.sqrt(np.diag(begin))
    found = met.corrected(begin, scale) * np.outer(scale, scale)
    np.testing.assert_allclose(found @ (at - before), true @ (at - before), rtol=1e-9)
    assert np.linalg.eigvalsh(found)[0] > 0.0


def test_a_slope_that_grows_uphill_leaves_the_curvature_positive() -> None:
    met = Met()
    met.meet(np.zeros(2), np.zeros(2))
    met.meet(np.array([1.0, 0.0]), np.array([3.0, 0.0]))
    found = met.corrected(np.eye(2), np.ones(2))
    assert 0.0 < found[0, 0] < 1.0
    assert found[1, 1] == 1.0
