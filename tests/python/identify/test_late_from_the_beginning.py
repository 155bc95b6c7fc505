"""A drive with late wheels, as late in its first samples as in all others."""

from dataclasses import replace

import pytest

from sysid_vehicle import Fit, Model, SensorNoise, drive, identify, manoeuvres

DELAY_S = 0.06


@pytest.mark.parametrize("seed", [453737, 487658])
def test_the_beginning_of_a_delay_is_no_lag(truth: Model, seed: int) -> None:
    """Wheels that stood still until the delay was over looked like a lag: 10 to 25 nats."""
    late = truth.add("steer_delay").with_values({"steer_delay.delay_s": DELAY_S})
    course = manoeuvres.handling_course(15.0, lateral_mps2=8.0)
    exact = replace(SensorNoise(), steer_rad=0.0)
    log = drive(late, course, seed=seed, noise=exact, rate_hz=50.0)

    def fitted(*effects: str) -> Fit:
        return identify(truth.add(*effects), log, starts=1)

    alone, other = fitted("steer_delay"), fitted("steer_lag")
    assert alone["steer_delay.delay_s"].value == pytest.approx(DELAY_S, abs=0.002)
    assert other.log_likelihood < alone.log_likelihood
    assert fitted("steer_delay", "steer_lag").log_likelihood < alone.log_likelihood + 3.0
