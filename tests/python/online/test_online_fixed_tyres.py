"""Observers whose tyres are fixed: their band is judged by one that learns the tyres."""

import dataclasses
import pickle
import warnings

import numpy as np
import pytest

import sysid_vehicle as sv
from sysid_vehicle.errors import SysidWarning
from sysid_vehicle.online import (
    KINDS,
    SideslipObserver,
    SideslipRun,
    SideslipSettings,
    estimate_sideslip,
)

FIXED = sorted(set(KINDS) - {"dual"})


def with_tyres(car: sv.Vehicle, *, grip: float = 1.0, stiffer: float = 1.0) -> sv.Vehicle:
    """Friction and cornering stiffness as factors of the car's."""
    tyres = {
        axle: getattr(car, axle).replace(
            D=grip * getattr(car, axle).D, B=stiffer / grip * getattr(car, axle).B
        )
        for axle in ("tyre_front", "tyre_rear")
    }
    return dataclasses.replace(car, **tyres)


CAR = sv.example_vehicle()


@pytest.fixture(scope="module")
def drives() -> dict[str, sv.Log]:
    exact = sv.SensorNoise(vy_mps=0.0)  # the truth that the observers are judged by
    surfaces = {"as told": CAR, "softer": with_tyres(CAR, stiffer=0.7)}
    surfaces["slippery"] = with_tyres(CAR, grip=0.5)
    with pytest.warns(sv.SysidWarning, match="the rear wheels drive .* would spin"):
        return driven(surfaces, exact)


def driven(surfaces: dict[str, sv.Vehicle], exact: sv.SensorNoise) -> dict[str, sv.Log]:
    return {
        name: sv.drive(
            sv.Model(car),
            sv.manoeuvres.handling_course(
                duration_s=30.0, lateral_mps2=0.75 * 9.81 * car.tyre_front.D
            ),
            seed=590 + i,
            noise=exact,
        )
        for i, (name, car) in enumerate(surfaces.items())
    }


def covered(run: SideslipRun) -> float:
    error = run.error()
    assert error is not None
    return error.covered


@pytest.mark.parametrize("kind", FIXED)
def test_other_tyres_than_told_are_seen_and_the_band_holds(
    drives: dict[str, sv.Log], kind: str
) -> None:
    as_exact = estimate_sideslip(CAR, drives["softer"], kind=kind, judge=False)
    assert covered(as_exact) < 0.8
    assert "takes the tyres of the vehicle file as exact" in str(as_exact)
    with pytest.warns(SysidWarning, match=r"do not fit this drive: in .* % of .*take kind 'dual'"):
        run = estimate_sideslip(CAR, drives["softer"], kind=kind)
    assert covered(run) > 0.9
    assert "refuted by the dual observer in " in str(run)
    assert np.array_equal(run.beta_rad, as_exact.beta_rad)
    assert run.exact_std_rad is not None
    assert np.array_equal(run.exact_std_rad, as_exact.beta_std_rad)
    told = run.to_dict()["series"]
    assert np.mean(told["refuted"]) > 0.05
    assert len(told["exact_std_rad"]) == len(told["beta_std_rad"])


@pytest.mark.parametrize("kind", FIXED)
def test_step_by_step_the_band_is_judged_as_over_a_log(
    drives: dict[str, sv.Log], kind: str
) -> None:
    log = drives["softer"].between(0.0, 12.0)
    settings = SideslipSettings.of(log, CAR)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SysidWarning)
        run = estimate_sideslip(CAR, log, kind=kind, settings=settings)
    assert run.refuted is not None
    names = ("steer_rad", "vx_mps", "yaw_rate_radps", "ax_mps2", "ay_mps2")
    sensors, dt = np.column_stack([log[name] for name in names]), 1.0 / log.rate_hz
    observer = SideslipObserver(CAR, settings, kind, judge=True)
    assert np.isnan(observer.refuted)
    halves = [observer.run(np.full(log.n // 2, dt), sensors[: log.n // 2])]
    observer = pickle.loads(pickle.dumps(observer)).copy()
    halves.append(np.array([observer.step(dt, *row) for row in sensors[log.n // 2 :]]))
    found = np.concatenate(halves)
    np.testing.assert_array_equal(found[:, 0], run.beta_rad)
    np.testing.assert_array_equal(found[:, 1], run.beta_std_rad)
    assert observer.samples == log.n
    assert observer.refuted == pytest.approx(float(np.mean(run.refuted)), abs=1e-12)
    assert observer.refuted > 0.05


def test_without_another_observer_nothing_is_judged(drives: dict[str, sv.Log]) -> None:
    plain, judged = SideslipObserver(CAR), SideslipObserver(CAR, judge=True)
    for observer in (plain, judged, SideslipObserver(CAR, kind="ukf")):
        assert observer.step(0.01, 0.02, 20.0, 0.11, 0.0, 2.3).beta_std_rad > 0.0
        assert np.isnan(observer.refuted)


@pytest.mark.parametrize("kind", ["ukf", "linear-ukf"])
def test_on_a_slippery_surface_the_band_holds(drives: dict[str, sv.Log], kind: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SysidWarning)
        run = estimate_sideslip(CAR, drives["slippery"], kind=kind)
    assert covered(run) > 0.9


@pytest.mark.filterwarnings("error")
def test_tyres_that_fit_are_not_refuted(drives: dict[str, sv.Log]) -> None:
    run = estimate_sideslip(CAR, drives["as told"], kind="ukf")
    assert covered(run) > 0.9
    assert run.refuted is not None
    assert run.refuted.mean() < 0.05


def test_the_dual_observer_judges_itself(drives: dict[str, sv.Log]) -> None:
    run = estimate_sideslip(CAR, drives["softer"])
    assert run.refuted is None
    assert "refuted" not in run.to_dict()["series"]
    assert "dual observer in" not in str(run)


def test_a_car_that_never_moves_is_judged_by_nothing(drives: dict[str, sv.Log]) -> None:
    log = drives["as told"]
    standing = sv.Log.from_arrays(
        {**{name: log[name] for name in log.channels}, "vx_mps": np.full(log.n, 1.0)},
        name="standing",
        check=False,
    )
    with pytest.warns(SysidWarning, match="no sideslip was estimated") as heard:
        run = estimate_sideslip(CAR, standing, kind="ukf")
    assert run.refuted is None
    assert len(heard) == 1
