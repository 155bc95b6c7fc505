"""The report: self-contained, written whole or not at all, and showing what the study found."""

import base64
import re
import warnings
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

import sysid_vehicle as sv
from sysid_vehicle import _style
from sysid_vehicle.demo.story import findings
from sysid_vehicle.diagnose import EffectVerdict, Verdicts
from sysid_vehicle.report import figures, sections, write_report
from sysid_vehicle.report.excerpt import worst_excerpt
from sysid_vehicle.report.tyres import driven_slip, identified_curves, model_curves
from sysid_vehicle.report.words import interval, quantity, ranking_title, summary

TRUTH = (
    sv.Model(sv.example_vehicle())
    .add("tyre_load_sensitivity")
    .with_values({"tyre_load_sensitivity.sensitivity": 0.25})
)

UNTESTED = ("aero_drag", "steer_ratio")


@pytest.fixture(scope="module")
def study() -> sv.Study:
    train = sv.drive(TRUTH, sv.manoeuvres.lap(30.0), seed=1, rate_hz=50.0, name="lap & <30 s>")
    test = sv.drive(TRUTH, sv.manoeuvres.handling_course(25.0), seed=2, rate_hz=50.0, name="other")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sv.SysidWarning)
        return sv.improve(
            sv.Model(TRUTH.vehicle),
            train,
            test,
            candidates=["tyre_load_sensitivity", "steer_lag"],
            starts=2,
        )


@pytest.fixture(scope="module")
def nothing_added(study: sv.Study) -> sv.Study:
    """The same as if the search had ended at once."""
    return replace(
        study,
        verdict="unknown",
        fits=study.fits[:1],
        diagnoses=study.diagnoses[:1],
        train=study.train[:1],
        test=study.test[:1],
        added=(),
    )


@pytest.fixture(scope="module")
def written(study: sv.Study, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("report") / "report.html"
    study.report(path)
    return path


def test_what_the_driving_cannot_test_is_told_by_refits(study: sv.Study) -> None:
    seen = "".join(sections._hidden(study))
    assert "would have been seen" in seen
    open_ = Verdicts(tuple(EffectVerdict(sv.effect(e), "not testable") for e in UNTESTED))
    told = "".join(sections._hidden(replace(study, verdicts=open_)))
    assert "Of the 2 effects that are not testable" in told
    assert "0.45 m2 that is not modelled adds less than one percent to any parameter" in told
    assert re.search(r"ratio_error 0\.08 that is not modelled adds \+\d", told)


class Checker(HTMLParser):
    """Collects what would reach outside the file, and tags that are not closed."""

    EMPTY = frozenset({"meta", "img", "br", "hr", "link", "input"})

    def __init__(self) -> None:
        super().__init__()
        self.outside: list[str] = []
        self.images: list[str] = []
        self.open: list[str] = []
        self.text: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag not in self.EMPTY:
            self.open.append(tag)
        if tag in {"script", "link", "iframe", "object"}:
            self.outside.append(tag)
        for name, value in attrs:
            if name in {"src", "href"}:
                if tag == "img" and value and value.startswith("data:image/svg+xml;base64,"):
                    self.images.append(value)
                else:
                    self.outside.append(f"{tag} {name}={value}")

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text.append(data)


def read(path: Path) -> Checker:
    checker = Checker()
    checker.feed(path.read_text(encoding="utf-8"))
    checker.close()
    return checker


def test_a_report_is_whole_and_needs_no_other_file(written: Path) -> None:
    page = read(written)
    assert page.open == []
    assert page.outside == []
    assert len(page.images) >= 8
    for image in page.images:
        svg = base64.b64decode(image.partition(",")[2]).decode("utf-8")
        assert svg.rstrip().endswith("</svg>")
        drawn = re.sub(r'"data:image/png;base64,[^"]*"', "", svg)  # any letters may occur there
        assert not re.search(r"\bnan\b", drawn, re.IGNORECASE)
    assert "url(http" not in written.read_text(encoding="utf-8")
    assert [p.name for p in written.parent.iterdir()] == ["report.html"]


def test_a_report_tells_where_it_fails_and_the_shape_of_what_is_unknown(
    study: sv.Study, nothing_added: sv.Study, written: Path, tmp_path: Path
) -> None:
    text = " ".join(read(written).text)
    assert "Where, when and how fast the model fails" in text
    assert [title for title, _ in study.where_lines] == [
        "Where the baseline fails",
        "Where the final model (with tyre_load_sensitivity) fails",
    ]
    for title, lines in study.where_lines:
        assert title in text
        for line in lines:
            assert line[1:] in text
    assert "The shape of what is missing" not in text
    nothing_added.report(tmp_path / "unknown.html")
    text = " ".join(read(tmp_path / "unknown.html").text)
    assert "The shape of what is missing" in text
    assert nothing_added.unknown is not None
    for proposal in nothing_added.unknown.proposals:
        assert str(proposal) in text


def test_a_report_tells_what_the_study_found(study: sv.Study, written: Path) -> None:
    text = " ".join(read(written).text)
    found = study.fit["tyre_load_sensitivity.sensitivity"]
    assert study.meaning in text
    assert quantity(found.value) in text
    assert interval(found) in text
    assert str(study.omnibus) in text
    for warning in study.warnings:
        assert warning in text
    for channel, score in study.test[-1].channels.items():
        assert channel in text
        assert f"{score.nrmse:.2f}" in text
    for sensor in study.fit.noise.sensor:
        assert f"{sensor:.3g}" in text
    assert "lap & <30 s>" in text, "names of logs are shown as they are"
    assert "truth" not in text


def test_the_truth_stands_beside_what_was_found_where_it_is_known(
    study: sv.Study, tmp_path: Path
) -> None:
    path = tmp_path / "report.html"
    write_report(study, path, truth=TRUTH)
    rows = re.findall(r"<tr>(.*?)</tr>", path.read_text(encoding="utf-8"))
    cells = {r[0]: r[-1] for r in (re.findall(r"<td>(.*?)</td>", row) for row in rows) if r}
    assert cells["tyre_load_sensitivity.sensitivity"] == "0.25"
    assert cells["B_front"] == quantity(TRUTH.vehicle.tyre_front.B)
    load = TRUTH.vehicle.mass_kg * 9.80665 * TRUTH.vehicle.lr_m / TRUTH.vehicle.wheelbase_m
    stiffness = TRUTH.vehicle.tyre_front.cornering_stiffness_per_load * load
    assert float(cells["cornering stiffness front"]) == pytest.approx(stiffness, rel=1e-4)


def test_the_same_study_gives_the_same_bytes(
    study: sv.Study, written: Path, tmp_path: Path
) -> None:
    study.report(tmp_path / "again.html")
    assert (tmp_path / "again.html").read_bytes() == written.read_bytes()


def test_a_study_that_added_nothing_has_one_column_and_no_equations(
    nothing_added: sv.Study, tmp_path: Path
) -> None:
    path = tmp_path / "report.html"
    nothing_added.report(path)
    text = " ".join(read(path).text)
    assert "none of them holds on validation data" in text
    assert "final model" not in re.sub(
        "Parameters of the final model|the final model still", "", text
    )
    assert "Equations of the added effects" not in text


def test_a_failing_figure_leaves_the_old_report_alone(
    study: sv.Study, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "report.html"
    path.write_text("old", encoding="utf-8")

    def fail(*_: object) -> None:
        raise RuntimeError("no ink")

    monkeypatch.setattr(figures, "overlay", fail)
    with pytest.raises(RuntimeError, match="no ink"):
        study.report(path)
    assert path.read_text(encoding="utf-8") == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["report.html"]


def test_a_folder_that_does_not_exist_is_named(study: sv.Study, tmp_path: Path) -> None:
    with pytest.raises(sv.InvalidInput, match=r"nowhere.*choose a folder that exists"):
        study.report(tmp_path / "nowhere" / "report.html")


def test_a_report_opens_no_window_and_leaves_no_figure(study: sv.Study, tmp_path: Path) -> None:
    from matplotlib import pyplot

    before = dict(pyplot.rcParams)
    study.report(tmp_path / "report.html")
    assert pyplot.get_fignums() == []
    assert dict(pyplot.rcParams) == before


def test_the_summary_has_three_sentences_with_the_figures(
    study: sv.Study, nothing_added: sv.Study
) -> None:
    verdict, effects, errors = summary(study)
    assert study.meaning in verdict
    assert "tyre_load_sensitivity: sensitivity = " in effects
    assert f"from {study.test[0].error:.2f} to {study.test[-1].error:.2f}" in errors
    assert "tyre_load_sensitivity" in summary(nothing_added)[1]
    assert "fell" not in summary(nothing_added)[2]


def test_an_error_that_rose_did_not_fall(study: sv.Study) -> None:
    def errors(before: float, after: float) -> str:
        first, last = (
            replace(c, error=e) for c, e in zip(study.test, (before, after), strict=True)
        )
        return summary(replace(study, test=(first, last)))[2]

    assert "fell from 1.32 to 1.22" in errors(1.32, 1.22)
    assert "rose from 1.22 to 1.32" in errors(1.22, 1.32)
    assert "stayed at 1.22" in errors(1.221, 1.219)


def test_what_cannot_be_told_apart_is_named_together(study: sv.Study, tmp_path: Path) -> None:
    group = replace(study.added[0], confounded_with=("longitudinal_load_transfer",))
    either = replace(study, added=(group,))
    together = "or else longitudinal_load_transfer, which this driving cannot tell from it"
    assert together in str(either)
    assert together in either._repr_html_()
    assert together in summary(either)[1]
    assert together in ranking_title(either)
    assert together in "\n".join(findings(either))
    assert either.steps[1] == "+ tyre_load_sensitivity or longitudinal_load_transfer"
    (told,) = either.to_dict()["effects"]
    assert told["confounded_with"] == ["longitudinal_load_transfer"]
    path = tmp_path / "either.html"
    either.report(path)
    text = " ".join(read(path).text)
    assert together in text
    assert "+ tyre_load_sensitivity or longitudinal_load_transfer" in str(either.waterfall())


def test_a_stand_in_is_not_said_to_be_missing(study: sv.Study) -> None:
    """Nothing is left, and still something is missing: the text says how both can be."""
    stand_in = replace(study.added[0], stands_in="no car has such a value")
    unknown = replace(study, verdict="unknown", added=(stand_in,))
    assert "nothing left" in unknown.in_the_end
    assert "taken up by stand-ins: tyre_load_sensitivity" in unknown.in_the_end
    assert "it only stands in for something else: no car has such a value" in str(unknown)
    assert "most likely missing" not in ranking_title(unknown)
    assert "most likely missing" in ranking_title(study)


def test_bars_are_as_high_as_the_errors(study: sv.Study) -> None:
    ax = figures.errors_by_step(study)
    assert [bar.get_height() for bar in ax.patches] == [c.error for c in study.test]
    labels = [t.get_text() for t in ax.get_xticklabels()]
    assert labels == ["baseline", "+ tyre_load_sensitivity"]
    assert ax.get_yscale() == "linear" or max(c.error for c in study.test) > 8.0


def test_a_wide_range_of_errors_gets_a_logarithmic_axis(study: sv.Study) -> None:
    wild = replace(study, test=(replace(study.test[0], error=40.0), study.test[1]))
    assert figures.errors_by_step(wild).get_yscale() == "log"


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
