"""A simulator of a user's own: intervals of its mass hold where the speed is not compared."""

import warnings
from typing import Any

import numpy as np
import pytest

from sysid_vehicle.errors import InvalidInput, SysidWarning
from sysid_vehicle.twin import (
    CallableTwin,
    Observation,
    Observer,
    SideBySide,
    Unknown,
    observe_with,
)

DT, N = 0.02, 1200
MASS_KG, INERTIA_KGM2 = 1725.0, 2900.0
NAMES = ("vx_mps", "vy_mps", "yaw_rate_radps", "ax_mps2", "ay_mps2")
STD = np.array([0.03, 0.03, 0.003, 0.08, 0.08])
COMPARED = {"ax_mps2": 0.08, "ay_mps2": 0.08, "yaw_rate_radps": 0.003}
SEEDS = range(733301, 733309)


def forces(x: np.ndarray, u: np.ndarray, p: dict[str, float]) -> tuple[float, float, float]:
    """Accelerations and yaw acceleration of a single track with linear tyres and drag."""
    front = 95000.0 * (u[1] - np.arctan2(x[1] + 1.25 * x[2], x[0]))
    rear = -120000.0 * np.arctan2(x[1] - 1.45 * x[2], x[0])
    along = u[0] - front * np.sin(u[1]) - 0.4 * x[0] ** 2
    across = front * np.cos(u[1])
    yaw = (1.25 * across - 1.45 * rear) / p["yaw_inertia_kgm2"]
    return along / p["mass_kg"], (across + rear) / p["mass_kg"], yaw


def rates(x: np.ndarray, u: np.ndarray, p: dict[str, float]) -> np.ndarray:
    ax, ay, yaw = forces(x, u, p)
    return np.array([ax + x[1] * x[2], ay - x[0] * x[2], yaw])


def step(x: np.ndarray, u: np.ndarray, p: dict[str, float]) -> np.ndarray:
    middle = x + 0.5 * DT * rates(x, u, p)
    return x + DT * rates(middle, u, p)


def twin(
    mass: float,
    inertia: float,
    names: tuple[str, str] = ("force_n", "steer_rad"),
    states: tuple[str, ...] = NAMES[:3],
) -> Any:
    return CallableTwin(
        step,
        lambda x, u, p: np.array([*x, *forces(x, u, p)[:2]]),
        np.array([18.0, 0.0, 0.0]),
        dt_s=DT,
        input_names=names,
        output_names=NAMES,
        state_names=states,
        parameters={"mass_kg": mass, "yaw_inertia_kgm2": inertia},
    )


def driven(seed: int, speed: float = 18.0) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    rng, t = np.random.default_rng(seed), DT * np.arange(N)
    pull = 600.0 + 2200.0 * np.sin(0.5 * t + rng.uniform(0, 6)) + 900.0 * np.sin(1.7 * t)
    steer = 0.035 * np.sin(1.3 * t + rng.uniform(0, 6)) + 0.02 * np.sin(4.1 * t)
    inputs, car = np.column_stack([pull, steer]), twin(MASS_KG, INERTIA_KGM2)
    car.set_state(np.array([speed, 0.0, 0.0]))
    read = []
    for u in inputs:
        read.append(car.outputs(u))
        car.step(u)
    read = np.array(read) + STD * rng.standard_normal((N, 5))
    return inputs, dict(zip(NAMES, read.T, strict=True))


def found(
    inputs: np.ndarray, read: dict[str, np.ndarray], begun: Any = None, **doubt: Any
) -> Observation:
    unknowns = [
        Unknown("mass_kg", 250.0, 10.0, 700.0, 3000.0),
        Unknown("yaw_inertia_kgm2", 500.0, 20.0, 800.0, 5000.0),
    ]
    observer = Observer(batch=SideBySide(unknowns, COMPARED, **doubt))
    return observe_with(begun or twin(1500.0, 2400.0), inputs, read, observer)


def away(run: Observation) -> float:
    return (float(run.parameters["mass_kg"][-1]) - MASS_KG) / run.spread["mass_kg"]


def test_the_interval_of_a_mass_found_by_accelerations_holds_it() -> None:
    """With a start taken as exact, 0.1 m/s made the mean square 7.9."""
    runs = [found(*driven(seed, speed=18.1), input_std=0.0) for seed in SEEDS]
    assert np.mean([away(run) ** 2 for run in runs]) < 2.0
    assert max(run.spread["mass_kg"] for run in runs) < 0.01 * MASS_KG


def test_a_twin_that_begins_too_fast_finds_the_mass() -> None:
    """Taken as exact, 0.5 m/s were 24 kg, with a standard deviation of 4."""
    run = found(*driven(SEEDS[0], speed=18.5), input_std=0.0)
    assert abs(away(run)) < 3.0
    assert run.spread["mass_kg"] < 0.01 * MASS_KG


def test_a_speed_that_no_name_tells_is_warned_of() -> None:
    """Its start was silently taken as exact."""
    own = twin(1500.0, 2400.0, states=("u", "v", "r"))
    with pytest.warns(SysidWarning, match=r"states \(u, v, r\) is named vx_mps"):
        run = found(*driven(SEEDS[0], speed=18.5), own, input_std=0.0)
    assert run.contradictions
    assert abs(away(run)) < 1.0
    exact = twin(1500.0, 2400.0, states=("u", "v", "r"))
    inputs, read = driven(SEEDS[0])
    assert not found(inputs, read, exact, input_std=0.0, start_std=0.0).contradictions


def stateless(mass: float, inertia: float) -> Any:
    own = twin(mass, inertia)
    own.capabilities = frozenset({"parameters", "clone", "snapshot"})
    return own


def test_beside_a_speed_that_nothing_sets_what_bends_show_is_not_believed() -> None:
    """Its mass was up to 14 standard errors away by both accelerations, with no word."""
    inputs, read = driven(SEEDS[3])
    mass = [Unknown("mass_kg", 250.0, 10.0, 700.0, 3000.0)]

    def run(*channels: str) -> Observation:
        noise = {name: COMPARED[name] for name in channels}
        observer = Observer(batch=SideBySide(mass, noise, input_std=0.0))
        return observe_with(stateless(1500.0, INERTIA_KGM2), inputs, read, observer)

    along = run("ax_mps2")
    assert not along.contradictions
    assert abs(away(along)) < 3.0
    for other in ("ay_mps2", "yaw_rate_radps"):
        with pytest.warns(SysidWarning, match=rf"{other}: the twin's speed cannot be set.* alone"):
            bent = run("ax_mps2", other)
        assert abs(away(bent)) < 1.0


def test_a_force_told_wrong_is_held_by_the_spread() -> None:
    inputs, read = driven(SEEDS[1])
    told = inputs * [1.04, 1.0]
    assert abs(away(found(told, read))) < 2.0
    assert abs(away(found(told, read, input_std=0.0))) > 3.0


def test_forces_that_names_do_not_tell_are_warned_of() -> None:
    inputs, read = driven(SEEDS[2])
    short, few = inputs[:200], {name: values[:200] for name, values in read.items()}
    named = twin(1500.0, 2400.0, ("F", "delta"))
    with pytest.warns(SysidWarning, match=r"no input of the twin \(F, delta\) .*input_std=0\.0"):
        found(short, few, named)
    for doubt in ({"uncertain_inputs": ("F",)}, {"input_std": 0.0}):
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            found(short, few, twin(1500.0, 2400.0, ("F", "delta")), **doubt)


def test_an_estimate_that_noise_takes_off_its_limit_stands_there() -> None:
    """The last value was below the limit by a few kilograms, and nothing was said."""
    inputs, read = driven(733340)
    heavy = Unknown("mass_kg", 250.0, 10.0, 1000.0, 1600.0)
    observer = Observer(batch=SideBySide([heavy], {"ax_mps2": 0.08}))
    with pytest.warns(SysidWarning, match=r"mass_kg = 15\d\d\S* stands at its limit, 1600"):
        run = observe_with(twin(1500.0, INERTIA_KGM2), inputs, read, observer)
    assert run.parameters["mass_kg"][-1] < 1600.0


def test_twins_beyond_the_limits_are_refused() -> None:
    """They taught nothing: the mass stayed where it began."""
    far = Unknown("mass_kg", 250.0, 1e6, 700.0, 3000.0)
    with pytest.raises(InvalidInput, match=r"mass_kg: twins 1e\+06 apart, with limits of 700"):
        SideBySide([far], {"ax_mps2": 0.08})
