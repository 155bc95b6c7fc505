"""What an excitation will teach, and choosing one that teaches the most."""

from collections.abc import Callable
from dataclasses import replace

import model_cars
import numpy as np
import pytest

from sysid_vehicle import (
    DriveLimits,
    InvalidInput,
    Model,
    NumericalError,
    Tyre,
    example_vehicle,
    published,
)
from sysid_vehicle.identify.search.search import Box, minimise
from sysid_vehicle.lab import (
    Design,
    Limits,
    Sensor,
    Setup,
    design_excitation,
    excitation,
    preview,
    run_closed_loop,
)
from sysid_vehicle.lab.design.information import (
    MOTION,
    READINGS,
    TYRES,
    information,
    parameters_of,
    problem_of,
    sensor_noise,
)

HARD = excitation.multi_sine(lateral_mps2=16.0, speed_mps=25.0, duration_s=25.0)
EASY = excitation.multi_sine(lateral_mps2=5.0, speed_mps=25.0, duration_s=25.0)


@pytest.fixture(scope="module")
def setup() -> Setup:
    default = Setup.default()
    return replace(default, simulator=replace(default.simulator, inputs_linear=True))


@pytest.fixture(scope="module")
def believed(setup: Setup) -> Model:
    values = (20.0, 1.75, 1.65, 0.7, 23.0, 1.75, 1.55, 0.7)
    return setup.plant.with_values(dict(zip(TYRES, values, strict=True)))


@pytest.fixture(scope="module")
def design(setup: Setup, believed: Model) -> Design:
    return design_excitation(setup, believed=believed, duration_s=20.0, trials=12, uncertainty=0.05)


def test_a_tyre_knows_its_curve_and_its_peak() -> None:
    tyre = Tyre(22.0, 1.8, 1.6, 0.8)
    assert tyre.peak_slip_rad() == pytest.approx(0.0796, abs=3e-4)
    assert float(tyre.friction(tyre.peak_slip_rad())) == pytest.approx(1.6, rel=1e-6)
    slope = float(tyre.friction(1e-6)) / 1e-6
    assert slope == pytest.approx(tyre.cornering_stiffness_per_load, rel=1e-6)
    assert float(tyre.friction(-0.05)) == -float(tyre.friction(0.05))


def test_an_easy_drive_tells_the_stiffness_and_no_single_coefficient() -> None:
    seen = preview(EASY)
    assert all(e.relative > 0.2 for e in seen.expected if e.name[0] in "BE")
    assert all(c.beyond_half == 0.0 for c in seen.coverage)
    assert seen.condition > 1e8
    assert "> 100 %" in str(seen)


def test_a_hard_drive_tells_everything(setup: Setup) -> None:
    seen = preview(HARD, setup)
    assert seen.worst.relative < 0.05
    assert all(c.reached > 1.0 for c in seen.coverage)
    assert seen["D_front"].relative < 1e-3
    assert seen.condition < preview(EASY, setup).condition


def test_information_is_that_of_the_scatter_of_fits(setup: Setup) -> None:
    # Fits to logs with other noise scatter as the information says.
    model, names = setup.plant, ("B_front", "D_front", "B_rear", "D_rear")
    columns = [model.parameters[n].column for n in names]
    low, high = np.array([model.bounds(n) for n in names]).T
    box = Box(columns, low, high)
    pulls = []
    for seed in range(12):
        drive = run_closed_loop(HARD, setup, seed=seed)
        motion = (1e-4, 1e-4, 1e-5)
        p = model.vector()
        p[columns] *= 1.02
        problem = problem_of(drive, model)
        frozen = problem.freeze(p, sensor_noise(drive, motion).vector())
        found = minimise(problem, p, frozen, box, rounds=20, tolerance=1e-3)
        told = information(drive, model, names, motion=motion)
        error = found.x - model.vector()[columns]
        pulls.append(float(error @ told @ error))
    # Chi-square with 48 degrees of freedom: 99.9 % lie between 23 and 84.
    assert 23.0 < sum(pulls) < 84.0


@pytest.mark.parametrize("load_share", [1.0, 0.5])
def test_information_is_about_the_parameters_of_the_model(setup: Setup, load_share: float) -> None:
    """Where the simulator lets the tyres feel a share of the load, too."""
    setup = replace(setup, simulator=replace(setup.simulator, load_share=load_share))
    gentle = excitation.multi_sine(lateral_mps2=3.0, speed_mps=20.0, duration_s=6.0)
    drive = run_closed_loop(gentle, setup, seed=1)
    names, model = ["B_front", "D_front", "D_rear"], setup.plant
    told = information(drive, model, names)
    problem = problem_of(drive, model, READINGS)
    frozen = problem.freeze(parameters_of(drive, model), sensor_noise(drive, MOTION).vector())

    def residuals(name: str, off: float) -> np.ndarray:
        moved = model.with_values({name: model.value(name) + off})
        return np.nan_to_num(problem.residuals(parameters_of(drive, moved), frozen)).ravel()

    step = 1e-4
    slopes = [(residuals(n, step) - residuals(n, -step)) / (2.0 * step) for n in names]
    np.testing.assert_allclose(told, np.inner(slopes, slopes), rtol=1e-4)


def test_information_adds_up_and_grows_with_readings(setup: Setup) -> None:
    drive = run_closed_loop(HARD, setup, seed=1)
    model = setup.plant
    whole = information(drive, model, TYRES)
    np.testing.assert_allclose(whole, whole.T, rtol=1e-9)
    without = information(drive, model, TYRES, readings=("yaw_rate_radps", "ay_mps2", "vx_mps"))
    assert np.linalg.inv(without)[7, 7] > np.linalg.inv(whole)[7, 7]
    fewer = information(drive, model, TYRES[:4])
    np.testing.assert_allclose(fewer, whole[:4, :4], rtol=1e-9)


def test_half_the_load_halves_the_grip_that_is_told() -> None:
    seen = preview(published.Identification(amplitude_rad=0.60), published.setup())
    assert seen["D_front"].value == 1.6
    assert seen["D_front"].relative < 0.01
    assert seen.coverage[0].reached > 1.0
    assert seen["E_rear"].relative > 10.0 * seen["E_front"].relative


def test_more_unknowns_make_each_less_certain(setup: Setup) -> None:
    alone = preview(HARD, setup)
    aero = tuple(n for n in setup.plant.names if n.startswith("aero"))
    both = preview(HARD, setup, free=(*TYRES, *aero))
    for name in TYRES:
        assert both[name].std >= alone[name].std * (1.0 - 1e-9)
    assert {e.name for e in both.expected} == {*TYRES, *aero}


def test_a_preview_draws_and_shows_itself(setup: Setup) -> None:
    seen = HARD.preview(setup)
    assert "front tyre: slip angle up to" in str(seen)
    assert "<table>" in seen._repr_html_()
    assert seen.plot().get_title().startswith("What multi_sine")


def test_a_design_keeps_its_limits_and_tells_what_the_published_drive_does_not(
    design: Design, setup: Setup
) -> None:
    seen = design.preview
    assert design.best.broken == ()
    assert design.limits.broken(seen) == []
    assert seen.drive.lost_s is None
    assert seen.road_width_m < design.limits.road_width_m
    assert design.best.relative < 0.2
    assert design.best.relative == max(
        t.relative for t in design.trials if t.cost == design.best.cost
    )
    for plain in (EASY, published.Identification(duration_s=20.0)):
        assert seen.worst.relative < 0.05 * preview(plain, setup).worst.relative


def test_a_design_from_wrong_tyres_serves_the_true_car(design: Design) -> None:
    # The true tyres were hidden from it.
    drive = run_closed_loop(design.excitation, design.setup, seed=5)
    assert drive.lost_s is None
    # Slip angles are limited against the believed peaks, and those were wrong.
    broken = {what for what, _ in design.limits.broken(preview(design.excitation, design.setup))}
    assert broken <= {"front slip angle", "rear slip angle"}
    assert preview(design.excitation, design.setup, seed=6).worst.relative < 0.2


def test_a_design_is_repeatable_and_better_with_more_trials(
    design: Design, setup: Setup, believed: Model
) -> None:
    again = design_excitation(
        setup, believed=believed, duration_s=20.0, trials=12, uncertainty=0.05, workers=1
    )
    assert again.excitation == design.excitation
    assert design.best.cost <= min(t.cost for t in design.trials[:6])


def test_a_design_draws_and_shows_itself(design: Design) -> None:
    assert "excitations tried" in str(design)
    assert "<table>" in design._repr_html_()
    assert len(design.plot().get_lines()) == 2


def test_limits_that_leave_nothing_are_told(setup: Setup) -> None:
    with pytest.raises(NumericalError, match="road width"):
        design_excitation(
            setup, limits=Limits(road_width_m=0.1), duration_s=10.0, trials=2, uncertainty=0.0
        )


def test_limits_follow_the_car(setup: Setup) -> None:
    car = setup.plant.vehicle
    lorry = car.replace(mass_kg=12000.0, lf_m=3.5, lr_m=2.5, yaw_inertia_kgm2=1e5, cg_height_m=1.2)
    assert Limits.usual(car) == Limits()
    assert Limits.usual(lorry).lateral_mps2 == DriveLimits.usual(lorry).lateral_mps2
    assert Limits.usual(lorry).fastest_mps == pytest.approx(45.0 * 25.0 / 36.0)
    assert Limits.usual(lorry, fastest_mps=20.0).fastest_mps == 20.0


@pytest.mark.parametrize("name", ["model", "lorry"])
def test_a_model_car_and_a_lorry_have_designs_by_default(name: str) -> None:
    """With the limits of an ordinary car the one left the road and the other tipped over."""
    lorry = example_vehicle().replace(
        mass_kg=12000.0, lf_m=3.5, lr_m=2.5, yaw_inertia_kgm2=1e5, cg_height_m=1.2
    )
    car = model_cars.car() if name == "model" else lorry
    made = design_excitation(Setup.of(Model(car)), duration_s=20.0, trials=8)
    assert not made.best.broken
    assert np.abs(made.preview.drive.truth["ay_mps2"]).max() <= made.limits.lateral_mps2
    assert made.preview.drive.truth["vx_mps"].max() <= 36.0 * min(car.wheelbase_m / 2.0, 1.0) ** 0.5


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda s: Limits(road_width_m=0.0), "road_width_m"),
        (lambda s: Limits(slowest_mps=20.0, fastest_mps=21.0), "no room"),
        (lambda s: design_excitation(s, trials=1), "trials"),
        (lambda s: excitation.Weaving(mean_mps=5.0, swing_mps=4.0), "3 m/s"),
        (lambda s: preview(EASY, s, free=("B_middle",)), "no parameter 'B_middle'"),
        (lambda s: preview(EASY, s, readings=("roll",)), "'roll'"),
        (
            lambda s: preview(
                EASY,
                replace(s, sensors=replace(s.sensors, steer_rad=Sensor(rate_hz=10.0))),
            ),
            "steer_rad or fx_n has no reading at sample 1",
        ),
    ],
)
def test_what_makes_no_sense_is_refused(
    make: Callable[[Setup], object], words: str, setup: Setup
) -> None:
    with pytest.raises(InvalidInput, match=words):
        make(setup)
