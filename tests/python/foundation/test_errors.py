"""Whatever fails inside leaves as one of the package's own errors, with place and remedy."""

import pickle
from collections.abc import Callable

import numpy as np
import pytest

import sysid_vehicle as sv
from sysid_vehicle import Fit, InvalidInput, Log, Model, NumericalError, SysidError, _core
from sysid_vehicle._common.arrays import as_float64
from sysid_vehicle.errors import explained
from sysid_vehicle.identify.suspects import suspects

N = 40


def problem(model: Model, name: str = "", start: float = 0.0) -> _core.Problem:
    found = _core.Problem(model.core())
    readings = np.tile([20.0, 0.0, 0.0, 0.0, 0.0], (N, 1))
    found.add_run(0.01, np.zeros((N, 2)), readings, start, name)
    return found


def test_the_core_has_no_errors_of_its_own() -> None:
    own = [x for x in vars(_core).values() if isinstance(x, type) and issubclass(x, Exception)]
    assert own == []


def test_a_failing_kernel_raises_the_public_error(truth: Model, fit: Fit) -> None:
    nowhere = np.full(_core.PARAMETERS, np.nan)
    with pytest.raises(NumericalError, match=r"not finite at sample 0$") as caught:
        problem(truth).freeze(nowhere, fit.noise.vector())
    assert caught.value.sample == 0
    again = pickle.loads(pickle.dumps(caught.value))
    assert (type(again), str(again), again.sample) == (NumericalError, str(caught.value), 0)


def test_a_failure_in_a_log_names_it_and_the_time(truth: Model, fit: Fit) -> None:
    noise = fit.noise.vector()
    late = problem(truth, "lap.csv", start=3.2)
    for run in (late.freeze, late.noise_score, lambda p, v: late.trace(p, v, True)):
        with pytest.raises(
            NumericalError, match=r"^lap\.csv: the .* at 3\.2 s \(sample 320\)$"
        ) as caught:
            run(np.full(_core.PARAMETERS, np.nan), noise)
        assert caught.value.sample == 320


def test_what_the_core_refuses_is_invalid_input(truth: Model) -> None:
    with pytest.raises(InvalidInput, match=r"measurements: expected shape \(40, 5\)"):
        _core.Problem(truth.core()).add_run(0.01, np.zeros((N, 2)), np.zeros((N, 4)))
    inputs = np.zeros((N, 2))
    inputs[7, 1] = np.nan
    with pytest.raises(InvalidInput, match=r"^lap, inputs: not finite at sample 7"):
        _core.Problem(truth.core()).add_run(0.01, inputs, np.zeros((N, 5)), 0.0, "lap")


def test_an_error_of_python_passes_the_border(truth: Model) -> None:
    with pytest.raises(TypeError):
        problem(truth).freeze("text", "text")  # type: ignore[arg-type]


def test_a_block_gives_failures_place_and_remedy_once() -> None:
    with (
        pytest.raises(NumericalError, match=r"^lap: Singular matrix; check the mass$") as caught,
        explained("outer", "another remedy"),
        explained("lap", lambda: "check the mass"),
    ):
        np.linalg.inv(np.zeros((2, 2)))
    assert caught.value.remedy == "check the mass"
    with pytest.raises(InvalidInput, match=r"^as it is$"), explained("lap", "no"):
        raise InvalidInput("as it is")


@pytest.mark.filterwarnings("ignore:dead. ay_mps2. constant:sysid_vehicle.SysidWarning")
def test_suspects_are_what_no_car_has_and_what_stands_still(truth: Model, lap: Log) -> None:
    assert "units and signs" in suspects(truth, [lap])
    heavy = Model(truth.vehicle.replace(cg_height_m=4.9))
    dead = Log.from_arrays(
        {c: lap[c] if c != "ay_mps2" else np.full(lap.n, 0.5) for c in lap.channels},
        name="dead",
        check=False,
    )
    told = suspects(heavy, [lap, dead])
    assert "cg_height_m = 4.9 (cars: 0 to 2.5)" in told
    assert "ay_mps2, which stays at 0.5 in dead" in told


def _strange(lap: Log, rng: np.random.Generator) -> Log:
    """A short piece of a log with one or two channels spoilt."""
    start = int(rng.integers(0, lap.n - 400))
    data = {c: lap[c][start : start + 400].copy() for c in lap.channels}
    data["time_s"] = np.arange(400) / lap.rate_hz
    for name in rng.choice([c for c in data if c != "time_s"], 2, replace=False):
        spoil = int(rng.integers(5))
        y = data[name]
        if spoil == 0:
            y[:] = y[0]
        elif spoil == 1:
            y *= 10.0 ** rng.uniform(-8, 8)
        elif spoil == 2:
            y[rng.integers(400)] = 10.0 ** rng.uniform(0, 200)
        elif spoil == 3:
            y[rng.integers(400) :] = np.nan
        else:
            y *= -1.0
    return Log.from_arrays(data, name="strange")


def _extreme(rng: np.random.Generator) -> sv.Vehicle:
    def between(low: float, high: float) -> float:
        return float(np.exp(rng.uniform(np.log(low), np.log(high))))

    mass, front, rear = between(1.0, 5e4), between(1e-3, 20.0), between(1e-3, 20.0)
    tyres = [
        sv.Tyre(
            between(1e-9, 200.0),
            between(1e-9, 4.0),
            between(1e-9, 5.0),
            float(rng.uniform(-50.0, 1.0)),
        )
        for _ in range(2)
    ]
    return sv.Vehicle(
        mass_kg=mass,
        lf_m=front,
        lr_m=rear,
        cg_height_m=float(rng.uniform(0.0, 5.0)),
        track_front_m=between(1e-9, 5.0),
        track_rear_m=between(1e-9, 5.0),
        drag_area_m2=between(1e-9, 50.0),
        brake_front_share=float(rng.uniform()),
        drive_front_share=float(rng.uniform()),
        tyre_front=tyres[0],
        tyre_rear=tyres[1],
        yaw_inertia_kgm2=mass * front * rear * between(0.11, 9.0) if rng.uniform() < 0.5 else None,
    )


def _failure(run: Callable[[], object]) -> NumericalError | None:
    try:
        run()
    except NumericalError as failure:
        return failure
    except SysidError:
        pass
    return None


@pytest.mark.filterwarnings("ignore::sysid_vehicle.SysidWarning")
@pytest.mark.parametrize("seed", range(40))
def test_extreme_cars_and_strange_logs_fail_in_the_open(seed: int, lap: Log, fit: Fit) -> None:
    rng = np.random.default_rng(seed)
    try:
        log = _strange(lap, rng)
    except InvalidInput:
        log = lap
    model = Model(_extreme(rng))
    for failure in (
        _failure(lambda: sv.compare(fit, log)),
        _failure(lambda: sv.compare(_with(fit, model), log)),
        _failure(lambda: sv.identify(model, log, starts=1)),
    ):
        if failure is not None:
            assert failure.remedy
            assert str(failure).startswith(log.name)


def _with(fit: Fit, model: Model) -> Fit:
    return sv.Fit(
        model,
        fit.noise,
        fit.estimates,
        as_float64(fit.covariance),
        fit.log_likelihood,
        fit.driving,
        (),
        True,
    )
