"""Recursive least squares for the cornering stiffness of both axles.

Where the slip angles are known, lateral and yaw acceleration are linear in the stiffnesses:
``a_y = (C_f alpha_f + C_r alpha_r) / m``, ``r_dot = (l_f C_f alpha_f - l_r C_r alpha_r) / I_z``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from .. import _core
from .._common.arrays import FloatArray, as_float64
from .._common.printed import Told
from .._common.style import AFTER, MEASURED, axes_or_new, tidy
from .._common.text import number
from .._common.typed import typed
from ..errors import InvalidInput, warn
from ..estimate.inputs import white_noise_std
from ..log import Log, check_steering_of
from ..vehicle import Vehicle, slip_angles
from .cornering_forces import (
    along_the_car,
    felt_beside,
    load_shares,
    of_roll,
    parabolas,
    pulled_sideways,
    straightness,
    times_road_wheels,
    warn_of_steering,
)
from .sideslip import static_stiffness, yaw_inertia
from .sideslip_settings import NOISE_BLOCK

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_ENOUGH = 200  # samples with slip
_SHORTEST_S, _LONGEST_S = 0.15, 1.0  # of the window; corners are smoothed away by a longer one
_SLOWEST_MPS = 1.0  # below it slip angles mean nothing
_NOISE_SHARE = 0.01  # of the variance of a slip angle
# A parabola over w samples leaves 9 / (4 w) of the variance of white noise at its middle.
_KEPT = 2.25
_AY_STD_MPS2 = 0.1
_MOST_FADED = 0.5  # with more no stiffness is told


class CorneringRls:
    """Recursive least squares with forgetting, one sample at a time.

    Parameters
    ----------
    vehicle : Vehicle
        Mass, geometry and inertia; its tyres are where the estimate starts.
    forgetting : float
        Weight of the past per used sample, 0.98 to 1.
    prior_std_npr : float
        Standard deviation at the start [N/rad]; the covariance never grows beyond it.
    ay_std_mps2, yaw_acceleration_std_radps2 : float
        Noise of the two readings, by which they are weighted.
    least_slip_rad, most_slip_rad : float
        Samples whose larger slip angle lies outside are left out: with less they tell nothing
        (and would only make the filter forget), with more the tyre is not linear.

    Raises
    ------
    InvalidInput
        If a value cannot be.
    """

    @typed
    def __init__(
        self,
        vehicle: Vehicle,
        *,
        forgetting: float = 0.999,
        prior_std_npr: float = 1e5,
        ay_std_mps2: float = _AY_STD_MPS2,
        yaw_acceleration_std_radps2: float = 0.1,
        least_slip_rad: float = 0.004,
        most_slip_rad: float = 0.03,
    ) -> None:
        if not 0.98 <= forgetting <= 1.0:
            raise InvalidInput(f"forgetting: {forgetting:g} lies outside 0.98 to 1")
        for name, value in (
            ("prior_std_npr", prior_std_npr),
            ("ay_std_mps2", ay_std_mps2),
            ("yaw_acceleration_std_radps2", yaw_acceleration_std_radps2),
        ):
            if not (np.isfinite(value) and value > 0.0):
                raise InvalidInput(f"{name}: {value:g} is not above 0")
        if not 0.0 <= least_slip_rad < most_slip_rad:
            raise InvalidInput("least_slip_rad: must lie between 0 and most_slip_rad")
        self._core = _core.CorneringRls(
            vehicle.mass_kg, yaw_inertia(vehicle), vehicle.lf_m, vehicle.lr_m, forgetting,
            prior_std_npr, ay_std_mps2, yaw_acceleration_std_radps2, most_slip_rad, least_slip_rad,
            *static_stiffness(vehicle),
        )  # fmt: skip

    @typed
    def step(
        self, alpha_f_rad: float, alpha_r_rad: float, ay_mps2: float, yaw_acceleration_radps2: float
    ) -> bool:
        """Use one sample and tell whether it was used; NaN is a missing reading.

        Slip angles are positive where the force is: ``alpha_f = delta - beta - l_f r / v``,
        ``alpha_r = -beta + l_r r / v``.

        Raises
        ------
        NumericalError
            If a value is infinite; the message gives the sample.
        """
        return self._core.step(alpha_f_rad, alpha_r_rad, ay_mps2, yaw_acceleration_radps2)

    @typed
    def run(self, readings: FloatArray) -> FloatArray:
        """Use many samples; columns are the arguments of :meth:`step`.

        Returns
        -------
        ndarray, shape (n, 5)
            Stiffness front and rear [N/rad], their standard deviations, 1 where used.
        """
        readings = as_float64(readings)
        if readings.ndim != 2 or readings.shape[1] != 4:
            raise InvalidInput(f"readings: shape {readings.shape}; give (n, 4)")
        return self._core.run(readings)

    def reset(self) -> None:
        """Reset the covariance, not the estimate: the road or the tyres are others."""
        self._core.reset()

    @property
    def stiffness_npr(self) -> tuple[float, float]:
        """Cornering stiffness of the front and the rear axle [N/rad]."""
        return self._core.stiffness_npr

    @property
    def std_npr(self) -> tuple[float, float]:
        """Their standard deviations [N/rad]."""
        return self._core.std_npr

    @property
    def used(self) -> int:
        """How many samples were used."""
        return self._core.used


@dataclass(frozen=True, repr=False)
class CorneringRun(Told):
    """The way of the stiffnesses through a log; arrays have shape (n,).

    Attributes
    ----------
    time_s, cf_npr, cr_npr, cf_std_npr, cr_std_npr : ndarray
        Time, stiffness of the axles at no slip and the load at rest [N/rad], and their standard
        deviations. These cover that of the regression, with the noise of the slip angles, and all
        that was put back of what bent tyres and noise in the slip angles take from the stiffness.
    used : ndarray of bool
        Whether the sample held enough slip, and not too much.
    """

    log_name: str
    time_s: FloatArray
    cf_npr: FloatArray
    cr_npr: FloatArray
    cf_std_npr: FloatArray
    cr_std_npr: FloatArray
    used: np.ndarray

    @property
    def excited(self) -> bool:
        """Whether enough samples held slip for the result to mean something."""
        return int(self.used.sum()) >= _ENOUGH

    def __str__(self) -> str:
        front, rear = (
            f"{number(float(value[-1]) / 1e3)} +- {number(float(std[-1]) / 1e3, 2)}"
            for value, std in ((self.cf_npr, self.cf_std_npr), (self.cr_npr, self.cr_std_npr))
        )
        return (
            f"{self.log_name}: cornering stiffness front {front}, rear {rear} kN/rad, from "
            f"{int(self.used.sum())} of {len(self.used)} samples"
        )

    @typed
    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw both stiffnesses over time onto `ax`."""
        ax = axes_or_new(ax, 9.0, 3.5)
        ax.plot(self.time_s, self.cf_npr / 1e3, color=AFTER, label="front")
        ax.plot(self.time_s, self.cr_npr / 1e3, color=MEASURED, label="rear")
        ax.legend(frameon=False)
        return tidy(ax, xlabel="time [s]", ylabel="cornering stiffness [kN/rad]")


@typed
def cornering_stiffness(
    vehicle: Vehicle,
    log: Log,
    *,
    beta_rad: FloatArray | None = None,
    forgetting: float = 0.9999,
    window_s: float | None = None,
    **settings: float,
) -> CorneringRun:
    """Cornering stiffness over a log, by recursive least squares.

    Told is the stiffness at no slip and the load at rest. What the tyres bend away at the slips
    used, by shape and friction of the vehicle file, is put back, as is what noise in the slip
    angles takes. Load that the acceleration moves, side force of driven and braked front wheels,
    and up to a tenth more of `ay_mps2` than the motion has, which a rolling body makes, are
    allowed for; the standard deviations hold all of the first and the last, as friction may be
    another one, and as a road may lean. Not known are tyres that answer late, and what lateral
    load transfer takes: of cars with both it is up to 5 % low in front (`benchmarks/online`).

    Parameters
    ----------
    vehicle : Vehicle
        The car.
    log : Log
        Its driving.
    beta_rad : ndarray, shape (n,), optional
        Sideslip; from the log's ``vy_mps`` if left out.
    forgetting : float
        Weight of the past per used sample, 0.98 to 1.
    window_s : float, optional
        Slip angles, lateral acceleration and yaw rate are smoothed by local parabolas of this
        length, the same for all so that none lags or fades; from the yaw rate follows the yaw
        acceleration. If left out, as long as
        it takes for the noise of sideslip and yaw rate to be no more than 1 % of the variance of
        either slip angle, at most 1 s: noise in what is regressed on makes the stiffness too small.
    **settings : float
        Further arguments of :class:`CorneringRls`.

    Raises
    ------
    InvalidInput
        If neither `beta_rad` nor ``vy_mps`` is there, a value cannot be, the log is shorter than
        the window, or the steering angle is not that of a car of this wheelbase, as that of the
        steering wheel is not.

    Warns
    -----
    SysidWarning
        If too few samples hold slip, the result is negative, or the steering angle is surely not
        that of the road wheels.
    """
    beta = np.arctan2(log["vy_mps"], log["vx_mps"]) if beta_rad is None else as_float64(beta_rad)
    if beta.shape != (log.n,):
        raise InvalidInput(f"beta_rad: shape {beta.shape}; give one value for each of {log.n}")
    if window_s is not None and not (np.isfinite(window_s) and window_s > 0.0):
        raise InvalidInput(f"window_s: {window_s:g} is not above 0; leave it out to have it chosen")
    check_steering_of(log, vehicle.wheelbase_m)
    rate, vx = log["yaw_rate_radps"], log["vx_mps"]
    vx = np.where(vx > _SLOWEST_MPS, vx, np.nan)
    slips = slip_angles(vehicle.lf_m, vehicle.lr_m, log["steer_rad"], 1.0, np.tan(beta), rate / vx)
    # At a standstill the angle of noise is anything: that of the speed is what the sensor has.
    drift: float | FloatArray = white_noise_std(np.where(vx > 0.0, beta, np.nan), NOISE_BLOCK)
    if beta_rad is None:
        drift = white_noise_std(log["vy_mps"], NOISE_BLOCK) / vx
    turn = white_noise_std(rate, NOISE_BLOCK) / vx
    noises = [np.hypot(drift, arm * turn) for arm in (vehicle.lf_m, vehicle.lr_m)]
    noises[0] = np.hypot(noises[0], white_noise_std(log["steer_rad"], NOISE_BLOCK))
    ay_std = settings.get("ay_std_mps2", _AY_STD_MPS2)
    clear = _clear(vehicle, slips, noises, ay_std)
    slips = np.where(clear, slips[0], np.nan), np.where(clear, slips[1], np.nan)
    if window_s is None:
        window_s = max(
            _window_s(slip, noise, log.rate_hz) for slip, noise in zip(slips, noises, strict=True)
        )
    width = max(5, 2 * round(0.5 * window_s * log.rate_hz) + 1)
    if width > log.n:
        raise InvalidInput(
            f"{log.name}: {log.n} samples are fewer than the window of {width}; give a longer log, "
            f"or a shorter window_s"
        )
    motion = (vx, vx * np.tan(beta), rate, log["ay_mps2"], log["steer_rad"])
    moved = [parabolas(y, width) for y in motion]
    warn_of_steering(log, times_road_wheels(vehicle, moved, log.rate_hz, width))
    felt_more = felt_beside(moved[:4], log.rate_hz)
    readings, smooth = _readings(vehicle, log, slips, width, of_roll(felt_more))
    found = CorneringRls(vehicle, forgetting=forgetting, **settings).run(readings).T
    cf, cr, cf_std, cr_std, used = found
    # Noise of the slips, which both axles share, times the stiffness is one of the readings.
    felt = (cf * noises[0] + cr * noises[1]) / vehicle.mass_kg
    louder = np.hypot(1.0, _root_mean(felt, used) / ay_std)
    both = []
    for i, (c, std) in enumerate(((cf, cf_std), (cr, cr_std))):
        tyre, load = (vehicle.tyre_front, vehicle.tyre_rear)[i], vehicle.static_loads_n[i]
        faded = _faded(smooth[i], _KEPT / width * noises[i] ** 2, used)
        straight = straightness(tyre, load, smooth[i], used, c)
        whole = c / ((1.0 - faded) * straight)
        put_back = np.hypot(np.hypot(1.0 - straight, faded), min(abs(felt_more), _MOST_FADED))
        both.append((whole, np.hypot(std * louder / straight, whole * put_back)))
    (cf, cf_std), (cr, cr_std) = both
    run = CorneringRun(log.name, log["time_s"], cf, cr, cf_std, cr_std, used > 0.5)
    if not run.excited:
        warn(
            f"{log.name}: only {int(run.used.sum())} samples hold slip angles in the linear range; "
            f"the cornering stiffness stays near where it started. Give a log with gentle corners "
            f"in which no channel is missing for long"
        )
    for axle, c, std in (("front", cf, cf_std), ("rear", cr, cr_std)):
        if run.excited and c[-1] <= 0.0:
            warn(
                f"{log.name}: the {axle} cornering stiffness is {c[-1] / 1e3:.3g} +- "
                f"{std[-1] / 1e3:.2g} kN/rad at sample {log.n - 1}, which no tyre has: check signs "
                f"and places of steer_rad, vy_mps, yaw_rate_radps and ay_mps2; at a few m/s slip "
                f"angles are noise"
            )
    return run


def _readings(
    vehicle: Vehicle, log: Log, slips: Sequence[FloatArray], width: int, roll: float
) -> tuple[FloatArray, list[FloatArray]]:
    """Arguments of :meth:`CorneringRls.run`, and the slip angles of both axles, smoothed alike.

    Slip angles count by the load of their axle, and for the front one by what of its side force
    acts across the car. Readings are without the side force of drive and brake, and without the
    share `roll` of gravity.
    """
    channels = (*slips, log["ay_mps2"], log["yaw_rate_radps"], log["steer_rad"])
    *alpha, a_y, rate, steer = (parabolas(y, width) for y in channels)
    a_x, force = (parabolas(y, width) for y in along_the_car(vehicle, log))
    # The slope of a local parabola fades sooner with frequency than its value does: next to values
    # it would be too small, and the stiffness with it.
    turning = np.gradient(rate, 1.0 / log.rate_hz)
    pulled = pulled_sideways(vehicle, force, steer)
    front, rear = load_shares(vehicle, a_x)
    columns = (
        alpha[0] * front * np.cos(np.nan_to_num(steer)),
        alpha[1] * rear,
        a_y / (1.0 + roll) - pulled / vehicle.mass_kg,
        turning - vehicle.lf_m * pulled / yaw_inertia(vehicle),
    )
    return np.column_stack(columns), alpha


def _clear(
    vehicle: Vehicle, slips: Sequence[FloatArray], noises: Sequence[FloatArray], ay_std: float
) -> npt.NDArray[np.bool_]:
    """Samples that together tell the stiffnesses best by least squares, which weigh all alike.

    Slip angles of a car that parks are noise: more samples would then tell less. The variance of
    the regression has its least where all samples from some size of this noise on are left out.
    """
    felt = [c / vehicle.mass_kg for c in static_stiffness(vehicle)]
    noise = (felt[0] * noises[0] + felt[1] * noises[1]) ** 2
    told = (felt[0] * slips[0]) ** 2 + (felt[1] * slips[1]) ** 2
    order = np.argsort(noise)
    order = order[np.isfinite((noise + told)[order])]
    if order.size == 0:
        return np.isfinite(noise)
    summed = np.maximum(np.cumsum(told[order]), 1e-12)
    variance = np.cumsum(told[order] * (ay_std**2 + noise[order])) / summed**2
    return np.asarray(noise <= noise[order][np.argmin(variance)])


def _faded(slip_rad: FloatArray, noise: FloatArray, used: FloatArray) -> FloatArray:
    """Share by which noise of that variance in the slips used so far makes the stiffness small."""
    known = (used > 0.5) & np.isfinite(slip_rad) & np.isfinite(noise)
    squares = np.cumsum(np.where(known, slip_rad**2, 0.0))
    share = np.cumsum(np.where(known, noise, 0.0)) / np.maximum(squares, 1e-12)
    return as_float64(np.minimum(share, _MOST_FADED))


def _root_mean(noise: FloatArray, used: FloatArray) -> FloatArray:
    """Root mean square over the samples used so far."""
    known = (used > 0.5) & np.isfinite(noise)
    squares = np.cumsum(np.where(known, noise**2, 0.0))
    return np.asarray(np.sqrt(squares / np.maximum(np.cumsum(known), 1)))


def _window_s(slip: FloatArray, noise: FloatArray, rate_hz: float) -> float:
    """Shortest window that leaves little of the noise [rad] of a slip angle."""
    known = np.isfinite(slip) & np.isfinite(noise)
    noise_variance = float(np.mean(noise[known] ** 2)) if known.any() else 0.0
    variance = float(np.mean(slip[known] ** 2)) - noise_variance if known.any() else 0.0
    if variance <= 0.0:
        return _LONGEST_S
    samples = _KEPT * noise_variance / (_NOISE_SHARE * variance)
    return min(max(samples / rate_hz, _SHORTEST_S), _LONGEST_S)
