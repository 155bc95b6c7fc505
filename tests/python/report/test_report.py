"""The report: self-contained, written whole or not at all, and showing what the study found."""

import json
import re
import shutil
import subprocess
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from reported import TRUTH, ended_at_once, reported_study

import sysid_vehicle as sv
from sysid_vehicle.demo.story import findings
from sysid_vehicle.diagnose import EffectVerdict, Verdicts
from sysid_vehicle.report import figures, sections, write_report
from sysid_vehicle.report.samples import samples_of
from sysid_vehicle.report.words import interval, quantity, ranking_title, summary

UNTESTED = ("aero_drag", "speed_sensor_lever_arm")


@pytest.fixture(scope="module")
def study() -> sv.Study:
    return reported_study()


@pytest.fixture(scope="module")
def nothing_added(study: sv.Study) -> sv.Study:
    return ended_at_once(study)


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
    assert re.search(r"0\.4 m that is not modelled adds \+\d", told)


def test_a_report_in_markdown_has_its_text_and_tables(
    study: sv.Study, written: Path, tmp_path: Path
) -> None:
    study.report(tmp_path / "report.md")
    text = (tmp_path / "report.md").read_text("utf-8")
    lines = text.splitlines()
    assert lines[0].startswith("# Study of ")
    assert study.meaning in text
    assert "## 4 Added" in lines
    assert "## Parameters of the final model" in lines
    before, after = (c.error for c in study.test)
    assert f"- baseline: {before:.2f}" in lines
    assert f"- + tyre\\_load\\_sensitivity: {after:.2f}" in lines
    tables = re.findall(r"(?:^\|.*\|$\n)+", text, re.MULTILINE)
    assert len(tables) == written.read_text("utf-8").count("<table>")
    for table in tables:
        columns = {len(re.findall(r"(?<!\\)\|", line)) for line in table.splitlines()}
        assert len(columns) == 1, "as many cells in each line"
    assert "<" not in text.replace("\\<", "")


def test_a_study_is_a_table(study: sv.Study) -> None:
    pytest.importorskip("pandas")
    table = study.to_pandas()
    assert list(table.index) == list(study.steps)
    assert list(table["validation_error"]) == [c.error for c in study.test]
    ranking = study.diagnoses[0].to_pandas()
    assert list(ranking.index) == [c.id for c in study.diagnoses[0].ranking]


class Checker(HTMLParser):
    """Collects what would reach outside the file, and tags that are not closed."""

    EMPTY = frozenset({"meta", "img", "br", "hr", "link", "input"})

    def __init__(self) -> None:
        super().__init__()
        self.outside: list[str] = []
        self.pictures: list[str] = []
        self.open: list[str] = []
        self.text: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag not in self.EMPTY:
            self.open.append(tag)
        if tag in {"link", "iframe", "object"}:
            self.outside.append(tag)
        if tag == "svg" and dict(attrs).get("role") == "img":
            self.pictures.append(dict(attrs).get("aria-label") or "")
        for name, value in attrs:
            inside = (value or "").startswith(("#", "data:image/png;base64,"))
            if name in {"src", "href", "xlink:href"} and not inside:
                self.outside.append(f"{tag} {name}={value}")

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if not {"style", "script"} & set(self.open):
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
    assert len(page.pictures) >= 15
    assert all(page.pictures), "each tells those who do not see it what it shows"
    text = written.read_text(encoding="utf-8")
    assert len(text) < 1_000_000
    for drawn in re.findall(r"<figure.*?</figure>", text, re.DOTALL):
        assert not re.search(r"\b(nan|inf)\b", drawn, re.IGNORECASE)
    assert not re.search(r"url\(|import\(|fetch\(|XMLHttpRequest|src=", text)
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
    assert "none of them improves the prediction of validation data" in text
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
    together = "confounded with longitudinal_load_transfer in this driving"
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
    stand_in = replace(study.added[0], stands_in="no car has such a value", grade="alias")
    unknown = replace(study, verdict="unknown", added=(stand_in,))
    assert "no remaining error" in unknown.in_the_end
    assert "absorbed what is missing: tyre_load_sensitivity" in unknown.in_the_end
    assert "it compensates for something else: no car has such a value" in str(unknown)
    unsure = replace(unknown, added=(replace(stand_in, grade="plausible"),))
    assert "it may compensate for something else: no car" in str(unsure)
    assert "most likely missing" not in ranking_title(unknown)
    assert "most likely missing" in ranking_title(study)


def in_browser(page: Path, folder: Path, script: str, scheme: str = "light") -> dict[str, Any]:
    """What a script says of the page in a browser of 1400 x 900 pixels, beside what failed."""
    text = page.read_text("utf-8")
    listen = "<script>const failed=[];addEventListener('error',e=>failed.push(e.message))</script>"
    run = f"<script>document.title=JSON.stringify({{...(()=>{{{script}}})(),failed}})</script>"
    text = text.replace("<head>", f"<head>{listen}").replace("</body>", f"{run}</body>")
    page = folder / "page.html"
    page.write_text(text, "utf-8")
    dark = ["--force-dark-mode", "--blink-settings=preferredColorScheme=0"]
    command = [
        *("chromium", "--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars"),
        *(f"--user-data-dir={folder / 'profile'}", "--window-size=1400,900"),
        *(dark if scheme == "dark" else ["--blink-settings=preferredColorScheme=1"]),
        *("--dump-dom", page.as_uri()),
    ]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
    title = re.search(r"<title>(.*?)</title>", done.stdout)
    assert title is not None
    found: dict[str, Any] = json.loads(title[1].replace("&amp;", "&"))
    assert found["failed"] == []
    return found


needs_browser = pytest.mark.skipif(shutil.which("chromium") is None, reason="there is no chromium")


@pytest.mark.manual
@needs_browser
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_the_story_fits_on_one_screen(written: Path, tmp_path: Path, scheme: str) -> None:
    script = """const p=[...document.querySelectorAll('.panel')];return {
        bottom:Math.max(...p.map(e=>e.getBoundingClientRect().bottom)),
        wide:document.documentElement.scrollWidth,
        cut:p.filter(e=>e.scrollWidth>e.clientWidth).length,
        paper:getComputedStyle(document.body).backgroundColor,
        ink:getComputedStyle(document.querySelector('figure svg text')).fill}"""
    found = in_browser(written, tmp_path, script, scheme)
    assert found["bottom"] <= 900.0
    assert found["wide"] <= 1400
    assert found["cut"] == 0
    paper = [int(x) for x in re.findall(r"\d+", found["paper"])]
    ink = [int(x) for x in re.findall(r"\d+", found["ink"])]
    assert (sum(paper) < 200 < sum(ink)) == (scheme == "dark")


_BRUSH = """
const all = [...document.querySelectorAll('svg[data-link]')];
const of = link => all.find(s => s.dataset.link === link);
const send = (to, type, s, x, y) => { const b = s.getBoundingClientRect();
  to.dispatchEvent(new PointerEvent(type, { clientX: b.left + x * b.width,
    clientY: b.top + y * b.height, bubbles: true })); };
const drag = (s, a, b, c, d) => { send(s, 'pointerdown', s, a, b);
  send(window, 'pointermove', s, c, d); send(window, 'pointerup', s, c, d); };
const count = (s, name) => (s.querySelector(name).getAttribute('d').match(/M/g) || []).length;
const now = () => ({
  rings: all.filter(s => s.dataset.link.includes(',')).map(s => count(s, 'path.selected')),
  spans: all.filter(s => s.dataset.link === 't').map(s => count(s, 'path.span')),
  ticks: [...document.querySelectorAll('svg[data-link=zoom][data-bare=""] .xt text')]
    .map(e => Number(e.textContent)),
  said: document.querySelector('[role=status]').textContent });
const out = { first: now() };
drag(of('t'), 0.3, 0.2, 0.6, 0.4); out.span = now();
drag(of('ay,ax'), 0.1, 0.05, 0.5, 0.5); out.region = now();
send(of('zoom'), 'pointermove', of('zoom'), 0.5, 0.5);
out.tip = document.querySelector('.tip').textContent;
out.cursors = all.filter(s => s.querySelector('.cursor').getAttribute('d')).length;
document.querySelectorAll('.tools button')[1].click(); out.all = now();
of('zoom').dispatchEvent(new KeyboardEvent('keydown', { key: 'Escape' })); out.last = now();
return { ...out, pictures: all.length };
"""


@pytest.mark.manual
@needs_browser
def test_every_picture_follows_what_is_brushed_in_one(
    study: sv.Study, written: Path, tmp_path: Path
) -> None:
    found = in_browser(written, tmp_path, _BRUSH)
    samples = samples_of(study)
    assert samples is not None
    t, ay, ax = (samples[c] for c in ("t", "ay", "ax"))
    inside = int(samples.inside.sum())
    assert set(found["first"]["rings"]) == {inside}
    # The frame of the chart of all the driving, of 768 px: 46 px at the left, 8 px at the right.
    at = t[0] + (t[-1] - t[0]) * (768.0 * np.array([0.3, 0.6]) - 46.0) / 714.0
    chosen = int(np.count_nonzero((t >= at[0]) & (t <= at[1])))
    assert all(abs(n - chosen) <= 4 for n in found["span"]["rings"])
    assert at[0] <= min(found["span"]["ticks"]) < max(found["span"]["ticks"]) <= at[1] + 1e-6
    # From speed and accelerations at the upper left: turning right while driven.
    region = found["region"]
    assert len(set(region["rings"])) == 1
    middle = 0.5 * (ax.min() + ax.max())
    assert 0 < region["rings"][0] <= int(np.count_nonzero((ay < 1.0) & (ax > middle - 0.5)))
    assert set(region["spans"]) == {region["spans"][0]}
    assert region["spans"][0] > 1
    assert found["tip"].count("\n") == 4, "time, speed, measured and both models"
    assert found["cursors"] == found["pictures"]
    assert set(found["all"]["rings"]) == {len(t)}
    both = [float(x) for x in re.findall(r"\d+\.\d\d", found["all"]["said"])]
    assert both == pytest.approx([c.error for c in study.test], rel=0.05)
    assert found["last"] == found["first"]
