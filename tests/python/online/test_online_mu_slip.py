"""Friction over slip: data that is refused, estimators, figures, and the command."""

import json
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from sysid_vehicle import InvalidInput
from sysid_vehicle.cli import main
from sysid_vehicle.online import (
    MAGIC_FORMULA,
    TWO_PARAMETER,
    MuSlipData,
    MuSlipFilter,
    MuSlipFrame,
    MuSlipPrior,
    animate_mu_slip,
    compare_mu_slip,
    draw_mu_slip_convergence,
    draw_mu_slip_observability,
    draw_mu_slip_signal,
    magic_formula_coefficients,
    mu_slip_cramer_rao,
    mu_slip_ekf,
    mu_slip_fit,
    mu_slip_smooth,
    save_animation,
    simulate_mu_slip,
)
from sysid_vehicle.online.mu_slip.figures import one_sigma_contour

TRUTH = (0.35, 0.15)
PACEJKA = (0.9, 0.12, 1.65, 2.4)
SETS = 400


@pytest.fixture(scope="module")
def sets() -> list[MuSlipData]:
    rng = np.random.default_rng(7)
    return [simulate_mu_slip(seed=rng) for _ in range(SETS)]


def test_noise_free_readings_give_the_published_numbers() -> None:
    last = mu_slip_ekf(simulate_mu_slip()).estimate
    np.testing.assert_allclose(last.values, (0.34314887, 0.15529258), atol=1e-8)
    np.testing.assert_allclose(last.std, (0.040034, 0.030074), atol=1e-6)


def test_one_reading_at_a_time_gives_the_same_numbers_as_all_at_once() -> None:
    data = simulate_mu_slip(seed=4)
    for iterations in (1, 10):
        run = mu_slip_ekf(data, iterations=iterations, drift_std=(0.01, 0.002))
        step = MuSlipFilter(0.04, iterations=iterations, drift_std=(0.01, 0.002))
        for k in range(len(data.slip)):
            step.update(data.slip[k], data.mu[k])
            np.testing.assert_array_equal(step.mean, run.mean[k])
            np.testing.assert_array_equal(step.covariance, run.covariance[k])
        assert step.readings == 41


def test_least_squares_reaches_the_bound_without_bias(sets: list[MuSlipData]) -> None:
    bound = np.sqrt(np.diag(mu_slip_cramer_rao(sets[0].slip, TRUTH, 0.04)))
    np.testing.assert_allclose(bound, (0.0106, 0.0079), atol=5e-5)
    found = np.array([mu_slip_fit(d, corrected=True).values for d in sets])
    sampling = bound / np.sqrt(SETS)
    assert (np.abs(found.mean(axis=0) - TRUTH) < 3.5 * sampling).all()
    np.testing.assert_allclose(found.std(axis=0), bound, rtol=0.13)  # 3.7 times its own scatter


def test_the_correction_removes_the_bias_that_least_squares_has() -> None:
    # At two and a half times the noise the bias stands out of the scatter of the mean.
    rng = np.random.default_rng(11)
    loud = [simulate_mu_slip(noise_std=0.1, seed=rng) for _ in range(2000)]
    bias = []
    for corrected in (False, True):
        found = [mu_slip_fit(d, start=TRUTH, corrected=corrected).values[1] for d in loud]
        bias.append(abs(np.mean(found) - 0.15))
    assert bias[0] > 1.5e-3
    assert bias[1] < 0.5 * bias[0]


def test_a_second_pass_takes_most_of_the_bias(sets: list[MuSlipData]) -> None:
    once = np.mean([mu_slip_ekf(d).mean[-1] for d in sets], axis=0) - TRUTH
    twice = np.mean([mu_slip_ekf(d, passes=2).mean[-1] for d in sets], axis=0) - TRUTH
    assert (np.abs(twice) < 0.4 * np.abs(once)).all()


def test_the_smoother_is_as_certain_as_it_should_be(sets: list[MuSlipData]) -> None:
    inside = []
    for data in sets:
        found = mu_slip_smooth(data)
        assert found.converged
        error = found.mean[-1] - TRUTH
        inside.append(error @ np.linalg.solve(found.covariance[-1], error) < 1.0)
    # The one-sigma contour holds 39 % of a bivariate normal, the published filter's 99 %.
    assert np.mean(inside) == pytest.approx(1 - np.exp(-0.5), abs=0.08)


def test_the_magic_formula_is_fitted_by_the_same_estimators() -> None:
    data = simulate_mu_slip(PACEJKA, curve=MAGIC_FORMULA, noise_std=0.02)
    np.testing.assert_allclose(mu_slip_fit(data, curve=MAGIC_FORMULA).values, PACEJKA, rtol=1e-6)
    noisy = simulate_mu_slip(PACEJKA, curve=MAGIC_FORMULA, noise_std=0.02, seed=5)
    for estimate in (
        mu_slip_ekf(noisy, curve=MAGIC_FORMULA).estimate,
        mu_slip_smooth(noisy, curve=MAGIC_FORMULA).estimate,
    ):
        assert estimate.values[0] == pytest.approx(0.9, abs=0.05)
        assert estimate.values[1] == pytest.approx(0.12, abs=0.03)
        slip = np.linspace(0.02, 1.0, 50)
        error = MAGIC_FORMULA.mu(slip, estimate.values) - MAGIC_FORMULA.mu(slip, PACEJKA)
        assert np.sqrt(np.mean(error**2)) < 0.03


def test_coefficients_of_the_magic_formula_give_the_same_curve() -> None:
    B, C, D, E = magic_formula_coefficients(PACEJKA)
    slip = np.linspace(0.0, 1.0, 20)
    x = B * slip
    mu = D * np.sin(C * np.arctan(x - E * (x - np.arctan(x))))
    np.testing.assert_allclose(mu, MAGIC_FORMULA.mu(slip, PACEJKA), atol=1e-14)


def test_missing_readings_are_left_out() -> None:
    data = simulate_mu_slip(seed=3)
    mu = data.mu.copy()
    mu[5::7] = np.nan
    there = np.isfinite(mu)
    holed, short = MuSlipData(data.slip, mu, 0.04), MuSlipData(data.slip[there], mu[there], 0.04)
    np.testing.assert_array_equal(mu_slip_ekf(holed).mean[-1], mu_slip_ekf(short).mean[-1])
    np.testing.assert_allclose(
        mu_slip_fit(holed).values, mu_slip_fit(short).values, rtol=0, atol=1e-12
    )
    np.testing.assert_allclose(
        mu_slip_smooth(holed).mean[-1], mu_slip_smooth(short).mean[-1], rtol=0, atol=1e-9
    )
    with_drift = mu_slip_ekf(holed, iterations=5, drift_std=(0.01, 0.01))
    np.testing.assert_array_equal(with_drift.mean[5], with_drift.mean[4])
    assert with_drift.covariance[5, 0, 0] > with_drift.covariance[4, 0, 0]


def test_the_noise_is_learnt_where_it_is_not_told() -> None:
    data = simulate_mu_slip(slip=np.linspace(0.0, 1.0, 2000), seed=1)
    blind = compare_mu_slip(MuSlipData(data.slip, data.mu))
    assert blind.data.noise_std == pytest.approx(0.04, rel=0.08)
    assert "least squares, corrected" in str(blind)
    with pytest.raises(InvalidInput, match="noise_std: cannot be learnt"):
        compare_mu_slip(MuSlipData(data.slip, TWO_PARAMETER.mu(data.slip, TRUTH)))


def test_readings_that_end_before_the_peak_are_noted() -> None:
    data = simulate_mu_slip(slip=np.linspace(0.0, 0.1, 60), noise_std=0.002, seed=1)
    whole = simulate_mu_slip(seed=1)
    assert any("before the peak" in note for note in mu_slip_fit(data).notes)
    assert any("before the peak" in note for note in mu_slip_smooth(data).estimate.notes)
    assert any("before the peak" in note for note in mu_slip_ekf(data).estimate.notes)
    assert mu_slip_fit(whole).notes == ()
    assert mu_slip_smooth(whole).estimate.notes == ()
    assert mu_slip_ekf(whole).estimate.notes == ()


@pytest.mark.parametrize(
    ("slip", "mu", "message"),
    [
        ([0.1, 0.2], [0.1, 0.2, 0.3], "same length"),
        ([0.0, 7.5, 9.0], [0.1, 0.2, 0.3], "slip: 7.5 at sample 1 cannot be; give .* percent"),
        (
            [0.0, np.nan, 0.2],
            [0.1, 0.2, 0.3],
            "slip: nan at sample 1 cannot be; leave that reading out",
        ),
        ([0.0, 0.1, 0.2], [0.1, 0.2, 900.0], "mu: 900 at sample 2 cannot be; give .* force"),
        ([0.0, 0.1, 0.2], [0.1, np.inf, 0.3], "mu: inf at sample 1 cannot be; leave that"),
        ([0.0, 0.1, 0.2], [0.1, np.nan, 0.3], "fewer than 3 readings"),
    ],
)
def test_impossible_readings_are_named(slip: list[float], mu: list[float], message: str) -> None:
    with pytest.raises(InvalidInput, match=message):
        MuSlipData(np.array(slip), np.array(mu))


def test_a_start_that_leads_nowhere_does_not_spoil_the_fit() -> None:
    # From the mean of the prior these readings lead to a corner where they tell nothing.
    data = simulate_mu_slip(PACEJKA, curve=MAGIC_FORMULA, seed=56)
    with pytest.raises(InvalidInput, match="do not determine the magic-formula curve"):
        mu_slip_fit(data, curve=MAGIC_FORMULA, start=MAGIC_FORMULA.prior.mean)
    fit = mu_slip_fit(data, curve=MAGIC_FORMULA)
    assert fit.values[:2] == pytest.approx(PACEJKA[:2], abs=0.05)


def test_a_comparison_goes_on_where_least_squares_cannot() -> None:
    comparison = compare_mu_slip(MuSlipData(np.zeros(5), np.arange(5.0) / 10, 0.04))
    assert comparison.best.method == "iterated smoother"
    assert len(comparison.notes) == 5
    assert "least squares, 1 iteration: left out" in str(comparison)


def test_impossible_settings_are_refused() -> None:
    data = simulate_mu_slip(seed=1)
    with pytest.raises(InvalidInput, match="noise_std: 0 is not above 0"):
        MuSlipFilter(0.0)
    with pytest.raises(InvalidInput, match="iterations: 0 is below 1"):
        mu_slip_ekf(data, iterations=0)
    with pytest.raises(InvalidInput, match="passes: 0 is below 1"):
        mu_slip_ekf(data, passes=0)
    with pytest.raises(InvalidInput, match="noise_factor: -1 is not above 0"):
        mu_slip_ekf(data, noise_factor=-1.0)
    with pytest.raises(InvalidInput, match="drift_std"):
        mu_slip_ekf(data, drift_std=(0.1,))
    with pytest.raises(InvalidInput, match=r"prior: slip_peak = -0\.2"):
        mu_slip_ekf(data, prior=MuSlipPrior((0.6, -0.2), (0.6, 0.2)))
    with pytest.raises(InvalidInput, match="prior: a standard deviation"):
        MuSlipPrior((0.6, 0.2), (0.6, 0.0))
    with pytest.raises(InvalidInput, match=r"start: shape \(4,\)"):
        mu_slip_fit(data, start=PACEJKA)
    with pytest.raises(InvalidInput, match="bounds: a lower limit"):
        mu_slip_fit(data, bounds=((0.5, 0.2), (0.6, 0.2)))
    with pytest.raises(InvalidInput, match="do not determine"):
        mu_slip_cramer_rao(np.zeros(5), TRUTH, 0.04)
    with pytest.raises(InvalidInput, match="noise_std: 0 is not above 0"):
        mu_slip_cramer_rao(data.slip, TRUTH, 0.0)
    silent = MuSlipData(np.zeros(5), np.arange(5.0) / 10)
    with pytest.raises(InvalidInput, match="do not determine the two-parameter curve; take"):
        mu_slip_fit(silent, start=TRUTH)
    with pytest.raises(InvalidInput, match="noise_std: cannot be learnt, the readings do not"):
        compare_mu_slip(silent)


def test_a_refused_reading_leaves_the_filter_as_it_was() -> None:
    step = MuSlipFilter(0.04)
    step.update(0.1, 0.2)
    before = step.mean
    with pytest.raises(InvalidInput, match="slip: 12 at sample 1"):
        step.update(12.0, 0.3)
    assert step.readings == 1
    np.testing.assert_array_equal(step.mean, before)


def test_figures_draw_onto_the_axes_they_are_given() -> None:
    run = mu_slip_ekf(simulate_mu_slip(seed=2))
    ax = Figure().subplots(1, 4)
    assert draw_mu_slip_convergence(run, ax[0]) is ax[0]
    assert draw_mu_slip_signal(run, ax[1]) is ax[1]
    assert draw_mu_slip_observability(TRUTH, ax[2]) is ax[2]
    assert run.estimate.plot(run.data, ax[3]) is ax[3]
    # The correlation turns negative past the peak; a reading at the peak tells nothing of its slip.
    correlation = ax[0].lines[-1].get_ydata()
    assert correlation[10] > 0.5
    assert correlation[-1] < -0.4
    slip, to_slip_peak = ax[2].lines[1].get_data()
    assert abs(np.interp(0.15, slip, to_slip_peak)) < 1e-3
    # Early on pseudo-noise is by far the larger part (0.19^2 against 0.12^2).
    assert ax[1].lines[1].get_ydata().max() == pytest.approx(0.19**2, rel=0.2)


def test_the_contour_is_the_one_sigma_ellipse() -> None:
    P = np.array([[0.04, 0.01], [0.01, 0.02]])
    slip, mu = one_sigma_contour(np.array([0.3, 0.2]), P)
    away = np.vstack([mu - 0.3, slip - 0.2])
    np.testing.assert_allclose(np.einsum("ik,ij,jk->k", away, np.linalg.inv(P), away), 1.0)


def test_the_animation_ends_with_the_last_estimate(tmp_path: Path) -> None:
    run = mu_slip_ekf(simulate_mu_slip(seed=2))
    ax = Figure(figsize=(3, 2)).subplots()
    animation = animate_mu_slip(run, ax, TRUTH, every=20)
    path = tmp_path / "convergence.gif"
    save_animation(animation, path)
    assert path.read_bytes()[:6] == b"GIF89a"
    assert [p.name for p in tmp_path.iterdir()] == ["convergence.gif"]
    assert "41 of 41" in ax.get_title()
    frame = MuSlipFrame(run)
    frame.show(0)
    assert "0 of 41" in frame.ax.get_title()
    with pytest.raises(InvalidInput, match="choose 0 to 41"):
        frame.show(42)
    with pytest.raises(InvalidInput, match=r"end the name in \.gif"):
        save_animation(animation, tmp_path / "convergence.mp4")


@pytest.fixture
def csv(tmp_path: Path) -> Path:
    data = simulate_mu_slip(seed=2)
    path = tmp_path / "tyre.csv"
    rows = (f"{k},{s},{m}" for k, (s, m) in enumerate(zip(data.slip, data.mu, strict=True)))
    path.write_text("\n".join(["sample,slip,mu", *rows]) + "\n", encoding="utf-8")
    return path


@pytest.mark.parametrize("curve", ["two-parameter", "magic-formula"])
def test_the_command_prints_and_writes(
    curve: str, csv: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    figure, numbers = tmp_path / "f.svg", tmp_path / "n.json"
    outputs = ["--plot", str(figure), "--json", str(numbers)]
    status = main(["mu-slip", str(csv), "--curve", curve, "--noise-std", "0.04", *outputs])
    assert status == 0
    out = capsys.readouterr().out
    assert "iterated EKF" in out
    assert "Recommended" in out
    assert "</svg>" in figure.read_text(encoding="utf-8")
    result = json.loads(numbers.read_text(encoding="utf-8"))
    assert result["curve"] == curve
    best = result["estimates"][-1]
    assert best["method"] == result["recommended"]
    for name, truth in zip(("mu_peak", "slip_peak"), TRUTH, strict=True):
        found = best["parameters"][name]
        assert abs(found["value"] - truth) < 3.0 * found["std"]


def test_the_command_names_what_is_wrong_with_a_file(
    csv: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    wrong = tmp_path / "wrong.csv"
    wrong.write_text("slip_ratio,mu\n0.1,0.2\n", encoding="utf-8")
    out = tmp_path / "out.json"
    assert main(["mu-slip", str(wrong), "--json", str(out)]) == 2
    err = capsys.readouterr().err
    assert "no column 'slip' (did you mean 'slip_ratio'?)" in err
    assert len(err.splitlines()) == 1
    assert main(["mu-slip", str(csv), "--json", str(csv)]) == 2
    assert "is also an input" in capsys.readouterr().err
    assert main(["mu-slip", str(csv), "--noise-std", "-1"]) == 2
    assert "noise_std" in capsys.readouterr().err
    for option, name in (("--plot", "f.png"), ("--animation", "a.mp4")):
        assert main(["mu-slip", str(csv), "--json", str(out), option, str(tmp_path / name)]) == 2
        assert "end the name in" in capsys.readouterr().err
    assert not out.exists()
