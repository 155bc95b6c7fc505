"""The extended-state observer, its smoother and the noise it learns."""

import argparse
import dataclasses
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from sysid_vehicle import InvalidInput, Model, NumericalError, Vehicle, drive, manoeuvres, published
from sysid_vehicle.cli import lab_logs
from sysid_vehicle.cli.outputs import refuse_outputs
from sysid_vehicle.cli.parser import parse
from sysid_vehicle.lab import (
    EMResult,
    NoiseStructure,
    Observer,
    ObserverCar,
    ObserverNoise,
    ObserverRecord,
    learn_observer_noise,
)

CAR = ObserverCar(mass_kg=780.0, yaw_inertia_kgm2=1000.0, lf_m=1.4, lr_m=1.6, drag_nspm=0.3)
SENSOR_STD = np.array([0.05, 0.01, 0.003, 0.02])


def simulate(rng: np.random.Generator, n: int = 3000, side_force_n: float = 600.0) -> dict:
    """Drive a linear single-track car, fine Euler steps, with an unknown constant side force."""
    dt, fine = 0.01, 20
    t = dt * np.arange(n)
    steer = 0.02 * np.sin(1.5 * t) + 0.01 * np.sin(5.0 * t)
    force = 800.0 * np.cos(0.4 * t)
    front, rear = 90e3, 100e3
    vx, vy, r = 15.0, 0.0, 0.0
    truth = np.zeros((n, 4))
    for k in range(n):
        for part in range(fine):
            fy_front = front * (steer[k] - (vy + CAR.lf_m * r) / vx)
            fy_rear = -rear * (vy - CAR.lr_m * r) / vx
            ay = (fy_front + fy_rear + side_force_n) / CAR.mass_kg
            if part == 0:
                truth[k] = vx, vy, r, ay
            ax = (force[k] - CAR.drag_nspm * vx) / CAR.mass_kg
            yaw = (CAR.lf_m * fy_front - CAR.lr_m * fy_rear) / CAR.yaw_inertia_kgm2
            h = dt / fine
            vx, vy, r = vx + h * (ax + vy * r), vy + h * (ay - vx * r), r + h * yaw
    return {
        "arrays": {
            "rate_hz": 1.0 / dt,
            "force_x_n": force,
            "steer_rad": steer,
            "stiffness_front_nprad": front,
            "stiffness_rear_nprad": rear,
            "readings": truth + SENSOR_STD * rng.standard_normal((n, 4)),
        },
        "truth": truth,
    }


@pytest.fixture(scope="module")
def driven() -> dict:
    return simulate(np.random.default_rng(3))


@pytest.fixture(scope="module")
def record(driven: dict) -> ObserverRecord:
    return ObserverRecord.from_arrays(**driven["arrays"], name="drive")


@pytest.fixture(scope="module")
def observer(record: ObserverRecord) -> Observer:
    return Observer(CAR, ObserverNoise.first_guess(record, CAR))


@pytest.fixture(scope="module")
def learned(observer: Observer, record: ObserverRecord) -> EMResult:
    return learn_observer_noise(observer, record, most_iterations=300)


@pytest.fixture
def golden(shared_data: Path) -> tuple[ObserverRecord, np.ndarray]:
    path = shared_data / "golden_closed_loop" / "identification_amp035.npz"
    if not path.is_file():
        pytest.skip(f"the closed-loop log is not at {path}")
    with np.load(path) as data:
        record = ObserverRecord.from_arrays(
            rate_hz=100.0,
            force_x_n=data["u"][:, 0],
            steer_rad=data["u"][:, 1],
            stiffness_front_nprad=63.36 * data["fz_front"],
            stiffness_rear_nprad=63.36 * data["fz_rear"],
            readings=data["measurements"],
        )
        return record, np.column_stack([data["truth_gt"][:, 3:6], data["ay_true"]])


class TestGolden:
    def test_published_form_is_reproduced(self, golden: tuple[ObserverRecord, np.ndarray]) -> None:
        as_published = published.observer(CAR)
        assert as_published.log_likelihood(golden[0]) == pytest.approx(120432.7509, abs=1e-3)
        floor = NoiseStructure(floor=1e-9)
        em = learn_observer_noise(
            as_published,
            golden[0],
            process=floor,
            sensors=floor,
            most_iterations=19,
            tolerance=0.0,
            accelerate=False,
        )
        assert em.log_likelihood[-1] == pytest.approx(125624.68, abs=0.05)

    def test_corrected_form_learns_the_sensors(
        self, golden: tuple[ObserverRecord, np.ndarray]
    ) -> None:
        record, truth = golden
        corrected = Observer(CAR, published.OBSERVER_NOISE)
        em = learn_observer_noise(
            corrected, record, most_iterations=20, tolerance=0.0, accelerate=False
        )
        assert em.log_likelihood[-1] >= 190433
        assert em.monotone
        found = np.diag(em.noise.sensors)
        np.testing.assert_allclose(found[:3], [0.01, 1e-5, 1e-5], rtol=0.05)
        error = corrected.with_noise(em.noise).smoothed(record).reading - truth
        rms = np.sqrt(np.mean(error**2, axis=0))
        assert (rms[1:] <= [0.00062, 0.00030, 0.0032]).all()


class TestLearning:
    def test_finds_the_sensors_without_being_told(self, learned: EMResult) -> None:
        assert learned.monotone
        assert learned.fell == 0
        assert learned.converged
        std = np.sqrt(np.diag(learned.noise.sensors))
        np.testing.assert_allclose(std, SENSOR_STD, rtol=0.06)

    def test_log_likelihood_is_that_of_the_result(
        self, observer: Observer, record: ObserverRecord, learned: EMResult
    ) -> None:
        value = observer.with_noise(learned.noise).log_likelihood(record)
        # The start of the state is as uncertain as the sensors, which have changed.
        assert value == pytest.approx(learned.log_likelihood[-1], abs=10.0)
        assert learned.log_likelihood[0] == observer.log_likelihood(record)

    def test_finds_a_correlation_of_sensors(self, driven: dict, observer: Observer) -> None:
        rng = np.random.default_rng(8)
        y = driven["truth"] + SENSOR_STD * rng.standard_normal(driven["truth"].shape)
        common = rng.standard_normal(len(y))
        y[:, 2] = driven["truth"][:, 2] + SENSOR_STD[2] * common
        y[:, 3] = driven["truth"][:, 3] + SENSOR_STD[3] * (
            0.8 * common + 0.6 * rng.standard_normal(len(y))
        )
        both = ObserverRecord.from_arrays(**{**driven["arrays"], "readings": y})
        pair = NoiseStructure(correlated=(("yaw_rate_radps", "ay_mps2"),))
        em = learn_observer_noise(observer, both, sensors=pair, most_iterations=300)
        assert em.monotone
        correlation = em.sensor_correlation
        assert correlation[2, 3] == pytest.approx(0.8, abs=0.05)
        assert correlation[0, 1] == 0.0

    def test_pools_logs(self, observer: Observer, driven: dict, record: ObserverRecord) -> None:
        second = ObserverRecord.from_arrays(
            **simulate(np.random.default_rng(4), n=1000)["arrays"], name="second"
        )
        em = learn_observer_noise(observer, [record, second], most_iterations=5)
        assert em.samples == 4000
        alone = observer.log_likelihood(record) + observer.log_likelihood(second)
        assert em.log_likelihood[0] == pytest.approx(alone, abs=30.0)

    def test_fixed_and_tied_and_floor(self, observer: Observer, record: ObserverRecord) -> None:
        em = learn_observer_noise(
            observer,
            record,
            process=NoiseStructure(
                fixed=("xi_x_n",), tied=(("vx_mps", "vy_mps"),), floor={"yaw_rate_radps": 1e-3}
            ),
            most_iterations=30,
        )
        before, after = np.diag(observer.noise.process), np.diag(em.noise.process)
        assert after[3] == before[3]
        assert after[0] / after[1] == pytest.approx(before[0] / before[1])
        assert after[0] != before[0]
        assert after[2] == 1e-3

    def test_without_sideslip_and_with_gaps(self, driven: dict, observer: Observer) -> None:
        y = driven["arrays"]["readings"].copy()
        y[::3, 0] = np.nan
        y[500:520] = np.nan
        gaps = ObserverRecord.from_arrays(**{**driven["arrays"], "readings": y}).without("vy_mps")
        em = learn_observer_noise(observer, gaps, most_iterations=60)
        assert em.monotone
        assert em.unmeasured == ("vy_mps",)
        kept = observer.noise.sensors[1, 1]
        assert em.noise.sensors[1, 1] == pytest.approx(kept, rel=1e-9)
        assert "not measured" in str(em)
        std = np.sqrt(np.diag(em.noise.sensors))
        np.testing.assert_allclose(std[[0, 2]], SENSOR_STD[[0, 2]], rtol=0.1)

    def test_result_shows_itself(self, learned: EMResult) -> None:
        assert "converged" in str(learned)
        assert "<table>" in learned._repr_html_()
        ax = learned.plot()
        assert len(ax.lines[0].get_ydata()) == learned.iterations + 1
        std = np.sqrt(np.diag(learned.noise.sensors) / np.diag(learned.start.sensors))
        np.testing.assert_allclose(learned.plot_noise().lines[1].get_ydata()[6:], std)

    @pytest.mark.parametrize(
        ("structure", "words"),
        [
            (NoiseStructure(fixed=("xi_y",)), "did you mean 'xi_y_n'"),
            (NoiseStructure(full=True, tied=(("vx_mps", "vy_mps"),)), "choose one"),
            (NoiseStructure(tied=(("vx_mps", "vy_mps"), ("vx_mps", "xi_x_n"))), "tied twice"),
            (NoiseStructure(floor=0.0), "above zero"),
        ],
    )
    def test_contradictory_structure(
        self, observer: Observer, record: ObserverRecord, structure: NoiseStructure, words: str
    ) -> None:
        with pytest.raises(InvalidInput, match=words):
            learn_observer_noise(observer, record, process=structure)


class TestSmoothing:
    def test_better_than_the_filter_and_honest(
        self, observer: Observer, record: ObserverRecord, learned: EMResult, driven: dict
    ) -> None:
        known = observer.with_noise(learned.noise)
        error = {
            kind: estimate.reading - driven["truth"]
            for kind, estimate in (
                ("filtered", known.filtered(record)),
                ("smoothed", known.smoothed(record)),
            )
        }
        rms = {kind: np.sqrt(np.mean(e[300:] ** 2, axis=0)) for kind, e in error.items()}
        assert (rms["smoothed"] <= rms["filtered"]).all()
        assert (rms["smoothed"] < 0.5 * SENSOR_STD).all()
        inside = np.abs(error["smoothed"]) < 1.96 * known.smoothed(record).reading_std
        assert (inside[300:].mean(axis=0) > 0.85).all()

    def test_virtual_force_sensor(
        self, observer: Observer, record: ObserverRecord, learned: EMResult
    ) -> None:
        estimate = observer.with_noise(learned.noise).smoothed(record)
        force, std = estimate.force[500:, 1], estimate.force_std[500:, 1]
        assert abs(force.mean() - 600.0) < 15.0
        assert np.abs(force - 600.0).max() < 6.0 * std.max()
        assert np.abs(estimate.force[500:, 2]).mean() < 100.0

    def test_estimate_shows_itself(self, observer: Observer, record: ObserverRecord) -> None:
        estimate = observer.smoothed(record)
        # One takes the readings of a sample together, the other in turn: rounding apart, the same.
        assert estimate.log_likelihood == pytest.approx(observer.log_likelihood(record), rel=1e-13)
        assert "smoothed state" in str(estimate)
        assert "xi_y_n" in estimate._repr_html_()
        for channel in ("xi_psi_nm", "ay_mps2"):
            assert estimate.plot(channel).get_xlabel() == "time [s]"
        np.testing.assert_array_equal(
            estimate.plot_forces().lines[1].get_ydata(), estimate.force[:, 1]
        )
        with pytest.raises(InvalidInput, match="did you mean 'xi_y_n'"):
            estimate.plot("xi_y")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            {"steer_rad": lambda u: np.where(np.arange(len(u)) == 250, np.nan, u)},
            "sample 250 .2.50",
        ),
        ({"stiffness_front_nprad": lambda u: 0.0 * u}, "stiffness_front_nprad is 0.0 at sample 0"),
        (
            {"readings": lambda y: np.where(y == y[7, 2], np.inf, y)},
            "yaw_rate_radps is inf at samp",
        ),
        ({"readings": lambda y: y[:, :3]}, "samples x 4"),
        ({"readings": lambda y: y * [np.nan, 1, 1, 1]}, "no reading of vx_mps"),
        ({"force_x_n": lambda u: u[:-1]}, "force_x_n has shape"),
        ({"rate_hz": lambda _: 0.0}, "rate_hz"),
    ],
)
def test_unusable_records_name_the_sample(
    driven: dict, change: dict[str, Callable[[np.ndarray], np.ndarray]], words: str
) -> None:
    arrays = dict(driven["arrays"])
    for key, f in change.items():
        arrays[key] = f(np.asarray(arrays[key]))
    with pytest.raises(InvalidInput, match=words):
        ObserverRecord.from_arrays(**arrays)


def test_broken_filter_is_one_clear_error(observer: Observer, record: ObserverRecord) -> None:
    absurd = dataclasses.replace(record, steer_rad=np.full(len(record.steer_rad), 1e306))
    for run in (
        observer.smoothed,
        observer.log_likelihood,
        lambda r: learn_observer_noise(observer, r),
    ):
        with pytest.raises(NumericalError, match="sample 0"):
            run(absurd)


@pytest.mark.parametrize(
    ("process", "sensors", "words"),
    [
        (np.eye(5), np.eye(4), "process noise has shape .5, 5.; give 6 x 6"),
        (-np.eye(6), np.eye(4), "variance of vx_mps is -1"),
        (np.eye(6), np.diag([1.0, 0.0, 1.0, 1.0]), "sensor noise: the variance of vy_mps is 0"),
        (np.eye(6), np.diag([1.0, 1.0, np.nan, 1.0]), "variance of yaw_rate_radps is nan"),
        (np.eye(6), np.eye(4) + np.eye(4, k=1), "row and column of vx_mps differ"),
        (np.eye(6), np.eye(4) - np.eye(4, k=1) - np.eye(4, k=-1), "not positive definite; lower"),
    ],
)
def test_noise_that_is_none(process: np.ndarray, sensors: np.ndarray, words: str) -> None:
    with pytest.raises(InvalidInput, match=words):
        ObserverNoise(process, sensors)


def test_too_little_to_learn_from(driven: dict, observer: Observer, record: ObserverRecord) -> None:
    arrays = {
        key: value[:40] if np.ndim(value) else value for key, value in driven["arrays"].items()
    }
    with pytest.raises(InvalidInput, match="short: 40 readings of vx_mps are too few"):
        learn_observer_noise(observer, ObserverRecord.from_arrays(**arrays, name="short"))
    frozen = np.diag(observer.noise.process).copy()
    frozen[4] = 0.0
    stuck = observer.with_noise(
        ObserverNoise.from_variances(frozen, np.diag(observer.noise.sensors))
    )
    with pytest.raises(InvalidInput, match="process noise of xi_y_n starts at zero"):
        learn_observer_noise(stuck, record)
    still = learn_observer_noise(stuck, record, process=NoiseStructure(fixed=("xi_y_n",)))
    assert still.noise.process[4, 4] == 0.0


def test_car_from_a_vehicle(car: Vehicle) -> None:
    same = ObserverCar.of(car)
    assert same.mass_kg == car.mass_kg
    assert sum(same.static_loads_n()) == pytest.approx(car.mass_kg * 9.80665)
    with pytest.raises(InvalidInput, match="yaw_inertia_kgm2"):
        ObserverCar.of(car.replace(yaw_inertia_kgm2=None))
    with pytest.raises(InvalidInput, match="mass_kg"):
        ObserverCar(0.0, 1000.0, 1.4, 1.6)


class TestCommand:
    @pytest.fixture
    def files(self, tmp_path: Path, car: Vehicle) -> tuple[Path, Path]:
        car.to_toml(tmp_path / "car.toml")
        log = drive(Model(car), manoeuvres.lap(20.0), seed=1, rate_hz=50.0)
        log.to_csv(tmp_path / "lap.csv")
        return tmp_path / "car.toml", tmp_path / "lap.csv"

    def test_learns_from_a_file(
        self, files: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        vehicle, log = files
        out, figure = tmp_path / "em.json", tmp_path / "em.svg"
        given = [str(log), "--vehicle", str(vehicle), "--correlated"]
        wanted = ["--json", str(out), "--plot", str(figure), "--iterations", "40"]
        lab_logs.em(parsed([*given, *wanted]), ["heard before"])
        printed = capsys.readouterr().out
        assert "sensor ay_mps2" in printed
        assert "smoothed state" in printed
        content = json.loads(out.read_text(encoding="utf-8"))
        assert content["warnings"] == ["heard before"]
        assert (np.diff(content["log_likelihood"]) >= 0.0).all()
        sensors = np.array(content["noise"]["sensors"])
        assert sensors[2, 3] != 0.0
        assert sensors[0, 1] == 0.0
        assert figure.read_text(encoding="utf-8").rstrip().endswith("</svg>")

    def test_names_what_a_log_lacks(self, files: tuple[Path, Path], tmp_path: Path) -> None:
        vehicle, log = files
        rows = [line.split(",") for line in log.read_text(encoding="utf-8").splitlines()]
        at = rows[0].index("fx_n")
        text = "\n".join(",".join(row[:at] + row[at + 1 :]) for row in rows)
        (tmp_path / "coasting.csv").write_text(text, encoding="utf-8")
        given = [str(tmp_path / "coasting.csv"), "--vehicle", str(vehicle)]
        with pytest.raises(InvalidInput, match="no fx_n; the observer needs the wheel force"):
            lab_logs.em(parsed(given), [])
        with pytest.raises(InvalidInput, match="also an input"):
            refuse_outputs(parsed([*given, "--json", str(vehicle)]))


def parsed(argv: list[str]) -> argparse.Namespace:
    return parse(["lab", "em", *argv])
