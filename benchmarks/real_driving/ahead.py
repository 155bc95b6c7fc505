"""How well a model predicts lateral speed and yaw rate some seconds ahead.

Each window starts from the smoothed motion (`sysid_vehicle.check`, no tyre in it) and knows the
steering angle and the longitudinal acceleration of the same motion, so that its speed is the
measured one. Its error is that of v_y and yaw rate over the window, each over its standard
deviation in all the driving; the figure is the median over windows of the root of the sum of both
squares, of all windows and of those in which the car turns for at least half of the time.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import sysid_vehicle as sv
from sysid_vehicle.diagnose.evidence.coordinates import begins
from sysid_vehicle.estimate import Driving, turning
from sysid_vehicle.forces.motion import Places, smoothed
from sysid_vehicle.identify import driving_of

_BEGIN_S = 0.5  # between windows
_STEPS = 20  # in a window
_LOST = 3.0  # standard deviations of lateral speed or yaw rate, beyond which the car is lost
# The filter that starts the windows follows the smoothed motion.
_CERTAIN = sv.NoiseModel(
    (0.01, 0.005, 0.0005, 1e3, 1e3), (0.05, 0.05, 0.02), (100.0, 100.0, 100.0), 0.3
)


@dataclass(frozen=True)
class Ahead:
    """Median over windows of the relative error of v_y, of the yaw rate, of both, and the lost.

    `turning` is that of both where the car turns.
    """

    vy: float
    yaw_rate: float
    both: float
    vy_mps: float
    turning: float
    lost: float
    windows: int

    def __str__(self) -> str:
        return (
            f"v_y {self.vy:.4f} ({self.vy_mps:.4f} m/s), yaw rate {self.yaw_rate:.4f}, "
            f"both {self.both:.4f} of their standard deviations, {self.turning:.4f} where the car "
            f"turns; {100 * self.lost:.0f} % of {self.windows} windows lost"
        )


def motion_logs(check: sv.SensorCheck, logs: list[sv.Log]) -> list[sv.Log]:
    """The smoothed motion at the samples of some of the checked logs, one log per stretch."""
    places = Places.of(check)
    motion = smoothed(check, places)
    steer = places.values(check, "steer_rad")
    along = np.zeros_like(steer)
    for number in np.unique(places.stretch):
        own = places.stretch == number
        along[own] = np.gradient(motion.vx[own], places.time_s[own])
    along -= motion.vy * motion.yaw
    # What is not found stays in the logs that are put right, and in what is predicted of them.
    left = {f.name: 0.0 if f.found else f.value for f in check.faults if np.isfinite(f.std)}
    vy = motion.vy + left.get("bias_vy_mps", 0.0)
    yaw = (1.0 + left.get("gain_yaw_rate", 0.0)) * motion.yaw + left.get("bias_yaw_rate_radps", 0.0)
    out = []
    for number, stretch in enumerate(check.stretches):
        if not any(check.logs[stretch.log] is log for log in logs):
            continue
        own = places.stretch == number
        columns = {
            "time_s": places.time_s[own],
            "vx_mps": motion.vx[own],
            "vy_mps": vy[own],
            "yaw_rate_radps": yaw[own],
            "ax_mps2": along[own],
            "ay_mps2": motion.ay[own],
            "steer_rad": steer[own],
        }
        name = f"{check.logs[stretch.log].name}, stretch {number}"
        out.append(sv.Log.from_arrays(columns, name=name, check=False))
    return out


def ahead(
    fit: sv.Fit, logs: list[sv.Log], seconds: float = 2.0, logged: Driving | None = None
) -> Ahead:
    """Predict windows of so many seconds of the logs that `motion_logs` gave.

    `logged`: the logs themselves, by which nuisances of the model are found for each.
    """
    model, driving = fit.model, Driving.of(logs)
    if logged is not None and model.nuisances:
        own = driving_of(fit, logged)
        by_name = {log.name: o for log, o in zip(own.logs, own.offsets, strict=False)}
        offsets = tuple(by_name.get(log.name.rpartition(", stretch ")[0], {}) for log in logs)
        driving = Driving(driving.logs, driving.force_known, offsets)
    problem = driving.problem(model)
    rate = driving.mean_rate_hz
    every = round(_BEGIN_S * rate)
    starts = _starts(driving, round(seconds * rate), every)
    if not len(starts):
        return Ahead(*(float("nan"),) * 6, 0)
    leads = np.unique(np.round(np.linspace(0.0, seconds * rate, _STEPS + 1)[1:]).astype(int))
    asked = [(int(lead), every) for lead in leads]
    found = problem.look_ahead(model.vector(), _CERTAIN.vector(), asked)
    squares = [e[starts + lead][:, 1:3] ** 2 for e, lead in zip(found, leads, strict=True)]
    spread = np.nanstd(driving.measured[:, 1:3], axis=0)
    with np.errstate(invalid="ignore"):
        last = np.sqrt(squares[-1]) / spread
        relative = np.sqrt(np.mean(squares, axis=0)) / spread
    relative = np.where(np.isfinite(relative), relative, np.inf)
    lost = ~(last < _LOST).all(axis=1)
    both = np.sqrt(np.sum(relative**2, axis=1))
    vy, yaw = map(float, np.median(relative, axis=0))
    turned = np.concatenate([[0.0], np.cumsum(turning(driving))])
    turns = 2.0 * (turned[starts + leads[-1]] - turned[starts]) >= leads[-1]
    corners = float(np.median(both[turns])) if turns.any() else float("nan")
    share = float(lost.mean())
    whole = float(np.median(both))
    return Ahead(vy, yaw, whole, vy * float(spread[0]), corners, share, len(starts))


def _starts(driving: Driving, length: int, every: int) -> np.ndarray:
    """Samples at which whole windows begin."""
    out = []
    firsts = begins(driving)
    for first, last in zip(firsts, [*firsts[1:], driving.samples], strict=True):
        out.append(np.arange(first, max(last - length, first), every))
    return np.concatenate(out)
