"""Results pickle and deep-copy with all they hold, and work in other processes."""

import copy
import multiprocessing
import pickle
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from same import same

import sysid_vehicle as sv
from sysid_vehicle import Fit, Log, Model, published
from sysid_vehicle import lab as laboratory
from sysid_vehicle.fleet import Row


@pytest.fixture(scope="module")
def results(fit: Fit, lap: Log, course: Log, truth: Model) -> dict[str, object]:
    """One of each result, by name."""
    found = sv.diagnose(fit, candidates=["mass", "steer_lag"])
    drive = sv.simulate.drive_truth(truth, sv.manoeuvres.step_steer(), seed=0)
    wanted = published.Oval()
    run = laboratory.run_closed_loop(wanted, seed=0)
    checked = sv.check(lap)
    return {
        "Vehicle": truth.vehicle,
        "Tyre": truth.vehicle.tyre_front,
        "Model": truth.add("steer_lag"),
        "Effect": sv.effect("steer_lag"),
        "catalogue": sv.catalogue(),
        "parameter": sv.parameter("gain", "N", typical=1.0, lower=-1.0, upper=2.0),
        "Log": lap,
        "ChannelMap": sv.ChannelMap({}),
        "Driving": fit.driving,
        "NoiseModel": fit.noise,
        "SensorNoise": sv.SensorNoise(),
        "RoadDisturbance": sv.RoadDisturbance(),
        "DriveLimits": sv.DriveLimits(),
        "Rules": sv.Rules(),
        "SensorCheck": checked,
        "AxleForces": sv.axle_forces(lap, truth.vehicle, sensors=checked, count=2),
        "Fit": fit,
        "RunsFit": sv.identify_runs(fit.model, {"a": lap}, starts=1),
        "Comparison": sv.compare(fit, course),
        "Change": sv.changed(fit, course, candidates=["steer_offset"]),
        "Diagnosis": found,
        "verdicts": sv.verdicts(found),
        "where": sv.where(fit),
        "bias_report": sv.bias_report(fit, [sv.effect("mass")]),
        "manoeuvre": sv.manoeuvres.lap(),
        "drive": drive,
        "excitation": wanted,
        "closed loop": run,
        "laboratory log": run.to_log(),
        "Fleet": sv.Fleet(Path("results"), (Row("a/b", "a", verdict="adequate"),)),
        "NumericalError": sv.NumericalError("lap: no"),
    }


NAMES = (
    *("Vehicle", "Tyre", "Model", "Effect", "catalogue", "parameter", "Log", "ChannelMap"),
    *("Driving", "NoiseModel", "SensorNoise", "RoadDisturbance", "DriveLimits", "Fit"),
    *("Comparison", "Diagnosis", "verdicts", "where", "bias_report", "manoeuvre", "drive"),
    *("excitation", "closed loop", "laboratory log", "NumericalError", "Rules"),
    *("SensorCheck", "AxleForces", "Fleet", "RunsFit", "Change"),
)


@pytest.mark.parametrize("name", NAMES)
def test_results_are_copied_whole(name: str, results: dict[str, object]) -> None:
    x = results[name]
    ways: tuple[Callable[[object], object], ...] = (
        copy.deepcopy,
        lambda y: pickle.loads(pickle.dumps(y)),
    )
    for way in ways:
        again = way(x)
        same(x, again, name)
        assert str(again) == str(x) or "object at 0x" in str(x)


def test_every_public_name_is_a_function_or_among_these() -> None:
    """A new public class has to be copied here as well."""
    public = {n for n in sv.__all__ if isinstance(getattr(sv, n), type)}
    errors = {"Interrupted", "InvalidInput", "SysidError", "SysidWarning"}
    slow = {"Study"}
    assert public - errors - slow <= set(NAMES)


@pytest.mark.manual
def test_a_study_is_copied_whole(start: Model, lap: Log, course: Log) -> None:
    study = sv.improve(start, lap, course, candidates=["steer_lag"], starts=1)
    for again in (copy.deepcopy(study), pickle.loads(pickle.dumps(study))):
        assert str(again) == str(study)
        assert again.to_dict() == study.to_dict()


@pytest.mark.skipif(sys.platform == "win32", reason="there is no fork")
@pytest.mark.filterwarnings("ignore:.*multi-threaded.*fork:DeprecationWarning")
@pytest.mark.parametrize("way", ["fork", "spawn"])
def test_another_process_finds_the_same(way: str, start: Model, lap: Log) -> None:
    short = lap.between(0.0, 8.0)
    here = sv.identify(start, short, starts=2)
    with multiprocessing.get_context(way).Pool(1) as pool:
        there = pool.apply(sv.identify, (start, short), {"starts": 2})
    same(here.estimates, there.estimates)
    same(here.covariance, there.covariance)
    assert here.log_likelihood == there.log_likelihood
