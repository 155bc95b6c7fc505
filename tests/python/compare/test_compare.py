"""The one-step error of a model, by channel and by where it drives."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from matplotlib import pyplot

from sysid_vehicle import (
    Comparison,
    Driving,
    Fit,
    InvalidInput,
    Log,
    Model,
    SysidWarning,
    compare,
    drive,
    identify,
    manoeuvres,
)
from sysid_vehicle.compare import FailureMap, Region, one_step_error
from sysid_vehicle.estimate import MEASURED


@pytest.fixture(scope="module")
def validation(fine_fit: Fit, fine_course: Log) -> Comparison:
    return compare(fine_fit, fine_course)


@pytest.fixture(scope="module")
def dragged(fit: Fit, truth: Model) -> Comparison:
    """The complete model against a car with more drag than it knows."""
    car = truth.add("aero_drag").with_values({"aero_drag.drag_area_m2": 0.45})
    log = drive(car, manoeuvres.handling_course(30.0, lateral_mps2=7.5), seed=2)
    return compare(fit, log)


def test_a_complete_model_is_at_the_noise_floor(validation: Comparison) -> None:
    assert validation.error == pytest.approx(1.0, abs=0.03)
    for score in validation.channels.values():
        assert score.nrmse == pytest.approx(1.0, abs=0.05)
        assert score.rmse == pytest.approx(score.noise_floor, rel=0.05)
        assert score.r2 > 0.99


def test_figures_of_a_channel_are_those_of_its_readings(
    dragged: Comparison, fit: Fit, course: Log
) -> None:
    found = compare(fit, course)
    for i, (name, score) in enumerate(found.channels.items()):
        assert score.r2 == pytest.approx(1.0 - score.rmse**2 / np.var(course[name]), rel=1e-9)
        assert score.nrmse == pytest.approx(np.sqrt(np.mean(found.residual[:, i] ** 2)), rel=1e-9)
    assert dragged.channels["vx_mps"].r2 < found.channels["vx_mps"].r2 < 1.0
    assert one_step_error(fit, Driving.of(course), fit.noise) == pytest.approx(found.error)


def test_it_is_there_on_the_driving_it_was_fitted_to_as_well(fit: Fit) -> None:
    assert compare(fit, fit.driving).error == pytest.approx(1.0, abs=0.02)


def test_a_hidden_effect_is_above_the_floor(dragged: Comparison) -> None:
    assert dragged.error > 1.2
    nrmse = {c: s.nrmse for c, s in dragged.channels.items()}
    assert max(nrmse, key=lambda c: nrmse[c]) in ("vx_mps", "ax_mps2")
    assert nrmse["yaw_rate_radps"] < 0.5 * nrmse["vx_mps"]


def test_regions_lie_where_the_effect_acts(fit: Fit, truth: Model) -> None:
    car = truth.add("lateral_load_transfer")
    names = [n for n in car.names if n.startswith("lateral_load_transfer.")]
    hidden = car.with_values({n: 2.0 * car.parameters[n].typical for n in names})
    log = drive(hidden, manoeuvres.handling_course(30.0, lateral_mps2=7.5), seed=2)
    regions = compare(fit, log).regions
    assert regions
    # It grows with the square of the lateral acceleration.
    assert all(abs(sum(r.lateral_mps2) / 2) > 2.0 for r in regions)
    assert all(r.error > 1.1 for r in regions)
    shares = [r.share for r in regions]
    assert shares == sorted(shares, reverse=True)
    assert 0.0 < sum(shares) <= 1.0 + 1e-12


def test_every_measured_channel_has_a_score(validation: Comparison) -> None:
    assert tuple(validation.channels) == MEASURED


def test_channels_that_were_not_measured_have_none(
    fit: Fit, course: Log, altered: Callable[..., Log]
) -> None:
    blind = compare(fit, altered(course, without=["vy_mps"]))
    assert tuple(blind.channels) == tuple(c for c in MEASURED if c != "vy_mps")
    assert np.isnan(blind.residual[:, MEASURED.index("vy_mps")]).all()
    assert blind.error == pytest.approx(1.0, abs=0.03)
    no_force = compare(fit, altered(course, without=["fx_n"]))
    assert "ax_mps2" not in no_force.channels


def test_a_force_that_the_fit_did_not_have_is_not_used_and_this_is_said(
    start: Model, lap: Log, course: Log, altered: Callable[..., Log]
) -> None:
    """Its accelerometer has no noise in that fit, and every reading would seem a failure."""
    blind = identify(start, altered(lap, without=["fx_n"]), starts=1)
    with pytest.warns(SysidWarning, match=r"course.*without the wheel force.*fx_n is not used"):
        found = compare(blind, course)
    assert "ax_mps2" not in found.channels
    assert found.error == pytest.approx(1.0, abs=0.05)
    with pytest.raises(InvalidInput, match=r"course.*has no ax_mps2, and the fit was made without"):
        compare(blind, altered(course, without=["ax_mps2"]))


def test_a_channel_whose_noise_the_fit_did_not_learn_has_no_score(
    start: Model, lap: Log, course: Log
) -> None:
    """It was called twelve times as wrong as its noise, for a model without error."""
    blind = identify(start, lap.without("ax_mps2"), starts=1)
    with pytest.warns(SysidWarning, match="ax_mps2 of handling_course is not used: lap does not"):
        found = compare(blind, course)
    assert "ax_mps2" not in found.channels
    assert found.error == pytest.approx(1.0, abs=0.05)
    assert set(compare(blind, course.without("ax_mps2")).channels) == set(found.channels)


def test_samples_keep_their_place(validation: Comparison, fine_fit: Fit, fine_course: Log) -> None:
    fit, course = fine_fit, fine_course
    assert np.array_equal(validation.time_s, course["time_s"])
    assert validation.residual.shape == (course.n, 5)
    both = compare(fit, [course, course])
    assert both.log_number.tolist() == [0.0] * course.n + [1.0] * course.n
    assert np.array_equal(both.residual[: course.n], both.residual[course.n :])
    assert both.error == pytest.approx(validation.error, rel=1e-12)
    assert both.log_likelihood == pytest.approx(2.0 * validation.log_likelihood, rel=1e-12)


def test_louder_noise_makes_the_same_error_smaller(fit: Fit, course: Log) -> None:
    louder = type(fit.noise).from_vector(2.0 * fit.noise.vector())
    assert compare(fit, course, noise=louder).error == pytest.approx(0.5, abs=0.05)


def test_the_map_counts_excess_and_leaves_empty_cells_out(fit: Fit, course: Log) -> None:
    driving = Driving.of(course)
    white = np.ones((driving.samples, 5))
    there = np.full(driving.samples, 5)
    fast = course["vx_mps"] > np.percentile(course["vx_mps"], 70.0)
    white[fast] = 3.0
    found = FailureMap.of(driving, white**2 @ np.ones(5), there)
    assert found.error.shape == (len(found.speed_mps) - 1, len(found.lateral_mps2) - 1)
    assert np.isnan(found.error).any()
    assert np.nanmin(found.error) == pytest.approx(1.0)
    assert np.nanmax(found.error) == pytest.approx(3.0)
    edge = np.percentile(course["vx_mps"], 70.0)
    assert all(r.speed_mps[1] > edge for r in found.worst())
    assert FailureMap.of(driving, 0.81 * there, there).worst() == ()


def test_it_prints_and_draws(validation: Comparison, dragged: Comparison) -> None:
    for text in (str(dragged), dragged._repr_html_()):
        assert "vx_mps" in text
        assert f"{dragged.error:.3f} of the noise floor" in text
        assert str(dragged.regions[0]) in text
    _, (left, right) = pyplot.subplots(1, 2)
    assert dragged.plot(left) is left
    assert left.get_ylabel() == "speed [m/s]"
    assert validation.plot_residuals(right) is right
    drawn = {line.get_label() for line in right.get_lines()}
    assert set(MEASURED) <= drawn
    assert validation.plot() is not None
    assert validation.plot_residuals() is not None


def test_residuals_are_drawn_over_the_seconds_driven(fit: Fit, course: Log) -> None:
    """What lies between stretches and logs takes no time; a value that stands has that rms."""
    two = compare(fit, [course.between(0.0, 10.0), course.between(20.0, 25.0)])
    steady = replace(two, residual=np.full_like(two.residual, -2.0))
    steady.residual[::3] = np.nan
    line = steady.plot_residuals().get_lines()[0]
    step = 1.0 / course.rate_hz
    assert line.get_xdata()[-1] == pytest.approx(15.0 + step, abs=1e-6)
    assert np.diff(line.get_xdata()) == pytest.approx(step)
    shown = line.get_ydata()[np.isfinite(line.get_ydata())]
    assert len(shown) == len(line.get_ydata()) - 1  # the line is broken once, between the logs
    assert shown == pytest.approx(2.0)


def test_cells_of_a_slow_car_have_two_ends() -> None:
    assert str(Region((27.4, 29.6), (6.31, 8.1), 0.12, 5.79)).startswith(
        "27 to 30 m/s, lateral acceleration +6.3 to +8.1 m/s2: 12 %"
    )
    assert str(Region((2.61, 2.93), (-0.02, 0.03), 0.07, 7.84)).startswith(
        "2.6 to 2.9 m/s, lateral acceleration -0.02 to +0.03 m/s2: 7 %"
    )
