"""Whittle's likelihood of noise behind a low-pass, with its derivatives."""

import numpy as np
import pytest

from sysid_vehicle.sensors.low_pass.low_pass import _amounts, _Problem
from sysid_vehicle.sensors.low_pass.spectrum import Spectrum


def spectrum(seed: int, rate_hz: float = 100.0) -> Spectrum:
    """Any noise that falls with frequency, in 120 frequencies up to half the rate."""
    rng = np.random.default_rng(seed)
    frequency = np.linspace(0.5, 0.5 * rate_hz, 120)
    power = (1e-4 + 1e-2 / (1.0 + (frequency / 6.0) ** 4)) * rng.chisquare(8, 120) / 8.0
    used = frequency > 3.0
    return Spectrum(rate_hz, 100.0, frequency, power, used, (), 1e-6, 4.0)


@pytest.mark.parametrize("digital", [None, False, True])
def test_slopes_agree_with_differences(digital: bool | None) -> None:
    problem = _Problem((spectrum(1), spectrum(2, 50.0), spectrum(3)), digital)
    x = problem.begin(12.0) if digital is not None else problem.begin()
    x = problem.kept(x + 0.1 * np.random.default_rng(4).standard_normal(x.size))
    state = problem.state(x)
    step = 1e-4
    for i, row in enumerate(np.eye(x.size)):
        ahead, behind = (problem.state(x + s * step * row) for s in (1.0, -1.0))
        slope = (ahead.cost - behind.cost) / (2.0 * step)
        # The response is moved by one-sided differences.
        assert state.slope[i] == pytest.approx(slope, rel=0.01, abs=0.02), i
    assert np.linalg.eigvalsh(state.information).min() >= -1e-9


def test_the_search_ends_where_no_parameter_gains() -> None:
    problem = _Problem((spectrum(1), spectrum(3)), True)
    x = problem.search(problem.begin(12.0))
    best = problem.state(x).cost
    for row in np.eye(x.size):
        for off in (-0.05, 0.05):
            assert problem.state(problem.kept(x + off * row)).cost > best - 1e-2


def test_amounts_of_known_parts_are_found() -> None:
    s = spectrum(1)
    f = s.frequency_hz[s.used]
    parts = np.stack([np.ones(f.size), 1.0 / (1.0 + (f / 6.0) ** 4)])
    cost, found = _amounts(s, parts, np.array([1e-3, 1e-3]))
    np.testing.assert_allclose(found, [1e-4, 1e-2], rtol=0.3)
    for off in (0.8, 0.9, 1.1, 1.25):
        for k in range(2):
            other = found * np.where(np.arange(2) == k, off, 1.0)
            model = other @ parts + s.floor
            assert s.weight * np.sum(np.log(model) + s.power[s.used] / model) > cost
