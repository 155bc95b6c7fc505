"""What a report draws: the first screen, the excerpt, maps, sizes, tyre curves."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from reported import TRUTH, ended_at_once, reported_study

import sysid_vehicle as sv
from sysid_vehicle.estimate import MEASURED, Driving
from sysid_vehicle.report import chart, figures
from sysid_vehicle.report.excerpt import worst_excerpt
from sysid_vehicle.report.samples import Samples, samples_of
from sysid_vehicle.report.screen import _effect, first_screen
from sysid_vehicle.report.tyres import driven_slip, identified_curves, model_curves
from sysid_vehicle.study import look_ahead


@pytest.fixture(scope="module")
def study() -> sv.Study:
    return reported_study()


@pytest.fixture(scope="module")
def samples(study: sv.Study) -> Samples:
    found = samples_of(study)
    assert found is not None
    return found


@pytest.fixture(scope="module")
def nothing_added(study: sv.Study) -> sv.Study:
    return ended_at_once(study)


def test_the_first_screen_tells_the_story(
    study: sv.Study, samples: Samples, nothing_added: sv.Study
) -> None:
    each = r'<div class="panel w\d+"><h2>(.*?)</h2>(.*?)(?=<div class="panel|</section>)'
    told = re.findall(each, "".join(first_screen(study, samples)), re.DOTALL)
    panels = dict(told)
    first = ["1 Compare", "2 Where", "3 Which", "4 Added", "5 Error falls"]
    assert list(panels) == [*first, "6 What remains"]
    assert study.in_the_end[:40] in panels["6 What remains"]
    assert panels["6 What remains"].count("Next: ") == len(study.next_steps)
    assert "measured" in panels["1 Compare"]
    assert f"predicted {0.5:g} s ahead" in panels["1 Compare"]
    assert str(study.test[0].regions[0]).split(",")[0] in panels["2 Where"]
    before, after = (c.error for c in study.test)
    alone = study.errors_with[0]["tyre_load_sensitivity"][1]
    assert f"{100.0 * (before - alone) / (before - 1.0):.0f} %" in panels["3 Which"]
    assert "tyre_load_sensitivity (" in panels["4 Added"]
    gain = np.degrees(study.horizons.gains(1)["yaw_rate_radps"][1])
    assert f"yaw rate {-gain:+.2g} deg/s" in panels["4 Added"]
    assert f"{before:.2f}" in panels["5 Error falls"]
    lengths = [float(x) for x in re.findall(r"width: ([\d.]+)%", panels["5 Error falls"])]
    assert lengths == pytest.approx([100.0, 100.0 * after / before, 100.0 / before], abs=0.06)
    bare = "".join(first_screen(nothing_added, samples_of(nothing_added)))
    assert "none of them improves the prediction of validation data" in bare
    untried = replace(nothing_added, stopped=(nothing_added.diagnoses[0].significant[0].id,))
    late = "".join(first_screen(untried, samples_of(nothing_added)))
    assert "none of them holds" not in late
    assert "the time limit ended before all were tried" in late
    assert "final" not in bare
    assert "5 Error<" in bare


def test_what_one_step_takes_off_is_no_single_effects(study: sv.Study) -> None:
    """Of effects that were added together nobody knows which takes what."""
    first, last = study.added[0], study.fits[-1]
    richer = replace(last, model=last.model.add("steer_lag"))
    both = replace(
        study,
        fits=(*study.fits[:-1], richer),
        added=(first, replace(first, id="steer_lag")),
    )
    assert "together with" not in _effect(study, first)
    assert "together with steer_lag changes the error" in _effect(both, first)


@pytest.mark.parametrize("slope_mps2", [0.0, 0.1])
def test_the_excerpt_is_where_the_baseline_predicts_worst(
    study: sv.Study, slope_mps2: float
) -> None:
    """What is predicted from a part of the driving is what all of it would give."""
    noise = replace(study.fit.noise, road=(slope_mps2, slope_mps2), road_time_s=2.0)
    last = replace(study.fit, noise=noise)
    study = replace(study, fits=(*study.fits[:-1], last))
    found = worst_excerpt(study)
    assert found is not None
    first, floor = study.fits[0], study.fit.noise.floor()
    ends = (first, study.fit)
    whole = look_ahead(first, floor, study.validation, found.horizon_s, between=ends)
    columns = [MEASURED.index(c) for c in found.channels]
    np.testing.assert_allclose(
        found.errors["baseline"], whole[found.where][:, columns], rtol=0.02, atol=2e-3
    )


def test_the_excerpt_has_the_offsets_of_its_log(nothing_added: sv.Study) -> None:
    """Those of all of it: a few seconds by themselves would take up every error."""
    before = nothing_added.fits[0]
    log = nothing_added.validation.logs[0]
    columns = {c: np.array(log[c]) for c in log.channels}
    columns["yaw_rate_radps"] += 0.01
    moved = sv.Log.from_arrays(columns, check=False)
    model = before.model.with_nuisances(("steer_offset", "gyro_bias"))
    fit = sv.identify(model, before.driving.logs, starts=1)
    study = replace(nothing_added, fits=(fit,), validation=Driving.of(moved))
    found = worst_excerpt(study)
    assert found is not None
    whole = look_ahead(fit, fit.noise.floor(), study.validation, found.horizon_s)
    np.testing.assert_allclose(
        found.errors["baseline"],
        whole[found.where][:, [MEASURED.index(c) for c in found.channels]],
        rtol=0.02,
        atol=2e-3,
    )


def test_samples_are_those_of_the_driving(study: sv.Study, samples: Samples) -> None:
    """Thinned, and dense where the baseline is worst; the track is as long as what was driven."""
    log, excerpt = study.validation.logs[0], samples.excerpt
    rows = np.searchsorted(log["time_s"], samples["t"] - 1e-6)
    np.testing.assert_array_equal(samples["ay"], log["ay_mps2"][rows])
    np.testing.assert_array_equal(samples["m.ay_mps2"], log["ay_mps2"][rows])
    np.testing.assert_array_equal(samples["t"][samples.inside], excerpt.time_s)
    for k, errors in enumerate(excerpt.errors.values()):
        left = (samples["m.ay_mps2"] - samples[f"p{k}.ay_mps2"])[samples.inside]
        np.testing.assert_allclose(left, errors[:, 1], atol=1e-9)
    residual = study.test[0].residual[rows]
    np.testing.assert_allclose(samples["s0"], np.nanmean(residual**2, axis=1))
    assert samples.has_track
    along = np.hypot(np.diff(samples["x"]), np.diff(samples["y"]))
    assert along.sum() == pytest.approx(samples["d"][-1] - samples["d"][0], rel=0.02)
    told = json.loads(samples.json())
    assert told.pop("logs") == ["other"]
    assert samples.time_label == "time [s]"
    assert {len(column) for column in told.values()} == {len(rows)}
    np.testing.assert_allclose(told["e0"], samples["e0"], rtol=1e-3)


def points(path: str) -> np.ndarray:
    return np.array(re.findall(r"[ML]([-\d.]+) ([-\d.]+)", path), dtype=float)


def test_a_chart_puts_values_where_its_axes_say() -> None:
    drawn = chart.Chart(200, 100, (0.0, 10.0), (-1.0, 1.0), left=40.0, bottom=24.0)
    drawn.line([0.0, 5.0, np.nan, 10.0], [-1.0, 0.0, 0.0, 1.0], "after")
    svg = drawn.svg("what it shows")
    path = re.search(r'class="line after" d="(.*?)"', svg)
    assert path is not None
    assert path[1].count("M") == 2, "it breaks where a value is missing"
    np.testing.assert_allclose(points(path[1]), [[40.0, 76.0], [116.0, 41.0], [192.0, 6.0]])
    at = {
        word: float(x)
        for x, word in re.findall(r'<text x="([\d.]+)"[^>]*"middle">(.*?)</text>', svg)
    }
    assert at["5"] == pytest.approx(116.0)
    assert 'aria-label="what it shows"' in svg


@pytest.mark.parametrize(
    ("low", "high", "most", "words"),
    [
        (0.0, 10.0, 5, ["0", "2", "4", "6", "8", "10"]),
        (-0.013, 0.021, 4, ["\u22120.01", "0.00", "0.01", "0.02"]),
        (13.2, 19.7, 7, ["14", "15", "16", "17", "18", "19"]),
        (1e4, 6e4, 3, ["20000", "40000", "60000"]),
    ],
)
def test_ticks_are_round(low: float, high: float, most: int, words: list[str]) -> None:
    assert [word for _, word in chart.ticks(low, high, most)] == words


def test_colours_run_from_end_to_end() -> None:
    found = chart.colours([-1.0, 1.0, 1.5, 2.0, 9.0], (1.0, 2.0), ("#000000", "#808080", "#ffffff"))
    assert found == ["#000000", "#000000", "#808080", "#ffffff", "#ffffff"]


def test_failure_maps_share_one_colour_scale(study: sv.Study) -> None:
    html = figures.failure_maps(study, "maps")
    drawn = [re.findall(r'fill="(#\w+)"', svg) for svg in html.split('<svg role="img"')[1:]]
    cells = [study.test[i].failure_map.error for i in (0, -1)]
    assert [len(d) for d in drawn] == [int(np.isfinite(c).sum()) for c in cells]
    errors = np.concatenate([c[np.isfinite(c)] for c in cells])
    ink = dict(zip(errors.tolist(), [*drawn[0], *drawn[1]], strict=True))
    order = sorted(ink)
    green = [int(ink[e][3:5], 16) for e in order]
    assert green == sorted(green), "the larger the error, the greener, in both maps"
    assert green[0] < 20 < 200 < green[-1]


def test_sizes_are_drawn_in_units_of_the_typical_one(study: sv.Study) -> None:
    html = figures.sizes(study, TRUTH, "sizes")
    typical = sv.effect("tyre_load_sensitivity").parameters[0].typical
    size = study.fit["tyre_load_sensitivity.sensitivity"].value / typical
    labels = re.findall(r'<text x="([\d.]+)"[^>]*"middle">([\u2212\d.]+)</text>', html)
    x, value = np.array([[float(a), float(b.replace("\u2212", "-"))] for a, b in labels]).T
    for kind, expected in (("after", size), ("truth", 0.25 / typical)):
        dot = re.search(rf'class="dots {kind} large" d="M([\d.]+) ', html)
        assert dot is not None
        assert np.interp(float(dot[1]), x, value) == pytest.approx(expected, abs=0.01)


def test_tyre_curves_are_those_at_the_load_of_the_car_that_was_found() -> None:
    slip = np.linspace(0.0, 0.2, 11)
    named = {"mass.relative_error": 0.1, "steer_ratio.ratio_error": 0.1}
    model = TRUTH.add(*(n.split(".")[0] for n in named)).with_values(named)
    for heavy, plain in zip(model_curves(model, slip), model_curves(TRUTH, slip), strict=True):
        np.testing.assert_allclose(heavy.force_n, 1.1 * plain.force_n, rtol=1e-9)


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


def test_the_last_label_of_an_axis_is_not_cut_off() -> None:
    drawn = chart.Chart(200, 100, (0.0, 1000.0), (-1.0, 1.0), left=40.0, bottom=24.0).svg()
    labels = re.findall(
        r'<text x="([0-9.]+)" y="[0-9.]+" text-anchor="middle">([0-9]+)</text>', drawn
    )
    assert labels[-1][1] == "1000"
    assert all(float(x) + 3.0 * len(word) <= 200.0 for x, word in labels)
