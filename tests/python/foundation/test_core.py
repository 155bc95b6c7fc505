"""The boundary of the compiled core: what it refuses, and that it runs beside Python."""

import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

from sysid_vehicle import Driving, Fit, Log, Model, _core, catalogue
from sysid_vehicle._common.arrays import as_float64
from sysid_vehicle.errors import NumericalError
from sysid_vehicle.identify import objective_of

N = 50


@pytest.fixture(scope="module")
def driving(lap: Log) -> Driving:
    return Driving.of(lap.between(0.0, 10.0))


@pytest.fixture
def problem(truth: Model) -> _core.Problem:
    found = _core.Problem(truth.core())
    found.add_run(0.01, np.zeros((N, 2)), np.tile([20.0, 0.0, 0.0, 0.0, 0.0], (N, 1)))
    return found


@pytest.mark.parametrize(
    ("inputs", "measurements", "message"),
    [
        (np.zeros((N, 1)), np.zeros((N, 5)), r"inputs: expected shape \(50, 2\)"),
        (np.zeros((N, 11)), np.zeros((N, 5)), r"inputs: expected shape \(50, 10\)"),
        (np.zeros((N, 2)), np.zeros((N, 4)), r"measurements: expected shape \(50, 5\)"),
        (np.zeros((N, 2)), np.zeros((N - 1, 5)), r"measurements: expected shape \(50, 5\)"),
        (np.zeros(2 * N), np.zeros((N, 5)), "inputs: expected shape"),
        (np.zeros((1, 2)), np.zeros((1, 5)), "inputs: expected two samples or more"),
    ],
)
def test_wrong_shapes_of_a_run_are_refused(
    inputs: np.ndarray, measurements: np.ndarray, message: str, problem: _core.Problem
) -> None:
    with pytest.raises(ValueError, match=message):
        problem.add_run(0.01, inputs, measurements)
    assert problem.samples == N


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("column", [0, 1])
def test_an_input_that_is_no_number_is_named(
    bad: float, column: int, problem: _core.Problem
) -> None:
    inputs = np.zeros((N, 2))
    inputs[17, column] = bad
    with pytest.raises(ValueError, match="inputs: not finite at sample 17"):
        problem.add_run(0.01, inputs, np.zeros((N, 5)))


def test_wrong_sizes_of_vectors_are_refused(problem: _core.Problem, fit: Fit) -> None:
    p, noise = fit.model.vector(), fit.noise.vector()
    expected = f"parameters: expected {_core.PARAMETERS} values, got {_core.PARAMETERS - 1}"
    with pytest.raises(ValueError, match=expected):
        problem.freeze(p[:-1], noise)
    with pytest.raises(ValueError, match=f"noise: expected {_core.NOISE_PARAMETERS} values"):
        problem.freeze(p, np.append(noise, 1.0))
    with pytest.raises(ValueError, match="motion: expected 3 values, got 2"):
        fit.model.core().evaluate(p, np.zeros(2), 0.0, 0.0)
    frozen = problem.freeze(p, noise)
    with pytest.raises(ValueError, match=r"signals: expected shape \(50, 1\)"):
        problem.signal_sensitivities(p, frozen, np.zeros((N - 1, 1)), [0])


def test_sets_of_parameters_have_the_likelihoods_of_each(fit: Fit) -> None:
    model = fit.model.with_priors({"D_front": (1.0, 0.1)})
    objective = objective_of(model, fit.driving.problem(model), fit.driving)
    noise = fit.noise.vector()
    sets = np.tile(model.vector(), (6, 1))
    sets[:, 2] *= np.linspace(0.95, 1.05, 6)
    each = [objective.log_likelihood(p, noise) for p in sets]
    # Terms of either sign add up to less than they are.
    room = 1e-12 * float(np.abs(each).max())
    np.testing.assert_allclose(objective.log_likelihoods(sets, noise), each, rtol=0.0, atol=room)
    with pytest.raises(ValueError, match="parameters: expected shape"):
        objective.problem.log_likelihoods(sets[:, :-1], noise)  # type: ignore[attr-defined]


def test_sets_with_delays_of_their_own_go_through_the_filter_together(
    fit: Fit, driving: Driving
) -> None:
    """Each lane has the steering of its own delay: derivatives by it are asked in every climb."""
    model = fit.model.add("steer_delay").with_values({"steer_delay.delay_s": 0.02})
    problem, noise = driving.problem(model), fit.noise.vector()
    sets = np.tile(model.vector(), (6, 1))
    sets[:, model.parameters["steer_delay.delay_s"].column] += [0.0, 0.0, 0.01, -0.01, 0.01, 0.005]
    sets[:, 2] *= np.linspace(0.95, 1.05, 6)
    each = np.array([problem.freeze(p, noise).log_likelihood for p in sets])
    together = problem.log_likelihoods(sets, noise)
    np.testing.assert_allclose(together, each, rtol=1e-11)
    assert np.any(together != each)  # other roundings: one after the other they are the same


@pytest.mark.parametrize(
    "effects",
    [
        ("steer_lag",),
        ("tyre_relaxation", "steer_lag"),
        ("sensor_delay",),
        ("sensor_delay", "tyre_relaxation", "steer_lag"),
        ("sensor_delay", "tyre_relaxation", "steer_lag", "force_lag", "body_roll"),
    ],
)
def test_one_filter_has_room_for_the_states_that_lanes_have(
    effects: tuple[str, ...], fit: Fit, driving: Driving
) -> None:
    """Filters of one set are compiled for some numbers of states, those in lanes have any."""
    model = fit.model.add(*effects)
    lags = {e.id: e for e in model.parts if e.id in effects}
    model = model.with_values(
        {f"{e}.{p.name}": p.typical for e, part in lags.items() for p in part.parameters}
    )
    problem, p = driving.problem(model), model.vector()
    road = replace(fit.noise, road=(0.1, 0.2))
    for noise in (road, replace(road, colour=(0.002, 0.1, 0.1))):
        one = problem.freeze(p, noise.vector()).log_likelihood
        lanes = problem.log_likelihoods(np.tile(p, (4, 1)), noise.vector())
        np.testing.assert_allclose(lanes, one, rtol=1e-9)


@pytest.mark.parametrize("column", [-1, _core.PARAMETERS])
def test_a_parameter_that_is_not_there_is_refused(
    column: int, problem: _core.Problem, fit: Fit
) -> None:
    p = fit.model.vector()
    frozen = problem.freeze(p, fit.noise.vector())
    with pytest.raises(ValueError, match=f"columns: there is no {column}"):
        problem.sensitivities(p, frozen, [0, column])
    with pytest.raises(ValueError, match=f"columns: there is no {column}"):
        problem.normal_equations(p, frozen, [column])


@pytest.mark.parametrize("dt", [0.0, -0.01, np.nan, np.inf])
def test_an_interval_that_is_none_is_refused(dt: float, problem: _core.Problem) -> None:
    with pytest.raises(ValueError, match="dt: the step must be positive and finite"):
        problem.add_run(dt, np.zeros((N, 2)), np.zeros((N, 5)))


def test_a_missing_measurement_is_fine_an_infinite_one_is_not(problem: _core.Problem) -> None:
    measurements = np.zeros((N, 5))
    measurements[3, 1] = np.nan
    problem.add_run(0.01, np.zeros((N, 2)), measurements)
    measurements[5, 2] = np.inf
    with pytest.raises(ValueError, match="measurements: infinite at sample 5"):
        problem.add_run(0.01, np.zeros((N, 2)), measurements)
    assert problem.samples == 2 * N


def test_a_filter_of_other_runs_is_refused(problem: _core.Problem, fit: Fit) -> None:
    p = fit.model.vector()
    frozen = problem.freeze(p, fit.noise.vector())
    longer = _core.Problem(fit.model.core())
    longer.add_run(0.01, np.zeros((2 * N, 2)), np.tile([20.0, 0.0, 0.0, 0.0, 0.0], (2 * N, 1)))
    uses = [
        lambda: longer.residuals(p, frozen),
        lambda: longer.half_sum_of_squares(p, frozen),
        lambda: longer.sensitivities(p, frozen, [0]),
        lambda: longer.normal_equations(p, frozen, [0]),
        lambda: longer.signal_sensitivities(p, frozen, np.zeros((2 * N, 1)), [0]),
    ]
    for use in uses:
        with pytest.raises(ValueError, match="filter: was made from other runs"):
            use()


@pytest.mark.parametrize("target", [-1, _core.EXTERNALS + _core.CHANNELS])
def test_a_target_that_is_not_there_is_refused(
    target: int, problem: _core.Problem, fit: Fit
) -> None:
    p = fit.model.vector()
    frozen = problem.freeze(p, fit.noise.vector())
    with pytest.raises(ValueError, match=f"targets: there is no {target}"):
        problem.signal_sensitivities(p, frozen, np.zeros((N, 1)), [target])


def test_effects_that_are_not_there_are_refused() -> None:
    with pytest.raises(ValueError, match="effects: the mask names effects there are none of"):
        _core.SingleTrack(_core.VehicleData(), 1 << len(catalogue()), True)


@pytest.mark.parametrize(
    ("name", "shortest"),
    [
        ("steer_lag.time_constant_s", 1e-6),
        ("tyre_relaxation.relaxation_length_m", 1e-5),
        ("front_tyre_relaxation.relaxation_length_m", 1e-5),
        ("rear_tyre_relaxation.relaxation_length_m", 1e-5),
        ("force_lag.time_constant_s", 1e-6),
    ],
)
def test_a_lag_too_short_to_resolve_acts_like_none(
    name: str, shortest: float, fit: Fit, driving: Driving
) -> None:
    def log_density(model: Model) -> np.ndarray:
        trace = driving.problem(model).trace(model.vector(), fit.noise.vector(), False)
        each = trace["log_density"] - 0.5 * np.sum(trace["whitened"] ** 2, axis=1)
        return each[5:]  # before that the filter has yet to learn where the lagging state stands

    lagging = fit.model.add(name.split(".")[0]).with_values({name: shortest})
    assert log_density(lagging).sum() == pytest.approx(log_density(fit.model).sum(), abs=0.5)


def test_a_simulation_needs_matching_arrays(truth: Model) -> None:
    core, p, driver = truth.core(), truth.vector(), _core.Driver()
    wanted = np.tile([20.0, 0.0, 0.0], (N, 1))
    with pytest.raises(ValueError, match=r"disturbance: expected shape \(50, 3\)"):
        _core.simulate(core, p, 0.01, wanted, driver, np.zeros((N - 1, 3)), 20.0)
    with pytest.raises(ValueError, match="references: expected two samples or more"):
        _core.simulate(core, p, 0.01, wanted[:1], driver, np.zeros((1, 3)), 20.0)
    inputs, states, outputs, lost_at = _core.simulate(
        core, p, 0.01, wanted, driver, np.zeros((N, 3)), 20.0
    )
    assert (len(inputs), len(states), len(outputs), lost_at) == (N, N, N, N)


def test_parameters_that_are_no_numbers_fail_with_the_sample(
    problem: _core.Problem, fit: Fit
) -> None:
    with pytest.raises(NumericalError, match="at sample 0"):
        problem.freeze(np.full(_core.PARAMETERS, np.nan), fit.noise.vector())
    assert issubclass(NumericalError, ArithmeticError)


def test_only_numbers_are_taken(problem: _core.Problem) -> None:
    with pytest.raises(TypeError):
        problem.add_run(0.01, np.zeros((N, 2), dtype=complex), np.zeros((N, 5)))  # type: ignore[arg-type]
    with pytest.raises(TypeError):
        _core.FrozenFilter()
    with pytest.raises(TypeError):
        _core.SingleTrack(_core.VehicleData(), -1, True)


@pytest.mark.parametrize(
    "layout",
    [
        np.asfortranarray,
        lambda a: np.repeat(a, 2, axis=0)[::2],
        lambda a: np.hstack([a, a])[:, : a.shape[1]],
        lambda a: a[::-1].copy()[::-1],
    ],
    ids=["fortran", "every second row", "left columns", "backwards"],
)
def test_another_memory_layout_is_never_misread(
    layout: Callable[[np.ndarray], np.ndarray], driving: Driving, fit: Fit
) -> None:
    log = driving.logs[0]
    inputs = as_float64(np.column_stack([log["steer_rad"], log["fx_n"]]))
    p, noise = fit.model.vector(), fit.noise.vector()
    values = []
    for u, y in ((inputs, driving.measured), (layout(inputs), layout(driving.measured))):
        run = _core.Problem(fit.model.core())
        run.add_run(0.01, as_float64(u), as_float64(y))
        values.append(run.freeze(p, noise).log_likelihood)
    assert values[0] == values[1]
    raw = _core.Problem(fit.model.core())
    try:
        raw.add_run(0.01, layout(inputs), layout(driving.measured))
    except TypeError:
        return
    assert raw.freeze(p, noise).log_likelihood == values[0]


def test_single_precision_is_converted_once_on_the_python_side() -> None:
    values = np.linspace(0.0, 1.0, 7)
    assert as_float64(values) is values
    single = as_float64(values.astype(np.float32))
    assert single.dtype == np.float64
    np.testing.assert_allclose(single, values, atol=1e-7)
    strided = as_float64(np.arange(10.0)[::2])
    assert strided.flags.c_contiguous
    assert strided.tolist() == [0.0, 2.0, 4.0, 6.0, 8.0]


def test_threads_get_the_same_answers_as_one_after_the_other(driving: Driving, fit: Fit) -> None:
    problem, noise = driving.problem(fit.model), fit.noise.vector()
    parameters = []
    for k in range(8):
        p = fit.model.vector()
        p[0] *= 1.0 + 0.01 * k
        parameters.append(p)
    columns = list(range(8))

    def work(p: np.ndarray) -> tuple[float, bytes, bytes]:
        frozen = problem.freeze(p, noise)
        cost, gradient, information = problem.normal_equations(p, frozen, columns)
        return cost, gradient.tobytes(), information.tobytes()

    alone = [work(p) for p in parameters]
    with ThreadPoolExecutor(4) as pool:
        together = list(pool.map(work, parameters))
    assert together == alone
    assert len(set(alone)) == 8


def test_python_runs_while_a_kernel_runs(driving: Driving, fit: Fit) -> None:
    problem = driving.problem(fit.model)
    p, noise = fit.model.vector(), fit.noise.vector()
    enough = threading.Event()
    spans, ticks = [], []

    def kernel() -> None:
        for _ in range(500):
            began = time.perf_counter()
            problem.look_ahead(p, noise, [(400, 1)])
            spans.append((began, time.perf_counter()))
            if enough.is_set():
                return

    thread = threading.Thread(target=kernel)
    thread.start()
    while thread.is_alive():
        ticks.append(time.perf_counter())
        time.sleep(1e-3)
        if len(ticks) >= 40:
            enough.set()
    thread.join()
    # With the interpreter locked, one tick at most would come between a look at the clock and the
    # kernel's return.
    inside = [sum(began < t < ended for t in ticks) for began, ended in spans]
    assert sum(max(n - 1, 0) for n in inside) >= 10


def test_the_answer_does_not_depend_on_the_order_of_runs(lap: Log, fit: Fit) -> None:
    a, b = lap.between(0.0, 8.0), lap.between(20.0, 28.0)
    p, noise = fit.model.vector(), fit.noise.vector()
    there = Driving.of([a, b]).problem(fit.model)
    back = Driving.of([b, a]).problem(fit.model)
    e, f = (x.residuals(p, x.freeze(p, noise)) for x in (there, back))
    assert np.array_equal(e[: a.n], f[b.n :])
    assert np.array_equal(e[a.n :], f[: b.n])
