"""A speed that is compared keeps what it began with: its start is looked for beside the mass."""

from typing import Any

import numpy as np
import pytest
from pulled_car import DT, MASS, twin

from sysid_vehicle.errors import InvalidInput, SysidWarning
from sysid_vehicle.twin import (
    NOMINAL_SUV,
    NativeTwin,
    Observation,
    Observer,
    SideBySide,
    StateGain,
    TwinCar,
    measure,
    observe,
    observe_with,
    unknowns,
    urban_cycle,
)

N, NOISE = 3000, 0.05


def drawn(seed: int) -> tuple[float, np.ndarray, np.ndarray]:
    """Mass, forces, and the speed of that mass with noise."""
    rng = np.random.default_rng(seed)
    mass = float(rng.uniform(850.0, 1300.0))
    t = DT * np.arange(N)
    force = 800.0 + rng.uniform(800, 2000) * np.sin(rng.uniform(0.3, 2.0) * t + rng.uniform(0, 6))
    speed = np.empty(N)
    v = 10.0
    for k in range(N):
        speed[k] = v
        v += DT * (force[k] - 50.0 * v) / mass
    return mass, force[:, None], speed + NOISE * rng.standard_normal(N)


def found(seed: int, *, gains: Any = (), first: float | None = None, **batch: Any) -> Any:
    mass, force, speed = drawn(seed)
    batch = {"input_std": 0.0, **batch}  # the forces are exact
    observer = Observer(gains, batch=SideBySide([MASS], {"vx_mps": NOISE}, **batch))
    begun = twin(speed[0] if first is None else first)
    return observe_with(begun, force, {"vx_mps": speed}, observer), mass


def away(run: Observation, mass: float) -> float:
    return float(run.parameters["mass_kg"][-1] - mass) / run.spread["mass_kg"]


SEEDS = range(267496, 267502)


def test_the_interval_of_a_mass_found_by_the_speed_holds_it() -> None:
    """Without the start the mean square was 36."""
    runs = [found(seed) for seed in SEEDS]
    assert not any(run.contradictions for run, _ in runs)
    assert np.mean([away(*run) ** 2 for run in runs]) < 2.0
    assert max(run.spread["mass_kg"] for run, _ in runs) < 0.02 * 1000.0


def test_a_first_speed_far_from_the_cars_does_no_harm() -> None:
    runs = [found(seed, first=11.0) for seed in SEEDS[:4]]
    assert max(abs(away(*run)) for run in runs) < 3.0


def test_a_gain_that_corrects_the_speed_takes_the_place_of_its_start() -> None:
    gain = [StateGain("vx_mps", "vx_mps", 0.5)]
    run, mass = found(SEEDS[0], gains=gain)
    same, _ = found(SEEDS[0], gains=gain, start_std=0.0)
    assert run.parameters["mass_kg"].tolist() == same.parameters["mass_kg"].tolist()
    assert abs(away(run, mass)) < 3.0


def test_a_speed_that_nothing_sets_is_said_to_hold_old_guesses() -> None:
    _, force, speed = drawn(SEEDS[0])
    fixed = twin(speed[0])
    fixed.capabilities = frozenset({"parameters", "clone", "snapshot"})  # type: ignore[misc]
    observer = Observer(batch=SideBySide([MASS], {"vx_mps": NOISE}))
    with pytest.warns(SysidWarning, match=r"vx_mps: the twin's speed cannot be set.*ax_mps2"):
        run = observe_with(fixed, force, {"vx_mps": speed}, observer)
    assert run.spread["mass_kg"] >= MASS.spread


@pytest.mark.parametrize("channel", ["vx_mps", "wheel_speed_fl_radps"])
def test_the_built_in_car_looks_for_it_too(channel: str) -> None:
    """Also where a wheel tells the speed; and alike where each step is made from Python."""
    true = NOMINAL_SUV.replace(mass_kg=1.15 * NOMINAL_SUV.mass_kg)
    drive = urban_cycle(TwinCar(), true, duration_s=30.0, dt_s=2e-3)
    noise = {channel: 0.05, "yaw_rate_radps": 0.005}
    readings = measure(drive, [channel], noise=noise, seed=655631)
    batch = SideBySide(unknowns("mass_kg"), {channel: 0.05}, input_std=0.0)
    speed = float(drive["vx_mps"][0]) + 0.05
    run = observe(
        TwinCar(), NOMINAL_SUV, drive.inputs, readings, Observer(batch=batch), speed_mps=speed
    )
    assert abs(away(run, true.mass_kg)) < 3.0
    assert run.spread["mass_kg"] < 5.0
    few = slice(0, 1500)
    measured = {channel: readings[channel][few]}
    native = NativeTwin(TwinCar(), NOMINAL_SUV, speed, dt_s=2e-3)
    stepped = observe_with(native, drive.inputs[few], measured, Observer(batch=batch))
    here = run.parameters["mass_kg"][:150]
    assert np.ptp(here) > 1.0
    assert stepped.parameters["mass_kg"] == pytest.approx(here, rel=1e-9)


def test_starts_out_of_range_are_refused() -> None:
    with pytest.raises(InvalidInput, match=r"start_std = -1.0; give a number from 0 on"):
        SideBySide([MASS], {"vx_mps": NOISE}, start_std=-1.0)
    assert SideBySide([MASS], {"roll_rate_radps": 0.1}).starts(("roll_rate_radps",)) == {}
