"""Estimators of friction over slip at several levels of noise, and their way through a swing."""

from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from sysid_vehicle import InvalidInput
from sysid_vehicle.cli import main
from sysid_vehicle.online import (
    TWO_PARAMETER,
    MuSlipData,
    MuSlipEstimate,
    draw_mu_slip_lissajous,
    mu_slip_ekf,
    mu_slip_fit,
    mu_slip_over_noise,
    simulate_mu_slip,
    sinusoidal_slip,
)

TRUTH = (0.35, 0.15)


def test_errors_over_noise_are_those_of_the_estimators() -> None:
    study = mu_slip_over_noise(TRUTH, noise_std=(0.01, 0.04), sets=100, seed=5)
    assert study.methods[0] == "EKF"
    assert study.methods[-1] == "least squares, corrected"
    assert study.rms.shape == (len(study.methods), 2, 2)
    np.testing.assert_allclose(study.signal_to_noise, [35.0, 8.75])
    # Of 100 sets an rms error is known to 7 %, one standard deviation.
    np.testing.assert_allclose(study.rms[-1], study.bound, rtol=0.25)
    # What pseudo-noise costs does not fall with the noise.
    assert (study.rms[0, :, 0] > 1.1 * study.bound[:, 0]).all()
    assert study.gain[0, 0] < study.gain[-1, 0]
    np.testing.assert_allclose(study.gain * study.rms[..., 0], [[0.01, 0.04]] * len(study.methods))
    assert not study.failed.any()
    draws = np.random.default_rng(5).integers(2**63, size=100)
    data = [simulate_mu_slip(TRUTH, noise_std=0.04, seed=int(k)) for k in draws]
    errors = [mu_slip_ekf(d).mean[-1] - TRUTH for d in data]
    np.testing.assert_allclose(study.rms[0, 1], np.sqrt(np.mean(np.square(errors), axis=0)))
    text = str(study)
    assert "Cramer-Rao bound" in text
    assert f"{study.rms[0, 0, 0]:.5f}" in text
    assert "<pre>" in study._repr_html_()
    axes = Figure().subplots(1, 2)
    assert study.plot(axes[0]) is axes[0]
    np.testing.assert_array_equal(axes[0].lines[0].get_ydata(), study.rms[0, :, 0])
    study.plot(axes[1], "slip_peak")
    np.testing.assert_array_equal(axes[1].lines[-1].get_ydata(), study.bound[:, 1])
    with pytest.raises(InvalidInput, match="choose mu_peak or slip_peak"):
        study.plot(axes[0], "shape")


def test_sets_that_an_estimator_cannot_use_are_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(data: MuSlipData, **options: object) -> MuSlipEstimate:
        if data.noise_std == 0.08 or options.get("corrected"):
            raise InvalidInput("mu: the readings do not determine the curve; take more")
        return mu_slip_fit(data, **options)  # type: ignore[arg-type]

    monkeypatch.setattr("sysid_vehicle.online.mu_slip.compare.mu_slip_fit", fail)
    study = mu_slip_over_noise(noise_std=(0.02, 0.08), sets=3)
    row = study.methods.index("least squares")
    np.testing.assert_array_equal(study.failed[row], [0, 3])
    assert np.isfinite(study.rms[row, 0]).all()
    assert np.isnan(study.rms[row, 1]).all()
    assert "least squares: 3 of 3 sets at noise 0.08 left out" in str(study)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"noise_std": [0.01, 0.0]}, "noise_std: 0 is not above 0"),
        ({"noise_std": []}, "give a list"),
        ({"sets": 1}, "sets: 1 is below 2"),
        ({"slip": [0.0, 0.0, 0.0]}, "do not determine"),
        ({"values": (0.35,)}, "two-parameter curve has the 2 parameters"),
    ],
)
def test_a_study_of_noise_names_what_is_wrong(options: dict[str, object], words: str) -> None:
    with pytest.raises(InvalidInput, match=words):
        mu_slip_over_noise(**options)  # type: ignore[arg-type]


def test_friction_against_slip_over_time_ends_on_the_true_curve() -> None:
    slip = sinusoidal_slip(0.2, 0.2, 3.0, 300)
    assert slip.min() == pytest.approx(0.0)
    assert slip.max() == pytest.approx(0.4)
    np.testing.assert_allclose(slip[:100], slip[100:200], atol=1e-12)
    data = simulate_mu_slip(TRUTH, slip=slip, seed=3)
    run = mu_slip_ekf(data)
    # Each is expected from what was known before it.
    for k in (1, 40, 299):
        assert run.expected_mu[k] == pytest.approx(run.curve.mu(slip[k], run.mean[k - 1])[0])
    ax = Figure().subplots()
    assert draw_mu_slip_lissajous(run, ax, TRUTH) is ax
    drawn = {line.get_label(): line.get_data() for line in ax.lines}
    true = TWO_PARAMETER.mu(slip, TRUTH)
    np.testing.assert_array_equal(drawn["measured"], (slip, data.mu))
    np.testing.assert_array_equal(drawn["true"], (slip, true))
    error = np.abs(drawn["filtered"][1] - true)
    assert error[200:].max() < 0.02
    assert error[:100].max() > 3.0 * error[200:].max()
    draw_mu_slip_lissajous(run, ax := Figure().subplots())
    assert "true" not in {line.get_label() for line in ax.lines}
    for wrong in ({"readings": 2}, {"amplitude": 0.0}, {"periods": -1.0}, {"mean": np.nan}):
        with pytest.raises(InvalidInput, match="slip: "):
            sinusoidal_slip(**wrong)  # type: ignore[arg-type]


def test_the_command_judges_estimators_and_draws_over_time(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    data, csv = simulate_mu_slip(seed=2), tmp_path / "tyre.csv"
    rows = (f"{s},{m}" for s, m in zip(data.slip, data.mu, strict=True))
    csv.write_text("\n".join(["slip,mu", *rows]) + "\n", encoding="utf-8")
    over_time, noise = tmp_path / "t.svg", tmp_path / "n.svg"
    options = ["--lissajous", str(over_time), "--over-noise", str(noise)]
    assert main(["mu-slip", str(csv), *options]) == 0
    assert "Cramer-Rao bound" in capsys.readouterr().out
    for path in (over_time, noise):
        assert "</svg>" in path.read_text(encoding="utf-8")
    assert main(["mu-slip", str(csv), "--over-noise", str(tmp_path / "n.png")]) == 2
    assert "end the name in" in capsys.readouterr().err
