"""A car on a scale has a short wheelbase: the car's own numbers tell it from a wrong unit."""

import re
import warnings
from dataclasses import replace
from pathlib import Path

import model_cars
import numpy as np
import pytest

import sysid_vehicle as sv
from sysid_vehicle.log import Log, check_car
from sysid_vehicle.log.laws.plausibility import contradictions


def columns(wheelbase_m: float, seconds: float = 40.0) -> dict[str, np.ndarray]:
    """A neutral car of this wheelbase at 3 to 6 m/s, in bends of up to 4 m/s2."""
    rng = np.random.default_rng(3)
    time_s = np.arange(0.0, seconds, 0.01)
    speed = 4.5 + 1.2 * np.sin(0.4 * time_s)
    ay = 2.0 * np.sin(1.3 * time_s) + 2.0 * np.sin(0.5 * time_s)
    yaw_rate = ay / speed
    return {
        "time_s": time_s,
        "vx_mps": speed + 0.02 * rng.standard_normal(time_s.size),
        "yaw_rate_radps": yaw_rate + 0.01 * rng.standard_normal(time_s.size),
        "ax_mps2": 0.48 * np.cos(0.4 * time_s) + 0.1 * rng.standard_normal(time_s.size),
        "ay_mps2": ay + 0.1 * rng.standard_normal(time_s.size),
        "steer_rad": wheelbase_m * yaw_rate / speed + 0.0005 * ay,
    }


def test_a_model_car_is_read_with_a_note() -> None:
    with pytest.warns(sv.SysidWarning, match=r"steer_rad: .* small .* if this is no model car"):
        log = Log.from_arrays(columns(0.33))
    assert not [c for c in contradictions(columns(0.33), log.rate_hz) if c.channel == "steer_rad"]
    check_car(log, mass_kg=3.7, wheelbase_m=0.33)


def test_no_note_is_needed_where_the_car_is_known(tmp_path: Path) -> None:
    vehicle = replace(
        sv.example_vehicle(), mass_kg=3.7, lf_m=0.16, lr_m=0.17, yaw_inertia_kgm2=None
    )
    log = tmp_path / "log.csv"
    table = columns(0.33)
    rows = np.column_stack(list(table.values()))
    np.savetxt(log, rows, delimiter=",", header=",".join(table), comments="")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        sv.read_log(log, vehicle=vehicle)


def test_its_numbers_must_be_those_of_the_log() -> None:
    with pytest.warns(sv.SysidWarning, match="model car"):
        log = Log.from_arrays(columns(0.33))
    with pytest.raises(sv.InvalidInput, match=r"steer_rad is 0.1.* wheelbase of 2.7 m"):
        check_car(log, mass_kg=1500.0, wheelbase_m=2.7)
    with pytest.raises(sv.InvalidInput, match=r"steer_rad is .* wheelbase of 0.1 m"):
        check_car(log, mass_kg=3.7, wheelbase_m=0.1)


def test_no_car_is_so_short() -> None:
    with pytest.raises(sv.InvalidInput, match=r"steer_rad: .* small for the yaw rate.*its unit"):
        Log.from_arrays(columns(0.05))


def driven(mass_kg: float, wheelbase_m: float = 0.33) -> dict[str, np.ndarray]:
    """The same with a wheel force."""
    table = columns(wheelbase_m)
    drag = 0.001 * mass_kg * table["vx_mps"] ** 2
    return {**table, "fx_n": mass_kg * 0.48 * np.cos(0.4 * table["time_s"]) + drag}


def test_the_force_of_a_model_car_is_read_with_a_note() -> None:
    with pytest.warns(sv.SysidWarning) as heard:
        log = Log.from_arrays(driven(3.7))
    (told,) = (str(w.message) for w in heard if "fx_n" in str(w.message))
    assert re.search(r"mass of 3\.\d* kg; if this is no model car, and it is in kN", told)
    assert not log.contradictions
    check_car(log, mass_kg=3.7, wheelbase_m=0.33)
    with pytest.raises(sv.InvalidInput, match=r"mass_kg = 1500, but fx_n moves the car as if"):
        check_car(log, mass_kg=1500.0, wheelbase_m=0.33)


def test_a_force_in_kn_moves_no_car_of_usual_length() -> None:
    with pytest.raises(sv.InvalidInput, match=r"fx_n: .* mass of 1.* kg; if it is in kN"):
        Log.from_arrays(driven(1.5, 2.7))


def test_of_a_model_car_with_the_file_of_another_one_its_own_file_is_asked_for() -> None:
    """In thousands of newtons 2.3 kg would be 2300 kg: not the unit need be wrong."""
    with pytest.raises(sv.InvalidInput, match="of a model car, give its own vehicle file"):
        Log.from_arrays(driven(2.3), vehicle=sv.example_vehicle())


def test_a_fast_model_car_needs_little_force() -> None:
    """Three kilograms at 16 m/s, where the drag of any other car takes more than 30 N."""
    table = driven(3.0)
    fast = 3.6  # times as fast, in as many times as wide bends
    for name in ("vx_mps", "ax_mps2", "fx_n"):
        table[name] = fast * table[name]
    table["yaw_rate_radps"] = table["yaw_rate_radps"] / fast
    table["steer_rad"] = table["steer_rad"] / fast**2
    with pytest.warns(sv.SysidWarning, match="model car"):
        log = Log.from_arrays(table)
    assert np.abs(log["fx_n"]).max() < 30.0
    assert np.median(log["vx_mps"]) > 15.0


def test_a_quick_model_car_needs_little_force() -> None:
    """A slalom at 18 m/s asks 8 N of a car of 22 kg; it was refused as a force in kN."""
    base = sv.example_vehicle()
    car = replace(
        base,
        mass_kg=22.0,
        yaw_inertia_kgm2=1.5,
        lf_m=0.2 * base.lf_m,
        lr_m=0.2 * base.lr_m,
        cg_height_m=0.2 * base.cg_height_m,
        track_front_m=0.2 * base.track_front_m,
        track_rear_m=0.2 * base.track_rear_m,
        drag_area_m2=0.04 * base.drag_area_m2,
    )
    driven = sv.drive(sv.Model(car), sv.manoeuvres.slalom(), seed=88123)
    log = {name: driven[name] for name in driven.channels}
    assert 1.0 < np.abs(log["fx_n"]).max() < 30.0
    assert "fx_n" in Log.from_arrays(log, vehicle=car).channels
    with pytest.raises(sv.InvalidInput, match=r"fx_n: .* of a model car, read the log with its"):
        Log.from_arrays(log)


@pytest.fixture(scope="module")
def slow() -> Log:
    """A model car of 2.3 kg in a yard, always below 5 m/s."""
    model = sv.Model(model_cars.car())
    return sv.drive(model, sv.manoeuvres.lap(60.0, 4.0, 4.5), seed=1, rate_hz=100.0)


@pytest.mark.parametrize(
    ("leave_out", "told"),
    [((), "mass_kg = 900, but fx_n moves the car as if it had 2.2"), (("fx_n",), "wheelbase of")],
)
def test_a_slow_model_car_is_not_one_of_900_kg(
    slow: Log, leave_out: tuple[str, ...], told: str
) -> None:
    """A full-size car at its speeds turns by its wheelbase; this one never drives so fast."""
    log = slow.without(*leave_out) if leave_out else slow
    with pytest.raises(sv.InvalidInput, match=re.escape(told)) as error:
        check_car(log, mass_kg=900.0, wheelbase_m=2.4)
    assert "the vehicle file is that of another car" in str(error.value)
    car = model_cars.car()
    check_car(log, mass_kg=car.mass_kg, wheelbase_m=car.wheelbase_m)


@pytest.mark.parametrize("seed", [635, 404077])
def test_a_model_car_that_is_driven_hard_is_not_one_of_900_kg(seed: int) -> None:
    """At 6 to 12 m/s, and without a wheel force, which would tell the mass."""
    own, other = model_cars.car(), replace(sv.example_vehicle(), mass_kg=900.0)
    for driven in model_cars.drives(sv.Model(own), seed):
        log = driven.without("fx_n")
        told = (
            r"wheelbase of 1\.\d* m at most .* lf_m \+ lr_m are 2\.6 m; the vehicle file is that of"
        )
        for few in (log, log.without("vy_mps")):
            with pytest.raises(sv.InvalidInput, match=told):
                check_car(few, mass_kg=other.mass_kg, wheelbase_m=other.wheelbase_m)
            check_car(few, mass_kg=own.mass_kg, wheelbase_m=own.wheelbase_m)


@pytest.mark.parametrize("rear", [1.0, 0.65])
def test_a_car_that_is_driven_hard_is_itself(rear: float) -> None:
    """Also one that oversteers."""
    car = sv.example_vehicle()
    car = replace(car, tyre_rear=car.tyre_rear.replace(B=rear * car.tyre_rear.B))
    for seed, manoeuvre in enumerate((sv.manoeuvres.lap(60.0, 8.0, 20.0), sv.manoeuvres.slalom())):
        log = sv.drive(sv.Model(car), manoeuvre, seed=seed)
        for few in (log, log.without("fx_n", "vy_mps")):
            check_car(few, mass_kg=car.mass_kg, wheelbase_m=car.wheelbase_m)


@pytest.mark.parametrize("slope_rad", [0.0, 0.03])
def test_a_car_that_only_manoeuvres_slowly_is_itself(slope_rad: float) -> None:
    """On hills, too: below 5 m/s no more than magnitudes are told."""
    car = sv.example_vehicle()
    for seed in range(4):
        log = sv.drive(
            sv.Model(car),
            sv.manoeuvres.lap(60.0, 1.5, 4.0),
            seed=seed,
            rate_hz=50.0,
            disturbance=sv.RoadDisturbance(slope_rad=slope_rad),
        )
        for few in (log, log.without("fx_n")):
            check_car(few, mass_kg=car.mass_kg, wheelbase_m=car.wheelbase_m)
