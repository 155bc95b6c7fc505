"""`sysid-vehicle twin`, and the figures of the paper."""

import json
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from sysid_vehicle import InvalidInput
from sysid_vehicle.cli import main
from sysid_vehicle.cli import twin as command
from sysid_vehicle.published import (
    JointExperiment,
    LoadExperiment,
    estimate_pitch,
    mass_and_sideslip,
    run_schedule,
)
from sysid_vehicle.published.figures import joint_figure, load_figure
from sysid_vehicle.twin import NOMINAL_SUV


@pytest.fixture(scope="module")
def lanes() -> JointExperiment:
    return mass_and_sideslip("double_lane_change")


def test_the_twin_beats_the_double_track_on_a_drive_it_was_not_calibrated_on(
    lanes: JointExperiment,
) -> None:
    figures = lanes.figures()
    assert figures["twin"]["mass_error_percent"] < 5.0
    assert figures["twin"]["sideslip_rms_deg"] < 0.8 * figures["double track"]["sideslip_rms_deg"]
    assert "double track" in str(lanes)


def test_the_joint_figure_shows_drive_mass_and_sideslip(lanes: JointExperiment) -> None:
    figure = joint_figure([lanes])
    labels = [ax.get_ylabel() for ax in figure.axes]
    assert labels[:3] == ["vx_mps", "yaw_rate_radps", "plane_ay_mps2"]
    assert labels[3:] == ["mass [kg]", "sideslip [deg]", "sideslip [deg]"]


def test_a_load_figure_shows_every_start_and_every_sweep() -> None:
    runs = [estimate_pitch(first_error=[e], duration_s=10.0, seed=3) for e in (-1.0, 0.5)]
    figure = load_figure(runs, {"signal to noise": {5.0: [3.0], 10.0: [1.0]}}, driven="road_fl_m")
    assert [ax.get_ylabel() for ax in figure.axes] == [
        "jyy_kgm2", "road_fl_m", "error [% of the change]",
    ]  # fmt: skip
    assert len(figure.axes[0].lines) == 3


def _short(experiment: str, **given: object) -> object:
    real = command._EXPERIMENTS[experiment]
    return type(real)(
        lambda **options: real.estimate(**{**options, **given}),
        real.driven,
        real.starts,
        dict(list(real.rows.items())[2:4]),
        real.road,
    )


def test_an_experiment_from_the_command_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    short = {**command._EXPERIMENTS, "inertia-pitch": _short("inertia-pitch", duration_s=8.0)}
    monkeypatch.setattr(command, "_EXPERIMENTS", short)
    monkeypatch.setattr(command, "_RATIOS", (5.0, 10.0))
    monkeypatch.setattr(command, "_ROAD", (0.1,))
    plot, numbers = tmp_path / "p.svg", tmp_path / "p.json"
    given = ["twin", "inertia-pitch", "--road-noise", "0.1", "--table", "--seed", "4"]
    assert main([*given, "--plot", str(plot), "--json", str(numbers)]) == 0
    assert "jyy_kgm2" in capsys.readouterr().out
    assert plot.read_text(encoding="utf-8").startswith("<?xml")
    content = json.loads(numbers.read_text(encoding="utf-8"))
    assert set(content["table"]) == {"snr 10", "snr 10, road noise"}
    assert content["parameters"]["jyy_kgm2"]["true"] == 4394.4


@pytest.mark.skipif(find_spec("bayes_opt") is None, reason="bayesian-optimization not installed")
def test_calibrated_gains_go_to_validate(
    tmp_path: Path, lanes: JointExperiment, monkeypatch: pytest.MonkeyPatch
) -> None:
    gains = tmp_path / "gains.json"
    monkeypatch.setattr(command, "twin_cost", lambda g, *, law, seed: abs(np.log(g["yaw"] / 20.0)))
    assert main(["twin", "calibrate", "--trials", "8", "--json", str(gains)]) == 0
    seen: list[object] = []

    def kept(course: str, **options: object) -> JointExperiment:
        seen.append(options["gains"])
        return lanes

    monkeypatch.setattr(command, "mass_and_sideslip", kept)
    assert main(["twin", "validate", "--gains", str(gains)]) == 0
    content = json.loads(gains.read_text(encoding="utf-8"))
    assert seen[0] == content["gains"]
    assert set(content["candidates"]) == {"observed", "predicted"}
    assert len(content["candidates"]["predicted"]["fresh"]) == 5


@pytest.mark.parametrize(
    ("given", "told"),
    [
        (["mass", "--seed", "-1"], "--seed -1"),
        (["mass", "--plot", "a.png"], "end the name in .svg"),
        (["inertia-pitch", "--road-noise", "2"], "--road-noise 2"),
        (["mass", "--snr", "0"], "--snr 0.0"),
        (["validate", "--gains", "bad.json"], "twin calibrate --json"),
    ],
)
def test_wrong_input_is_one_line(
    given: list[str], told: str, tmp_path: Path, capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    (tmp_path / "bad.json").write_text('{"law": "side-by-side"}', encoding="utf-8")
    assert main(["twin", *given]) != 0
    assert told in capsys.readouterr().err


def test_the_whole_schedule_from_the_command_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        command, "run_schedule", lambda **options: run_schedule(shorten=0.25, **options)
    )
    plot, numbers = tmp_path / "p.svg", tmp_path / "p.json"
    given = ["twin", "schedule", "--road-noise", "0.05", "--seed", "2"]
    assert main([*given, "--plot", str(plot), "--json", str(numbers)]) == 0
    said = capsys.readouterr().out
    assert "% of change" in said
    assert plot.read_text(encoding="utf-8").startswith("<?xml")
    content = json.loads(numbers.read_text(encoding="utf-8"))
    assert [s["experiment"] for s in content["stages"]] == [
        "mass", "roll and yaw inertia", "pitch inertia",
    ]  # fmt: skip
    for name in ("mass_kg", "jxx_kgm2", "jyy_kgm2", "jzz_kgm2"):
        row = content["parameters"][name]
        assert row["error_percent_of_change"] < 10.0, name
        assert abs(row["found"] - row["true"]) < 5.0 * row["spread"], name


def test_each_stage_begins_with_what_those_before_it_found() -> None:
    done = run_schedule(snr=float("inf"), shorten=0.1, law="gradient")
    mass, turning, pitch = done.stages
    assert turning.found.parameters["mass_kg"][0] == mass.found.last("mass_kg")
    assert pitch.found.parameters["jzz_kgm2"][0] == turning.found.last("jzz_kgm2")
    assert done.load.jyy_kgm2 == pitch.found.last("jyy_kgm2")
    assert mass.found.parameters["mass_kg"][0] == NOMINAL_SUV.mass_kg
    assert done.plot("jxx_kgm2").get_ylabel() == "jxx_kgm2"
    with pytest.raises(InvalidInput, match="no stage looked for 'cg_z_m'"):
        done.plot("cg_z_m")
    for wrong in ({"road_noise": 2.0}, {"shorten": 0.0}, {"snr": -1.0}):
        with pytest.raises(InvalidInput, match=next(iter(wrong))):
            run_schedule(**wrong)  # type: ignore[arg-type]


def test_a_load_experiment_is_one(tmp_path: Path) -> None:
    done = estimate_pitch(duration_s=6.0, law="gradient")
    assert isinstance(done, LoadExperiment)
    assert done.plot("jyy_kgm2").get_ylabel() == "jyy_kgm2"
