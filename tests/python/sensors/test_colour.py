"""Level and colour of a sensor's noise."""

import numpy as np
import pytest
from scipy.integrate import trapezoid
from scipy.signal import lfilter

from sysid_vehicle.sensors.kinematics.colour import Colour, fit_colour, neighbours

PHI, WHITE = np.array([0.9, -0.4]), 0.2


@pytest.fixture
def errors(rng: np.random.Generator) -> np.ndarray:
    return lfilter([1.0], [1.0, *-PHI], WHITE * rng.standard_normal((1, 40000)), axis=1)


@pytest.fixture
def colour(errors: np.ndarray) -> Colour:
    return fit_colour(errors, np.arange(errors.shape[1]), 1e-6)


def test_a_process_is_found(errors: np.ndarray, colour: Colour) -> None:
    assert colour.white_std == pytest.approx(WHITE, rel=0.02)
    assert colour.std == pytest.approx(float(errors.std()), rel=0.02)
    np.testing.assert_allclose(colour.phi[:2], PHI, atol=0.03)
    assert np.abs(colour.phi[2:]).max(initial=0.0) < 0.03
    assert fit_colour(errors[:, ::50], np.arange(800), 1e-6).phi.size == 0  # so far apart, white


def test_what_is_whitened_is_white_and_of_unit_variance(errors: np.ndarray, colour: Colour) -> None:
    """Where the log has a gap the process begins anew, with its whole variance."""
    run = neighbours(np.repeat([0, 1], 20000), np.arange(40000.0))
    assert run[[0, 1, 19999, 20000, 20001]].tolist() == [0, 1, 19999, 0, 1]
    (white,) = colour.whitened(run, errors[0])
    assert np.std(white) == pytest.approx(1.0, abs=0.02)
    assert abs(np.mean(white[1:] * white[:-1])) < 0.02
    assert white[20000] == pytest.approx(errors[0, 20000] / colour.std)
    rows = colour.whitener(run)[500].toarray()[0]
    assert np.flatnonzero(rows).max() == 500  # of errors before, none that comes


def test_the_spectrum_holds_the_variance(colour: Colour) -> None:
    rate_hz = 50.0
    frequency = np.linspace(0.0, rate_hz / 2.0, 20001)
    power = colour.spectrum(frequency, rate_hz)
    assert trapezoid(power, frequency) == pytest.approx(colour.std**2, rel=0.02)
    # PHI swings with a period of 2 pi / arccos(0.9 / (2 sqrt(0.4))) samples.
    peak = frequency[int(power.argmax())]
    assert 3.0 < peak < 9.0
    assert Colour(0.2, 0.2, np.empty(0)).spectrum(frequency, rate_hz) == pytest.approx(
        2.0 * 0.2**2 / rate_hz
    )


def test_irregular_samples_have_no_neighbours() -> None:
    time_s = np.array([0.0, 0.1, 0.2, 0.3, 0.7, 0.8, 0.9])
    assert neighbours(np.zeros(7, dtype=int), time_s).tolist() == [0, 1, 2, 3, 0, 1, 2]
