"""Ctrl-C ends a kernel in the middle, in the main thread and in those that it waits for."""

import json
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

import sysid_vehicle as sv
from sysid_vehicle import _core
from sysid_vehicle._common.threads import Workers

# Each piece of work takes more than 20 s of processor time; a signal comes after 0.3 s. A child
# process runs it: a signal that came too late would end the tests.
_CHILD = """
import json, os, signal, threading, time
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background jobs ignore it
import numpy as np
import sysid_vehicle as sv
from sysid_vehicle import lab, online, twin

t = 0.01 * np.arange(400_000)
rng = np.random.default_rng(1)
steer, noise = 0.02 * np.sin(1.5 * t), rng.standard_normal((len(t), 4))
car = sv.example_vehicle()

def learn():
    readings = np.column_stack([15 + 0 * t, 0.3 * steer, 5 * steer, 70 * steer]) + 0.05 * noise
    record = lab.ObserverRecord.from_arrays(
        rate_hz=100.0, force_x_n=0 * t, steer_rad=steer,
        stiffness_front_nprad=8e4, stiffness_rear_nprad=9e4, readings=readings)
    body = lab.ObserverCar.of(car)
    observer = lab.Observer(body, lab.ObserverNoise.first_guess(record, body))
    return lambda: lab.learn_observer_noise(observer, record)

def identify():
    log = sv.drive(sv.Model(car), sv.manoeuvres.lap(60.0), seed=1)
    begin = sv.Model(car.replace(tyre_front=sv.Tyre(), tyre_rear=sv.Tyre()))
    return lambda: sv.identify(begin, log, starts=5000, workers=2)

def observe():
    sensors = np.column_stack([steer, 20 + 0 * t, 5 * steer, 0 * t, 70 * steer])
    sensors[:, 1:] += 0.01 * noise
    observer = online.SideslipObserver(car)
    return lambda: observer.run(np.full(len(t), 0.01), sensors)

for prepare in (learn, identify, observe):
    work, sent = prepare(), []
    def send():
        sent.append(time.process_time())
        os.kill(os.getpid(), signal.SIGINT)
    timer = threading.Timer(0.3, send)
    timer.start()
    try:
        work()
        took = "it was done before the signal"
    except KeyboardInterrupt:
        took = time.process_time() - sent[0]
    timer.cancel()
    print(json.dumps([prepare.__name__, took]), flush=True)
"""


def test_an_interrupt_ends_a_kernel_long_before_its_work_is_done() -> None:
    child = subprocess.run(
        [sys.executable, "-c", _CHILD], capture_output=True, text=True, timeout=300, check=False
    )
    assert child.returncode == 0, child.stderr
    took = dict(json.loads(line) for line in child.stdout.splitlines())
    assert set(took) == {"learn", "identify", "observe"}
    for name, seconds in took.items():
        assert isinstance(seconds, float), f"{name}: {seconds}"
        assert seconds < 5.0, f"{name}: {seconds:.2f} s of processor time after the signal"


@pytest.mark.manual
def test_a_study_that_is_interrupted_keeps_its_steps(
    truth: sv.Model,
) -> None:
    values = {"tyre_load_sensitivity.sensitivity": 0.3}
    loaded = truth.add("tyre_load_sensitivity").with_values(values)
    courses = sv.manoeuvres.lap(30.0), sv.manoeuvres.handling_course(30.0)
    logs = [sv.drive(loaded, course, seed=1, rate_hz=50.0) for course in courses]

    def press(text: str) -> None:
        if text.startswith("Added"):
            raise KeyboardInterrupt

    with pytest.raises(sv.Interrupted, match="tyre_load_sensitivity: sensitivity 0") as caught:
        sv.improve(
            sv.Model(truth.vehicle),
            *logs,
            candidates=["tyre_load_sensitivity", "steer_lag"],
            starts=2,
            tell=press,
        )
    assert [f.model.effects for f in caught.value.fits] == [(), ("tyre_load_sensitivity",)]


def _runs(count: int) -> None:
    for _ in range(count):
        _long_observer_run()


def _long_observer_run() -> None:
    n = 500_000
    rls = _core.CorneringRls(1500.0, 2500.0, 1.2, 1.4, 0.998, 1e5, 0.1, 0.1, 0.035, 0.0, 8e4, 9e4)
    rls.run(np.random.default_rng(0).uniform(-0.01, 0.01, (n, 4)))


@pytest.mark.skipif(
    threading.current_thread() is not threading.main_thread(), reason="signals need it"
)
def test_a_handler_of_the_callers_own_is_heard_in_a_kernel() -> None:
    class Enough(Exception):
        pass

    def give_up(*_: object) -> None:
        raise Enough

    before = signal.signal(signal.SIGALRM, give_up)
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.1)
        with pytest.raises(Enough):
            _runs(100)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def test_an_error_in_one_thread_ends_the_kernels_of_the_others() -> None:
    ended: list[BaseException] = []

    def forever() -> None:
        try:
            _runs(10_000)
        except BaseException as error:
            ended.append(error)
            raise

    def work() -> None:
        with Workers(2) as pool:
            for _ in range(3):  # the third never begins
                pool.submit(forever)
            time.sleep(0.2)
            raise ValueError("wrong")

    began = time.monotonic()
    with pytest.raises(ValueError, match="wrong"):
        work()
    assert time.monotonic() - began < 5.0
    assert len(ended) == 2
    assert all(isinstance(error, KeyboardInterrupt) for error in ended)


def test_a_pool_in_a_pool_ends_with_the_outer_one() -> None:
    ended: list[str] = []

    def inner() -> None:
        def forever() -> None:
            try:
                _runs(10_000)
            except KeyboardInterrupt:
                ended.append("inner")
                raise

        with Workers(1) as pool:
            pool.submit(forever).result()

    def outer() -> None:
        with Workers(1) as pool:
            pool.submit(inner)
            time.sleep(0.3)
            raise ValueError("wrong")

    with pytest.raises(ValueError, match="wrong"):
        outer()
    assert ended == ["inner"]


def test_without_an_error_a_pool_finishes_its_work() -> None:
    with Workers(2) as pool:
        found = list(pool.map(lambda x: x * x, range(20)))
    assert found == [x * x for x in range(20)]
