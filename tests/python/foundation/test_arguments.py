"""What is given by mistake is refused with a word on what to give."""

from collections.abc import Callable
from decimal import Decimal
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import sysid_vehicle as sv
from sysid_vehicle import Fit, InvalidInput, Log, Model, Vehicle, lab
from sysid_vehicle._common.arguments import generator, real, whole
from sysid_vehicle._common.threads import Workers


class Table:
    """Has columns, as a DataFrame."""

    columns = ("time_s", "vx_mps")


@pytest.mark.parametrize(
    "value",
    [np.float32(1.5), np.float64(1.5), np.array(1.5), Fraction(3, 2), Decimal("1.5"), 1.5],
)
def test_any_real_scalar_is_a_number(value: object, car: Vehicle) -> None:
    assert real(value) == 1.5
    changed = car.replace(lf_m=value, tyre_front=car.tyre_front.replace(C=value))  # type: ignore[arg-type]
    assert (changed.lf_m, changed.tyre_front.C) == (1.5, 1.5)
    assert type(changed.lf_m) is type(changed.tyre_front.C) is float


@pytest.mark.parametrize(
    "value", [True, np.True_, "1.5", None, 1j, np.array([1.5]), np.array("x"), np.array(1j)]
)
def test_what_is_no_real_scalar(value: object, car: Vehicle) -> None:
    assert real(value) is None
    with pytest.raises(InvalidInput, match="is not a number"):
        car.replace(mass_kg=value)


def test_numbers_beyond_a_float(car: Vehicle) -> None:
    assert real(-(10**400)) == -np.inf
    with pytest.raises(InvalidInput, match="mass_kg = inf is out of range"):
        car.replace(mass_kg=10**400)


def test_axles_that_coincide_are_refused(car: Vehicle) -> None:
    with pytest.raises(InvalidInput, match=r"lf_m = 1e-200 is out of range .* lr_m = 1e-200"):
        car.replace(lf_m=1e-200, lr_m=1e-200)


def test_a_vehicle_is_made_of_tyres_and_a_name(car: Vehicle) -> None:
    with pytest.raises(InvalidInput, match=r"tyre_rear = \{'B': 10\} is no tyre; give a"):
        car.replace(tyre_rear={"B": 10})
    with pytest.raises(InvalidInput, match="name = 3 is not a text"):
        car.replace(name=3)


@pytest.mark.parametrize("workers", [0, -2, 1.5, True, "2"])
def test_no_pool_is_made_of_less_than_one_worker(workers: object) -> None:
    with pytest.raises(InvalidInput, match=r"workers = .*: give a whole number, 1 or more"):
        Workers(workers)  # type: ignore[arg-type]
    with pytest.raises(InvalidInput, match="workers = "):
        lab.design_excitation(trials=2, duration_s=10.0, workers=workers)  # type: ignore[arg-type]


def test_whole_numbers_and_seeds() -> None:
    assert whole(np.int8(3), "n") == whole(np.array(3), "n") == 3
    for value in (-1, 1.0, True, "3", None, np.nan):
        with pytest.raises(InvalidInput, match=r"n = .*: give a whole number, 0 or more"):
            whole(value, "n")
        with pytest.raises(InvalidInput, match="give a whole number from zero up, or a numpy"):
            generator(value)
    rng = np.random.default_rng(0)
    assert generator(rng) is rng


@pytest.mark.parametrize(
    ("how", "words"),
    [
        ({"workers": 0}, "workers = 0: give a whole number, 1 or more"),
        ({"starts": 0}, "starts = 0: give a whole number, 1 or more"),
        ({"seed": -1}, "seed = -1: give a whole number, 0 or more"),
        ({"seed": None}, "seed = None: give a whole number"),
    ],
)
def test_counts_and_seeds_are_checked_first(
    how: dict[str, int], words: str, start: Model, lap: Log
) -> None:
    with pytest.raises(InvalidInput, match=words):
        sv.identify(start, lap, **how)  # type: ignore[arg-type]
    if "workers" not in how:
        with pytest.raises(InvalidInput, match=words):
            sv.improve(start, lap, **how)  # type: ignore[arg-type]


def test_seeds_of_everything_that_draws(fit: Fit, truth: Model) -> None:
    draws: tuple[Callable[[], object], ...] = (
        lambda: sv.drive(truth, sv.manoeuvres.lap(10.0), seed=-1),
        lambda: sv.diagnose(fit, seed=-1),
        lambda: sv.where(fit, seed=-1),
    )
    for draw in draws:
        with pytest.raises(InvalidInput, match=r"seed = -1[:;] give a whole number"):
            draw()


def fleet(cars: Any, logs: Any, **how: Any) -> object:
    """A fleet that nothing is written of."""
    return sv.improve_many(cars, logs, out="/nowhere/at all", progress=False, **how)


MISTAKES: tuple[tuple[Callable[..., object], str], ...] = (
    (lambda fit, lap, model: sv.identify(model, "lap.csv"), "str was given .* read_log"),
    (lambda fit, lap, model: sv.identify(model, Path("x")), "Path was given .* read_log"),
    (lambda fit, lap, model: sv.identify(model, [Path("x")]), "Path was given .* read_log"),
    (lambda fit, lap, model: sv.identify(model, Table()), r"Table .* Log\.from_arrays"),
    (lambda fit, lap, model: sv.identify(model, {"vx_mps": []}), r"dict .* Log\.from_arrays"),
    (lambda fit, lap, model: sv.identify(model, model), "Model .* model comes first"),
    (lambda fit, lap, model: sv.identify(model.vehicle, lap), r"Vehicle .*: Model\(vehicle\)"),
    (lambda fit, lap, model: sv.identify("car.toml", lap), r"str .*Vehicle\.from_toml"),
    (lambda fit, lap, model: sv.identify(fit, lap), r"Fit .* pass its \.model"),
    (lambda fit, lap, model: sv.identify(lap, model), "identify: a Log .* model comes first"),
    (lambda fit, lap, model: sv.compare(model, lap), r"compare: a Model .* fit it first"),
    (lambda fit, lap, model: sv.compare(lap, fit), "Log .* fit comes first"),
    (lambda fit, lap, model: sv.compare(fit, "lap.csv"), "str .* read_log"),
    (lambda fit, lap, model: sv.diagnose(model), r"diagnose: a Model .* fit it first"),
    (lambda fit, lap, model: sv.diagnose(fit, fit), "Fit .* fit comes first"),
    (lambda fit, lap, model: sv.diagnose(None), "NoneType .* pass a Fit"),
    (lambda fit, lap, model: sv.where(model), r"where: a Model .* fit it first"),
    (lambda fit, lap, model: sv.unknown(model, lap), r"unknown: a Model .* fit it first"),
    (lambda fit, lap, model: sv.bias_report(model), r"bias_report: a Model .* fit it first"),
    (lambda fit, lap, model: sv.suggest_manoeuvre(model, "mass", "mass"), "fit it first"),
    (lambda fit, lap, model: sv.improve(fit, lap), r"improve: a Fit .* pass its \.model"),
    (lambda fit, lap, model: sv.improve(model, "lap.csv"), "str .* read_log"),
    (lambda fit, lap, model: sv.improve(model, lap, Table()), r"Table .* Log\.from_arrays"),
    (lambda fit, lap, model: sv.check(None), r"check: a NoneType .* pass a Log"),
    (lambda fit, lap, model: sv.check([]), "check: no log was given"),
    (lambda fit, lap, model: sv.check(lap, model), "check: a Model .* pass its .vehicle"),
    (lambda fit, lap, model: sv.axle_forces("lap.csv", model.vehicle), "forces: a str .* read_log"),
    (lambda fit, lap, model: sv.axle_forces(lap, "car.toml"), "axle_forces: a str .* Vehicle"),
    (
        lambda fit, lap, model: sv.axle_forces(lap, model.vehicle, sensors=fit),  # type: ignore[arg-type]
        "axle_forces: a Fit .* SensorCheck",
    ),
    (lambda fit, lap, model: sv.export(None, "x.fmu"), "export: a NoneType .* pass a Model"),  # type: ignore[arg-type]
    (lambda fit, lap, model: sv.casadi_function(fit), r"function: a Fit .* pass its \.model"),
    (lambda fit, lap, model: sv.read_log(fit), "a Fit has no named columns"),
    (lambda fit, lap, model: sv.drive(model, "lap", seed=1), "drive: a str .* Manoeuvre"),  # type: ignore[arg-type]
    (lambda fit, lap, model: sv.drive(lap, lap, seed=1), "drive: a Log .* Model"),
    (lambda fit, lap, model: sv.verdicts(fit), "verdicts: a Fit .* pass a Diagnosis"),
    (lambda fit, lap, model: sv.effect(["mass"]), "effect: a list .* pass a str"),  # type: ignore[arg-type]
    (lambda fit, lap, model: sv.check_excitation(fit), "check_excitation: a Fit"),
    (lambda fit, lap, model: fleet(model, None), "improve_many: None is no log"),
    (lambda fit, lap, model: fleet(model, {"a": None}), "a: None is no log"),
    (lambda fit, lap, model: fleet(model, [lap], validation=[lap]), "validation is a list"),
    (
        lambda fit, lap, model: fleet(model, [lap], executor=3),
        "an int was given .* pass an Executor",
    ),
    (lambda fit, lap, model: fleet({}, {"a": lap}), "a: no car is given for it; name 'a' among"),
    (lambda fit, lap, model: Model("car.toml"), r"made of a Vehicle, .*Vehicle\.from_toml"),
    (lambda fit, lap, model: Model(model.vehicle, "mass"), "give a tuple of names"),
)


@pytest.mark.parametrize(("call", "words"), MISTAKES, ids=[w for _, w in MISTAKES])
def test_mistakes_are_told(
    call: Callable[..., object], words: str, fit: Fit, lap: Log, truth: Model
) -> None:
    with pytest.raises(InvalidInput, match=words):
        call(fit, lap, truth)


def test_no_log_at_all(truth: Model) -> None:
    for none in ([], (), iter(())):
        with pytest.raises(InvalidInput, match="no log was given"):
            sv.identify(truth, none)  # type: ignore[arg-type]


def test_arguments_may_be_named(fit: Fit, lap: Log) -> None:
    assert sv.compare(logs=lap, fit=fit).error == sv.compare(fit, lap).error


def test_results_are_short_where_a_traceback_or_a_list_shows_them(fit: Fit, lap: Log) -> None:
    for shown in (fit, sv.compare(fit, lap), fit.driving, [fit]):
        assert "\n" not in repr(shown)
        assert len(repr(shown)) < 300
    assert repr(fit).startswith("<Fit: ")
