"""Tyres that are driven and braked in corners, and intervals where the peak is not reached."""

import dataclasses
import warnings
from collections.abc import Callable
from types import SimpleNamespace

import numpy as np
import pytest

from sysid_vehicle import Log, SysidWarning, lab
from sysid_vehicle.identify.intervals.profile import Profile
from sysid_vehicle.lab.tyres.fit import ELLIPSE, PARAMETERS

CAR = lab.GreyBoxVehicle(
    1400.0, 2100.0, 1.2, 1.4, cg_height_m=0.5, brake_front_share=0.65, drive_front_share=0.0
)
TYRES = ((11.0, 1.45, 0.95, 0.1), (13.0, 1.45, 1.02, 0.1))
YAW_RATE_STD = 0.002
WAVES = ((0.2, 0.13), (0.5, 0.3))  # Hz, of steering and wheel force
BENCHMARK = ("closed_loop", "weaving_car")


@pytest.fixture(scope="module")
def driven(program: SimpleNamespace) -> Callable[..., Log]:
    """Weaving under power and brakes, by nothing of the package."""
    of = program.weaving_car

    def drive(seed: int, *, ellipse: float, steered: float = 0.045, pulled_g: float = 0.25) -> Log:
        rng = np.random.default_rng(seed)
        waves = [of.Wave(f, g, *rng.uniform(0.0, 2.0 * np.pi, 2)) for f, g in WAVES]
        log: Log | None = of.weave(
            of.Car(CAR, TYRES), waves, rng, ellipse=ellipse, steered=steered, pulled_g=pulled_g
        )
        assert log is not None
        return log

    return drive


def fitted(log: Log, combined_slip: bool | None = None) -> tuple[lab.TyreFit, str]:
    logs = lab.TyreLog.from_log(log, CAR)
    with warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always")
        fit = lab.identify_tyres(CAR, logs, combined_slip=combined_slip, starts=2, profiles=False)
    return fit, " ".join(str(w.message) for w in heard if issubclass(w.category, SysidWarning))


def test_drive_and_brake_force_make_no_smaller_peak(driven: Callable[..., Log]) -> None:
    log = driven(1, ellipse=1.0)
    fit, heard = fitted(log)
    assert fit[ELLIPSE].value == pytest.approx(1.0, abs=0.1)
    assert "combined_slip=" not in heard
    plain, warned = fitted(log, combined_slip=False)
    assert ELLIPSE not in [e.name for e in plain.estimates]
    assert "one load for both wheels of an axle" in str(fit)
    assert "one load for both wheels of an axle" not in str(plain)
    assert "the readings ask for a friction ellipse of" in warned
    assert "identify with combined_slip=True" in warned
    for one, most in ((fit, 0.005), (plain, None)):
        off = max(
            abs(one[f"BCD_{a}"].value / (b * c * d) - 1.0)
            for a, (b, c, d, _) in zip(("front", "rear"), TYRES, strict=True)
        )
        assert off < most if most is not None else off > 0.015
    for axle, tyre in zip(("front", "rear"), TYRES, strict=True):
        assert fit[f"D_{axle}"].value == pytest.approx(tyre[2], rel=0.01)


def test_no_ellipse_is_found_where_there_is_none(driven: Callable[..., Log]) -> None:
    fit, heard = fitted(driven(2, ellipse=0.0))
    assert ELLIPSE not in [e.name for e in fit.estimates]
    assert "ellipse" not in heard
    for axle, tyre in zip(("front", "rear"), TYRES, strict=True):
        assert fit[f"D_{axle}"].value == pytest.approx(tyre[2], rel=0.01)


def test_an_identified_ellipse_is_validated_and_kept(driven: Callable[..., Log], tmp_path) -> None:
    fit, _ = fitted(driven(3, ellipse=1.0), combined_slip=True)
    known = lab.IdentifiedCar.of(fit)
    log = lab.TyreLog.from_log(driven(4, ellipse=1.0), CAR)[0]
    (found,) = lab.validate_tyres(known, log)
    without = known.parameters.copy()
    without[PARAMETERS.index(ELLIPSE)] = 0.0
    (other,) = lab.validate_tyres(dataclasses.replace(known, parameters=without), log)
    assert found.rms[1, 2] < 1.2 * YAW_RATE_STD
    assert other.rms[1, 2] > 2.0 * YAW_RATE_STD
    earlier = dataclasses.replace(known, parameters=known.parameters[:-1])
    assert np.array_equal(earlier.parameters, without)


def test_intervals_that_fail_short_of_the_peak_are_told() -> None:
    setup = lab.Setup.default()
    car = lab.GreyBoxVehicle.of(setup.plant.vehicle)
    told = {}
    for name, driver in (
        ("short of it", lab.excitation.Weaving(duration_s=20.0)),
        ("beyond it", lab.design_excitation(setup, duration_s=20.0).excitation),
    ):
        drive = lab.run_closed_loop(driver, setup, seed=5)
        logs = lab.TyreLog.from_log(drive.to_log(), car)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            told[name] = lab.identify_tyres(car, logs, starts=2, profiles=False)
    short, beyond = told["short of it"], told["beyond it"]
    assert {"B_front", "C_front", "B_rear", "C_rear"} <= {*short.bent, *short.undetermined}
    assert not {"B_front", "C_front", "D_front"} & set(short.determined)
    assert f"Intervals not to be trusted: {short.bent[0]}" in str(short)
    assert short.to_dict()["bent"] == list(short.bent)
    open_above = Profile("peak_front", np.array([1.0, 1.6]), np.zeros(2), 1.0, 1.7, False, True)
    assert dataclasses.replace(beyond, profiles=(open_above,)).interval("peak_front")[1] == np.inf
    assert beyond.bent == ()
    assert "not to be trusted" not in str(beyond)
