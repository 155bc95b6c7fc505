"""Results leave as tables of pandas, xarray and ArviZ, and as draws of the posterior."""

import sys

import numpy as np
import pytest

import sysid_vehicle as sv
from sysid_vehicle.identify.intervals.posterior import Posterior

KNOWN = ("C_front", "D_front", "E_front", "C_rear", "D_rear", "E_rear")


@pytest.fixture(scope="module")
def short(truth: sv.Model) -> sv.Log:
    return sv.drive(truth, sv.manoeuvres.lap(20.0), seed=1, rate_hz=25.0, name="short")


@pytest.fixture(scope="module")
def fit(truth: sv.Model, short: sv.Log) -> sv.Fit:
    """Only B of either axle free: their posterior is normal."""
    return sv.identify(truth, short, fixed=KNOWN, starts=1)


def test_a_log_goes_through_pandas_and_xarray(short: sv.Log) -> None:
    pytest.importorskip("pandas")
    for table in (short.to_pandas(), short.to_xarray()):
        again = sv.read_log(table)
        assert again.channels == short.channels
        for channel in short.channels:
            np.testing.assert_array_equal(again[channel], short[channel])
    assert short.to_xarray()["yaw_rate_radps"].attrs["units"] == "rad/s"


def test_estimates_and_scores_are_data_frames(fit: sv.Fit, short: sv.Log) -> None:
    pytest.importorskip("pandas")
    found = fit.to_pandas()
    assert list(found.index) == [e.name for e in (*fit.estimates, *fit.derived)]
    assert found.loc["B_front", "value"] == fit["B_front"].value
    assert tuple(found.loc["B_front", ["low", "high"]]) == fit["B_front"].interval
    score = sv.compare(fit, short)
    assert score.to_pandas().loc["ay_mps2", "rmse"] == score.channels["ay_mps2"].rmse
    cells = score.to_xarray()
    assert cells["residual"].sel(channel="ay_mps2").shape == score.time_s.shape
    assert cells["error"].dims == ("speed", "lateral_acceleration")
    np.testing.assert_array_equal(cells["error"], score.failure_map.error)


def test_draws_have_the_spread_of_the_fit(fit: sv.Fit) -> None:
    found = fit.posterior(4000, seed=1)
    assert found.values.shape == (1, 4000, 2 + len(fit.derived))
    x = found.values[0, :, :2]
    np.testing.assert_allclose(np.cov(x.T), fit.covariance, rtol=0.1)
    np.testing.assert_allclose(x.mean(axis=0), [e.value for e in fit.estimates], rtol=1e-3)
    stiffness = fit["cornering stiffness front"]
    assert found["cornering_stiffness_front"].std() == pytest.approx(stiffness.std, rel=0.1)
    np.testing.assert_array_equal(fit.posterior(4000, seed=1).values, found.values)
    assert "4000 draws" in str(found)


def test_draws_of_a_tyre_keep_what_is_known_of_it(truth: sv.Model, short: sv.Log) -> None:
    free = sv.identify(truth, short, starts=1)
    with pytest.warns(sv.SysidWarning, match="less likely than what the driving leaves open: by"):
        found = free.posterior(1000)
    for name in truth.free_names:
        low, high = free.model.bounds(name)
        assert found[name].min() >= low
        assert found[name].max() <= high
    assert "nan" not in str(found)
    # B, C and D by themselves are known to tens of per cent, their product to 1 %.
    for axle in ("front", "rear"):
        stiffness = free[f"cornering stiffness {axle}"]
        draws = found[f"cornering stiffness {axle}"]
        assert free[f"B_{axle}"].std / free[f"B_{axle}"].value > 5 * stiffness.std / stiffness.value
        assert draws.mean() == pytest.approx(stiffness.value, abs=0.3 * stiffness.std)
        assert draws.std() == pytest.approx(stiffness.std, rel=0.2)


@pytest.mark.filterwarnings("ignore:the walkers took")
def test_an_ensemble_samples_the_likelihood(fit: sv.Fit) -> None:
    pytest.importorskip("emcee")
    found = fit.posterior(2000, seed=2, method="ensemble")
    assert found.log_density.size >= 2000
    for e in fit.estimates:
        assert found[e.name].mean() == pytest.approx(e.value, abs=0.3 * e.std)
        assert found[e.name].std() == pytest.approx(e.std, rel=0.2)
    best = np.unravel_index(found.log_density.argmax(), found.log_density.shape)
    assert found["B_front"][best] == pytest.approx(fit["B_front"].value, abs=fit["B_front"].std)
    np.testing.assert_array_equal(
        fit.posterior(40, seed=3, method="ensemble").values,
        fit.posterior(40, seed=3, method="ensemble").values,
    )


@pytest.mark.slow
def test_an_ensemble_follows_a_valley_that_bends(truth: sv.Model, short: sv.Log) -> None:
    """Walkers that begin where no likelihood is stay there for thousands of steps."""
    pytest.importorskip("emcee")
    free = sv.identify(truth, short, starts=1)
    with pytest.warns(sv.SysidWarning, match="still depend on where they began; draw .* or more"):
        found = free.posterior(3000, seed=1, method="ensemble")
    # Half a chi-squared number of eight parameters: its median is 3.7, one in 10^4 is beyond 16.
    falls = found.log_density.max() - found.log_density
    assert 1.5 < np.median(falls) < 6.0
    assert falls.max() < 20.0
    stiffness = free["cornering stiffness front"]
    draws = found["cornering stiffness front"]
    assert draws.std() == pytest.approx(stiffness.std, rel=0.3)


@pytest.mark.filterwarnings("ignore::FutureWarning")
def test_draws_go_to_arviz(fit: sv.Fit) -> None:
    pytest.importorskip("arviz")
    draws = fit.posterior(100)
    found = draws.to_arviz()
    np.testing.assert_array_equal(found.posterior["B_front"], draws["B_front"])
    np.testing.assert_array_equal(found.sample_stats["lp"], draws.log_density)
    assert found.posterior["B_front"].attrs["units"] == "1/rad"
    assert list(draws.to_pandas().columns) == list(draws.names)


def test_draws_of_tyres_without_a_peak_are_printed() -> None:
    draws = np.where(np.arange(100.0) < 90.0, 0.1, np.inf).reshape(1, 100, 1)
    assert "0.1 .. inf" in str(Posterior(("slip",), ("rad",), draws, np.zeros((1, 100)), "normal"))


def test_what_cannot_be_is_said(fit: sv.Fit, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(sv.InvalidInput, match="choose 'normal' or 'ensemble'"):
        fit.posterior(method="nuts")  # type: ignore[arg-type]
    with pytest.raises(KeyError, match="B_front"):
        fit.posterior(10)["B"]
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(sv.InvalidInput, match=r"pandas is not installed; pip install.*\[tables\]"):
        fit.to_pandas()
