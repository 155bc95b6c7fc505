"""The command line: what it prints, what it writes, and how it fails."""

import json
import re
import warnings
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import pytest

import sysid_vehicle as sv
from sysid_vehicle.cli import commands, main

TRUTH = (
    sv.Model(sv.example_vehicle()).add("steer_lag").with_values({"steer_lag.time_constant_s": 0.06})
)
VERDICTS = {"adequate", "explained", "partly_explained", "unknown", "not_testable"}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A vehicle file and two short logs."""
    path = tmp_path_factory.mktemp("cli")
    TRUTH.vehicle.to_toml(path / "car.toml")
    drives = {"lap": sv.manoeuvres.lap(25.0), "course": sv.manoeuvres.handling_course(20.0)}
    for seed, (name, manoeuvre) in enumerate(drives.items(), 1):
        sv.drive(TRUTH, manoeuvre, seed=seed, rate_hz=25.0).to_csv(path / f"{name}.csv")
    return path


@pytest.fixture
def arguments(folder: Path) -> list[str]:
    return [str(folder / "lap.csv"), "--vehicle", str(folder / "car.toml")]


FEW = {"steer_lag", "steer_delay", "tyre_relaxation", "yaw_inertia", "mass", "aero_drag"}
SEARCH = [
    *("--exclude", ", ".join(sorted({e.id for e in sv.catalogue()} - FEW))),
    *("--max-effects", "3", "--time-limit", "1e4", "--matters", "yaw_rate=0.5deg/s, vy=0.1"),
]


STUDIES: list[tuple[str, sv.Study]] = []
"""What the command asked for, in words, and the study that it got."""


def asked(model: sv.Model, *logs: Any, **keywords: Any) -> str:
    """Everything that a study depends on."""
    data = [[log.name, {c: log[c].tolist() for c in log.channels}] for each in logs for log in each]
    told = {name: value for name, value in keywords.items() if name != "tell"}
    return repr((model, data, sorted(told.items())))


@pytest.fixture(scope="module")
def improved(folder: Path) -> tuple[Path, dict[str, Any]]:
    """Folder and JSON of one `improve` run, whose searches start from the vehicle file alone."""
    real = commands.improve

    def kept(*args: Any, **keywords: Any) -> sv.Study:
        STUDIES.append((asked(*args, **keywords), real(*args, **{**keywords, "starts": 1})))
        return STUDIES[-1][1]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(commands, "improve", kept)
        status = main(
            [
                "improve",
                str(folder / "lap.csv"),
                *("--vehicle", str(folder / "car.toml")),
                *("--test", str(folder / "course.csv")),
                *("--report", str(folder / "out.html")),
                *("--json", str(folder / "out.json")),
                *SEARCH,
            ]
        )
    assert status == 0
    return folder, json.loads((folder / "out.json").read_text(encoding="utf-8"))


@pytest.fixture
def one_start(monkeypatch: pytest.MonkeyPatch) -> None:
    """Searches from the vehicle file alone, which is right."""
    monkeypatch.setattr(commands, "identify", partial(sv.identify, starts=1))


def fails(capsys: pytest.CaptureFixture[str], *argv: str) -> str:
    """Run a command that must fail, and give its one line."""
    assert main(list(argv)) == 2
    out, err = capsys.readouterr()
    assert out == ""
    lines = err.splitlines()
    assert len(lines) == 1, err
    assert lines[0].startswith("sysid-vehicle: error: ")
    return lines[0]


def test_improve_finds_the_effect_and_writes_json_and_report(
    improved: tuple[Path, dict[str, Any]],
) -> None:
    folder, result = improved
    assert set(result) >= {"verdict", "effects", "ranking", "channels", "regions", "warnings"}
    assert result["verdict"] in VERDICTS
    assert [e["id"] for e in result["effects"]] == ["steer_lag"]
    found = result["effects"][0]
    assert set(found) == {
        *("id", "parameters", "error_before", "error_after", "p_value"),
        *("confounded_with", "stands_in", "grade", "takes_little", "useful", "backed", "gains"),
        *("own_share", "own_share_in_training", "share_together", "share_together_in_training"),
    }
    lag = found["parameters"]["time_constant_s"]
    assert lag["unit"] == "s"
    assert abs(lag["value"] - 0.06) < 4.0 * lag["std"]
    assert found["error_after"] < found["error_before"]
    first = result["ranking"][0]  # half a minute of a lap hardly tells a lag from a delay
    assert "steer_lag" in {first["id"], *first["indistinguishable_from"]}
    assert {c["id"] for c in result["ranking"]} == FEW
    assert set(result["horizons"]["channels"]) >= {"vy_mps", "yaw_rate_radps", "ay_mps2"}
    assert 0.5 < result["explained"]["share"] <= 1.0
    assert 0.0 < result["explained"]["low"] < result["explained"]["share"]
    assert set(result["unknown"]["explainable"]) == {"F_y", "M_z"}
    for candidate in result["ranking"]:
        assert set(candidate) >= {
            "id",
            "statistic",
            "p_value",
            "train_error",
            "test_error",
            "indistinguishable_from",
        }
    for when in ("before", "after"):
        for where in ("train", "test"):
            scores = result["channels"][when][where]
            assert set(scores) == {"vx_mps", "vy_mps", "yaw_rate_radps", "ax_mps2", "ay_mps2"}
            for score in scores.values():
                assert set(score) == {"rmse", "noise_floor", "nrmse", "r2"}
    assert (folder / "out.html").read_text(encoding="utf-8").endswith("</html>\n")
    assert not list(folder.glob(".*")), "temporary files are left"


def test_improve_without_report_prints_alone(
    improved: tuple[Path, dict[str, Any]],
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    folder, result = improved
    monkeypatch.setattr(commands, "improve", lambda *_, **__: STUDIES[0][1])
    there = sorted(folder.iterdir())
    car = str(folder / "car.toml")
    capsys.readouterr()
    assert main(["improve", str(folder / "lap.csv"), "--vehicle", car]) == 0
    told = capsys.readouterr().out
    assert f"Verdict: {result['verdict']}" in told
    assert "Report:" not in told
    assert sorted(folder.iterdir()) == there


def test_improve_prints_the_intervals_of_the_study(
    improved: tuple[Path, dict[str, Any]],
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Where something is missing those of the fit, which knows of noise alone, are too narrow."""
    study = replace(STUDIES[0][1], widened=9.0 * STUDIES[0][1].fit.covariance)
    monkeypatch.setattr(commands, "improve", lambda *_, **__: study)
    assert main(["improve", f"{improved[0]}/lap.csv", "--vehicle", f"{improved[0]}/car.toml"]) == 0
    told = re.findall(r"^  C_front +\S+ +(\S+)", capsys.readouterr().out, re.M)
    assert float(told[-1]) == pytest.approx(3.0 * study.fit["C_front"].std, rel=0.06)


def test_diagnose_prints_the_ranking_and_has_the_keys_of_improve(
    improved: tuple[Path, dict[str, Any]],
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The same study for the same arguments: it is not done twice."""
    folder, result = improved
    ((wanted, study),) = STUDIES

    def again_(*args: Any, **keywords: Any) -> sv.Study:
        assert asked(*args, **keywords) == wanted
        return study

    monkeypatch.setattr(commands, "improve", again_)
    capsys.readouterr()
    status = main(
        [
            "diagnose",
            str(folder / "lap.csv"),
            *("--vehicle", str(folder / "car.toml")),
            *("--test", str(folder / "course.csv")),
            *("--json", str(folder / "diagnosis.json")),
            *SEARCH,
        ]
    )
    assert status == 0
    again = json.loads((folder / "diagnosis.json").read_text(encoding="utf-8"))
    assert again == result
    out = capsys.readouterr().out
    assert "most likely missing: steering lag" in out
    assert result["verdict"] in out.lower().replace(" ", "_")


@pytest.mark.usefixtures("one_start")
def test_compare_fits_with_the_effects_that_are_named(
    arguments: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    errors = []
    for effects in ([], ["--effects", "steer_lag, mass"]):
        path = tmp_path / "out.json"
        assert main(["compare", *arguments, *effects, "--json", str(path)]) == 0
        result = json.loads(path.read_text(encoding="utf-8"))
        assert set(result) >= {"channels", "regions", "parameters", "warnings"}
        assert set(result["channels"]["ay_mps2"]) == {"rmse", "noise_floor", "nrmse", "r2"}
        errors.append(result["error"])
        out = capsys.readouterr().out
        assert "noise floor" in out
        assert "B_front" in out
    assert errors[1] < errors[0]
    lag = result["parameters"]["steer_lag.time_constant_s"]
    assert abs(lag["value"] - 0.06) < 4.0 * lag["std"]
    assert result["effects"] == ["steer_lag", "mass"]


@pytest.mark.usefixtures("one_start")
def test_a_channel_map_is_used(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = (folder / "lap.csv").read_text(encoding="utf-8")
    log, mapping = tmp_path / "log.csv", tmp_path / "map.toml"
    log.write_text(text.replace("yaw_rate_radps", "gyro_z", 1), encoding="utf-8")
    car = str(folder / "car.toml")
    assert "yaw_rate_radps" in fails(capsys, "compare", str(log), "--vehicle", car)
    mapping.write_text('[channels]\nyaw_rate_radps = "gyro_z"\n', encoding="utf-8")
    assert main(["compare", str(log), "--vehicle", car, "--channels", str(mapping)]) == 0


@pytest.mark.parametrize(
    ("argv", "message"),
    [
        (["compare", "none.csv", "--vehicle", "{car}"], "none.csv: cannot be read"),
        (["compare", "{log}", "--vehicle", "none.toml"], "none.toml: cannot be read"),
        (["compare", "{log}", "--vehicle", "{log}"], "a log in CSV, not a vehicle file"),
        (["compare", "{car}", "--vehicle", "{car}"], "car"),
        (
            ["compare", "{log}", "--vehicle", "{car}", "--effects", "drag"],
            "did you mean 'aero_drag'",
        ),
        (["compare", "{log}", "--vehicle", "{car}", "--effects", "mass,mass"], "named twice"),
        (["compare", "{log}", "--vehicle", "{car}", "--channels", "no.toml"], "no.toml: cannot be"),
        (["diagnose", "{log}", "--vehicle", "{car}", "--test", "no.csv"], "no.csv: cannot be read"),
        (["improve", "{log}", "--vehicle", "{car}", "--report", "no/r.html"], "does not exist"),
        (["improve", "{log}", "--vehicle", "{car}", "--report", "."], "is a folder"),
        (["compare", "{log}", "--vehicle", "{car}", "--json", "{log}"], "is also an input"),
        (
            ["improve", "{log}", "--vehicle", "{car}", "--report", "a", "--json", "a"],
            "is also another output",
        ),
        (["demo", "--hidden", "steer_lg"], "did you mean 'steer_lag'"),
        (["demo", "--report", "no/r.html"], "does not exist"),
    ],
)
def test_what_cannot_be_used_is_one_line_and_status_2(
    argv: list[str],
    message: str,
    folder: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    before = (folder / "lap.csv").read_bytes()
    names = {"log": folder / "lap.csv", "car": folder / "car.toml"}
    assert message in fails(capsys, *(a.format(**names) for a in argv))
    assert list(tmp_path.iterdir()) == []
    assert (folder / "lap.csv").read_bytes() == before


@pytest.mark.parametrize(
    "words", ["", "fly", "compare", "improve log.csv", "demo --seed -1", "demo --seed two"]
)
def test_wrong_usage_is_status_2(words: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stopped:
        main(words.split())
    assert stopped.value.code == 2
    assert "usage:" in capsys.readouterr().err


def test_a_log_that_breaks_in_the_middle_leaves_no_output(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    lines = (folder / "lap.csv").read_text(encoding="utf-8").splitlines()
    lines[400] = lines[400].replace(lines[400].split(",")[0], "zero", 1)
    log = tmp_path / "broken.csv"
    log.write_text("\n".join(lines), encoding="utf-8")
    out = tmp_path / "out.json"
    line = fails(
        capsys, "compare", str(log), "--vehicle", str(folder / "car.toml"), "--json", str(out)
    )
    assert "broken" in line
    assert not out.exists()


@pytest.mark.usefixtures("one_start")
def test_warnings_are_single_lines_on_the_error_stream_and_in_the_json(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    car = tmp_path / "car.toml"
    lines = (folder / "car.toml").read_text(encoding="utf-8").splitlines()
    car.write_text("\n".join(x for x in lines if "inertia" not in x), encoding="utf-8")
    path = tmp_path / "out.json"
    argv = ["compare", str(folder / "lap.csv"), "--vehicle", str(car), "--json", str(path)]
    assert main(argv) == 0
    out, err = capsys.readouterr()
    said = [x for x in err.splitlines() if "yaw_inertia_kgm2 is absent" in x]
    assert len(said) == 1
    assert said[0].startswith("sysid-vehicle: warning: ")
    assert "is absent" not in out
    collected = json.loads(path.read_text(encoding="utf-8"))["warnings"]
    assert any("yaw_inertia_kgm2 is absent" in text for text in collected)


def test_warnings_of_a_study_come_once_and_reach_the_json(
    improved: tuple[Path, dict[str, Any]],
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    folder, _ = improved
    study: list[sv.Study] = []
    real = commands.improve

    def short(*args: Any, **keywords: Any) -> sv.Study:
        study.append(real(*args, **{**keywords, "starts": 1, "candidates": ["steer_lag"]}))
        return study[0]

    monkeypatch.setattr(commands, "improve", short)
    path = folder / "one_log.json"
    argv = ["diagnose", str(folder / "lap.csv"), "--vehicle", str(folder / "car.toml")]
    capsys.readouterr()
    assert main([*argv, "--json", str(path)]) == 0
    out, err = capsys.readouterr()
    collected = json.loads(path.read_text(encoding="utf-8"))["warnings"]
    assert any("no validation data were given" in text for text in collected)
    assert set(study[0].warnings) <= set(collected)
    for text in collected:
        assert err.count(text) == 1
        assert text not in out


@pytest.mark.parametrize("asked_for", [False, True])
def test_offsets_of_measured_logs_are_in_the_model_on_demand(
    arguments: list[str], monkeypatch: pytest.MonkeyPatch, asked_for: bool
) -> None:
    models: list[sv.Model] = []

    def stop(model: sv.Model, *_: Any, **__: Any) -> None:
        models.append(model)
        raise sv.NumericalError("far enough")

    monkeypatch.setattr(commands, "improve", stop)
    assert main(["diagnose", *arguments, *(["--nuisances"] if asked_for else [])]) == 2
    assert ("gyro_bias" in models[0].nuisances) is asked_for
    assert models[0].effects == models[0].nuisances


def test_ctrl_c_is_status_130(
    arguments: list[str],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def interrupted(*_: Any, **__: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(commands, "improve", interrupted)
    path = tmp_path / "out.html"
    assert main(["improve", *arguments, "--report", str(path)]) == 130
    assert capsys.readouterr().err == "sysid-vehicle: interrupted\n"
    assert not path.exists()


@pytest.mark.usefixtures("one_start")
def test_the_process_leaves_warning_filters_as_they_were(arguments: list[str]) -> None:
    before, show = list(warnings.filters), warnings.showwarning
    assert main(["compare", *arguments]) == 0
    assert list(warnings.filters) == before
    assert warnings.showwarning is show


@pytest.mark.usefixtures("one_start")
def test_progress_stays_away_from_files(
    arguments: list[str], capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sysid_vehicle._common.progress._SILENT_S", 0.0)
    monkeypatch.setattr("sysid_vehicle._common.progress._REFRESH_S", 0.01)
    assert main(["compare", *arguments]) == 0
    out, err = capfd.readouterr()
    assert "\r" not in out + err
    assert "identify" not in err
