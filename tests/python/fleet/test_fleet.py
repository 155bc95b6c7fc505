"""Studies of many logs: kept one by one, resumed after a kill, on any executor."""

import json
import re
import subprocess
import sys
import time
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, Executor, Future, ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from side_wind import side_wind

import sysid_vehicle as sv
from sysid_vehicle._common import memo as _memo
from sysid_vehicle.cli import main
from sysid_vehicle.fleet import Cause, Effect, Row, manifest_jobs
from sysid_vehicle.fleet.improve_many import run
from sysid_vehicle.fleet.jobs import Job
from sysid_vehicle.fleet.page import fleet_page
from sysid_vehicle.fleet.store import Store
from sysid_vehicle.saved import fingerprint

QUICK: dict[str, Any] = {"candidates": [], "starts": 1}
pytestmark = pytest.mark.filterwarnings("ignore::sysid_vehicle.SysidWarning")


@pytest.fixture(scope="module")
def garage(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A car, three short logs in folders of two cars, one that is no log, and a manifest."""
    folder = tmp_path_factory.mktemp("garage")
    truth = sv.Model(sv.example_vehicle())
    truth.vehicle.to_toml(folder / "car.toml")
    for seed, name in enumerate(("a/one", "a/two", "b/one"), start=1):
        path = folder / "logs" / f"{name}.csv"
        path.parent.mkdir(parents=True, exist_ok=True)
        sv.drive(truth, sv.manoeuvres.lap(10.0), seed=seed, rate_hz=25.0).to_csv(path)
    (folder / "logs/b/bad.csv").write_text("time_s,vx_mps\n0,1\n")
    (folder / "fleet.toml").write_text(
        'vehicle = "car.toml"\nlogs = "logs/*/*.csv"\n[improve]\ncandidates = []\nstarts = 1\n'
    )
    return folder


def logs_of(garage: Path) -> dict[str, Path]:
    return {f"{p.parent.name}/{p.stem}": p for p in sorted(garage.glob("logs/*/*.csv"))}


def told(fleet: sv.Fleet) -> list[dict[str, Any]]:
    """Rows without what differs from run to run."""
    return [{**row.to_dict(), "seconds": None} for row in fleet.rows]


def kept(out: Path) -> dict[str, tuple[int, int]]:
    """Which file stands at each place: what is written again is another."""
    paths = (p for p in out.rglob("studies/**/*") if p.is_file())
    return {str(p.relative_to(out)): (p.stat().st_ino, p.stat().st_mtime_ns) for p in paths}


@pytest.fixture(scope="module")
def done(garage: Path, tmp_path_factory: pytest.TempPathFactory) -> sv.Fleet:
    """All four, one after the other in this process."""
    out = tmp_path_factory.mktemp("done")
    with ThreadPoolExecutor(1) as pool:
        return sv.improve_many(
            garage / "car.toml", logs_of(garage), out=out, executor=pool, **QUICK
        )


def test_one_bad_log_does_not_stop_the_rest(done: sv.Fleet) -> None:
    assert [r.name for r in done.rows] == ["a/one", "a/two", "b/bad", "b/one"]
    assert [r.name for r in done.failed] == ["b/bad"]
    assert "yaw_rate_radps" in done.failed[0].failure
    assert done.cars == ("a", "b")
    assert all(r.verdict == "adequate" and r.error_after == r.error_before for r in done.done)
    study = done.study("a/two")
    assert study.test[0].error == done.rows[1].error_after
    assert study.model.vehicle.name == sv.example_vehicle().name
    with pytest.raises(sv.InvalidInput, match=r"b/bad: there is no study of it: .*yaw_rate"):
        done.study("b/bad")
    with pytest.raises(sv.InvalidInput, match="did you mean 'a/one'"):
        done.study("a/on")
    assert "3 studies of 2 cars: 3 adequate; 1 failed" in str(done)


def test_tables_and_report_hold_every_study(done: sv.Fleet) -> None:
    page = (done.folder / "report.html").read_text("utf-8")
    assert all(r.name in page for r in done.rows)
    parquet = pytest.importorskip("pyarrow.parquet")
    table = parquet.read_table(done.folder / "summary.parquet").to_pylist()
    assert [row["study"] for row in table] == [r.name for r in done.rows]
    assert [bool(row["failure"]) for row in table] == [False, False, True, False]
    assert table[0]["error_after"] == done.rows[0].error_after


def test_without_pyarrow_the_tables_are_csv(
    done: sv.Fleet, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    Store(tmp_path).summarise(done.rows)
    lines = (tmp_path / "summary.csv").read_text("utf-8").splitlines()
    assert len(lines) == 5
    assert lines[3].startswith("b/bad,b,,")


class Refusing(Executor):
    """Takes nothing."""

    def submit(self, function: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        raise AssertionError("nothing was to be done")


def test_what_is_there_is_not_done_again(garage: Path, done: sv.Fleet) -> None:
    before = kept(done.folder)
    again = sv.improve_many(
        garage / "car.toml", logs_of(garage), out=done.folder, executor=Refusing(), **QUICK
    )
    assert again.rows == done.rows
    assert kept(done.folder) == before
    # A row without its study is no study, nor is one that is broken.
    store = Store(done.folder)
    job = Job("a/one", sv.Model(sv.example_vehicle()), (logs_of(garage)["a/one"],), options=QUICK)
    assert store.earlier("a/one", job.digest()) == done.rows[0]
    for change in (
        lambda: (done.folder / "studies/a/one.npz").unlink(),
        lambda: (done.folder / "studies/a/one.json").write_text("{"),
    ):
        held = {s: (done.folder / f"studies/a/one{s}").read_bytes() for s in (".npz", ".json")}
        change()
        assert store.earlier("a/one", job.digest()) is None
        for suffix, data in held.items():
            (done.folder / f"studies/a/one{suffix}").write_bytes(data)


def test_a_digest_tells_what_may_change_a_study(garage: Path, tmp_path: Path) -> None:
    model, log = sv.Model(sv.example_vehicle()), logs_of(garage)["a/one"]
    copy = tmp_path / "other.csv"
    copy.write_bytes(log.read_bytes())
    one = Job("a", model, (log,), options=QUICK).digest()
    assert Job("a", model, (copy,), options=dict(QUICK)).digest() == one  # wherever it stands
    copy.write_text(copy.read_text() + "\n")
    heavier = sv.Model(model.vehicle.replace(mass_kg=1700.0))
    others = [
        Job("a", model, (copy,), options=QUICK),
        Job("a", heavier, (log,), options=QUICK),
        Job("a", model, (log,), (log,), options=QUICK),
        Job("a", model, (log,), options={**QUICK, "starts": 2}),
        Job("a", model, (log,), options={**QUICK, "rules": sv.Rules(alpha=0.01)}),
        Job("a", model, (log,), options=QUICK, channels=sv.ChannelMap({})),
        Job("a", model, (log,), options=QUICK, define=(copy,)),
        Job("a", model, (tmp_path / "none.csv",), options=QUICK),
    ]
    digests = [job.digest() for job in others]
    assert len({one, *digests}) == 1 + len(others)
    read = sv.read_log(log)
    assert fingerprint(read) == fingerprint(sv.read_log(log))
    assert fingerprint(read) != fingerprint(read.between(0.0, 5.0))


def test_failures_are_tried_again_if_asked(garage: Path, tmp_path: Path) -> None:
    def tried(**more: Any) -> sv.Fleet:
        with ThreadPoolExecutor(1) as pool:
            return sv.improve_many(
                garage / "car.toml",
                {"bad": garage / "logs/b/bad.csv"},
                out=tmp_path,
                executor=pool,
                **QUICK,
                **more,
            )

    first = tried()
    at = kept(tmp_path)
    assert tried().rows == first.rows
    assert kept(tmp_path) == at
    assert tried(retry=True).rows[0].failure == first.rows[0].failure
    assert kept(tmp_path) != at


def test_logs_in_memory_and_a_car_for_each(garage: Path, tmp_path: Path) -> None:
    logs = {name: sv.read_log(path) for name, path in logs_of(garage).items() if "bad" not in name}
    car = sv.example_vehicle()
    cars = {"a": car, "b": car.replace(mass_kg=2000.0)}
    with ThreadPoolExecutor(2) as pool:
        found = sv.improve_many(
            cars, {n: [x] for n, x in logs.items()}, {"a/one": logs["a/two"]},
            out=tmp_path, executor=pool, **QUICK,
        )  # fmt: skip
    assert [found.study(n).model.vehicle.mass_kg for n in ("a/one", "b/one")] == [
        car.mass_kg, 2000.0,
    ]  # fmt: skip
    assert found.rows[0].validation_s == pytest.approx(10.0, abs=0.2)
    assert found.rows[1].validation_s == pytest.approx(3.0, abs=0.2)
    # A worker that does many studies holds none of their logs.
    assert _memo._memories
    assert not any(len(memory) for memory in _memo._memories)


def effect(name: str, before: float, after: float, grade: str = "confirmed") -> Effect:
    return Effect(
        name, grade, (), "", {"size": (after, 0.1, "kg")}, before, after, {"ay_mps2": 0.2}
    )


def test_causes_are_ranked_by_share_of_cars_and_gain() -> None:
    rows = (
        Row("a/1", "a", verdict="explained", effects=(effect("mass", 3.0, 2.0),)),
        Row("a/2", "a", verdict="explained", effects=(effect("mass", 3.0, 1.0),)),
        Row("b", "b", verdict="explained", effects=(effect("mass", 2.0, 1.9),)),
        Row("c", "c", verdict="unknown", effects=(effect("steer_lag", 9.0, 1.0, "alias"),)),
        Row("d", "d", effects=(effect("aero_drag", 5.0, 1.0), effect("cg_height", 2.0, 1.5))),
        Row("e", "e", failure="no"),
    )
    fleet = sv.Fleet(Path("nowhere"), rows)
    assert [c.id for c in fleet.causes] == ["mass", "aero_drag", "cg_height", "steer_lag"]
    mass, steer = fleet.causes[0], fleet.causes[-1]
    assert isinstance(mass, Cause)
    assert (mass.cars, mass.share, mass.studies) == (2, 0.5, 3)
    assert mass.gain == 1.0
    assert mass.gains == {"ay_mps2": 0.2}
    middle, low, high, unit = mass.parameters["size"]
    assert (middle, unit) == (1.9, "kg")
    assert low < middle < high
    assert (steer.cars, steer.aliases) == (0, 1)
    assert np.isnan(steer.gain)
    assert "not named; compensates for something else, or may, in 1" in str(fleet)
    assert fleet.causes[1].sizes == "size 1 kg"
    assert mass.sizes == "size 1.9 (1.18 to 1.98) kg"
    back = [Row.from_dict(json.loads(json.dumps(r.to_dict()))) for r in rows]
    assert tuple(back) == rows


def test_what_a_study_does_not_name_is_no_cause() -> None:
    unsure = replace(
        effect("mass", 3.0, 2.0, "plausible"), stands_in="its share is not significant"
    )
    rows = (
        Row("a", "a", verdict="unknown", effects=(unsure,), explained=(0.13, -0.001, 0.2)),
        Row("b", "b", verdict="explained", effects=(effect("mass", 2.0, 1.9),)),
    )
    fleet = sv.Fleet(Path("nowhere"), rows)
    (mass,) = fleet.causes
    assert (mass.cars, mass.share, mass.studies, mass.aliases) == (1, 0.5, 1, 1)
    text = fleet_page(fleet)
    assert "(mass)" in text
    assert "In brackets: added, but not named." in text
    assert "13 % (0 to 20)" in text


def test_processes_and_the_command_line_find_the_same(
    garage: Path, done: sv.Fleet, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    status = main(
        ["improve-many", str(garage / "fleet.toml"), "--out", str(tmp_path), "--workers", "1"]
    )
    said = capfd.readouterr()
    assert status == 2  # one log is bad
    assert "sysid-vehicle: warning: a/one: no validation data were given" in said.err
    assert "SysidWarning" not in said.err
    assert str(done) in said.out
    assert "b/bad: " in said.err
    again = sv.Fleet(tmp_path, tuple(Row.from_dict(json.loads(p.read_text())["row"]) for p in
                     sorted(tmp_path.glob("studies/*/*.json"))))  # fmt: skip
    assert told(again) == told(done)
    for name in ("a/one", "b/one"):
        assert again.study(name).to_dict() == done.study(name).to_dict()


@pytest.mark.manual
def test_a_process_that_is_killed_costs_its_study_alone(garage: Path, tmp_path: Path) -> None:
    killer = tmp_path / "killer.py"
    kills = "if mp.parent_process() is not None: os.kill(os.getpid(), signal.SIGKILL)"
    also = f"import multiprocessing as mp, os, signal\n{kills}\n"
    killer.write_text(side_wind("of_a_killer", also))
    jobs = [
        replace(job, define=(killer,)) if "bad" in job.name else job
        for job in manifest_jobs(garage / "fleet.toml")
    ]
    try:
        found = run(jobs, tmp_path / "out", workers=2)
    finally:
        sv.forget_effect("of_a_killer")
    assert [bool(r.failure) for r in found.rows] == [False, False, True, False]
    assert "was killed twice" in found.failed[0].failure


def children(parent: int) -> list[int]:
    """Processes that the process has started and that are still there."""
    return [int(c) for c in Path(f"/proc/{parent}/task/{parent}/children").read_text().split()]


@pytest.mark.manual
@pytest.mark.skipif(sys.platform != "linux", reason="it looks into /proc")
def test_a_run_that_is_killed_goes_on_where_it_stopped(
    garage: Path, done: sv.Fleet, tmp_path: Path
) -> None:
    """Killed twice, at whatever moment: nothing is lost, and nothing that ended is done again."""
    command = [sys.executable, "-m", "sysid_vehicle", "improve-many", str(garage / "fleet.toml")]
    for least in (1, 3):
        process = subprocess.Popen([*command, "--out", str(tmp_path), "--workers", "1"])
        while len(list(tmp_path.glob("studies/*/*.json"))) < least and process.poll() is None:
            time.sleep(0.005)
        workers = children(process.pid) if process.poll() is None else []
        process.kill()
        process.wait()
        before = {p: at for p, at in kept(tmp_path).items() if p.endswith(".json")}
        assert least <= len(before) <= 4
        # A study without a row was on its way; with one it stays as it is.
        ends = time.monotonic() + 30.0
        while any(Path(f"/proc/{w}").exists() for w in workers) and time.monotonic() < ends:
            time.sleep(0.05)
        assert not any(Path(f"/proc/{w}").exists() for w in workers), "they outlived their parent"
    subprocess.run([*command, "--out", str(tmp_path), "--workers", "2"], check=True)
    assert before.items() <= kept(tmp_path).items()
    with ThreadPoolExecutor(1) as pool:
        resumed = run(manifest_jobs(garage / "fleet.toml"), tmp_path, pool)
    assert told(resumed) == told(done)
    for name in ("a/one", "a/two", "b/one"):
        assert resumed.study(name).to_dict() == done.study(name).to_dict()


def on_executor(garage: Path, out: Path, executor: Executor, done: sv.Fleet) -> None:
    """Two of the four were done before; then the executor does the others, and all once more."""
    jobs = manifest_jobs(garage / "fleet.toml")
    with ThreadPoolExecutor(1) as pool:
        run(jobs[:2], out, pool)
    before = kept(out)
    assert told(run(jobs, out, executor)) == told(done)
    assert before.items() <= kept(out).items()
    again = run(jobs, out / "anew", executor)
    assert told(again) == told(done)
    assert again.study("b/one").to_dict() == done.study("b/one").to_dict()


@pytest.mark.manual
@pytest.mark.filterwarnings("ignore")
def test_dask(garage: Path, done: sv.Fleet, tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed")
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as all_,
        distributed.Client(all_) as client,
        client.get_executor() as executor,
    ):
        on_executor(garage, tmp_path, executor, done)


@pytest.mark.manual
@pytest.mark.filterwarnings("ignore")
def test_ray(garage: Path, done: sv.Fleet, tmp_path: Path) -> None:
    """With the executor that the how-to makes of its tasks."""
    ray = pytest.importorskip("ray")
    page = (Path(__file__).parents[3] / "docs/howto/fleets.md").read_text("utf-8")
    (code,) = re.findall(r"^class RayExecutor.*?(?=^\S*sv\.)", page, re.MULTILINE | re.DOTALL)
    names: dict[str, Any] = {"ray": ray, "Executor": Executor}
    exec(code, names)
    ray.init(num_cpus=2, include_dashboard=False, log_to_driver=False)
    try:
        on_executor(garage, tmp_path, names["RayExecutor"](), done)
    finally:
        ray.shutdown()


class Breaking(ThreadPoolExecutor):
    """Takes two pieces of work, and breaks."""

    taken = 0

    def submit(self, function: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        self.taken += 1
        if self.taken > 2:
            raise BrokenExecutor("gone")
        return super().submit(function, *args, **kwargs)


def test_what_ended_before_an_executor_broke_is_kept(
    garage: Path, done: sv.Fleet, tmp_path: Path
) -> None:
    with Breaking(1) as pool, pytest.raises(sv.SysidError, match="broke with 2 of 4 studies"):
        sv.improve_many(garage / "car.toml", logs_of(garage), out=tmp_path, executor=pool, **QUICK)
    before = kept(tmp_path)
    assert len(before) == 4
    with ThreadPoolExecutor(1) as pool:
        found = sv.improve_many(
            garage / "car.toml", logs_of(garage), out=tmp_path, executor=pool, **QUICK
        )
    assert told(found) == told(done)
    assert before.items() <= kept(tmp_path).items()
