"""What goes into the twin from outside: arrays, places, numbers; and copies of what came out."""

import copy
import pickle
import warnings
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from sysid_vehicle import InvalidInput, NumericalError, SysidWarning, _core
from sysid_vehicle.twin import (
    INPUTS,
    LOADED_SUV,
    NOMINAL_SUV,
    READINGS,
    CallableTwin,
    NativeTwin,
    Observer,
    Readings,
    SideBySide,
    StateGain,
    TwinCar,
    mass_law,
    measure,
    observe,
    observe_with,
    unknowns,
    urban_cycle,
)

N = 400
CAR = TwinCar().core(NOMINAL_SUV)
CALM = np.zeros((N, len(INPUTS)))
BATCH = SideBySide(unknowns("mass_kg", "cg_z_m"), {"ax_mps2": 0.1, "pitch_rate_radps": 0.01})


def readings(**columns: object) -> Readings:
    values = np.full((N, len(READINGS)), np.nan)
    for name, column in columns.items():
        values[:, READINGS.index(name)] = column
    return Readings(values, {}, 1e-3)


def seen(
    inputs: Any = CALM,
    read: Readings | None = None,
    observer: Observer | None = None,
    **options: Any,
) -> object:
    options = {"speed_mps": 15.0, **options}
    return observe(
        TwinCar(),
        NOMINAL_SUV,
        inputs,
        read or readings(ax_mps2=0.0),
        observer or Observer(),
        **options,
    )


def core_seen(**changes: Any) -> object:
    given: dict[str, Any] = {
        "twin": CAR,
        "start": CAR.rest(10.0),
        "inputs": CALM,
        "measured": readings().values,
        "dt": 1e-3,
        "gains": [],
        "laws": None,
        "batch": None,
        "stride": 10,
        "scaled": [],
        "starts": [],
    }
    return _core.observe14(**{**given, **changes})


@pytest.mark.parametrize(
    "changes",
    [
        {"gains": [[1e6, 0.0, 1.0, 0.0]]},
        {"gains": [[0.0, 1e6, 1.0, 0.0]]},
        {"gains": [[-1.0, 0.0, 1.0, 0.0]]},
        {"gains": [[0.5, 0.0, 1.0, 0.0]]},
        {"gains": [[float("nan"), 0.0, 1.0, 0.0]]},
        {"gains": [[0.0, 1e300, 1.0, 0.0]]},
        {"inputs": np.zeros((N, 20))},
        {"inputs": np.zeros((N + 1, 24))},
        {"inputs": np.zeros(24)},
        {"start": np.zeros(28)},
        {"measured": np.zeros((N, 20))},
        {"dt": 0.0},
        {"dt": float("nan")},
        {"stride": 0},
        {"scaled": [24]},
        {"scaled": [1]},
        {"starts": [[1, 6, 0.1]]},
        {"starts": [[0, 36, 0.1]]},
        {"inputs": np.full((N, 24), np.nan)},
    ],
    ids=str,
)
def test_places_shapes_and_steps_out_of_range_stop_at_the_border(changes: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=r"expected|whole number|is not one of|step|stride|no "):
        core_seen(**changes)


def test_laws_and_batches_check_their_places_and_rows() -> None:
    for row in ([1e6, 1, 1, 0, 0, 1, 0], [-1, 1, 1, 0, 0, 1, 0], [0.5, 1, 1, 0, 0, 1, 0]):
        with pytest.raises(ValueError, match="whole number"):
            _core.BatchEstimator([row], [[0, 0.1, 0]], 1e-3, [2, 1, 5, 4, 20])
    good = [[0, 10, 300, 0, 1000, 3000, 0]]
    with pytest.raises(ValueError, match="whole number"):
        _core.BatchEstimator(good, [[-1, 0.1, 0]], 1e-3, [2, 1, 5, 4, 20])
    batch = _core.BatchEstimator(good, [[3, 0.1, 0]], 1e-3, [2, 1, 5, 4, 20])
    estimate = [1.0] * _core.TWIN_ESTIMATES
    with pytest.raises(ValueError, match="twin 7: there are 2, counted from 0"):
        batch.of_twin(7, estimate)
    with pytest.raises(ValueError, match="car: expected 4 values"):
        batch.update(np.zeros(3), np.zeros((2, 3)), estimate)
    with pytest.raises(ValueError, match="reading"):
        core_seen(batch=_core.BatchEstimator(good, [[99, 0.1, 0]], 1e-3, [2, 1, 5, 4, 20]))
    law = _core.ParameterLaw()
    law.channel = 5
    laws = _core.ParameterLaws([law], 1e-3, 0, 20.0, [60.0, 10.0, 1e-3])
    with pytest.raises(ValueError, match="twin: expected 6 values"):
        laws.update(np.zeros(6), np.zeros(5), estimate)
    law.channel = 16
    laws = _core.ParameterLaws([law], 1e-3, 0, 20.0, [60.0, 10.0, 1e-3])
    with pytest.raises(ValueError, match="laws: reading 16"):
        core_seen(laws=laws)
    law.parameter = 77
    with pytest.raises(ValueError, match="parameter 77"):
        _core.ParameterLaws([law], 1e-3, 0, 20.0, [60.0, 10.0, 1e-3])


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"inputs": []}, r"inputs have shape \(0,\); give \(n, 24\)"),
        ({"inputs": np.zeros((0, 24))}, "inputs have no row"),
        ({"inputs": np.zeros((N, 20))}, r"inputs have shape \(400, 20\); give \(n, 24\)"),
        ({"inputs": "none"}, "no table of real numbers"),
        ({"inputs": np.zeros((N - 1, 24))}, "399 rows of inputs but 400 of readings"),
        ({"stride": 2.5}, "stride = 2.5: give a whole number"),
        ({"speed_mps": float("nan")}, "speed_mps = nan"),
        ({"speed_mps": 1e9}, "speed_mps = 1000000000.0"),
        ({"read": Readings(np.zeros((N, 16)), {}, 0.0)}, "dt_s = 0.0; give seconds"),
        ({"read": Readings(np.zeros((N, 16)), {}, 5.0)}, "dt_s = 5.0; give seconds"),
    ],
    ids=str,
)  # fmt: skip
def test_what_the_twin_cannot_run_on_is_said_with_the_remedy(
    options: dict[str, Any], told: str
) -> None:
    with pytest.raises(InvalidInput, match=told):
        seen(**options)


@pytest.mark.parametrize("column", range(len(INPUTS)))
def test_an_input_that_is_no_number_is_named_with_its_sample(column: int) -> None:
    # A road height that is no number once lifted the wheel and was never heard of again.
    inputs = CALM.copy()
    inputs[123, column] = np.nan
    with pytest.raises(InvalidInput, match=rf"{INPUTS[column]} is nan at sample 123, t = 0.123 s"):
        seen(inputs)
    inputs[123, column] = 1e9
    with pytest.raises(InvalidInput, match=rf"{INPUTS[column]} is 1e\+09 at sample 123.*its unit"):
        seen(inputs)


def test_readings_may_be_missing_but_not_absurd() -> None:
    column = np.zeros(N)
    column[7] = np.nan
    seen(read=readings(ax_mps2=column), observer=Observer(batch=BATCH))
    column[7] = np.inf
    with pytest.raises(InvalidInput, match=r"ax_mps2 is inf at sample 7, t = 0.007 s; put NaN"):
        seen(read=readings(ax_mps2=column))
    column[7] = 1e5
    with pytest.raises(InvalidInput, match=r"ax_mps2 is 100000 at sample 7.*check its unit"):
        seen(read=readings(ax_mps2=column))


def test_cars_and_loads_that_cannot_be_are_refused() -> None:
    for values in ({"front.track_m": 0.0}, {"rear.unsprung_kg": -1.0}, {"drag_area_m2": np.nan}):
        with pytest.raises(InvalidInput, match=next(iter(values)).replace(".", r"\.")):
            TwinCar(values=values)
    with pytest.raises(InvalidInput, match="not more than its unsprung part"):
        TwinCar().core(NOMINAL_SUV.replace(mass_kg=100.0))
    with pytest.raises(InvalidInput, match="no body has such products"):
        NOMINAL_SUV.replace(jxz_kgm2=3000.0)
    with pytest.raises(InvalidInput, match="cg_x_m = nan"):
        NOMINAL_SUV.replace(cg_x_m=float("nan"))
    twin = NativeTwin(TwinCar(), NOMINAL_SUV, 10.0)
    with pytest.raises(InvalidInput, match="did you mean 'mass_kg'"):
        twin.set_parameters({"mass": 1000.0})
    with pytest.raises(InvalidInput, match="unsprung part"):
        twin.set_parameters({"mass_kg": 10.0})


_STATES = ["vx_mps", "roll_rate_radps", "wheel_speed_fl_radps", "z_m"]
_NUMBERS = st.one_of(
    st.floats(allow_nan=True, allow_infinity=True),
    st.sampled_from([0.0, np.nan, np.inf, -np.inf, 1e-300, 1e6, -1e6, 1e300, 3.0, -0.5]),
)


@settings(max_examples=80, suppress_health_check=[HealthCheck.too_slow])
@given(data=st.data())
def test_whatever_it_is_fed_ends_in_an_own_error_or_in_numbers(data: st.DataObject) -> None:
    rng = np.random.default_rng(data.draw(st.integers(0, 1000)))
    inputs = 0.02 * rng.standard_normal((N, len(INPUTS)))
    inputs[:, 2:10] *= data.draw(st.sampled_from([1.0, 1e4, 1e6]))
    values = rng.standard_normal((N, len(READINGS)))
    for array in (inputs, values):
        for _ in range(data.draw(st.integers(0, 2))):
            row = data.draw(st.integers(0, N - 1))
            column = data.draw(st.integers(0, array.shape[1] - 1))
            array[row : row + data.draw(st.integers(1, N)), column] = data.draw(_NUMBERS)
    gains = [
        StateGain(
            data.draw(st.sampled_from(READINGS)),
            data.draw(st.sampled_from(_STATES)),
            data.draw(st.sampled_from([0.0, 10.0, -1e4, 1e8])),
        )
        for _ in range(data.draw(st.integers(0, 2)))
    ]  # fmt: skip
    laws = [mass_law(data.draw(st.sampled_from([0.0, 150.0, 1e6, 1e12])), lower=0.0)]
    observer = Observer(
        gains,
        laws if data.draw(st.booleans()) else (),
        BATCH if data.draw(st.booleans()) else None,
    )
    read = Readings(values, {}, data.draw(st.sampled_from([1e-3, 1e-2, 0.09, 1e-9])))
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        warnings.simplefilter("ignore", SysidWarning)
        stiff = data.draw(st.sampled_from([20.0, 1e6]))
        speed = data.draw(st.sampled_from([0.0, 15.0, -5.0, 140.0]))
        car = TwinCar(values={"both.tyre.slip_stiffness": stiff})
        try:
            found = observe(car, NOMINAL_SUV, inputs, read, observer, speed_mps=speed)
        except (InvalidInput, NumericalError):
            return
    assert all(np.isfinite(v).all() for v in (*found.parameters.values(), *found.outputs.values()))
    assert all(np.isfinite(s) for s in found.spread.values())


def test_white_noise_in_place_of_a_reading_is_not_believed() -> None:
    """A spread of 72 kg about a mass 600 kg off was once all there was."""
    drive = urban_cycle(TwinCar(), LOADED_SUV, duration_s=60.0)
    clean = measure(drive, ["ax_mps2", "pitch_rate_radps"], snr=10.0, seed=3)
    first = LOADED_SUV.replace(mass_kg=NOMINAL_SUV.mass_kg)
    noise = {name: clean.noise[name] for name in ("ax_mps2", "pitch_rate_radps")}
    observer = Observer(batch=SideBySide(unknowns("mass_kg", "cg_x_m", "cg_z_m"), noise))
    good = observe(TwinCar(), first, drive.inputs, clean, observer, speed_mps=12.0)
    assert good.contradictions == ()
    assert abs(good.last("mass_kg") - LOADED_SUV.mass_kg) < 3.0 * good.spread["mass_kg"]
    assert "white; the car follows the twin by" in str(good)
    for seed in range(3):
        values = clean.values.copy()
        values[:, 0] = np.random.default_rng(seed).standard_normal(len(values))
        blind = Readings(values, clean.noise, clean.dt_s)
        with pytest.warns(SysidWarning, match=r"ax_mps2: the car follows the twin by.*check"):
            bad = observe(TwinCar(), first, drive.inputs, blind, observer, speed_mps=12.0)
        assert "NOT TO BE BELIEVED: ax_mps2" in str(bad)
        assert abs(bad.last("mass_kg") - LOADED_SUV.mass_kg) < 2.0 * bad.spread["mass_kg"]
    values = clean.values.copy()
    values[:, 0] += 2.0
    with pytest.warns(SysidWarning, match="ax_mps2: .*"):
        observe(
            TwinCar(), first, drive.inputs, Readings(values, {}, 1e-3), observer, speed_mps=12.0
        )


def test_torques_told_wrong_stay_inside_the_interval_of_the_mass() -> None:
    drive = urban_cycle(TwinCar(), LOADED_SUV, duration_s=60.0)
    first = LOADED_SUV.replace(mass_kg=NOMINAL_SUV.mass_kg)
    unknown = unknowns("mass_kg")
    inside = 0
    for seed, error in enumerate((-0.05, -0.02, 0.02, 0.05)):
        readings = measure(drive, ["ax_mps2"], snr=10.0, seed=seed)
        inputs = drive.inputs.copy()
        inputs[:, 2:10] *= 1.0 + error
        noise = {"ax_mps2": readings.noise["ax_mps2"]}
        blind, aware = (
            observe(
                TwinCar(),
                first,
                inputs,
                readings,
                Observer(batch=SideBySide(unknown, noise, **doubt)),
                speed_mps=12.0,
            )
            for doubt in ({"input_std": 0.0}, {})
        )
        assert blind.last("mass_kg") == aware.last("mass_kg")
        off = abs(blind.last("mass_kg") - LOADED_SUV.mass_kg)
        assert off > 5.0 * blind.spread["mass_kg"]
        inside += abs(aware.last("mass_kg") - LOADED_SUV.mass_kg) < 1.96 * aware.spread["mass_kg"]
        assert aware.spread["mass_kg"] < 0.04 * LOADED_SUV.mass_kg
    assert inside == 4


def test_the_factor_of_inputs_is_considered_on_any_twin_that_takes_them() -> None:
    drive = urban_cycle(TwinCar(), LOADED_SUV, duration_s=2.5)
    readings = measure(drive, ["ax_mps2"], snr=10.0, seed=1)
    first = LOADED_SUV.replace(mass_kg=NOMINAL_SUV.mass_kg)
    observer = Observer(batch=SideBySide(unknowns("mass_kg"), {"ax_mps2": 0.1}))
    fast = observe(TwinCar(), first, drive.inputs, readings, observer, speed_mps=12.0)
    slow = observe_with(
        NativeTwin(TwinCar(), first, 12.0), drive.inputs, {"ax_mps2": readings["ax_mps2"]}, observer
    )
    np.testing.assert_allclose(slow.parameters["mass_kg"], fast.parameters["mass_kg"], rtol=1e-9)
    assert slow.spread == pytest.approx(fast.spread, rel=1e-6)
    sure = Observer(batch=SideBySide(unknowns("mass_kg"), {"ax_mps2": 0.1}, input_std=0.0))
    exact = observe(TwinCar(), first, drive.inputs, readings, sure, speed_mps=12.0)
    assert fast.spread["mass_kg"] > 1.001 * exact.spread["mass_kg"]
    with pytest.raises(InvalidInput, match="steering has no factor"):
        SideBySide(unknowns("mass_kg"), {"ax_mps2": 0.1}, uncertain_inputs=("steer_fl_rad",))
    with pytest.raises(InvalidInput, match="input_std"):
        SideBySide(unknowns("mass_kg"), {"ax_mps2": 0.1}, input_std=-1.0)
    with pytest.raises(InvalidInput, match=r"a noise of 0\.0"):
        SideBySide(unknowns("mass_kg"), {"ax_mps2": 0.0})


def _next(state: np.ndarray, inputs: np.ndarray, parameters: dict[str, float]) -> np.ndarray:
    return state + 0.01 * inputs[:1] / parameters["mass_kg"]


def _read(state: np.ndarray, inputs: np.ndarray, parameters: dict[str, float]) -> np.ndarray:
    return state.copy()


@pytest.mark.parametrize("how", ["pickle", "deepcopy", "copy"])
def test_twins_and_observers_are_copied_with_where_they_stand(how: str) -> None:
    def copied(item: Any) -> Any:
        if how == "pickle":
            return pickle.loads(pickle.dumps(item))
        return copy.deepcopy(item) if how == "deepcopy" else copy.copy(item)

    native = NativeTwin(TwinCar(values={"front.track_m": 1.5}), NOMINAL_SUV, 12.0)
    native.set_parameters({"mass_kg": 2300.0, "jxz_kgm2": -20.0})
    native.set_wrench(np.array([100.0, 0.0, 0.0]), np.zeros(3))
    functions = CallableTwin(
        _next, _read, np.array([3.0]), dt_s=0.01, input_names=("force_n",),
        output_names=("vx_mps",), state_names=("vx_mps",), parameters={"mass_kg": 1000.0},
    )  # fmt: skip
    for twin, u in ((native, np.full(24, 0.01)), (functions, np.array([50.0]))):
        twin.step(u)
        other = copied(twin)
        np.testing.assert_array_equal(other.outputs(u), twin.outputs(u))
        assert other.get_parameters() == twin.get_parameters()
        before = twin.outputs(u)
        other.step(u)
        other.set_parameters({"mass_kg": 900.0})
        np.testing.assert_array_equal(twin.outputs(u), before)
        twin.step(u)
        other.set_parameters(twin.get_parameters())
        np.testing.assert_array_equal(other.get_state(), twin.get_state())
    observer = Observer([StateGain("ax_mps2", "vx_mps", 1.0)], [mass_law()], BATCH)
    assert copied(observer) == observer
