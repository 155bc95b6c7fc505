"""Identified tyres on other driving: errors by horizon, files, the command line."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sysid_vehicle import lab
from sysid_vehicle.cli import main
from sysid_vehicle.errors import InvalidInput
from sysid_vehicle.lab.tyres.fit import PARAMETERS

SETUP = lab.Setup.default()
CAR = lab.GreyBoxVehicle.of(SETUP.plant.vehicle)
TRUE = dict.fromkeys(PARAMETERS, 0.0) | {
    f"{letter}_{axle}": value
    for axle in ("front", "rear")
    for letter, value in {"B": 22.0, "C": 1.8, "D": 1.6, "E": 0.8}.items()
}
TRUE |= {"mass_factor": 1.0, "yaw_inertia_factor": 1.0, "drag_area_m2": 0.6}
NOISE = np.array([0.1, 3.16e-3, 3.16e-3, 3.16e-3, 1e-3, 1e-4, 1e-4])


def identified(**other: float) -> lab.IdentifiedCar:
    values = TRUE | other
    return lab.IdentifiedCar(CAR, np.array([values[name] for name in PARAMETERS]), NOISE)


@pytest.fixture(scope="module")
def drive() -> lab.ClosedLoop:
    return lab.run_closed_loop(lab.excitation.all()["slalom"], SETUP, seed=4)


@pytest.fixture(scope="module")
def log(drive: lab.ClosedLoop) -> lab.TyreLog:
    (part,) = lab.TyreLog.from_log(drive.to_log(), CAR)
    return part


def test_the_true_car_leaves_the_noise_of_its_sensors(log: lab.TyreLog) -> None:
    (found,) = lab.validate_tyres(identified(), log)
    assert found.horizons == ("one sample", "1 s", "the whole drive")
    assert found.rms[:2, 1:3] == pytest.approx(np.full((2, 2), 3.16e-3), rel=0.05)
    assert found.rms[0, 3] == pytest.approx(3.16e-3, rel=0.1)
    # Further ahead the speed errs, which began with a noisy reading, and with it a_y.
    assert found.rms[1, 3] < 2.0 * 3.16e-3
    assert found.rms[2, 3] < 0.05
    assert found.rms[:, 0] == pytest.approx([0.1, 0.1, 0.1], rel=0.3)


def test_wrong_tyres_err_the_more_the_further_ahead(log: lab.TyreLog) -> None:
    (right,) = lab.validate_tyres(identified(), log)
    (wrong,) = lab.validate_tyres(identified(B_front=15.0), log)
    assert (wrong.rms[:, 2] > 1.5 * right.rms[:, 2]).all()
    assert wrong.rms[1, 2] > wrong.rms[0, 2]


def test_errors_are_those_of_the_predictions(log: lab.TyreLog) -> None:
    (found,) = lab.validate_tyres(identified(), log, horizon_s=0.5)
    assert found.horizons[1] == "0.5 s"
    assert np.isnan(found.predicted[1, :50]).all()
    assert np.isfinite(found.predicted[1, 50:]).all()
    by_hand = np.sqrt(np.mean((log.measurements[50:] - found.predicted[1, 50:]) ** 2, axis=0))
    assert found.rms[1] == pytest.approx(by_hand)


def test_a_reading_that_is_missing_has_no_error(log: lab.TyreLog) -> None:
    (found,) = lab.validate_tyres(identified(), log.without_sideslip())
    assert np.isnan(found.rms[:, 1]).all()
    assert np.isfinite(found.rms[:, [0, 2, 3]]).all()


def test_a_car_that_spins_errs_by_more_than_any_reading(log: lab.TyreLog) -> None:
    (found,) = lab.validate_tyres(identified(B_rear=1.0, D_rear=0.05), log)
    assert found.rms[2, 2] > np.abs(log.measurements[:, 2]).max()


def test_a_prediction_that_left_the_numbers_is_an_infinite_error(log: lab.TyreLog) -> None:
    (found,) = lab.validate_tyres(identified(), log)
    for lost in (np.inf, np.nan):
        predicted = found.predicted.copy()
        predicted[2, 1500:] = lost
        assert np.isinf(replace(found, predicted=predicted).rms[2]).all()


def test_no_log_and_horizons_beyond_it_are_refused(log: lab.TyreLog) -> None:
    with pytest.raises(InvalidInput, match="no log"):
        lab.validate_tyres(identified(), [])
    with pytest.raises(InvalidInput, match="choose a horizon in between"):
        lab.validate_tyres(identified(), log, horizon_s=1000.0)


def test_it_draws_what_was_measured_and_predicted(log: lab.TyreLog) -> None:
    (found,) = lab.validate_tyres(identified(), log)
    axes = found.plot(reading="vy_mps")
    assert [line.get_label() for line in axes.lines] == [
        "measured",
        "predicted, 1 s",
        "predicted, the whole drive",
    ]
    with pytest.raises(InvalidInput, match="no reading"):
        found.plot(reading="wind")


@pytest.mark.manual
def test_from_drive_to_validation_on_the_command_line(
    tmp_path: Path, drive: lab.ClosedLoop, capsys: pytest.CaptureFixture[str]
) -> None:
    train, test, tyres = tmp_path / "train.csv", tmp_path / "test.csv", tmp_path / "tyres.json"
    harder = lab.run_closed_loop(lab.excitation.multi_sine(), SETUP, seed=5)
    harder.to_log().to_csv(train)
    drive.to_log().to_csv(test)
    identify = ["lab", "identify", str(train), "--unchecked", "--fast", "--starts", "2"]
    assert main([*identify, "--json", str(tyres)]) == 0
    figures = tmp_path / "validation.json"
    capsys.readouterr()
    words = ["lab", "validate", str(test), "--unchecked", "--tyres", str(tyres)]
    assert main([*words, "--json", str(figures), "--plot", str(tmp_path / "v.svg")]) == 0
    assert "the whole drive" in capsys.readouterr().out
    rms = json.loads(figures.read_text())["drives"][0]["rms"]
    assert rms["1 s"]["yaw_rate_radps"] == pytest.approx(3.16e-3, rel=0.1)
    assert (tmp_path / "v.svg").read_text().rstrip().endswith("</svg>")


def test_a_file_without_tyres_is_named(tmp_path: Path) -> None:
    (tmp_path / "other.json").write_text("{}")
    with pytest.raises(InvalidInput, match="is JSON of another kind, not tyres of"):
        lab.IdentifiedCar.from_json(tmp_path / "other.json")


@pytest.mark.manual
def test_what_a_fit_writes_can_be_read(log: lab.TyreLog, tmp_path: Path) -> None:
    fit = lab.identify_tyres(CAR, log, start=TRUE, starts=1, profiles=False)
    (tmp_path / "tyres.json").write_text(json.dumps(fit.to_dict()))
    read = lab.IdentifiedCar.from_json(tmp_path / "tyres.json")
    assert read.vehicle == CAR
    assert read.parameters == pytest.approx(fit.parameters)
    assert read.noise == pytest.approx(fit.noise)
