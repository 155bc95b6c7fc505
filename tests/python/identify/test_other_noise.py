"""The maximum of the likelihood is the same whatever time scale the noise begins with."""

from dataclasses import replace

import numpy as np
import pytest

from sysid_vehicle import Model, Vehicle, effect, manoeuvres
from sysid_vehicle.errors import NumericalError
from sysid_vehicle.estimate import Driving, first_guess
from sysid_vehicle.identify import Fit, refine
from sysid_vehicle.identify.maximum import objectives
from sysid_vehicle.identify.search.box import free_box
from sysid_vehicle.identify.search.climb import FAR_BELOW
from sysid_vehicle.identify.search.other_noise import likelier_noise
from sysid_vehicle.simulate import RoadDisturbance, drive

FAST_S, SLOW_S = 0.02, 0.7


class TwoScales(RoadDisturbance):
    """A slow disturbance, and a fast one of twice its size."""

    def sample(self, n: int, rate_hz: float, rng: np.random.Generator) -> np.ndarray:
        slow = super().sample(n, rate_hz, rng)
        fast = RoadDisturbance(fy_n=340.0, mz_nm=1130.0, correlation_time_s=FAST_S)
        return slow + fast.sample(n, rate_hz, rng)


@pytest.fixture(scope="module")
def driving(car: Vehicle) -> Driving:
    """A lap of a car with a locking differential, which the fitted model lacks."""
    name = "limited_slip_differential"
    (size,) = effect(name).parameters
    truth = Model(car).add(name).with_values({f"{name}.{size.name}": 2.0 * size.typical})
    rough = TwoScales(fy_n=155.0, mz_nm=518.0, correlation_time_s=SLOW_S)
    return Driving.of(
        drive(truth, manoeuvres.lap(25.0, 7.0), seed=509, rate_hz=50.0, disturbance=rough)
    )


def begun(driving: Driving, car: Vehicle, time_s: float) -> Fit:
    """The fit whose noise begins with this time scale of lateral disturbances."""
    noise = replace(first_guess(driving, car), correlation_time_s=(0.3, time_s, time_s))
    return refine(Model(car).add("front_tyre_relaxation"), driving, noise)


@pytest.fixture(scope="module")
def fast(driving: Driving, car: Vehicle) -> Fit:
    return begun(driving, car, FAST_S)


def test_slow_noise_leads_to_the_maximum_of_fast_noise(
    driving: Driving, car: Vehicle, fast: Fit
) -> None:
    """Eight nats lower a moment of 0.2 s takes up what the parameters could explain."""
    assert fast.noise.correlation_time_s[2] < 0.06
    for time_s in (0.05, 1.0):
        slow = begun(driving, car, time_s)
        assert slow.log_likelihood > fast.log_likelihood - 1.0
        assert slow.noise.correlation_time_s[2] < 0.06


def test_where_other_noise_fails_what_was_found_stays(
    driving: Driving, fast: Fit, monkeypatch: pytest.MonkeyPatch
) -> None:
    fit = fast
    objective, _ = objectives(fit.model, driving)
    at_top = fit.model.vector(), fit.noise.vector()
    asked = []

    def failing(*_: object, **__: object) -> None:
        asked.append(1)
        raise NumericalError("the car spins")

    monkeypatch.setitem(likelier_noise.__globals__, "_with_time", failing)
    p, noise = likelier_noise(objective, at_top, free_box(fit.model), objective)
    assert asked
    assert (p, noise) == at_top


def test_other_noise_is_not_climbed_from_where_it_is_hopeless(
    driving: Driving, fast: Fit, monkeypatch: pytest.MonkeyPatch
) -> None:
    fit = fast
    objective, _ = objectives(fit.model, driving)
    at_top = fit.model.vector(), fit.noise.vector()
    value = objective.log_likelihood(*at_top)
    told: dict[str, list[float]] = {"settle": [], "to_the_top": []}

    def noting(name: str):  # type: ignore[no-untyped-def]
        known = likelier_noise.__globals__[name]

        def noted(problem, *args, least=-np.inf, **options):  # type: ignore[no-untyped-def]
            if problem is objective:
                told[name].append(least)
            return known(problem, *args, least=least, **options)

        return noted

    for name in told:
        monkeypatch.setitem(likelier_noise.__globals__, name, noting(name))
    slow = replace(fit.noise, correlation_time_s=(1.0, 1.0, 1.0)).vector()
    monkeypatch.setitem(likelier_noise.__globals__, "_led", lambda *_: (at_top[0], slow, np.inf))
    likelier_noise(objective, at_top, free_box(fit.model), replace(objective))
    assert told["settle"]
    assert set(told["settle"]) == {value - FAR_BELOW}
    assert told["to_the_top"] == []  # it settles to the noise of the maximum that is known
