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


def braked(
    seed: int, curve: online.MuSlipCurve = online.TWO_PARAMETER, peak: float = 0.9
) -> online.MuSlipData:
    """A wheel that an anti-lock brake lets slip to and fro."""
    rng = np.random.default_rng(seed)
    slip = np.abs(0.3 * np.sin(np.pi * 0.01 * np.arange(250) / 0.6))
    mu = curve.mu(slip, [peak, 0.08, 1.6, 2.6][: len(curve.parameters)])
    return online.MuSlipData(slip, mu + 0.03 * rng.standard_normal(slip.size), 0.03)


@pytest.mark.parametrize("curve", [online.TWO_PARAMETER, online.MAGIC_FORMULA])
@pytest.mark.parametrize("wheel", [-0.01, 0.01])
def test_a_rolling_radius_told_wrong_is_named_and_not_another_curve(
    curve: online.MuSlipCurve, wheel: float
) -> None:
    data = braked(11, curve)
    slip = 1.0 - (1.0 - data.slip) * (1.0 + wheel)
    found = online.compare_mu_slip(online.MuSlipData(slip, data.mu, 0.03), curve=curve)
    assert abs(found.best.values[1] - 0.08) > 4.0 * found.best.std[1]
    note = "slip: " + found.notes[-1].split("slip: ")[1]  # as likely as one of mu, or alone
    assert note.startswith("slip: with an offset of")
    assert "the rolling radius was told wrong by" in note
    offset, std = map(float, note.split(" offset of ")[1].split(" the ")[0].split(" +- "))
    assert abs(offset + wheel) < 4.0 * std < 0.003
    peak, at = note.split(", with mu_peak ")[1].split(":")[0].split(", slip_peak ")
    assert float(peak) == pytest.approx(0.9, abs=0.02)
    assert float(at) == pytest.approx(0.08, abs=0.006)


def test_a_force_that_is_none_of_the_tyre_is_named() -> None:
    data = braked(12)
    found = online.compare_mu_slip(online.MuSlipData(data.slip, data.mu + 0.06, 0.03))
    assert abs(found.best.values[0] - 0.9) > 5.0 * found.best.std[0]
    assert found.notes[-1].startswith("mu: with an offset of 0.0")
    assert "a slope of the road" in found.notes[-1]


@pytest.mark.parametrize("told", [0.03, None])
def test_a_road_that_changes_on_the_way_is_named(told: float | None) -> None:
    one, two = braked(13), braked(14, peak=0.5)
    both = online.MuSlipData(np.r_[one.slip, two.slip], np.r_[one.mu, two.mu], told)
    (note,) = online.compare_mu_slip(both).notes
    assert "depends on the order of the readings" in note
    assert "the road changed on the way" in note


@pytest.mark.parametrize(("factor", "word"), [(0.1, "small"), (10.0, "large")])
def test_noise_told_wrong_is_named(factor: float, word: str) -> None:
    data = braked(15)
    (note,) = online.compare_mu_slip(online.MuSlipData(data.slip, data.mu, 0.03 * factor)).notes
    assert f"times too {word}; leave it out, and it is learnt" in note
    assert online.compare_mu_slip(online.MuSlipData(data.slip, data.mu)).notes == ()


def test_readings_as_told_raise_no_doubt() -> None:
    """Five tests at 1e-3 each: 1 of 200 sets, by chance."""
    doubted = [bool(online.compare_mu_slip(braked(seed)).notes) for seed in range(100, 160)]
    assert sum(doubted) <= 2


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


@pytest.mark.parametrize("offset", [0.0, 0.03])
def test_noise_in_the_slip_is_named_and_is_no_offset(offset: float) -> None:
    """Least squares take slip as exact: an offset or another curve was told in 15 of 16 sets."""
    at, noise = online.sinusoidal_slip(), 0.01
    told, offsets = [], 0
    for seed in range(16):
        rng = np.random.default_rng(3000 + seed)
        mu = online.TWO_PARAMETER.mu(at, (0.9, 0.12)) + 0.02 * rng.standard_normal(at.size)
        slip = at + offset + noise * rng.standard_normal(at.size)
        notes = "; ".join(online.compare_mu_slip(online.MuSlipData(slip, mu)).notes)
        assert "slip: readings scatter more where the curve is steep" in notes
        assert "does not fit" not in notes
        told.append(float(notes.split("noise of about ")[1].split(" in it")[0]))
        offsets += "slip: with an offset of" in notes
    assert np.mean(told) == pytest.approx(noise, rel=0.4)
    assert offsets == 0 if offset == 0.0 else offsets >= 8


def test_few_readings_with_noise_in_the_slip_tell_no_offset() -> None:
    """A steep curve scatters most at its foot, which decides on an offset (6 of 20 before)."""
    at = (np.arange(41) / 40.0) ** 2
    for seed in range(20):
        rng = np.random.default_rng(4000 + seed)
        mu = online.TWO_PARAMETER.mu(at, (0.9, 0.12)) + 0.005 * rng.standard_normal(at.size)
        data = online.MuSlipData(at + 0.01 * rng.standard_normal(at.size), mu)
        assert "with an offset of" not in str(online.compare_mu_slip(data))


def test_the_iterated_filter_is_not_made_sure_by_one_odd_reading() -> None:
    """At little slip one reading in 3000 sets led to slip_peak 0.04, as if known to 0.05 (1312)."""
    worst = 0.0
    for seed, factor in ((1312, 3.0), *((s, 1.0) for s in range(5000, 5060))):
        data = online.simulate_mu_slip((0.35, 0.15), noise_std=0.04, seed=seed)
        run = online.mu_slip_ekf(data, iterations=10, noise_factor=factor)
        worst = max(worst, float(np.abs(run.mean[-1] / (0.35, 0.15) - 1.0).max()))
    assert worst < 0.4
