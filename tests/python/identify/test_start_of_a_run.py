"""A lag that goes to nothing leaves the likelihood of the model without it."""

import pytest

from sysid_vehicle import Model, RoadDisturbance, catalogue, drive, identify, manoeuvres
from sysid_vehicle.identify import Fit
from sysid_vehicle.identify.maximum import log_likelihood_of, objectives

LAGS = [
    e.id
    for e in catalogue()
    if e.scored_at_typical and e.states and len(e.parameters) == 1 and not e.refines
]


@pytest.fixture(scope="module")
def pushed(truth: Model) -> Fit:
    """Two stretches on a road that pushes: each begins with what nobody has measured yet."""
    push = RoadDisturbance(150.0, 200.0, 100.0, 0.3)
    logs = [drive(truth, manoeuvres.lap(12.0), seed=seed, disturbance=push) for seed in (3, 4)]
    return identify(truth, logs, starts=1)


@pytest.mark.parametrize("name", LAGS)
def test_the_likelihood_has_no_step_at_nothing(pushed: Fit, name: str) -> None:
    model = pushed.model.add(name)
    (parameter,) = (p for e in model.parts if e.id == name for p in e.parameters)
    shortest = model.with_values({f"{name}.{parameter.name}": 1e-6 * parameter.typical})
    objective, _ = objectives(shortest, pushed.driving)
    told = log_likelihood_of(objective, shortest.vector(), pushed.noise.vector())
    assert told == pytest.approx(pushed.log_likelihood, abs=0.05)


def test_every_lag_of_the_catalogue_is_tried() -> None:
    assert {"tyre_relaxation", "steer_lag", "force_lag"} <= {*LAGS}
