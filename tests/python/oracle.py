"""What a public call may do with bad data: refuse it in its own words, or give finite numbers.

A call that ends otherwise, in a raw error, a foreign warning, or a NaN that nobody warned of, is a
defect. The property tests and `benchmarks/fuzz` share this judgement.
"""

from __future__ import annotations

import dataclasses
import traceback
import warnings
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from sysid_vehicle import (
    Log,
    Model,
    SysidError,
    SysidWarning,
    Vehicle,
    compare,
    diagnose,
    identify,
    lab,
    online,
    twin,
)
from sysid_vehicle.estimate import Driving, first_guess

Columns = Mapping[str, np.ndarray]


@dataclasses.dataclass(frozen=True)
class Verdict:
    """How a call ended: `finite`, `refused`, or `wrong` with the reason."""

    state: str
    words: str = ""


def judge(call: Callable[[], Any]) -> Verdict:
    """Make a call and say how it ended."""
    with warnings.catch_warnings(record=True) as heard, np.errstate(all="warn", under="ignore"):
        warnings.simplefilter("always")
        try:
            result = call()
        except SysidError as error:
            words = str(error)
            if len(words) < 15:
                return Verdict("wrong", f"an error that says nothing: {words!r}")
            state = Verdict("refused", words)
        except Exception as error:
            where = traceback.extract_tb(error.__traceback__)[-1]
            return Verdict(
                "wrong",
                f"{type(error).__name__}: {error} ({where.filename.split('/')[-1]}:{where.lineno})",
            )
        else:
            state = Verdict("finite")
            lost = "" if heard else not_finite(result)
            if lost:
                return Verdict("wrong", f"{lost} is not finite, and no warning says so")
    for warning in heard:
        if not issubclass(warning.category, SysidWarning):
            where = f"{warning.filename.split('/')[-1]}:{warning.lineno}"
            return Verdict("wrong", f"{warning.category.__name__}: {warning.message} ({where})")
    return state


def not_finite(value: Any, name: str = "result") -> str:
    """Name of the first number that is not finite in floats, arrays and mappings; else empty."""
    if isinstance(value, float | np.ndarray):
        return "" if np.isfinite(np.asarray(value, dtype=float)).all() else name
    if isinstance(value, Mapping):
        found = (not_finite(v, f"{name}[{k!r}]") for k, v in value.items())
        return next(filter(None, found), "")
    if isinstance(value, list | tuple):
        found = (not_finite(v, f"{name}[{k}]") for k, v in enumerate(value))
        return next(filter(None, found), "")
    return ""


def read(columns: Columns, vehicle: Vehicle) -> Any:
    """Take columns as a log."""
    log = Log.from_arrays(columns)
    return {"rate_hz": log.rate_hz, "time_s": log["time_s"]}


def _log(columns: Columns) -> Log:
    """Without the plausibility checks, so that what they keep away reaches the kernels too."""
    return Log.from_arrays(columns, check=False)


def fit(columns: Columns, vehicle: Vehicle) -> Any:
    """Identify the baseline."""
    found = identify(Model(vehicle), _log(columns), starts=1, workers=1)
    return [found.log_likelihood, *(e.value for e in found.estimates)]


def compared(columns: Columns, vehicle: Vehicle) -> Any:
    """Compare the baseline, as it was identified, with its log."""
    log = _log(columns)
    found = compare(identify(Model(vehicle), log, starts=1, workers=1), log)
    return {"error": found.error, "log_likelihood": found.log_likelihood}


def diagnosed(columns: Columns, vehicle: Vehicle) -> Any:
    """Score all effects."""
    log = _log(columns)
    found = diagnose(identify(Model(vehicle), log, starts=1, workers=1), log, refits=0)
    return [c.statistic for c in found.ranking]


def smoothed(columns: Columns, vehicle: Vehicle) -> Any:
    """Filter and smooth with the model as it is."""
    driving = Driving.of(_log(columns))
    model = Model(vehicle)
    noise = first_guess(driving, vehicle).vector()
    trace = driving.problem(model).trace(model.vector(), noise, True)
    return {"log_likelihood": trace["log_likelihood"]}


def sideslip(kind: str) -> Callable[[Columns, Vehicle], Any]:
    """Estimate sideslip with one of the observers."""

    def call(columns: Columns, vehicle: Vehicle) -> Any:
        found = online.estimate_sideslip(vehicle, _log(columns), kind=kind)
        return {"beta_rad": found.beta_rad, "beta_std_rad": found.beta_std_rad}

    return call


def cornering(columns: Columns, vehicle: Vehicle) -> Any:
    """Recursive least squares for the cornering stiffness."""
    found = online.cornering_stiffness(vehicle, _log(columns))
    return {"cf_npr": found.cf_npr, "cr_npr": found.cr_npr, "std": found.cf_std_npr}


def observed(columns: Columns, vehicle: Vehicle) -> Any:
    """The laboratory's observer, with noise of its usual size."""
    if vehicle.yaw_inertia_kgm2 is None:
        usual = vehicle.mass_kg * vehicle.lf_m * vehicle.lr_m
        vehicle = vehicle.replace(yaw_inertia_kgm2=usual)
    car = lab.ObserverCar.of(vehicle)
    record = lab.ObserverRecord.from_log(_log(columns), car, (10.0, 11.0))
    found = lab.Observer(car, lab.ObserverNoise.first_guess(record, car)).smoothed(record)
    return {"state": found.state, "log_likelihood": found.log_likelihood}


def mu_slip(columns: Columns, vehicle: Vehicle) -> Any:
    """The estimators of the mu-slip curve; yaw rate and lateral acceleration stand in."""
    data = online.MuSlipData(np.abs(columns["yaw_rate_radps"]), columns["ay_mps2"] / 9.81)
    fitted = online.mu_slip_fit(data)
    filtered = online.mu_slip_ekf(data, iterations=2)
    smoothed = online.mu_slip_smooth(data)
    return [
        fitted.values,
        fitted.covariance,
        *((run.mean, run.covariance) for run in (filtered, smoothed)),
    ]


def twinned(columns: Columns, vehicle: Vehicle) -> Any:
    """An observer with twins side by side, which is given what the columns hold."""
    n = len(columns["time_s"])
    inputs = np.zeros((n, len(twin.INPUTS)))
    inputs[:, :2] = columns["steer_rad"][:, None]
    inputs[:, 2:6] = columns.get("fx_n", np.zeros(n))[:, None] * 0.08
    values = np.full((n, len(twin.READINGS)), np.nan)
    for name in ("ax_mps2", "ay_mps2"):
        values[:, twin.READINGS.index(name)] = columns.get(name, np.nan)
    read = twin.Readings(values, {}, 1e-3)
    batch = twin.SideBySide(twin.unknowns("mass_kg", "cg_z_m"), {"ax_mps2": 0.1, "ay_mps2": 0.1})
    speed = float(columns["vx_mps"][0]) if n else 20.0
    found = twin.observe(
        twin.TwinCar(),
        twin.NOMINAL_SUV,
        inputs,
        read,
        twin.Observer(batch=batch),
        speed_mps=speed,
    )
    return {"parameters": found.parameters, "spread": found.spread}


CALLS: dict[str, Callable[[Columns, Vehicle], Any]] = {
    "read": read,
    "identify": fit,
    "compare": compared,
    "diagnose": diagnosed,
    "smooth": smoothed,
    **{f"sideslip {kind}": sideslip(kind) for kind in ("dual", "ukf", "ekf", "square-root-ukf")},
    "cornering": cornering,
    "observer": observed,
    "mu-slip": mu_slip,
    "twin": twinned,
}
