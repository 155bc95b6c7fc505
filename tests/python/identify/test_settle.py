"""Searches that work the gains out anew: the climb, steps that rise, a second end."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from sysid_vehicle import _core
from sysid_vehicle.errors import NumericalError
from sysid_vehicle.identify.search.climb import climb
from sysid_vehicle.identify.search.objective import Objective
from sysid_vehicle.identify.search.search import Box
from sysid_vehicle.identify.search.settle import risen, rivalled, settle
from sysid_vehicle.identify.search.ways import slope_of


class Ridge:
    """A product that is known, and a filter whose spread alone tells its two factors apart.

    With frozen gains each pair of factors is nearly as good as any other. The likelihood has its
    maximum where one of them is at its bound.
    """

    samples = 1

    def errors(self, p: np.ndarray) -> np.ndarray:
        return np.array([30.0 * np.log(p[0] * p[1]), 1e-3 * np.log(p[0] / p[1])])

    def freeze(self, p: np.ndarray, noise: np.ndarray) -> SimpleNamespace:
        spread = 20.0 * np.tanh(0.25 * np.log(p[1] / p[0]))
        return SimpleNamespace(log_likelihood=spread - self.half_sum_of_squares(p, None))

    def half_sum_of_squares(self, p: np.ndarray, _: object) -> float:
        return 0.5 * float(self.errors(p) @ self.errors(p))

    def normal_equations(
        self, p: np.ndarray, gains: object, _: object
    ) -> tuple[float, np.ndarray, np.ndarray]:
        by = -np.array([[30.0, 30.0], [1e-3, -1e-3]]) / p
        return self.half_sum_of_squares(p, gains), by.T @ self.errors(p), by.T @ by

    def noise_score(self, p: np.ndarray, noise: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
        return self.freeze(p, noise).log_likelihood, np.zeros(1), np.eye(1)


def test_the_likelihood_is_climbed_where_frozen_gains_see_no_slope() -> None:
    noise, box = np.ones(1), Box([0, 1], np.array([0.2, 0.2]), np.array([5.0, 3.0]))
    objective = Objective(Ridge(), (), 0.5 * noise, 2.0 * noise)  # type: ignore[arg-type]
    highest = objective.log_likelihood(np.array([1.0 / 3.0, 3.0]), noise)
    p, _, converged = settle(objective, np.array([1.3, 0.8]), noise, box)
    assert converged
    assert objective.log_likelihood(p, noise) < highest - 10.0
    p, _, reached = climb(objective, p, noise, box)
    assert reached == objective.log_likelihood(p, noise)
    assert reached > highest - 0.05
    assert p[1] == pytest.approx(box.upper[1], rel=1e-12)


class Narrow:
    """A sum that is known, and a filter whose spread tells the difference, within narrow limits.

    With frozen gains the difference is next to nothing in a box that is wide.
    """

    samples, by = 1, -np.array([[30.0, 30.0], [1e-3, -1e-3]])

    def freeze(self, p: np.ndarray, noise: np.ndarray) -> SimpleNamespace:
        spread = -2.0 * (p[0] - p[1] - 3.0) ** 2
        return SimpleNamespace(log_likelihood=spread - self.half_sum_of_squares(p, None))

    def half_sum_of_squares(self, p: np.ndarray, _: object) -> float:
        return 0.5 * float(np.sum((self.by @ p) ** 2))

    def normal_equations(
        self, p: np.ndarray, gains: object, _: object
    ) -> tuple[float, np.ndarray, np.ndarray]:
        descent = -self.by.T @ self.by @ p
        return self.half_sum_of_squares(p, gains), descent, self.by.T @ self.by


def test_a_climb_that_is_led_astray_goes_on_in_shorter_steps() -> None:
    """Eighteen nats are to be had; three hundredths of the way to the bound are far beyond them."""
    noise, box = np.ones(1), Box([0, 1], np.full(2, -1e3), np.full(2, 1e3))
    objective = Objective(Narrow(), (), 0.5 * noise, 2.0 * noise)  # type: ignore[arg-type]
    p, begin, reached = climb(objective, np.zeros(2), noise, box)
    assert begin == pytest.approx(-18.0)
    assert reached == objective.log_likelihood(p, noise)
    assert reached > -0.1
    assert p == pytest.approx([1.5, -1.5], abs=0.1)


def test_noise_is_not_learned_again_where_parameters_hardly_moved() -> None:
    """The search ends where it began; the noise was learned there."""
    problem, noise = Valleys(), np.ones(1)
    asked: list[float] = []
    score = problem.noise_score
    problem.noise_score = lambda p, n: (asked.append(float(p[0])), score(p, n))[1]  # type: ignore[method-assign]
    objective = Objective(problem, (), 0.5 * noise, 2.0 * noise)  # type: ignore[arg-type]
    box = Box([0], np.array([-2.0]), np.array([2.0]))
    p, _, converged = settle(objective, np.array([1.0]), noise, box)
    assert converged
    assert p[0] == 1.0
    assert len(asked) == 1


def test_noise_is_learned_on_where_its_steps_ran_out() -> None:
    """Parameters that stand still tell nothing of noise that has not come to a stand."""

    class Far(Valleys):
        def freeze(self, p: np.ndarray, noise: np.ndarray) -> SimpleNamespace:
            return SimpleNamespace(log_likelihood=-5.0 * self.off(noise) ** 2)

        def off(self, noise: np.ndarray) -> float:
            return float(np.log(noise[0] / 1e6))

        def noise_score(
            self, p: np.ndarray, noise: np.ndarray
        ) -> tuple[float, np.ndarray, np.ndarray]:
            slope = np.array([-10.0 * self.off(noise)])
            return self.freeze(p, noise).log_likelihood, slope, 10.0 * np.eye(1)

    box, wide = Box([0], np.array([-2.0]), np.array([2.0])), np.array([1e9])
    objective = Objective(Far(), (), 1.0 / wide, wide)  # type: ignore[arg-type]
    # Six steps of one and a half, as far as one may go, reach 8e3.
    _, noise, converged = settle(objective, np.array([1.0]), np.ones(1), box)
    assert converged
    assert noise == pytest.approx(1e6, rel=0.01)


@pytest.mark.parametrize("free", [3, 12])
def test_the_slope_of_the_likelihood_by_differences(free: int) -> None:
    """Central ones of few parameters, one-sided ones with the bend taken off of many."""
    weights = np.linspace(1.0, 3.0, free)
    at, top = np.full(free, 0.9), np.full(free, 1.0)
    sets: list[int] = []

    def values_at(trials: np.ndarray) -> np.ndarray:
        sets.append(len(trials))
        return -0.5 * ((trials - top) ** 2) @ weights**2

    box = Box(list(range(free)), np.zeros(free) - 5.0, np.full(free, 0.9))  # all at their bounds
    slope = slope_of(values_at, at, np.diag(weights**2), box)
    np.testing.assert_allclose(slope, weights**2 * (top - at), rtol=0.2 if free < 9 else 1e-6)
    assert sum(sets) == (2 * free if 2 * free <= _core.LANES else free + 1)


class Rounded:
    """Twelve parameters of which one is never felt; values that come together round otherwise."""

    samples, weights = 1, np.r_[0.0, np.linspace(1.0, 3.0, 11)]

    def freeze(self, p: np.ndarray, noise: np.ndarray) -> SimpleNamespace:
        return SimpleNamespace(log_likelihood=-self.half_sum_of_squares(p, None))

    def half_sum_of_squares(self, p: np.ndarray, _: object) -> float:
        return 0.5 * float(((p - 1.0) ** 2) @ self.weights**2)

    def normal_equations(
        self, p: np.ndarray, gains: object, _: object
    ) -> tuple[float, np.ndarray, np.ndarray]:
        return (
            self.half_sum_of_squares(p, gains),
            self.weights**2 * (1.0 - p),
            np.diag(self.weights**2),
        )

    def log_likelihoods(self, sets: np.ndarray, noise: np.ndarray) -> np.ndarray:
        return np.array([1e-6 - self.half_sum_of_squares(p, None) for p in sets])


def test_what_the_driving_never_felt_is_not_sent_to_its_bound() -> None:
    noise, box = np.ones(1), Box(list(range(12)), np.full(12, -5.0), np.full(12, 5.0))
    objective = Objective(Rounded(), (), 0.5 * noise, 2.0 * noise)  # type: ignore[arg-type]
    p, _, _ = climb(objective, np.full(12, 0.5), noise, box)
    assert p[0] == 0.5
    assert p[1:] == pytest.approx(1.0, abs=0.05)


class Valleys:
    """Two values that fit alike but for three nats, and noise that may be worth some as well."""

    samples, slope, middle = 1, 0.0, 1.0

    def freeze(self, p: np.ndarray, noise: np.ndarray) -> SimpleNamespace:
        if p[0] > 1.9:
            raise NumericalError("the car spins")
        return SimpleNamespace(log_likelihood=3.0 * (p[0] > 0.0) - self.half_sum_of_squares(p, 0))

    def half_sum_of_squares(self, p: np.ndarray, _: object) -> float:
        return 50.0 * float(p[0] ** 2 - self.middle) ** 2

    def normal_equations(
        self, p: np.ndarray, gains: object, _: object
    ) -> tuple[float, np.ndarray, np.ndarray]:
        by = -20.0 * p[:1]
        gradient = by * 10.0 * (p[0] ** 2 - self.middle)
        return self.half_sum_of_squares(p, gains), gradient, np.outer(by, by)

    def noise_score(self, p: np.ndarray, noise: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
        return self.freeze(p, noise).log_likelihood, np.array([self.slope]), np.eye(1)


def test_another_end_is_followed_as_far_as_it_may_be_the_better_one(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    problem, noise, box = Valleys(), np.ones(1), Box([0], np.array([-2.0]), np.array([2.0]))
    objective = Objective(problem, (), 0.5 * noise, 2.0 * noise)  # type: ignore[arg-type]
    low, high = (np.array([-1.0]), noise, True), (np.array([1.0]), noise, True)
    assert rivalled(objective, low, np.array([0.8]), box)[0] == pytest.approx(1.0, abs=0.01)
    assert rivalled(objective, low, np.array([1.95]), box) is low
    asked: list[float] = []

    def seen(_: object, p: np.ndarray, *rest: object) -> tuple[np.ndarray, np.ndarray, bool]:
        asked.append(float(p[0]))
        return p, noise, True

    monkeypatch.setitem(rivalled.__globals__, "settle", seen)
    assert rivalled(objective, high, np.array([-0.8]), box) is high
    problem.slope = 2.0  # for which twice a nat is promised: less than is lacking
    assert rivalled(objective, high, np.array([-0.8]), box) is high
    assert not asked
    problem.slope = 5.0
    objective = Objective(problem, (), 0.5 * noise, 2.0 * noise)  # type: ignore[arg-type]
    assert rivalled(objective, high, np.array([-0.8]), box) is high
    assert asked == [pytest.approx(-1.0, abs=0.01)]


def test_an_end_that_lacks_too_much_on_few_samples_is_not_followed_on_all() -> None:
    noise, box = np.ones(1), Box([0], np.array([-2.0]), np.array([2.0]))
    few, every = (
        Objective(Valleys(), (), 0.5 * noise, 2.0 * noise)  # type: ignore[arg-type]
        for _ in range(2)
    )
    low, high = (np.array([-1.0]), noise, True), (np.array([1.0]), noise, True)
    reached = rivalled(every, low, np.array([0.8]), box, [few])
    assert reached[0] == pytest.approx(1.0, abs=0.01)
    refused = replace(every, problem=Refusing())  # type: ignore[arg-type]
    assert rivalled(refused, high, np.array([-0.8]), box, [few]) is high
    with pytest.raises(AssertionError, match="asked"):
        rivalled(refused, low, np.array([0.8]), box, [few])
    # Few samples lead both to one end: there is nothing to follow.
    assert rivalled(refused, low, np.array([-0.8]), box, [few]) is low


def test_few_samples_lead_unless_the_start_is_better_already() -> None:
    class Whole(Valleys):
        samples, asked = 2, 0

        def normal_equations(
            self, p: np.ndarray, gains: object, of: object
        ) -> tuple[float, np.ndarray, np.ndarray]:
            self.asked += 1
            return super().normal_equations(p, gains, of)

    class Still(Valleys):
        """All samples, of which frozen gains show no slope."""

        samples = 2

        def normal_equations(
            self, p: np.ndarray, gains: object, _: object
        ) -> tuple[float, np.ndarray, np.ndarray]:
            return self.half_sum_of_squares(p, gains), np.zeros(1), np.eye(1)

    noise, box = np.ones(1), Box([0], np.array([-2.0]), np.array([2.0]))

    def end(problem: Valleys, start: float, thin: Valleys | None) -> np.ndarray:
        every, few = (
            Objective(one, (), 0.5 * noise, 2.0 * noise)  # type: ignore[arg-type]
            for one in (problem, thin or problem)
        )
        return settle(every, np.array([start]), noise, box, thin=[few])[0]

    alone, led, between = Whole(), Whole(), Whole()
    levels = [
        Objective(one, (), 0.5 * noise, 2.0 * noise)  # type: ignore[arg-type]
        for one in (Valleys(), between, led)
    ]
    found, _, _ = settle(levels[-1], np.array([0.1]), noise, box, thin=levels[:-1])
    assert found == pytest.approx(1.0, abs=1e-3)
    assert settle(levels[0], np.array([0.1]), noise, box)[0] == pytest.approx(1.0, abs=1e-3)
    steps = led.asked, between.asked
    alone, led = Whole(), Whole()
    assert end(alone, 0.1, None) == pytest.approx(1.0, abs=1e-3)
    assert end(led, 0.1, Valleys()) == pytest.approx(1.0, abs=1e-3)
    assert steps == (led.asked, led.asked) < (alone.asked, alone.asked)
    elsewhere = Valleys()
    elsewhere.middle = 1.5
    assert end(elsewhere, 1.0, None) ** 2 == pytest.approx(1.5, abs=1e-3)
    assert end(Still(), 1.0, elsewhere) == 1.0


class Refusing(Valleys):
    """All samples, which nobody is to ask."""

    def freeze(self, p: np.ndarray, noise: np.ndarray) -> SimpleNamespace:
        raise AssertionError("asked")


def test_gains_that_were_asked_for_last_are_kept() -> None:
    class Counting:
        samples, asked = 1, 0

        def freeze(self, p: np.ndarray, noise: np.ndarray) -> SimpleNamespace:
            self.asked += 1
            return SimpleNamespace(log_likelihood=p[0] + noise[0])

    counting, p, noise = Counting(), np.ones(2), np.ones(1)
    objective = Objective(counting)  # type: ignore[arg-type]
    gains = objective.freeze(p, noise)
    assert objective.freeze(p.copy(), noise.copy()) is gains
    assert counting.asked == 1
    p[0] = 3.0  # the array itself is not what is remembered
    assert objective.freeze(p, noise).log_likelihood == 4.0
    assert objective.freeze(p, 2.0 * noise).log_likelihood == 5.0
    other = replace(objective, problem=Counting())  # type: ignore[arg-type]
    assert other.freeze(p, 2.0 * noise) is not objective.freeze(p, 2.0 * noise)
    assert counting.asked == 3
    # So are those of the two before them, unless they are too large.
    assert objective.freeze(np.ones(2), noise) is gains
    assert counting.asked == 3
    counting.samples = 10**6
    objective.freeze(p, 3.0 * noise)
    assert objective.freeze(np.ones(2), noise) is not gains
    assert counting.asked == 5


def test_normal_equations_that_were_asked_for_last_are_kept() -> None:
    class Counting(Valleys):
        asked = 0

        def normal_equations(
            self, p: np.ndarray, gains: object, columns: object
        ) -> tuple[float, np.ndarray, np.ndarray]:
            self.asked += 1
            return super().normal_equations(p, gains, columns)

    counting, p, gains = Counting(), np.array([0.5]), object()
    objective = Objective(counting)  # type: ignore[arg-type]
    first = objective.normal_equations(p, gains, [0])
    assert objective.normal_equations(p.copy(), gains, [0]) is first
    assert counting.asked == 1
    # Not those under other gains, by other parameters, elsewhere, or with further residuals.
    objective.normal_equations(p, object(), [0])
    objective.normal_equations(p, gains, [])
    objective.normal_equations(p, gains, [0])
    p[0] = 0.7
    assert objective.normal_equations(p, gains, [0])[0] != first[0]
    one = objective.also(lambda _: (np.ones(1), np.ones((1, 1))))
    assert one.normal_equations(p, gains, [0])[0] == pytest.approx(
        objective.normal_equations(p, gains, [0])[0] + 0.5
    )
    before = counting.asked
    counting.samples = 10**6  # gains of so many samples are not held for them
    objective.normal_equations(p, gains, [0])
    objective._linear.clear()
    objective.normal_equations(p, gains, [0])
    objective.normal_equations(p, gains, [0])
    assert counting.asked == before + 2


def test_parameters_move_only_where_the_likelihood_rises() -> None:
    """The search holds the gains of its start; with gains of its own its end may be worse."""

    class Peaked:
        samples = 1

        def __init__(self) -> None:
            self.asked: list[float] = []

        def freeze(self, p: np.ndarray, _: object) -> SimpleNamespace:
            self.asked.append(float(p[1]))
            if p[1] > 0.9:
                raise NumericalError("the car spins")
            return SimpleNamespace(log_likelihood=-float((p[1] - 0.2) ** 2))

    peaked, box = Peaked(), Box([1], np.zeros(1), np.ones(1))
    objective = Objective(peaked)  # type: ignore[arg-type]
    p, noise = np.array([7.0, 0.0]), np.empty(0)
    begin = peaked.freeze(p, None)
    reached, there = risen(objective, p, begin, np.array([1.0]), noise, box)
    assert peaked.asked == [0.0, 1.0, 0.5, 0.25]
    assert list(reached) == [7.0, 0.25]
    assert there.log_likelihood > begin.log_likelihood
    assert risen(objective, reached, there, np.array([0.8]), noise, box) == (reached, there)
