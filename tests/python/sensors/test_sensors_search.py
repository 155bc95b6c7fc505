"""How the search for faults of sensors comes to an end."""

import importlib
from collections.abc import Sequence

import numpy as np
import pytest
from scipy import sparse

import sysid_vehicle as sv
from sysid_vehicle._common.arrays import FloatArray
from sysid_vehicle.sensors.kinematics.equations import SWINGS
from sysid_vehicle.sensors.kinematics.estimate import Estimate
from sysid_vehicle.sensors.kinematics.one_sided import OneSided
from sysid_vehicle.sensors.kinematics.road import Unevenness
from sysid_vehicle.sensors.kinematics.system import Band, Normal

NAMES = ["gain.ax_mps2", "arm_x", "lean.ax_mps2"]
INFORMATION = np.array([[4.0, 1.0, 0.0], [1.0, 2.0, 0.0], [0.0, 0.0, 1.0]])
NOTHING = Band(sparse.eye(1, format="csr"))


def towards(best: Sequence[float], now: FloatArray) -> Normal:
    step = np.array(best) - now
    return Normal(NOTHING, np.zeros((1, 3)), INFORMATION, step, np.zeros(1))


def test_a_scale_rests_at_zero_where_both_sides_point_at_it() -> None:
    """Steps to the best of the side where the search stands would go on for ever."""
    gains, at = OneSided(NAMES), np.array([0.1, 0.0, 0.0])
    for _ in range(6):
        best = [-0.3, 0.5, 0.0] if at[0] > 0.0 else [0.2, 0.5, 0.0]
        at = at + gains.step(towards(best, at), at)
    assert at[0] == 0.0
    # What the others do is best beside that: their equation with what the scale does not do.
    assert at[1] == pytest.approx(0.5 + 0.2 * INFORMATION[0, 1] / INFORMATION[1, 1])


def test_a_scale_leaves_zero_once_a_side_has_changed() -> None:
    gains, at = OneSided(NAMES), np.array([0.1, 0.0, 0.0])
    for _ in range(4):
        best = [-0.3, 0.5, 0.0] if at[0] > 0.0 else [0.2, 0.5, 0.0]
        at = at + gains.step(towards(best, at), at)
    gains.forget()
    for _ in range(3):
        at = at + gains.step(towards([0.4, 0.5, 0.0], at), at)
    assert at == pytest.approx([0.4, 0.5, 0.0])
    down = OneSided(NAMES)
    at = np.array([0.1, 0.0, 0.0])
    for _ in range(3):
        at = at + down.step(towards([-0.2, 0.5, 0.0], at), at)
    assert at == pytest.approx([-0.2, 0.5, 0.0])


class Road:
    """A slope that is read with white noise once a second, and what follows from a deviation."""

    def __init__(self, read: FloatArray, noise: float) -> None:
        self.read, self.noise, n = read, noise, read.size
        self.changes = sparse.diags([-1.0, 1.0], [0, 1], shape=(n - 1, n), format="csr")

    def band(self, std: float) -> Band:
        told = sparse.eye(self.read.size, format="csr") / self.noise
        return Band(sparse.vstack([told, self.changes / std], format="csr"))

    def settled(self) -> tuple[Unevenness, int]:
        slope = Unevenness(self.changes)
        for count in range(1, 30):
            band = self.band(slope.std_mps2)
            slope.improve(band.solve(self.read / self.noise**2), band)
            if slope.at_rest:
                return slope, count
        return slope, count

    def likeliest(self) -> float:
        """The same by the density of the changes that are read, over a grid."""
        steps = np.diff(self.read)
        n = steps.size
        noise = self.noise**2 * (2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1))

        def likelihood(std: float) -> float:
            covariance = std**2 * np.eye(n) + noise
            return float(
                -steps @ np.linalg.solve(covariance, steps) - np.linalg.slogdet(covariance)[1]
            )

        return float(max(np.geomspace(0.003, 0.5, 400), key=likelihood))


@pytest.mark.parametrize("std", [0.01, 0.05, 0.2])
def test_how_uneven_a_road_is_has_maximum_likelihood(std: float, rng: np.random.Generator) -> None:
    true = np.cumsum(std * rng.standard_normal(200))
    road = Road(true + 0.02 * rng.standard_normal(200), 0.02)
    slope, count = road.settled()
    assert slope.at_rest
    assert count <= 12
    assert slope.std_mps2 == pytest.approx(road.likeliest(), rel=0.03)


def test_an_even_road_is_soon_known(rng: np.random.Generator) -> None:
    slope, count = Road(0.3 + 0.02 * rng.standard_normal(120), 0.02).settled()
    assert slope.at_rest
    assert count <= 8
    assert slope.std_mps2 == pytest.approx(0.003)


def test_what_is_known_of_a_log_is_not_asked_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """A search goes on from a better explanation: those without a fault are the same."""
    module = importlib.import_module("sysid_vehicle.sensors.explaining")
    asked: list[tuple[str, ...]] = []
    estimate = module.estimate

    def counted(readings: object, grid: object, names: Sequence[str], **how: object) -> Estimate:
        if how["begin"] is None:
            asked.append(tuple(names))
        found: Estimate = estimate(readings, grid, names, **how)
        return found

    monkeypatch.setattr(module, "estimate", counted)
    log = sv.drive(sv.Model(sv.example_vehicle()), sv.manoeuvres.sine_sweep(), seed=4)
    log = log.between(0.0, 15.0)
    t, ay = log["time_s"], log["ay_mps2"]
    check = sv.check(log.corrected({"ay_mps2": np.interp(t - 0.05, t, ay)}, []))
    assert [fault.name for fault in check.found] == ["delay_ay_s"]
    assert len(asked) == len(set(asked)) > 3
    assert not {*SWINGS} <= {*check.estimate.faults}
