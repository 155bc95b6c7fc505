"""What all Python tests share."""

import os
import sys
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import settings

from sysid_vehicle import Fit, Log, Model, Tyre, Vehicle, drive, example_vehicle, identify
from sysid_vehicle import manoeuvres as drives

os.environ["MPLBACKEND"] = "Agg"  # before anything imports pyplot: tests open no window

# The same examples at each run, and no clock in the verdict: machines differ in speed.
settings.register_profile("repeatable", derandomize=True, deadline=None, print_blob=False)
# For hours rather than seconds, and other examples each time: `--hypothesis-profile=long`.
settings.register_profile("long", deadline=None, max_examples=20_000, print_blob=True)
settings.load_profile("repeatable")

REPO = Path(__file__).resolve().parents[2]
RATE_HZ = 50.0  # of the drives that many tests share: what is done with them takes half as long

# Those that take longest come first. Without these files, `-m "not slow"`, the tests take less than
# a minute on two cores.
SLOW = (Path(__file__).parent / "slow_files.txt").read_text("utf-8").split()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark what stands in a slow file, or takes too long for continuous integration.

    Slow files come first: of several processes none has one left when the others are done.
    """
    for item in items:
        if item.path.name in SLOW or item.get_closest_marker("manual"):
            item.add_marker(pytest.mark.slow)
    place = {name: i for i, name in enumerate(SLOW)}
    items.sort(key=lambda item: place.get(item.path.name, len(SLOW)))


@pytest.fixture(autouse=True)
def _figures_closed() -> Iterator[None]:
    yield
    if "matplotlib.pyplot" in sys.modules:
        sys.modules["matplotlib.pyplot"].close("all")


@pytest.fixture(scope="session")
def repo() -> Path:
    """Root folder of the repository."""
    return REPO


@pytest.fixture(scope="module")
def program(request: pytest.FixtureRequest) -> Iterator[SimpleNamespace]:
    """The modules of a benchmark, which is a program and no package: `BENCHMARK` of the file."""
    folder, *modules = request.module.BENCHMARK
    path = str(REPO / "benchmarks" / folder)
    sys.path.insert(0, path)
    try:
        yield SimpleNamespace(**{name: __import__(name) for name in modules})
    finally:
        sys.path.remove(path)
        for name in modules:
            sys.modules.pop(name, None)


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder with driving logs made by others; they are not part of the repository."""
    folder = REPO.parent / "shared" / "data"
    if not folder.is_dir():
        pytest.skip(f"the driving logs are not at {folder}")
    return folder


@pytest.fixture
def rng() -> np.random.Generator:
    """Random numbers, the same at each run."""
    return np.random.default_rng(1)


@pytest.fixture(scope="session")
def car() -> Vehicle:
    """The car that is driven."""
    return example_vehicle()


@pytest.fixture(scope="session")
def truth(car: Vehicle) -> Model:
    """The model that is driven, complete without effects."""
    return Model(car)


@pytest.fixture(scope="session")
def start(car: Vehicle) -> Model:
    """The baseline of somebody who does not know the tyres."""
    return Model(car.replace(tyre_front=Tyre(), tyre_rear=Tyre()))


@pytest.fixture(scope="session")
def lap(truth: Model) -> Log:
    """Driving to fit to."""
    return drive(truth, drives.lap(40.0), seed=1, rate_hz=RATE_HZ)


@pytest.fixture(scope="session")
def course(truth: Model) -> Log:
    """Other driving of the same car."""
    course = drives.handling_course(30.0, lateral_mps2=7.5)
    return drive(truth, course, seed=2, rate_hz=RATE_HZ)


@pytest.fixture(scope="session")
def fine_lap(truth: Model) -> Log:
    """The lap at 100 Hz, for what so many samples show."""
    return drive(truth, drives.lap(40.0), seed=1)


@pytest.fixture(scope="session")
def fine_course(truth: Model) -> Log:
    """The other driving at 100 Hz."""
    return drive(truth, drives.handling_course(30.0, lateral_mps2=7.5), seed=2)


@pytest.fixture(scope="session")
def fine_fit(start: Model, fine_lap: Log) -> Fit:
    """The complete model fitted to the lap at 100 Hz."""
    return identify(start, fine_lap, starts=3)


@pytest.fixture(scope="session")
def fit(start: Model, lap: Log) -> Fit:
    """The complete model fitted to the lap."""
    return identify(start, lap, starts=3)


@pytest.fixture(scope="session")
def complete_fits(truth: Model, start: Model) -> tuple[Fit, ...]:
    """Fits of the complete model to drives that differ in their noise alone."""
    logs = [drive(truth, drives.lap(30.0), seed=s, rate_hz=RATE_HZ) for s in (11, 12, 13, 14)]
    return tuple(identify(start, log, starts=1) for log in logs)


@pytest.fixture(scope="session")
def hidden_fit(truth: Model, start: Model) -> Callable[..., Fit]:
    """Give the baseline fitted to a drive of a car with a parameter of an effect, by full name."""

    @cache
    def fitted(name: str, value: float, rate_hz: float = RATE_HZ) -> Fit:
        car = truth.add(name.split(".")[0]).with_values({name: value})
        log = drive(car, drives.lap(40.0), seed=5, rate_hz=rate_hz)
        return identify(start, log, starts=1)

    return fitted


@pytest.fixture(scope="session")
def double_lane_change(shared_data: Path) -> tuple[Vehicle, Log]:
    """A measured car (BMW M8) and its log, the steering on the clock of the motion."""
    vehicle = REPO / "benchmarks" / "real_driving" / "bmw_m8_roadview.vehicle.toml"
    motion, inputs = (
        np.genfromtxt(
            shared_data / "bmw_m8_roadview" / f"m8_double_lane_change_{part}.csv",
            delimiter=",",
            names=True,
        )
        for part in ("car_100Hz", "inputs_1kHz")
    )
    time = motion["car_time"]
    steer = np.interp(time, inputs["time"], inputs["steering"]) * 20.0 / 14.3
    names = ("Velocity_X", "Velocity_Y", "Yaw_Velocity", "Acceleration_X", "Acceleration_Y")
    channels = ("vx_mps", "vy_mps", "yaw_rate_radps", "ax_mps2", "ay_mps2")
    read = {c: motion[n] for c, n in zip(channels, names, strict=True)}
    log = Log.from_arrays({"time_s": time, "steer_rad": steer, **read}).between(5.0, 13.1)
    return Vehicle.from_toml(vehicle), log


@pytest.fixture(scope="session")
def altered() -> Callable[..., Log]:
    """Make a log without some channels (`without`) and with some replaced, by name."""

    def make(log: Log, without: Sequence[str] = (), **columns: np.ndarray) -> Log:
        data = {c: log[c] for c in log.channels if c not in without}
        return Log.from_arrays({**data, **columns}, name=log.name, check=False)

    return make
