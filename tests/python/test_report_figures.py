"""What a report draws: the first screen, the excerpt, maps, sizes, tyre curves."""

import re
from dataclasses import replace

import numpy as np
import pytest
from reported import TRUTH, ended_at_once, reported_study

import sysid_vehicle as sv
from sysid_vehicle import _style
from sysid_vehicle.estimate import MEASURED
from sysid_vehicle.report import figures
from sysid_vehicle.report.excerpt import worst_excerpt
from sysid_vehicle.report.screen import first_screen
from sysid_vehicle.report.tyres import driven_slip, identified_curves, model_curves
from sysid_vehicle.study import look_ahead


@pytest.fixture(scope="module")
def study() -> sv.Study:
    return reported_study()


@pytest.fixture(scope="module")
def nothing_added(study: sv.Study) -> sv.Study:
    return ended_at_once(study)


def test_the_first_screen_tells_the_story(study: sv.Study, nothing_added: sv.Study) -> None:
    told = re.findall(r'<div class="panel w\d"><h2>(.*?)</h2>(.*?)(?=<div class="panel|</section>)',
                      "".join(first_screen(study)), re.DOTALL)  # fmt: skip
    panels = dict(told)
    assert list(panels) == ["1 Compare", "2 Where", "3 Which", "4 Added", "5 Error falls"]
    assert "measured" in panels["1 Compare"]
    assert f"predicted {0.5:g} s ahead" in panels["1 Compare"]
    assert str(study.test[0].regions[0]).split(",")[0] in panels["2 Where"]
    before, after = (c.error for c in study.test)
    alone = study.errors_with[0]["tyre_load_sensitivity"][1]
    assert f"{100.0 * (before - alone) / (before - 1.0):.0f} %" in panels["3 Which"]
    assert "tyre_load_sensitivity (" in panels["4 Added"]
    gain = np.degrees(study.horizons.gains(1)["yaw_rate_radps"][1])
    assert f"{gain:.2g} deg/s of yaw rate" in panels["4 Added"]
    assert f"{before:.2f}" in panels["5 Error falls"]
    lengths = [float(x) for x in re.findall(r"width: ([\d.]+)%", panels["5 Error falls"])]
    assert lengths == pytest.approx([100.0, 100.0 * after / before, 100.0 / before], abs=0.06)
    bare = "".join(first_screen(nothing_added))
    assert "none of them holds on validation data" in bare
    assert "final" not in bare
    assert "5 Error<" in bare


def test_the_excerpt_is_where_the_baseline_predicts_worst(study: sv.Study) -> None:
    """What is predicted from a part of the driving is what all of it would give."""
    found = worst_excerpt(study)
    assert found is not None
    whole = look_ahead(study.fits[0], study.fit.noise.floor(), study.validation, found.horizon_s)
    columns = [MEASURED.index(c) for c in found.channels]
    np.testing.assert_allclose(
        found.errors["baseline"], whole[found.where][:, columns], rtol=0.02, atol=2e-3
    )


def test_a_place_is_shown_on_a_track_or_over_both_accelerations(study: sv.Study) -> None:
    found = worst_excerpt(study)
    assert found is not None
    ax = _style.framed(5.0, 4.0).add_subplot()
    assert figures.place(study, found, ax) == "Track from speed and yaw rate"
    log = study.validation.logs[0]
    distance = float(np.sum(log["vx_mps"]) / log.rate_hz)
    drawn = np.asarray(ax.collections[0].get_offsets())
    along = float(np.hypot(*np.diff(drawn, axis=0).T).sum())
    assert along == pytest.approx(distance, rel=0.02)


def test_failure_maps_share_one_colour_scale(study: sv.Study) -> None:
    axes = _style.new_figure(8.0, 3.0).subplots(1, 2)
    figures.failure_maps(study, list(axes))
    scales = [ax.collections[0].get_clim() for ax in axes]
    assert scales[0] == scales[1]
    shown = [np.ma.filled(ax.collections[0].get_array(), np.nan) for ax in axes]
    for values, comparison in zip(shown, (study.test[0], study.test[-1]), strict=True):
        np.testing.assert_array_equal(values, comparison.failure_map.error)


def test_sizes_are_drawn_in_units_of_the_typical_one(study: sv.Study) -> None:
    ax = figures.sizes(study, truth=TRUTH)
    drawn = [line.get_xdata() for line in ax.lines if line.get_marker() == "o"]
    typical = sv.effect("tyre_load_sensitivity").parameters[0].typical
    size = study.fit["tyre_load_sensitivity.sensitivity"].value / typical
    assert float(np.ravel(drawn[0])[0]) == pytest.approx(size)
    truth = [line.get_xdata() for line in ax.lines if line.get_marker() == "|"]
    assert any(np.ravel(x)[0] == pytest.approx(0.25 / typical) for x in truth)


def test_tyre_curves_follow_the_magic_formula() -> None:
    slip = np.linspace(0.0, 0.2, 41)
    for curve, axle, arm in zip(
        model_curves(TRUTH, slip), ("front", "rear"), ("lr_m", "lf_m"), strict=True
    ):
        v = TRUTH.vehicle
        t = TRUTH.tyre_of_vehicle(axle)
        load = v.mass_kg * 9.80665 * getattr(v, arm) / v.wheelbase_m
        x = t.B * slip
        force = load * t.D * np.sin(t.C * np.arctan(x - t.E * (x - np.arctan(x))))
        np.testing.assert_allclose(curve.force_n, force, rtol=2e-4)


def test_the_band_of_a_tyre_curve_is_that_of_many_draws(study: sv.Study) -> None:
    fit = study.fit
    curves = identified_curves(fit)
    # Far smaller than it is, so that the curve is straight over the spread.
    small = replace(fit, covariance=1e-12 * fit.covariance)
    band = identified_curves(small)
    values = [e.value for e in fit.estimates]
    rng = np.random.default_rng(3)
    draws = rng.multivariate_normal(values, small.covariance, size=400, method="eigh")
    slip = curves[0].slip_rad[::12]
    forces = []
    for draw in draws:
        named = {e.name: float(x) for e, x in zip(fit.estimates, draw, strict=True)}
        forces.append([c.force_n for c in model_curves(fit.model.with_values(named), slip)])
    spread = np.std(forces, axis=0)
    for i in range(2):
        np.testing.assert_allclose(band[i].std_n[::12][1:], spread[i][1:], rtol=0.15)
        np.testing.assert_allclose(1e6 * band[i].std_n, curves[i].std_n, rtol=1e-6)


def test_the_truth_lies_near_the_curve_where_the_car_was_driven(study: sv.Study) -> None:
    curves = identified_curves(study.fit)
    truth = model_curves(TRUTH, curves[0].slip_rad)
    for found, true, driven in zip(curves, truth, driven_slip(study.fit), strict=True):
        assert 0.02 < found.driven_rad == driven < 0.15
        inside = found.slip_rad < driven
        miss = np.abs(found.force_n - true.force_n)[inside]
        assert miss.max() < 0.03 * true.force_n.max()


def test_the_worst_excerpt_is_where_the_baseline_is_worst(study: sv.Study) -> None:
    excerpt = worst_excerpt(study, seconds=4.0, horizon_s=0.5)
    assert excerpt is not None
    assert excerpt.channels == ("yaw_rate_radps", "ay_mps2")
    assert excerpt.time_s[-1] - excerpt.time_s[0] == pytest.approx(4.0 - 0.02)
    log = study.validation.logs[0]
    first = int(np.searchsorted(log["time_s"], excerpt.time_s[0]))
    np.testing.assert_array_equal(
        excerpt.measured[:, 1], log["ay_mps2"][first : first + len(excerpt.time_s)]
    )
    before, after = (np.sqrt(np.mean(e**2, axis=0)) for e in excerpt.errors.values())
    assert np.all(before > 3.0 * after)
    longer = worst_excerpt(study, seconds=29.0)
    assert longer is not None
    whole = np.sqrt(np.mean(longer.errors["baseline"] ** 2, axis=0))
    assert np.all(before > whole)


def test_a_horizon_longer_than_the_driving_gives_no_excerpt(study: sv.Study) -> None:
    assert worst_excerpt(study, horizon_s=60.0) is None
