"""Several threads work with the same objects and get what one alone gets, to the last bit."""

import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from sysid_vehicle import Fit, Log, Model, Vehicle, compare, diagnose, drive, identify
from sysid_vehicle import manoeuvres as drives
from sysid_vehicle._common.threads import (
    Workers,
    at_most,
    before,
    check_time,
    cores,
    in_parallel,
    small_matrices,
)
from sysid_vehicle.estimate import Driving
from sysid_vehicle.online import SideslipObserver, estimate_sideslip

_THREADS = 4


def side_by_side(work: Callable[[], object], threads: int = _THREADS) -> list[object]:
    """Results of the same work, all begun at once."""
    begin = threading.Barrier(threads)

    def one() -> object:
        begin.wait()
        return work()

    with ThreadPoolExecutor(threads) as pool:
        return [future.result() for future in [pool.submit(one) for _ in range(threads)]]


@pytest.fixture(scope="module")
def short(truth: Model) -> Log:
    return drive(truth, drives.lap(8.0), seed=3)


def _identified(start: Model, log: Log, workers: int | None = 2) -> list[float]:
    fit = identify(start, log, starts=2, workers=workers)
    return [fit.log_likelihood, *(e.value for e in fit.estimates)]


def test_a_pool_has_all_cores_or_one_where_others_share_them() -> None:
    def inside(workers: int | None) -> int:
        with Workers(workers) as pool:
            return pool._max_workers

    assert inside(None) == cores() >= 1
    assert in_parallel(inside, [None, 3], workers=2) == [1, 3]
    with at_most(1):
        assert inside(None) == 1
        with at_most(None):
            assert inside(None) == 1
        with at_most(3):
            assert inside(None) == 3
    assert inside(None) == cores()


def _of_linear_algebra() -> set[int]:
    return {one["num_threads"] for one in threadpool_info() if one["user_api"] == "blas"}


def test_linear_algebra_has_one_thread_until_the_last_one_leaves() -> None:
    def inside() -> set[int]:
        with small_matrices:
            return _of_linear_algebra()

    with threadpool_limits(2, user_api="blas"), ThreadPoolExecutor(1) as pool:
        assert _of_linear_algebra() == {2}
        with small_matrices:
            assert inside() == {1}
            assert pool.submit(inside).result() == {1}
            assert _of_linear_algebra() == {1}
        assert _of_linear_algebra() == {2}
        # Each thread has a say, also where another one set the number before it.
        assert pool.submit(inside).result() == {1}
        assert _of_linear_algebra() == {2}
        pool.submit(small_matrices.__enter__).result()
        with small_matrices:
            pool.submit(small_matrices.__exit__).result()
            assert _of_linear_algebra() == {1}
        assert _of_linear_algebra() == {2}
    with threadpool_limits(3, user_api="blas"):
        assert _of_linear_algebra() == {3}


def test_a_public_function_holds_all_its_threads_to_what_was_said(
    fit: Fit, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Those of the scores too, which are told no number of their own."""
    opened: list[int] = []
    plain = ThreadPoolExecutor.__init__

    def noted(self: ThreadPoolExecutor, count: int, **kwargs: object) -> None:
        opened.append(count)
        assert {one["num_threads"] for one in threadpool_info() if "blas" in one["user_api"]} == {1}
        plain(self, count, **kwargs)  # type: ignore[arg-type]

    monkeypatch.setattr(ThreadPoolExecutor, "__init__", noted)
    for workers in (1, 3):
        opened.clear()
        diagnose(fit, candidates=["mass", "steer_lag"], refits=0, workers=workers)
        assert set(opened) == {workers}


def test_parallel_results_stand_in_order_and_the_first_error_is_raised() -> None:
    assert in_parallel(lambda x: x * x, range(50), workers=4) == [x * x for x in range(50)]
    with pytest.raises(ZeroDivisionError):
        in_parallel(lambda x: 1 / x, [1, 0, 2], workers=2)


def test_an_idle_thread_of_a_pool_helps_one_that_asks_for_several() -> None:
    both = threading.Barrier(2, timeout=10.0)  # breaks where one thread does all

    def met(_: int) -> int:
        both.wait()
        return threading.get_ident()

    def inside(mapped: bool) -> set[int]:
        if not mapped:
            return set(in_parallel(met, range(2)))
        with Workers() as pool:
            return set(pool.map(met, range(2)))

    for mapped in (False, True):
        (found,) = in_parallel(inside, [mapped], workers=2)
        assert len(found) == 2


def test_calls_stand_in_each_other_however_deep() -> None:
    def sums(depth: int) -> int:
        return 1 if depth == 0 else sum(in_parallel(sums, [depth - 1] * 3))

    for workers in (1, 2, 5):
        assert in_parallel(sums, [5, 4], workers=workers) == [3**5, 3**4]


def test_a_helper_raises_the_first_error_and_keeps_to_the_time_of_who_asked() -> None:
    def failing(_: object) -> list[float]:
        return in_parallel(lambda x: 1 / x, [1, 0, 2, 0])

    with pytest.raises(ZeroDivisionError):
        in_parallel(failing, [None], workers=2)

    def endless(_: int) -> None:
        while True:
            check_time()

    def asked(_: object) -> str:
        return before(time.perf_counter() + 0.05, lambda: str(in_parallel(endless, range(2))), "")

    def unhurried(_: object) -> bool:
        check_time()
        return True

    with Workers(2) as pool:
        assert list(pool.map(asked, range(2))) == ["", ""]
        assert all(pool.map(unhurried, range(4)))  # no thread is left with the time of another


def test_any_number_of_threads_gives_the_same(start: Model, short: Log, fit: Fit) -> None:
    def found(workers: int | None) -> list[object]:
        ranking = diagnose(fit, short, candidates=["mass", "steer_lag"], workers=workers).ranking
        scored = [(c.id, c.statistic, c.value, c.std) for c in ranking]
        return [*_identified(start, short, workers), *scored]

    alone = found(1)
    assert found(None) == alone
    assert found(3) == alone


def test_identify(start: Model, short: Log) -> None:
    alone = _identified(start, short)
    assert all(found == alone for found in side_by_side(lambda: _identified(start, short)))


def test_simulate(truth: Model) -> None:
    manoeuvre = drives.double_lane_change()
    alone = drive(truth, manoeuvre, seed=4)
    for found in side_by_side(lambda: drive(truth, manoeuvre, seed=4)):
        assert isinstance(found, Log)
        for channel in alone.channels:
            np.testing.assert_array_equal(found[channel], alone[channel])


def test_filter(start: Model, short: Log, fit: Fit) -> None:
    driving = Driving.of(short)  # its arrays are made when they are first asked for
    problem = driving.problem(start)
    p, noise = start.vector(), fit.noise.vector()
    alone = problem.trace(p, noise, True)
    for found in side_by_side(lambda: problem.trace(p, noise, True)):
        assert isinstance(found, dict)
        np.testing.assert_array_equal(found["state"], alone["state"])
        assert found["log_likelihood"] == alone["log_likelihood"]


def test_what_is_made_when_it_is_first_asked_for(start: Model, short: Log) -> None:
    driving = Driving.of(short)
    alone = Driving.of(short).measured
    for found in side_by_side(lambda: driving.measured):
        np.testing.assert_array_equal(found, alone)


def test_compare_and_score(fit: Fit, course: Log) -> None:
    alone = str(compare(fit, course))
    assert all(found == alone for found in side_by_side(lambda: str(compare(fit, course))))

    def scored() -> list[tuple[str, float]]:
        return [(c.id, c.statistic) for c in diagnose(fit, course, refits=0).ranking]

    one = scored()
    assert all(found == one for found in side_by_side(scored))


def test_sideslip_observers_of_the_same_car(car: Vehicle, short: Log) -> None:
    alone = estimate_sideslip(car, short).beta_rad
    for found in side_by_side(lambda: estimate_sideslip(car, short).beta_rad):
        np.testing.assert_array_equal(found, alone)


def test_copies_of_an_observer(car: Vehicle, short: Log) -> None:
    sensors = np.column_stack(
        [short[c] for c in ("steer_rad", "vx_mps", "yaw_rate_radps", "ax_mps2", "ay_mps2")]
    )
    dt = np.full(short.n, 1.0 / short.rate_hz)
    observer = SideslipObserver(car)
    alone = observer.copy().run(dt, sensors)
    for found in side_by_side(lambda: observer.copy().run(dt, sensors)):
        np.testing.assert_array_equal(found, alone)
