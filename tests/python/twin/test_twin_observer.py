"""The twin's car, drives, laws and observer as a user meets them."""

from contextlib import nullcontext

import numpy as np
import pytest

from sysid_vehicle import InvalidInput, NumericalError, SysidWarning, manoeuvres
from sysid_vehicle.twin import (
    LOADED_SUV,
    NOMINAL_SUV,
    OUTPUTS,
    SPORTS_CAR,
    Drive14,
    Load,
    Observer,
    ParameterLaw,
    PointMass,
    Schedule,
    SideBySide,
    StateGain,
    TwinCar,
    drive14,
    inertia_law,
    mass_law,
    measure,
    noisy_road,
    observe,
    on_manoeuvre,
    rough_road,
    swept_steer,
    unknowns,
    urban_cycle,
)

MASS_CHANGE = LOADED_SUV.mass_kg - NOMINAL_SUV.mass_kg
LIGHT = LOADED_SUV.replace(mass_kg=NOMINAL_SUV.mass_kg)


@pytest.fixture(scope="module")
def town() -> Drive14:
    return urban_cycle(TwinCar(), LOADED_SUV, duration_s=60.0)


@pytest.fixture(scope="module")
def sweep() -> Drive14:
    return swept_steer(TwinCar(), LOADED_SUV, repeats=2, sweep_s=15.0)


def test_drives_do_what_they_say(town: Drive14, sweep: Drive14) -> None:
    assert town["vx_mps"].min() > 4.0
    assert 2.0 < np.abs(town["plane_ax_mps2"]).max() < 5.0
    assert np.ptp(sweep["vx_mps"]) < 0.5
    assert np.std(sweep["roll_acceleration_radps2"]) > 0.5
    road = rough_road(TwinCar(), LOADED_SUV, seed=1, duration_s=5.0)
    lag = round(TwinCar().numbers()["wheelbase_m"] / 20.0 / road.dt_s)
    front, rear = road["road_fl_m"], road["road_rl_m"]
    assert np.corrcoef(front[:-lag], rear[lag:])[0, 1] > 0.99
    assert "m/s" in str(town)


def test_a_lost_car_is_an_error_with_its_time() -> None:
    references = np.zeros((4000, 3))
    references[:, 0], references[:, 2] = 40.0, 0.4
    with pytest.raises(NumericalError, match=r"lost at sample \d+, t = "):
        drive14(TwinCar(), None, references)


def test_a_manoeuvre_is_followed() -> None:
    wanted = manoeuvres.double_lane_change((20.0,))
    drive = on_manoeuvre(SPORTS_CAR, None, wanted)
    lateral = wanted.lateral_mps2(drive.time_s)
    assert np.std(drive["plane_ay_mps2"] - lateral) < 0.35 * np.std(lateral)
    with pytest.raises(InvalidInput, match="open loop"):
        on_manoeuvre(SPORTS_CAR, None, manoeuvres.step_steer())


def test_unknown_numbers_of_a_car_are_refused_with_near_names() -> None:
    with pytest.raises(InvalidInput, match=r"front\.spring_npm"):
        TwinCar(values={"front.sprng_npm": 1.0})
    assert TwinCar().replace({"both.track_m": 1.5}).numbers()["rear.track_m"] == 1.5
    with pytest.raises(InvalidInput, match="mass_kg"):
        NOMINAL_SUV.replace(mass_kg=-1.0)


def test_added_masses_keep_the_inequality_that_table_3_breaks() -> None:
    people = [PointMass(75.0, -1.3, -0.4, 0.9), PointMass(80.0, -2.2, 0.4, 0.9)]
    loaded = NOMINAL_SUV.with_masses(people)
    assert loaded.mass_kg == pytest.approx(NOMINAL_SUV.mass_kg + 155.0)

    def excess(load: Load) -> float:
        return load.jxx_kgm2 + load.jyy_kgm2 - load.jzz_kgm2

    assert excess(loaded) > excess(NOMINAL_SUV)
    assert excess(LOADED_SUV) < excess(NOMINAL_SUV)


def test_the_mass_converges_by_the_published_law_with_its_sign_corrected(town: Drive14) -> None:
    readings = measure(town, ["ax_mps2"], snr=10.0, seed=1)
    observer = Observer(laws=[mass_law(150.0)])
    found = observe(TwinCar(), LIGHT, town.inputs, readings, observer, speed_mps=12.0)
    assert found.error_percent("mass_kg", LOADED_SUV.mass_kg, MASS_CHANGE) < 10.0
    assert found.moved() == ["mass_kg"]
    assert "mass_kg" in str(found)


def test_the_printed_sign_diverges(town: Drive14) -> None:
    readings = measure(town, ["ax_mps2"])
    observer = Observer(laws=[mass_law(150.0, published_sign=True)])
    with pytest.warns(SysidWarning, match=r"mass_kg = \d+\.?\d* stands at its limit"):
        found = observe(TwinCar(), LIGHT, town.inputs, readings, observer, speed_mps=12.0)
    assert found.error_percent("mass_kg", LOADED_SUV.mass_kg, MASS_CHANGE) > 200.0


def test_the_sign_of_a_noisy_reading_lets_the_parameter_drift(sweep: Drive14) -> None:
    readings = measure(sweep, ["roll_rate_radps"], snr=10.0, seed=2)
    change = LOADED_SUV.jxx_kgm2 - NOMINAL_SUV.jxx_kgm2
    errors = {}
    for sign in ("twin", "measured"):
        law = Observer(laws=[inertia_law("jxx_kgm2", 100.0, sign=sign)])
        told = r"jxx_kgm2 = .* stands at its limit"
        with pytest.warns(SysidWarning, match=told) if sign == "measured" else nullcontext():
            found = observe(TwinCar(), LOADED_SUV, sweep.inputs, readings, law, speed_mps=22.0)
        errors[sign] = found.error_percent("jxx_kgm2", LOADED_SUV.jxx_kgm2, change)
    assert errors["twin"] < 15.0
    assert errors["measured"] > 4.0 * errors["twin"]


def test_the_gradient_law_converges_too(sweep: Drive14) -> None:
    readings = measure(sweep, ["yaw_rate_radps"], snr=10.0, seed=3)
    start = LOADED_SUV.replace(jzz_kgm2=NOMINAL_SUV.jzz_kgm2)
    law = inertia_law("jzz_kgm2", 600.0, kind="gradient")
    found = observe(TwinCar(), start, sweep.inputs, readings, Observer(laws=[law]), speed_mps=22.0)
    change = LOADED_SUV.jzz_kgm2 - NOMINAL_SUV.jzz_kgm2
    assert found.error_percent("jzz_kgm2", LOADED_SUV.jzz_kgm2, change) < 10.0


def test_twins_side_by_side_find_what_the_published_laws_cannot(sweep: Drive14) -> None:
    """Mass, centre of mass and inertia at once, from readings with a tenth of noise."""
    names = ("mass_kg", "jxx_kgm2", "jzz_kgm2", "cg_x_m", "cg_y_m", "cg_z_m", "jxz_kgm2")
    readings = measure(sweep, ["ay_mps2", "roll_rate_radps", "yaw_rate_radps"], snr=10.0, seed=4)
    observer = Observer(batch=SideBySide(unknowns(*names), readings.noise))
    found = observe(TwinCar(), NOMINAL_SUV, sweep.inputs, readings, observer, speed_mps=22.0)
    for name in ("mass_kg", "jxx_kgm2", "jzz_kgm2", "cg_x_m", "cg_z_m", "jxz_kgm2"):
        true, nominal = getattr(LOADED_SUV, name), getattr(NOMINAL_SUV, name)
        assert found.error_percent(name, true, true - nominal) < 10.0, name
        assert abs(found.last(name) - true) < 6.0 * found.spread[name], name


def test_a_gate_on_the_yaw_rate_stops_the_law(sweep: Drive14) -> None:
    readings = measure(sweep, ["ax_mps2"])
    law = mass_law(150.0, yaw_rate_below_radps=0.0, yaw_rate_above_radps=1.0)
    found = observe(TwinCar(), LIGHT, sweep.inputs, readings, Observer(laws=[law]), speed_mps=22.0)
    assert found.moved() == []


def test_stages_follow_one_another(town: Drive14) -> None:
    readings = measure(town, ["ax_mps2"])
    laws = [mass_law(150.0), inertia_law("jzz_kgm2", 100.0, stage=1)]
    schedule = Schedule(excited_s=20.0, window_s=5.0, relative_rate_ps=3e-3)
    observer = Observer(laws=laws, schedule=schedule)
    with pytest.warns(SysidWarning, match="yaw_rate_radps: the car follows the twin by"):
        # The second stage has seconds only, and its inertia is far off at the end.
        found = observe(TwinCar(), LIGHT, town.inputs, readings, observer, speed_mps=12.0)
    began = found.time_s[np.argmax(found.stages > 0)]
    assert 20.0 < began < 60.0
    inertia = found.parameters["jzz_kgm2"]
    assert np.ptp(inertia[found.time_s < began]) == 0.0
    assert np.ptp(inertia) > 0.0


def test_state_gains_pull_the_twin_to_the_car(sweep: Drive14) -> None:
    readings = measure(sweep, ["yaw_rate_radps"])
    free = observe(TwinCar(), LIGHT, sweep.inputs, readings, Observer(), speed_mps=22.0)
    gain = StateGain("yaw_rate_radps", "yaw_rate_radps", 50.0)
    held = observe(TwinCar(), LIGHT, sweep.inputs, readings, Observer(gains=[gain]), speed_mps=22.0)
    true = sweep["yaw_rate_radps"][::10]

    def error(outputs: dict[str, np.ndarray]) -> float:
        return float(np.std(outputs["yaw_rate_radps"] - true))

    assert error(held.outputs) < 0.3 * error(free.outputs)
    per_sample = StateGain("yaw_rate_radps", "yaw_rate_radps", 50.0 * sweep.dt_s, "per_sample")
    same = observe(
        TwinCar(), LIGHT, sweep.inputs, readings, Observer(gains=[per_sample]), speed_mps=22.0
    )
    np.testing.assert_allclose(same.outputs["vy_mps"], held.outputs["vy_mps"], atol=1e-9)


def test_wrong_questions_are_answered_with_the_remedy(town: Drive14) -> None:
    readings = measure(town, ["ax_mps2"])
    with pytest.raises(InvalidInput, match="did you mean 'ax_mps2'"):
        measure(town, ["ax_mps"])
    with pytest.raises(InvalidInput, match="snr"):
        measure(town, ["ax_mps2"], snr=-1.0)
    with pytest.raises(InvalidInput, match="give speed_mps"):
        observe(TwinCar(), LIGHT, town.inputs, readings, Observer())
    with pytest.raises(InvalidInput, match="rows of inputs"):
        observe(TwinCar(), LIGHT, town.inputs[1:], readings, Observer(), speed_mps=12.0)
    with pytest.raises(InvalidInput, match="stride = 0"):
        observe(TwinCar(), LIGHT, town.inputs, readings, Observer(), speed_mps=12.0, stride=0)
    with pytest.raises(InvalidInput, match="no parameter 'mass'"):
        unknowns("mass")
    with pytest.raises(InvalidInput, match="gains must not be negative"):
        ParameterLaw("mass_kg", "ax_mps2", -1.0)
    wild = StateGain("ay_mps2", "roll_rate_radps", -1e5)
    noisy = measure(town, ["ay_mps2"])
    with pytest.raises(NumericalError, match="sample"):
        observe(TwinCar(), LIGHT, town.inputs, noisy, Observer(gains=[wild]), speed_mps=12.0)


def test_noise_is_that_of_the_ratio(town: Drive14) -> None:
    clean = town["ax_mps2"]
    for unit, ratio in (("amplitude", 10.0), ("dB", 10.0**0.5)):
        readings = measure(town, ["ax_mps2"], snr=10.0, seed=5, unit=unit)
        assert np.std(readings["ax_mps2"] - clean) == pytest.approx(np.std(clean) / ratio, rel=0.02)
    assert np.isnan(readings["ay_mps2"]).all()
    assert OUTPUTS[:16][0] == "ax_mps2"
    road = rough_road(TwinCar(), LOADED_SUV, seed=1, duration_s=3.0)
    told = noisy_road(road.inputs, 0.1, seed=2)
    ratio = told[2500:, 10] / road.inputs[2500:, 10]
    assert ratio.min() > 0.9 - 1e-9
    assert ratio.max() < 1.1 + 1e-9
    np.testing.assert_array_equal(told[:, :10], road.inputs[:, :10])
