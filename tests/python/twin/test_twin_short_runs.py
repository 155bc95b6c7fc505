"""Short runs on simulators of others are judged as long ones are."""

import numpy as np
import pytest
from pulled_car import DT, MASS, twin

from sysid_vehicle.errors import SysidWarning
from sysid_vehicle.twin import (
    Observation,
    Observer,
    SideBySide,
    observe_with,
)

N = 1500
FORCE_N = 800.0 + 1500.0 * np.sin(0.8 * DT * np.arange(N))


def car() -> np.ndarray:
    """Acceleration of 1200 kg that start at 10 m/s, with noise."""
    ax, speed = [], 10.0
    for force in FORCE_N:
        ax.append((force - 50.0 * speed) / 1200.0)
        speed += DT * ax[-1]
    return np.array(ax) + 0.05 * np.random.default_rng(154491).standard_normal(N)


def found(
    readings: np.ndarray,
    force: np.ndarray = FORCE_N,
    speed: float = 10.0,
    stride: int = 10,
    start_std: float = 1.0,
) -> Observation:
    observer = Observer(batch=SideBySide([MASS], {"ax_mps2": 0.05}, start_std=start_std))
    return observe_with(twin(speed), force[:, None], {"ax_mps2": readings}, observer, stride=stride)


@pytest.mark.parametrize("stride", [1, 10, 500])
def test_what_is_right_is_believed_however_little_is_recorded(stride: int) -> None:
    run = found(car(), stride=stride)
    assert run.contradictions == ()
    assert [r.channel for r in run.residuals] == ["ax_mps2"]
    assert run.parameters["mass_kg"][-1] == pytest.approx(1200.0, rel=0.02)


def test_a_twin_that_starts_elsewhere_is_not_believed() -> None:
    with pytest.warns(SysidWarning, match="apart all the time"):
        run = found(car(), speed=20.0, start_std=0.0)
    assert run.spread["mass_kg"] == MASS.spread


def test_where_it_starts_is_looked_for_where_only_the_acceleration_is_compared() -> None:
    """Drag tells it; taken as exact, 5 m/s too much made a mass that was not believed."""
    run = found(car(), speed=15.0)
    assert run.contradictions == ()
    assert run.parameters["mass_kg"][-1] == pytest.approx(1200.0, rel=0.01)


def test_inputs_in_another_unit_are_not_believed() -> None:
    """The twin hardly moves: neither mass nor noise explains that."""
    with pytest.warns(SysidWarning, match=r"the car's reading moves by .*, the twin's by .*units"):
        found(car(), force=FORCE_N / 1e3)


def test_readings_in_another_unit_are_not_believed() -> None:
    with pytest.warns(SysidWarning, match=r"by a factor of 0\.1.*unit"):
        found(car() / 9.80665)
