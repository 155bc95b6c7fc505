"""Mistakes that anybody may make with a log or a vehicle file: each is told, with its remedy."""

import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import sysid_vehicle as sv
from sysid_vehicle.cli import main
from sysid_vehicle.log import check_car

Columns = dict[str, np.ndarray]
G, DEG = 9.80665, np.degrees(1.0)


def times(**factors: float) -> Callable[[Columns], None]:
    def change(data: Columns) -> None:
        for name, factor in factors.items():
            data[name] = data[name] * factor

    return change


def swap(a: str, b: str) -> Callable[[Columns], None]:
    def change(data: Columns) -> None:
        data[a], data[b] = data[b], data[a]

    return change


def held(name: str, rows: int) -> Callable[[Columns], None]:
    def change(data: Columns) -> None:
        data[name] = data[name][np.arange(data[name].size) // rows * rows]

    return change


def shuffle(data: Columns) -> None:
    order = np.random.default_rng(1).permutation(data["ay_mps2"].size)
    data["ay_mps2"] = data["ay_mps2"][order]


# What is done to a right log, and the words that the one message has to hold.
LOGS: dict[str, tuple[Callable[[Columns], None], list[str]]] = {
    "accelerations swapped": (swap("ax_mps2", "ay_mps2"), ["ax_mps2 and ay_mps2", "swap the two"]),
    "yaw rate for acceleration": (swap("yaw_rate_radps", "ay_mps2"), ["yaw_rate_radps"]),
    "force in kN": (times(fx_n=1e-3), ["fx_n", "factor = 1000"]),
    "force with brakes positive": (times(fx_n=-1.0), ["fx_n: wrong sign", "factor = -1"]),
    "speed in km/h": (times(vx_mps=3.6), ["vx_mps: seems to be in km/h", "0.2777778"]),
    "speed in mph": (times(vx_mps=1 / 0.44704), ["vx_mps: seems to be in miles", "0.44704"]),
    "yaw rate in deg/s": (times(yaw_rate_radps=DEG), ["yaw_rate_radps", "0.0174533"]),
    "lateral acceleration in g": (times(ay_mps2=1 / G), ["ay_mps2: seems to be in g", "9.80665"]),
    "longitudinal acceleration in g": (times(ax_mps2=1 / G), ["ax_mps2: seems to be in g"]),
    "steering in degrees": (times(steer_rad=DEG), ["steer_rad", "0.0174533"]),
    "angle of the steering wheel": (times(steer_rad=16.0), ["steer_rad", "steering wheel"]),
    "its degrees": (times(steer_rad=16.0 * DEG), ["steer_rad", "steering wheel", "ratio"]),
    "steering to the right": (times(steer_rad=-1.0), ["steer_rad: wrong sign", "factor = -1"]),
    "yaw rate to the right": (times(yaw_rate_radps=-1.0), ["yaw_rate_radps: wrong sign"]),
    "acceleration to the right": (times(ay_mps2=-1.0), ["ay_mps2: wrong sign", "factor = -1"]),
    "deceleration positive": (times(ax_mps2=-1.0), ["ax_mps2: wrong sign", "factor = -1"]),
    "z down, steering z up": (times(ay_mps2=-1.0, yaw_rate_radps=-1.0), ["steer_rad: wrong sign"]),
    "time in ms": (times(time_s=1e3), ["time_s", "factor = 0.001"]),
    "rows of a channel in disorder": (shuffle, ["ay_mps2", "order of time"]),
    "10 Hz speed held in 100 Hz": (held("vx_mps", 10), ["vx_mps: each value is held for 10"]),
}

# The same for the vehicle file, or for what only it can tell.
CARS: dict[str, tuple[Callable[[Columns], None], dict[str, float | None], list[str]]] = {
    "mass in pounds": (
        lambda data: None,
        {"mass_kg": 1250.0 / 0.45359237},
        ["mass_kg = 2755.78", "pounds", "0.4536"],
    ),
    "mass as a weight in newtons": (
        lambda data: None,
        {"mass_kg": 1250.0 * 9.80665, "yaw_inertia_kgm2": None},
        ["or mass_kg seems to be a weight in newtons: multiply it by 0.102"],
    ),
    "force in pounds": (times(fx_n=1 / 4.4482216), {}, ["fx_n seems to be in pounds", "4.448222"]),
    "steering ratio of 5 for 16": (
        times(steer_rad=16.0 / 5.0),
        {},
        ["steer_rad is 3.", "wheelbase of 2.6 m", "steering ratio"],
    ),
    "lengths in feet": (
        lambda data: None,
        {"lf_m": 1.25 * 3.28084, "lr_m": 1.35 * 3.28084, "yaw_inertia_kgm2": None},
        ["lf_m and lr_m seem to be in feet", "0.3048"],
    ),
}


@pytest.fixture(scope="module")
def right(truth: sv.Model) -> sv.Log:
    return sv.drive(truth, sv.manoeuvres.lap(40.0), seed=1)


@pytest.fixture
def data(right: sv.Log) -> Columns:
    return {name: np.array(right[name]) for name in right.channels}


@pytest.mark.parametrize("mistake", LOGS)
def test_in_a_log(data: Columns, mistake: str) -> None:
    change, words = LOGS[mistake]
    change(data)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            sv.Log.from_arrays(data, name="lap")
            message = "; ".join(str(w.message) for w in caught)
        except sv.InvalidInput as error:
            message = str(error)
    for word in ["lap: ", *words]:
        assert word in message


@pytest.mark.parametrize("mistake", CARS)
def test_in_what_is_known_of_the_car(data: Columns, car: sv.Vehicle, mistake: str) -> None:
    change, changes, words = CARS[mistake]
    change(data)
    log = sv.Log.from_arrays(data, name="lap", check=False)
    wrong = car.replace(**changes)  # type: ignore[arg-type]
    with pytest.raises(sv.InvalidInput) as caught:
        sv.identify(sv.Model(wrong), log)
    for word in ["lap: ", *words]:
        assert word in str(caught.value)


def test_the_laboratory_without_a_vehicle(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["lab", "identify", str(tmp_path / "none.csv")]) == 2
    err = capsys.readouterr().err
    assert "no --vehicle was given: mass, inertia and geometry are those of the published" in err


@pytest.mark.parametrize(
    "effect",
    [
        {"steer_ratio.ratio_error": 0.3},
        {"mass.relative_error": 0.3},
        {"force_gain.drive_error": 0.3},
        {"steer_lag.time_constant_s": 0.1},
        {"locked_differential.slip_stiffness_nm2": 240e3},
        {"tyre_load_sensitivity.sensitivity": 0.3},
    ],
    ids=str,
)
@pytest.mark.parametrize("manoeuvre", ["lap", "sine_sweep", "handling_course"])
def test_a_car_with_an_effect_is_no_mistake(
    truth: sv.Model, effect: dict[str, float], manoeuvre: str
) -> None:
    name = next(iter(effect)).split(".")[0]
    driven = truth.add(name).with_values(effect)
    log = sv.drive(driven, getattr(sv.manoeuvres, manoeuvre)(), seed=3, rate_hz=50.0)
    check_car(log, mass_kg=truth.vehicle.mass_kg, wheelbase_m=truth.vehicle.wheelbase_m)


@pytest.mark.parametrize(
    "manoeuvre", ["lap", "handling_course", "sine_sweep", "double_lane_change"]
)
def test_the_steering_ratio_is_told(truth: sv.Model, manoeuvre: str) -> None:
    log = sv.drive(truth, getattr(sv.manoeuvres, manoeuvre)(), seed=4, rate_hz=50.0)
    data = {name: np.array(log[name]) for name in log.channels}
    data["steer_rad"] *= 16.0 / 5.0
    wrong = sv.Log.from_arrays(data, check=False)
    with pytest.raises(sv.InvalidInput, match="the steering ratio is about"):
        check_car(wrong, mass_kg=truth.vehicle.mass_kg, wheelbase_m=truth.vehicle.wheelbase_m)


def test_what_a_locked_differential_asks_for_is_warned_of(truth: sv.Model) -> None:
    log = sv.drive(truth, sv.manoeuvres.handling_course(), seed=4, rate_hz=50.0)
    data = {name: np.array(log[name]) for name in log.channels}
    data["steer_rad"] *= 2.6
    more = sv.Log.from_arrays(data, check=False)
    with pytest.warns(sv.SysidWarning, match=r"the steering ratio is about 2\."):
        check_car(more, mass_kg=truth.vehicle.mass_kg, wheelbase_m=truth.vehicle.wheelbase_m)


@pytest.mark.parametrize(
    ("file", "car"),
    [
        ("carsim_like_handling/handling_course.csv", "carsim_like_handling"),
        ("tum_devbot_sim/data_to_train_2.csv", "tum_devbot_sim"),
        ("revs_250lm/revs_250lm_20140222_run1.csv", "revs_250lm"),
    ],
)
@pytest.mark.filterwarnings("ignore::sysid_vehicle.errors.SysidWarning")
def test_logs_of_others_are_of_their_cars(
    repo: Path, shared_data: Path, file: str, car: str
) -> None:
    folder = repo / "benchmarks/real_driving"
    log = sv.read_log(shared_data / file, folder / f"{car}.channels.toml")
    vehicle = sv.Vehicle.from_toml(folder / f"{car}.vehicle.toml")
    check_car(log, mass_kg=vehicle.mass_kg, wheelbase_m=vehicle.wheelbase_m)


def test_windows_of_a_good_log_are_of_its_car() -> None:
    """At a constant radius an offset, at one speed understeer stands for another wheelbase."""
    rng = np.random.default_rng(12)
    manoeuvres = sv.manoeuvres
    for _ in range(12):
        model = sv.Model(_any_car(rng))
        for task in (manoeuvres.constant_radius(), manoeuvres.lap(30.0)):
            log = sv.drive(model, task, seed=rng, rate_hz=20.0)
            whole = (log["vx_mps"].size - 1) / log.rate_hz
            for length in rng.uniform(5.0, whole, 3):
                begin = rng.uniform(0.0, whole - length)
                car = model.vehicle
                check_car(
                    log.between(begin, begin + length),
                    mass_kg=car.mass_kg,
                    wheelbase_m=car.wheelbase_m,
                )


def _any_car(rng: np.random.Generator) -> sv.Vehicle:
    wheelbase, front = rng.uniform(2.3, 3.1), rng.uniform(0.42, 0.58)
    return sv.Vehicle(
        mass_kg=rng.uniform(800.0, 2600.0),
        lf_m=(1.0 - front) * wheelbase,
        lr_m=front * wheelbase,
        cg_height_m=rng.uniform(0.35, 0.65),
        track_front_m=1.55,
        track_rear_m=1.55,
        drag_area_m2=0.6,
        brake_front_share=0.62,
        drive_front_share=float(rng.integers(2)),
        tyre_front=sv.Tyre(B=rng.uniform(8.0, 16.0), C=rng.uniform(1.2, 1.6), D=1.0, E=0.0),
        tyre_rear=sv.Tyre(B=rng.uniform(10.0, 20.0), C=rng.uniform(1.2, 1.6), D=1.1, E=0.0),
    )


def test_a_car_that_slides_has_no_wrong_ratio(monkeypatch: pytest.MonkeyPatch) -> None:
    """On the way into a slide and out of it the front is turned far, at low a_y too."""
    time_s = np.arange(8000) / 100.0
    slide_s, slide_radps = np.array([0.0, 0.8, 3.8, 4.6]), [0.0, 0.35, 0.35, 0.0]
    yaw_rate = sum(np.interp(time_s, slide_s + t, slide_radps) for t in (5.0, 17.0, 29.0))
    speed, wheelbase_m = 20.0, 2.6
    sliding = sv.Log.from_arrays(
        {
            "time_s": time_s,
            "vx_mps": np.full_like(time_s, speed),
            "yaw_rate_radps": yaw_rate,
            "ax_mps2": np.zeros_like(time_s),
            "ay_mps2": speed * yaw_rate,
            "steer_rad": 4.0 * wheelbase_m * yaw_rate / speed,
        },
        check=False,
    )
    check_car(sliding, mass_kg=1500.0, wheelbase_m=wheelbase_m)
    monkeypatch.setattr("sysid_vehicle.log.against_car._SETTLING", 0)
    with pytest.raises(sv.InvalidInput, match="steer_rad is"):
        check_car(sliding, mass_kg=1500.0, wheelbase_m=wheelbase_m)
