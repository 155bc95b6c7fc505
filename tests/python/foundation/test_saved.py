"""Results in files: what is read is what was written, and files that cannot be used say so."""

import dataclasses
import importlib
import io
import json
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from same import same

import sysid_vehicle as sv
from sysid_vehicle import saved
from sysid_vehicle.errors import InvalidInput

OLD = Path(__file__).parents[1] / "saved"


def again(result: Any, tmp_path: Path) -> Any:
    path = tmp_path / "result.npz"
    saved.save(result, path)
    return sv.load(path)


def test_a_fit(fit: sv.Fit, course: sv.Log, tmp_path: Path) -> None:
    fit.save(tmp_path / "fit.npz")
    read = sv.load(tmp_path / "fit.npz")
    same(read, fit)
    assert str(read) == str(fit)
    assert read.driving.logs[0]["vx_mps"].flags.writeable is False
    assert str(sv.compare(read, course)) == str(sv.compare(fit, course))


def test_other_results(fit: sv.Fit, course: sv.Log, tmp_path: Path) -> None:
    for result in (
        fit.model,
        fit.noise,
        fit.driving.logs[0],
        sv.example_vehicle(),
        sv.compare(fit, course),
    ):
        read = again(result, tmp_path)
        same(read, result)
        assert str(read) == str(result)


def test_a_check_of_sensors(lap: sv.Log, tmp_path: Path) -> None:
    check = sv.check(lap)
    check.save(tmp_path / "check.npz")
    read = sv.load(tmp_path / "check.npz")
    assert str(read) == str(check)
    assert read.to_dict() == check.to_dict()
    same(read.apply(lap), check.apply(lap))


@pytest.mark.filterwarnings("ignore::sysid_vehicle.errors.SysidWarning")  # it is short
def test_a_study(tmp_path: Path, truth: sv.Model, monkeypatch: pytest.MonkeyPatch) -> None:
    module = importlib.import_module("sysid_vehicle.study.study")
    logs = [sv.drive(truth, sv.manoeuvres.lap(12.0), seed=i, rate_hz=25.0) for i in (1, 2)]
    study = sv.improve(truth, *logs, candidates=["steer_lag", "mass"], starts=1)
    study.save(tmp_path / "study.npz")
    read = sv.load(tmp_path / "study.npz")
    same(read, study)
    assert str(read) == str(study)
    assert read.diagnoses[0].fit is read.fits[0]  # what was one is one
    # A report asks for all that takes long; what it was told is not worked out again.
    study.report(tmp_path / "study.html")
    study.save(tmp_path / "study.npz")
    read = sv.load(tmp_path / "study.npz")
    monkeypatch.setattr(module, "where", None)
    monkeypatch.setattr(module, "hidden", None)
    assert read.where is read.where_baseline
    same(read.where, study.where)
    same(read.hidden, study.hidden)
    read.report(tmp_path / "again.html")
    assert (tmp_path / "again.html").read_text() == (tmp_path / "study.html").read_text()


def test_an_effect_of_a_user_comes_along(tmp_path: Path) -> None:
    made = sv.define_effect(
        "gust",
        title="gust",
        parameters=[sv.parameter("gain", "N", typical=50.0, lower=-500.0, upper=500.0)],
        force_y=lambda d, p: p.gain * d.v_x / 20.0,
    )
    model = sv.Model(sv.example_vehicle()).add(made, "steer_lag").with_values({"gust.gain": 7.0})
    sv.forget_effect("gust")
    model.save(tmp_path / "model.npz")
    read = sv.load(tmp_path / "model.npz")
    assert read == model
    np.testing.assert_array_equal(read.vector(), model.vector())
    log = sv.drive(model, sv.manoeuvres.step_steer(), seed=1)
    same(sv.drive(read, sv.manoeuvres.step_steer(), seed=1), log)


def test_classes_are_found_where_they_have_moved_to() -> None:
    read = sv.load(OLD / "diagnosis_v1.npz")  # of before `diagnose` had folders
    assert isinstance(read, sv.Diagnosis)
    statistics = {c.id: c.statistic for c in read.ranking}
    assert statistics["yaw_inertia"] == pytest.approx(2.1, abs=0.05)
    for module in saved._MOVED.values():
        found = vars(importlib.import_module(f"sysid_vehicle.{module}")).values()
        assert any(dataclasses.is_dataclass(c) for c in found), module
    for place in saved._CALLED.values():
        module, _, name = place.partition(":")
        assert hasattr(importlib.import_module(f"sysid_vehicle.{module}"), name)


def test_files_of_earlier_versions_are_read() -> None:
    read = sv.load(OLD / "fit_v1.npz")
    assert isinstance(read, sv.Fit)
    assert read.model.effects == ("steer_lag",)
    assert read["B_front"].value == pytest.approx(read.model.value("B_front"))
    assert np.isfinite(sv.compare(read, list(read.driving.logs)).error)


def spoilt(path: Path, change: Callable[[dict[str, Any]], Any]) -> None:
    """Write a file again with another content."""
    with np.load(path) as archive:
        arrays = {name: archive[name] for name in archive.files}
    content = json.loads(bytes(arrays.pop("content")))
    change(content)
    text = np.frombuffer(json.dumps(content).encode(), dtype=np.uint8)
    held = io.BytesIO()
    np.savez(held, content=text, **arrays)
    path.write_bytes(held.getvalue())


def tyre(c: dict[str, Any]) -> dict[str, Any]:
    return next(o for o in c["objects"] if o["class"] == "tyre:Tyre")


def vehicle(c: dict[str, Any]) -> dict[str, Any]:
    return next(o for o in c["objects"] if o["class"] == "vehicle:Vehicle")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda c: c.update(version=99), ["version 99", "install a later sysid_vehicle"]),
        (lambda c: c.update(version="1"), ["version '1'"]),
        (lambda c: c.update(format="other"), ["no saved result of sysid_vehicle"]),
        (lambda c: tyre(c).update({"class": "cli.main:main"}), ["cannot make again"]),
        (lambda c: tyre(c).update({"class": "log.log:warn"}), ["cannot make again"]),
        (lambda c: tyre(c).update({"class": "vehicle:Path"}), ["cannot make again"]),
        (lambda c: vehicle(c)["fields"].pop("mass_kg"), ["cannot make again"]),
        (lambda c: vehicle(c)["fields"].update(mass_kg=-1.0), ["mass_kg = -1 is out of range"]),
        (lambda c: c.update(root={"object": 7}), ["cannot make again"]),
        (lambda c: c.update(root={"code": "x", "more": 1}), ["cannot make again"]),
        # Of versions that keep less, or more: there is a default, or it is left.
        (lambda c: tyre(c)["fields"].pop("D"), []),
        (lambda c: vehicle(c)["fields"].update(colour="red"), []),
        # Where the class stood before.
        (lambda c: tyre(c).update({"class": "vehicle:Tyre"}), []),
    ],
)
def test_files_that_cannot_be_used(
    tmp_path: Path, change: Callable[[dict[str, Any]], Any], words: list[str]
) -> None:
    path = tmp_path / "car.npz"
    saved.save(sv.example_vehicle(), path)
    spoilt(path, change)
    if not words:
        assert isinstance(sv.load(path), sv.Vehicle)
        return
    with pytest.raises(InvalidInput) as caught:
        sv.load(path)
    for word in ["car.npz: ", *words]:
        assert word in str(caught.value)


def test_files_that_are_something_else(tmp_path: Path) -> None:
    path = tmp_path / "x.npz"
    with pytest.raises(InvalidInput, match=r"x\.npz: cannot be read .*check the path"):
        sv.load(path)
    np.savez(path, a=np.zeros(3))
    with pytest.raises(InvalidInput, match="no saved result"):
        sv.load(path)
    path.write_bytes(b"time_s,vx_mps\n0,1\n")
    with pytest.raises(InvalidInput, match="no saved result"):
        sv.load(path)
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("content.npy", b"no array")
    with pytest.raises(InvalidInput, match="no saved result"):
        sv.load(path)


def test_damaged_files_are_refused(tmp_path: Path, lap: sv.Log) -> None:
    path, rng = tmp_path / "x.npz", np.random.default_rng(0)
    saved.save(lap.between(0.0, 2.0), path)
    whole = path.read_bytes()
    refused = 0
    for k in range(80):
        damaged = bytearray(whole[: rng.integers(len(whole))] if k % 4 == 0 else whole)
        for at in rng.integers(0, len(damaged), 5):
            damaged[at] = rng.integers(256)
        path.write_bytes(damaged)
        try:
            sv.load(path)
        except InvalidInput:
            refused += 1
    assert refused > 60
    np.savez(path, content=np.frombuffer(b'{"format": 1}', dtype=np.uint8), a0=np.array(["text"]))
    with pytest.raises(InvalidInput, match="no saved result"):
        sv.load(path)


def test_what_no_file_can_hold(tmp_path: Path, fit: sv.Fit) -> None:
    for thing in (print, sv.ChannelMap({}), {"f": open}, np.array([object()])):
        with pytest.raises(InvalidInput, match="cannot be saved"):
            saved.save(thing, tmp_path / "x.npz")
    assert not (tmp_path / "x.npz").exists()
    with pytest.raises(InvalidInput, match=r"the folder .* does not exist"):
        fit.save(tmp_path / "none" / "fit.npz")
