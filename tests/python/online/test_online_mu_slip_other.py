"""Readings of a tyre that is not of the curve's kind, of the other sign, and beyond the bounds."""

import numpy as np
import pytest

from sysid_vehicle import online
from sysid_vehicle.errors import InvalidInput


def burckhardt(seed: int) -> online.MuSlipData:
    """A dry road, M. Burckhardt, Fahrwerktechnik: Radschlupf-Regelsysteme (1993); peak 1.17."""
    rng = np.random.default_rng(seed)
    slip = np.linspace(0.0, 0.35, 250)
    mu = 1.2801 * (1.0 - np.exp(-23.99 * slip)) - 0.52 * slip
    return online.MuSlipData(slip, mu + 0.03 * rng.standard_normal(slip.size))


def test_a_curve_that_does_not_fit_is_told() -> None:
    data = burckhardt(9)
    found = online.compare_mu_slip(data)
    assert abs(found.best.values[0] - 1.17) > 5.0 * found.best.std[0]
    assert "does not fit: what it leaves depends on the slip" in str(found)
    assert "try the magic-formula curve" in str(found)
    other = online.compare_mu_slip(data, curve=online.MAGIC_FORMULA)
    assert abs(other.best.values[0] - 1.17) < 3.0 * other.best.std[0]
    assert "does not fit" not in str(other)


def test_a_curve_that_fits_is_not_doubted() -> None:
    doubted = [
        "does not fit" in str(online.compare_mu_slip(online.simulate_mu_slip((0.35, 0.15), seed=s)))
        for s in range(40)
    ]
    assert sum(doubted) == 0


def test_the_table_says_what_rests_at_a_bound() -> None:
    assert "0.60000 at its bound" in str(online.compare_mu_slip(burckhardt(9)))


def test_a_wrong_sign_is_named() -> None:
    data = burckhardt(9)
    with pytest.raises(InvalidInput, match=r"mu: of the other sign than slip .* sample \d+"):
        online.MuSlipData(data.slip, -data.mu)


@pytest.mark.parametrize("seed", [1, 3, 7])
def test_readings_of_little_slip_determine_no_bias(seed: int) -> None:
    """The bias takes the peak to -1e7, where no curve is to be held against the readings."""
    slip = np.linspace(0.0, 0.0168, 12)
    mu = 15.0 * slip / (1.0 + (slip / 0.12) ** 2)
    data = online.MuSlipData(slip, mu + 0.03 * np.random.default_rng(seed).standard_normal(12))
    found = online.compare_mu_slip(data)
    assert found.best.method == "least squares"
    assert "corrected: left out, the readings do not determine the curve" in str(found)
    with pytest.raises(InvalidInput, match="take readings on both sides of the peak"):
        online.mu_slip_fit(data, corrected=True)
