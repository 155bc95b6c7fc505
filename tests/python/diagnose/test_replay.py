"""Driving that is done again: what the model has acts from its first sample."""

import pytest

from sysid_vehicle import Model, drive, identify, manoeuvres
from sysid_vehicle.diagnose.experiment.replay import Replay


@pytest.fixture(scope="module")
def replay(truth: Model) -> Replay:
    """Of a car whose steering comes late, in a log that begins in a curve."""
    late = truth.add("steer_delay").with_values({"steer_delay.delay_s": 0.08})
    whole = drive(late, manoeuvres.lap(20.0), seed=4, rate_hz=50.0)
    return Replay(identify(late, whole.between(8.0, 16.0), starts=1), 10_000, 0)


@pytest.mark.parametrize("corrects", [False, True])
def test_late_steering_is_known_from_the_first_sample(replay: Replay, corrects: bool) -> None:
    """Without noise the model that drives leaves nothing; one without the delay does."""
    model = replay.fit.model
    noise = replay.fit.noise.vector()
    problem = replay._driven(model, 0.0, corrects)

    def left(car: Model) -> float:
        p = car.vector()
        return problem.half_sum_of_squares(p, problem.freeze(p, noise))

    assert left(model) < 1e-3
    assert left(model.with_values({"steer_delay.delay_s": 0.0})) > 1e3
