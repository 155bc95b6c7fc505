"""The exam keeps its books: what is hidden, what was found, and how often."""

import json
import re
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import sysid_vehicle as sv

BENCHMARK = ("exam", "confusion", "design", "rates", "rivals", "store", "tables", "trial", "truths")


@pytest.fixture(scope="module")
def exam(program: SimpleNamespace) -> SimpleNamespace:
    return program


def outcome(exam: SimpleNamespace, kind: str, truth: tuple[str, ...], **told: Any) -> Any:
    trial = exam.design.Trial(kind, truth, 2.0, "lap", "nominal", True, "saloon", told.pop("i", 0))
    usual = {
        "verdict": "adequate",
        "added": [],
        "groups": {},
        "leader": None,
        "leader_group": [],
        "findings": {},
        "left": [],
        "omnibus_first": 0.5,
        "omnibus_last": 0.5,
        "test_errors": [1.5, 1.0],
        "true_error": 1.0,
        "intervals": {},
    }
    return {"key": trial.key, "trial": trial.to_dict(), "state": "done", **usual, **told}


def test_the_wilson_interval_is_that_of_the_textbook(exam: SimpleNamespace) -> None:
    # Newcombe, Statistics in Medicine 17 (1998), table I: 81 of 263, 15 of 148, 0 of 20, 1 of 29.
    for hits, of, low, high in (
        (81, 263, 0.2553, 0.3662),
        (15, 148, 0.0624, 0.1605),
        (0, 20, 0.0, 0.1611),
        (1, 29, 0.0061, 0.1718),
    ):
        assert exam.rates.Rate(hits, of).interval == pytest.approx((low, high), abs=5e-5)
    assert str(exam.rates.Rate(0, 0)) == "none"
    assert str(exam.rates.Rate.over([True, False, True])) == "2/3 = 66.7 % (21-94)"


def test_the_grid_has_every_point_once(exam: SimpleNamespace) -> None:
    trials = exam.design.full(null_repeats=25)
    assert len({t.key for t in trials}) == len(trials)
    for name in exam.design.MANOEUVRES:
        assert sum(t.kind == "null" and t.driving == name for t in trials) == 400
    hidden = {t.truth[0] for t in trials if t.kind == "effect"}
    assert hidden == {e.id for e in sv.catalogue() if not e.on_request}
    assert len({t.truth for t in trials if t.kind == "pair"}) == 10
    assert set(exam.truths.OUTSIDE_FORCES) == set(exam.design.OUTSIDE)
    removed = next(t for t in trials if t.kind == "group removed" and t.truth == ("steer_lag",))
    assert set(removed.removed) == {"steer_lag", *sv.effect("steer_lag").confounded_with}
    assert {"steer_delay", "tyre_relaxation", "front_tyre_relaxation"} < set(removed.removed)
    halves = {t.truth: t.removed for t in trials if t.kind == "one removed"}
    assert len(halves) == 20
    assert all(goes in out and stays not in out for (stays, goes), out in halves.items())
    assert "tyre_relaxation" in halves["aero_downforce", "steer_lag"]


def test_a_sample_is_drawn_by_its_seed_from_every_kind(exam: SimpleNamespace) -> None:
    one, same, other = (exam.design.small(seed) for seed in (1, 1, 2))
    assert one == same
    assert {t.key for t in one} != {t.key for t in other}
    assert len({t.driving for t in one if t.kind == "null"}) == 4
    assert len({t.seed for t in one}) == len(one)


def test_rates_are_counted_against_what_was_hidden(exam: SimpleNamespace) -> None:
    found = [
        outcome(exam, "null", ()),
        outcome(exam, "null", (), i=1, leader="mass", added=["mass"], verdict="explained"),
        outcome(
            exam,
            "effect",
            ("steer_lag",),
            leader="steer_lag",
            added=["steer_lag"],
            verdict="explained",
            intervals={"steer_lag.time_constant_s": [0.13, 0.01, 0.12]},
        ),
        outcome(
            exam,
            "effect",
            ("mass",),
            leader="yaw_inertia",
            leader_group=["mass"],
            added=["yaw_inertia"],
            verdict="partly_explained",
            test_errors=[1.5, 1.6],
            intervals={"mass.relative_error": [0.1, 0.01, 0.24]},
        ),
        outcome(
            exam,
            "group removed",
            ("mass",),
            leader="yaw_inertia",
            verdict="explained",
            findings={"yaw_inertia": "missing"},
        ),
        outcome(exam, "outside", ("crowned road",), leader="road_bank", verdict="unknown"),
        outcome(exam, "outside", ("torque vectoring",)) | {"state": "lost"},
        outcome(
            exam,
            "one removed",
            ("mass", "steer_lag"),
            leader="yaw_inertia",
            added=["yaw_inertia", "road_grade", "gyro_scale"],
            groups={"road_grade": ["mass"]},
            findings={
                "yaw_inertia": "proxy",
                "road_grade": "one of a group",
                "gyro_scale": "missing",
            },
            verdict="partly_explained",
        ),
        outcome(exam, "one removed", ("steer_lag", "mass"), leader="mass", verdict="unknown"),
    ]
    rows = {r[0]: r[1] for t in exam.tables.tables(found) for r in t.rows}
    assert rows["any effect claimed, lap"].startswith("1/2 ")
    assert rows["of these named first"].startswith("1/2 ")
    assert rows["true one in the named group"].startswith("2/2 ")
    assert rows["mean size of the group"] == "1.50 of 2"
    assert rows["validation error improved by what was added"].startswith("1/2 ")
    assert rows["95 % intervals that hold the true parameter"].startswith("1/2 ")
    assert rows["lag or relaxation named first"].startswith("1/1 ")
    assert rows["something else left or added"].startswith("0/1 ")
    assert rows["the candidate named, or in the group"].startswith("1/2 ")
    assert rows["any other effect named beside it or alone"].startswith("1/2 ")
    assert rows["verdict partly explained"].startswith("1/2 ")
    by_title = {t.name: str(t) for t in exam.tables.tables(found)}
    assert "outside, severity 2: seen at all" in by_title["unknown"]
    assert "1/1 = 100.0 % (21-100)" in by_title["unknown"]
    names, counts = exam.confusion.confusion(found)
    at = names.index
    assert counts.sum() == 4
    assert counts[at("nothing"), at("nothing")] == counts[at("nothing"), at("mass")] == 1
    assert counts[at("mass"), at("yaw_inertia")] == 1
    assert np.trace(counts) == 2


def test_the_confusion_matrix_is_drawn_on_given_axes(exam: SimpleNamespace) -> None:
    from matplotlib.figure import Figure

    ax = Figure().add_subplot()
    assert exam.confusion.draw([outcome(exam, "null", ())], ax) is ax
    assert [t.get_text() for t in ax.texts] == ["1"]


def test_an_exam_goes_on_where_it_was_broken_off(
    exam: SimpleNamespace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    trials = exam.design.small(0)[:4]
    done = []

    def examine(trial: Any) -> dict[str, Any]:
        done.append(trial.key)
        return {"key": trial.key, "state": "done"}

    monkeypatch.setattr(exam.store, "examine", examine)
    path = tmp_path / "exam.jsonl"
    first = exam.store.run(trials, path=path)
    assert [next(first)["key"], next(first)["key"]] == [t.key for t in trials[:2]]
    first.close()
    # The machine failed in the middle of a line.
    path.write_text(path.read_text() + '{"key": "ha', encoding="utf-8")
    with ThreadPoolExecutor(2) as executor:
        again = list(exam.store.run(trials, executor=executor, path=path))
    assert sorted(o["key"] for o in again) == sorted(t.key for t in trials)
    assert sorted(done) == sorted(t.key for t in trials)
    lines = path.read_text(encoding="utf-8").splitlines()
    assert len(lines) == 5
    assert {json.loads(x)["key"] for i, x in enumerate(lines) if i != 2} == set(done)
    assert set(exam.store.read(path)) == set(done)


def test_what_is_outside_the_catalogue_pushes_the_car(exam: SimpleNamespace) -> None:
    for name in ("crowned road", "cornering drag by temperature", "rear tyre bump"):
        trial = exam.design.Trial("outside", (name,), 2.0, "sweep", "nominal", False, "hatchback")
        (log,), _, ease = exam.truths.sample(trial)
        nothing = exam.design.Trial("null", (), 1.0, "sweep", "nominal", False, "hatchback")
        (plain,), _, _ = exam.truths.sample(nothing)
        assert ease == 1.0
        assert not log.has("vy_mps")
        there = np.abs(log["yaw_rate_radps"] - plain["yaw_rate_radps"])
        slower = plain["fx_n"] - log["fx_n"]
        assert np.sqrt(np.mean(there**2)) > 0.006 or np.abs(np.mean(slower)) > 10.0


def test_a_trial_tells_what_was_found(exam: SimpleNamespace) -> None:
    trial = exam.design.Trial(
        "effect", ("accelerometer_bias",), 2.0, "step", "nominal", True, "saloon"
    )
    among = ("accelerometer_bias", "side_wind", "mass")
    found = json.loads(json.dumps(exam.trial.examine(trial, among)))
    assert found["state"] == "done"
    assert found["leader"] == "accelerometer_bias"
    assert found["added"][0] == "accelerometer_bias"
    value, std, true = found["intervals"]["accelerometer_bias.ay_mps2"]
    assert true == pytest.approx(0.5)
    assert abs(value - true) < 4.0 * std
    assert found["test_errors"][-1] < found["test_errors"][0]


def test_the_totals_are_those_of_the_rows() -> None:
    """Figures of a row that is added stand in the last line, and in what quotes it."""
    text = (Path(__file__).resolve().parents[3] / "benchmarks/exam/README.md").read_text("utf-8")
    table = text.split("## The present rules")[1].split("\n\n")[2].splitlines()
    rows = [[c.strip() for c in line.strip("|").split("|")] for line in table[2:]]
    *parts, whole = rows

    def shares(row: list[str], column: int) -> list[tuple[int, int]]:
        return [(int(a), int(b)) for a, b in re.findall(r"(\d+) of (\d+)", row[column])]

    def total(column: int, place: int) -> tuple[int, int]:
        told = (shares(row, column) for row in parts)
        few = [several[place] for several in told if len(several) > max(place, 0)]
        return sum(a for a, _ in few), sum(b for _, b in few)

    assert whole[0] == "together"
    for column in (2, 3, 6):
        assert shares(whole, column)[0] == total(column, 0)
    assert shares(whole, 4) == [total(4, 0), total(4, -1)]  # told apart, or all are
    assert shares(whole, 5) == [total(5, place) for place in range(3)]
