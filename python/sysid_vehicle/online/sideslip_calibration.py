"""What a drive with measured sideslip teaches the observers for drives without."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .._common.arguments import generator
from .._common.arrays import FloatArray
from .._common.printed import Told
from .._common.typed import typed
from ..errors import InvalidInput, warn
from ..export.vehicle_file import vehicle_and_rest
from ..identify import Fit
from ..log import Log, check_car
from ..vehicle import Vehicle
from .sideslip import SideslipObserver, run_over, static_stiffness, yaw_inertia
from .sideslip_results import SideslipRun, doubted
from .sideslip_settings import SideslipSettings

#: What no data sheet tells: errors of the model, and how far two sensors are to be trusted.
_LEARNT = (
    "road_mps2", "road_time_s", "roll_expected", "roll_share", "roll_time_s", "error_load",
    "error_lateral", "error_braking", "error_drive", "error_time_s", "yaw_walk_radps",
    "sideslip_walk_rad", "stiffness_prior", "stiffness_walk", "friction_prior",
    "friction_time_s", "relaxation_m", "relaxation_std", "error_curve", "error_slip_rad",
    "yaw_rate_radps", "ay_mps2",
)  # fmt: skip
_MEAN_S = 1.0
# Settings lie about those at the start, within a factor e; errors of the tyres last for a corner,
# so that so many seconds of a drive tell of them once.
_SPREAD, _LASTS_S = 1.0, 10.0
_FIRST_STEP, _WIDEN, _NARROW = 0.7, 1.15, 0.96  # of the logarithms


@dataclass(frozen=True, repr=False)
class SideslipCalibration(Told):
    """Settings under which the sideslip of a drive is likeliest.

    Attributes
    ----------
    settings : SideslipSettings
        To be used for further drives of the car.
    before, after : SideslipRun
        The drive with the settings at the start and with these; their error is in-sample.
    score_before, score_after : float
        Mean log density of the measured sideslip, of a sample and of the mean over a second.
    """

    settings: SideslipSettings
    before: SideslipRun
    after: SideslipRun
    score_before: float
    score_after: float

    def __str__(self) -> str:
        score = f"{self.score_before:.3f} to {self.score_after:.3f}"
        lines = [f"{self.after.log_name}: log density of the sideslip {score}"]
        for name, run in (("before", self.before), ("after", self.after)):
            e = run.error()
            assert e is not None
            lines.append(
                f"  {name:6s} {e.rms_deg:.3f} deg rms, {100.0 * e.covered:.1f} % inside 2 sigma"
            )
        old = self.before.settings
        new = {name: value for name, value in self.settings.items() if value != old[name]}
        changed = [f"{name} {old[name]:.3g} to {value:.3g}" for name, value in new.items()]
        return "\n".join([*lines, "  " + ", ".join(changed)])


@typed
def calibrate_sideslip(
    vehicle: Vehicle,
    log: Log,
    *,
    kind: str = "dual",
    settings: SideslipSettings | None = None,
    learnt: Sequence[str] = _LEARNT,
    runs: int = 120,
    seed: int = 0,
) -> SideslipCalibration:
    """Learn how far model and sensors are to be trusted, from a drive with measured sideslip.

    The observer runs without ``vy_mps``; its settings are those under which the measured sideslip
    has the highest density, which rewards small errors and an honest band alike (the logarithmic
    score is proper: Gneiting & Raftery, JASA 2007), by single samples and by means over a second.
    The white noise of the measured sideslip is part of that density, and settings lie about those
    at the start. The search is an evolution strategy with one parent and one child (Rechenberg,
    1973), over the logarithms of the settings.

    Parameters
    ----------
    vehicle : Vehicle
        The car, with its tyres identified: see :func:`fitted_vehicle`.
    log : Log
        A drive with ``vy_mps``; a minute or two of hard cornering is enough.
    kind : str
        One of :data:`KINDS`.
    settings : SideslipSettings, optional
        Where the search begins; :meth:`SideslipSettings.of` the log if left out.
    learnt : sequence of str
        The settings to learn.
    runs : int
        How often the observer runs over the log.
    seed : int
        Of the search.

    Raises
    ------
    InvalidInput
        If the log has no measured sideslip, the car is too slow for the observer all the time, or
        nothing is to be learnt.

    Warns
    -----
    SysidWarning
        As `estimate_sideslip` does, with the settings that were learnt.
    """
    if not log.has("vy_mps"):
        raise InvalidInput(f"{log.name}: vy_mps is not there; calibrate on a drive that has it")
    if runs < 1 or not learnt:
        raise InvalidInput("learnt, runs: give one setting and one run at least")
    check_car(log, mass_kg=vehicle.mass_kg, wheelbase_m=vehicle.wheelbase_m, lf_m=vehicle.lf_m)
    start = settings if settings is not None else SideslipSettings.of(log, vehicle)
    # What is warned of is warned of once: settings on trial say nothing of car or log.
    car = vehicle.replace(yaw_inertia_kgm2=yaw_inertia(vehicle))
    names = list(learnt)
    rng = generator(seed)

    x = begin = np.log([start[name] for name in names])

    def tried(x: FloatArray) -> tuple[float, SideslipRun]:
        changed = dict(zip(names, (float(v) for v in np.exp(x)), strict=True))
        trial = start.replace(**changed)
        run = run_over(log, SideslipObserver(car, trial, kind), trial)
        if run.too_slow:
            raise InvalidInput(
                f"{log.name}: no sideslip is estimated, as the car is too slow all the time; "
                f"calibrate on a drive with hard cornering"
            )
        far = 0.5 * float(np.sum((x - begin) ** 2)) / _SPREAD**2
        return _score(run) - far * _LASTS_S / max(log.duration_s, _LASTS_S), run

    steps = np.full(len(names), _FIRST_STEP)
    score_before, before = tried(x)
    score, after = score_before, before
    for _ in range(runs):
        moved = rng.integers(len(names), size=rng.integers(1, 4))
        child = x.copy()
        child[moved] += steps[moved] * rng.standard_normal(len(moved))
        found, run = tried(child)
        if found > score:
            score, after, x = found, run, child
            steps[moved] *= _WIDEN
        else:
            steps[moved] *= _NARROW
    if kind == "dual":
        doubted(after, static_stiffness(vehicle))
    return SideslipCalibration(after.settings, before, after, score_before, score)


def _score(run: SideslipRun) -> float:
    """Log density of the measured sideslip by single samples, and by means over a second.

    An estimate is not to answer for the noise of what it is compared with; where that is larger
    than its error, the means show the error, which lasts, while the noise does not.
    """
    assert run.true_beta_rad is not None
    assert run.true_beta_std_rad is not None
    known = np.isfinite(run.true_beta_rad) & (run.mode != 1)
    off = (run.beta_rad - run.true_beta_rad)[known]
    std, noise = run.beta_std_rad[known], run.true_beta_std_rad[known]
    _, second, count = np.unique(
        np.floor(run.time_s[known] / _MEAN_S), return_inverse=True, return_counts=True
    )

    def mean(values: FloatArray) -> FloatArray:
        return np.asarray(np.bincount(second, values) / count)

    slow = _log_density(mean(off), np.hypot(mean(std), np.sqrt(mean(noise**2) / count)))
    return _log_density(off, np.hypot(std, noise)) + slow


def _log_density(off: FloatArray, std: FloatArray) -> float:
    return float(np.mean(-0.5 * (off / std) ** 2 - np.log(std)) - 0.5 * math.log(2.0 * math.pi))


@typed
def fitted_vehicle(fit: Fit) -> Vehicle:
    """The car of a fit with the tyres, and the yaw inertia, that were found.

    Warns
    -----
    SysidWarning
        If the model has effects that no vehicle holds, which the observers then do without;
        offsets that every log has of its own, which they look for themselves, are not told.
    """
    car, rest = vehicle_and_rest(fit.model)
    own = {name.split(".")[0] for name in fit.model.offset_names}
    left = [e for e in rest.effects if e in fit.model.effects and e not in own]
    if left:
        warn(
            f"{car.name}: a vehicle has no place for effects ({', '.join(left)}): the observers "
            f"run without them, and where these move the car much their band is too narrow"
        )
    return car
