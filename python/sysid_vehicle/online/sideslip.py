"""Sideslip observers: one sample at a time in a control loop, or a whole log at once."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from .. import _core
from .._common.arrays import FloatArray, as_float64
from .._common.typed import typed
from ..errors import InvalidInput, warn
from ..estimate.inputs import white_noise_std
from ..log import Log, check_car
from ..tyre import Tyre
from ..vehicle import Vehicle, vehicle_data
from .sideslip_results import SideslipRun, doubted, judged, judged_by
from .sideslip_settings import NOISE_BLOCK, SideslipSettings

#: Kinds of observers, with what each is.
KINDS: Mapping[str, str] = {
    "dual": "dual UKF with saturating, load-dependent, adapting tyres",
    "ukf": "UKF of three states with the tyres of the vehicle file, which it takes as exact",
    "ekf": "the same as an extended Kalman filter",
    "square-root-ukf": "the same as a square-root UKF",
    "linear-ukf": "the UKF with tyres that do not saturate",
}
SENSORS = ("steer_rad", "vx_mps", "yaw_rate_radps", "ax_mps2", "ay_mps2")


class SideslipEstimate(NamedTuple):
    """What an observer knows after a sample; NaN where it does not say.

    `cf_npr` and `cr_npr` are the cornering stiffness of the axles at their static load [N/rad],
    `mu_f` and `mu_r` the friction at the peak, with standard deviations last. `mode` is 0 while
    running, 1 while the car is too slow, 2 while a reading is missing or refused: the models stand
    in, and a steering angle that is not read is as unknown as the driver may have made it.
    """

    beta_rad: float
    beta_std_rad: float
    vx_mps: float
    yaw_rate_radps: float
    fyf_n: float
    fyr_n: float
    fx_n: float
    cf_npr: float
    cr_npr: float
    cf_std_npr: float
    cr_std_npr: float
    mu_f: float
    mu_r: float
    nis: float
    observed: float
    log_likelihood: float
    mode: float
    mu_f_std: float
    mu_r_std: float


class SideslipObserver:
    """An observer that is given one sample of the sensors after another.

    Parameters
    ----------
    vehicle : Vehicle
        The car; its tyres are where adaptation begins.
    settings : SideslipSettings, optional
        The defaults for the size of the car (`SideslipSettings.of_car`) if left out.
    kind : str
        One of :data:`KINDS`.
    judge : bool
        Whether a dual observer runs beside one of another kind and judges its band, as in
        :func:`estimate_sideslip`: a step then takes as long as both.

    Notes
    -----
    The parallel structure of two filters is that of Cl4y3R/VehicleStateEstimation (2024). Tyres
    saturate (Pacejka, *Tire and Vehicle Dynamics*, 3rd ed., eq. 4.6), loads move with the
    acceleration, braking takes its share of the grip, and stiffness and friction of both axles are
    states, as are what the tyre model does not explain and what may have been told wrong: the yaw
    inertia, how late the wheels turn, the place of the accelerometer, offsets of the sensors; and a
    bank of the road and forces from outside, which no reading tells from these. Six tyre filters
    expect a car and sensors that are as told, small, middling and large departures from the model,
    banked roads, and another car or surface than was told. They count by the likelihood of the last
    readings (Raftery, Kárný & Ettler, *Technometrics* 52, 2010), tempered, because errors of a
    wrong model last (Grünwald & van Ommen, *Bayesian Analysis* 12, 2017). The standard deviation
    covers all of it, their disagreement, and the error of the tyre curve, which no reading tells.
    Little slip teaches less of the stiffness (partial update: Brink, *J. Guid. Control Dyn.* 40,
    2017).

    The standard deviation of the other kinds takes the tyres of the vehicle file as exact; with
    other tyres, or on another surface, it is far too small, unless it is judged.

    Readings that no car gives, by their size or by how fast they change, are refused: the tyre
    model stands in, and `mode` says so. Steps beyond 0.01 s are divided. After a step of more than
    1 s, or where the estimate leaves 1.2 rad, the motion begins again with its initial covariance;
    what was learnt of the tyres stays.

    Calls from several threads take turns. An observer pickles and copies with its state.
    """

    @typed
    def __init__(
        self,
        vehicle: Vehicle,
        settings: SideslipSettings | None = None,
        kind: str = "dual",
        *,
        judge: bool = False,
    ) -> None:
        values = dict(settings if settings is not None else SideslipSettings.of_car(vehicle))
        car = observed_car(vehicle)
        core: _core._SideslipObserver
        if kind == "dual":
            core = _core.SideslipDual(car, values)
        elif kind == "ekf":
            core = _core.SideslipEkf(car, values, False)
        elif kind == "square-root-ukf":
            core = _core.SideslipSquareRootUkf(car, values, False)
        elif kind in ("ukf", "linear-ukf"):
            core = _core.SideslipUkf(car, values, kind == "linear-ukf")
        else:
            raise InvalidInput(f"kind: '{kind}' is not known; give one of {', '.join(KINDS)}")
        beside = _core.SideslipDual(car, values) if judge and kind != "dual" else None
        self._begin(vehicle, kind, core, beside)

    def _begin(
        self,
        vehicle: Vehicle,
        kind: str,
        core: _core._SideslipObserver,
        dual: _core.SideslipDual | None = None,
    ) -> None:
        self.vehicle, self.kind = vehicle, kind
        self._core, self._dual = core, dual
        self._refuted = 0
        self._turn = threading.Lock()  # a dual observer beside takes the same samples

    @typed
    def step(
        self,
        dt_s: float,
        steer_rad: float,
        vx_mps: float,
        yaw_rate_radps: float,
        ax_mps2: float,
        ay_mps2: float,
    ) -> SideslipEstimate:
        """Use one sample, `dt_s` seconds after the one before; NaN is a missing reading.

        Raises
        ------
        NumericalError
            If a reading is infinite, the time step is not positive, or the filter leaves the range
            of numbers; the message gives the sample.
        """
        sample = dt_s, steer_rad, vx_mps, yaw_rate_radps, ax_mps2, ay_mps2
        if self._dual is None:
            return SideslipEstimate._make(self._core.step(*sample))
        with self._turn:
            own, dual = SideslipEstimate._make(self._core.step(*sample)), self._dual.step(*sample)
            std, refuted = judged(own.beta_rad, own.beta_std_rad, dual[0], dual[1])
            self._refuted += bool(refuted)
        return own._replace(beta_std_rad=float(std))

    @typed
    def run(self, dt_s: FloatArray, sensors: FloatArray) -> FloatArray:
        """Use many samples at once, with the numbers of as many steps.

        Parameters
        ----------
        dt_s : ndarray, shape (n,)
            Time since the sample before.
        sensors : ndarray, shape (n, 5)
            Columns in the order of the arguments of :meth:`step`.

        Returns
        -------
        ndarray, shape (n, 19)
            Columns in the order of :class:`SideslipEstimate`.
        """
        dt_s, sensors = as_float64(dt_s), as_float64(sensors)
        if sensors.ndim != 2 or sensors.shape[1] != len(SENSORS):
            raise InvalidInput(
                f"sensors: shape {sensors.shape}; give (n, 5) with columns {', '.join(SENSORS)}"
            )
        if dt_s.shape != (len(sensors),):
            raise InvalidInput(f"dt_s: shape {dt_s.shape}; give ({len(sensors)},), as sensors")
        if self._dual is None:
            return self._core.run(dt_s, sensors)
        with self._turn:
            own, dual = self._core.run(dt_s, sensors), self._dual.run(dt_s, sensors)
            own[:, 1], refuted = judged(*own[:, :2].T, *dual[:, :2].T)
            self._refuted += int(np.count_nonzero(refuted))
        return own

    def copy(self) -> SideslipObserver:
        """An independent observer in the same state."""
        other = object.__new__(type(self))
        with self._turn:
            dual = None if self._dual is None else self._dual.copy()
            other.__setstate__({**self.__getstate__(), "_core": self._core.copy(), "_dual": dual})
        return other

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in vars(self).items() if name != "_turn"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state, _turn=threading.Lock())

    @property
    def refuted(self) -> float:
        """Share of samples in which the dual observer refutes the estimate; NaN without one.

        Both are further apart than both bands allow: where that is more than one in twenty, the
        tyres of the vehicle file do not fit.
        """
        return self._refuted / self.samples if self._dual is not None and self.samples else np.nan

    @property
    def samples(self) -> int:
        """How many samples there were."""
        return self._core.samples


@typed
def estimate_sideslip(
    vehicle: Vehicle,
    log: Log,
    *,
    kind: str = "dual",
    settings: SideslipSettings | None = None,
    judge: bool = True,
) -> SideslipRun:
    """Estimate sideslip over a whole log; a measured ``vy_mps`` is not looked at.

    Kinds with fixed tyres take them as exact, and no reading tells them otherwise: where the car
    corners steadily, one sideslip explains any lateral acceleration. So the dual observer, which
    learns the tyres, is run beside them. By what it knows, the error of another estimate has the
    mean square of its own variance and the squared distance of both: that is the band.

    Parameters
    ----------
    vehicle : Vehicle
        The car; its tyres are where adaptation begins.
    log : Log
        Without ``ax_mps2`` the speed tells how the car brakes and drives.
    kind : str
        One of :data:`KINDS`.
    settings : SideslipSettings, optional
        If left out, :meth:`SideslipSettings.of` the log.
    judge : bool
        Whether the dual observer judges the band of another kind, which takes a hundred times as
        long. Without it the band is that of tyres that are exact.

    Raises
    ------
    InvalidInput
        If the kind is not known, or wheel force or steering angle are not
        those of a car of this mass and wheelbase.
    NumericalError
        If the filter leaves the range of numbers; the message gives the sample.

    Warns
    -----
    SysidWarning
        If there is no ``ax_mps2``, the car is too slow for the observer all the time, the tyres of
        the vehicle file do not fit the drive, or the dual observer has learnt far softer ones.
    """
    check_car(log, mass_kg=vehicle.mass_kg, wheelbase_m=vehicle.wheelbase_m, lf_m=vehicle.lf_m)
    if not log.has("ax_mps2"):
        warn(
            f"{log.name}: there is no channel 'ax_mps2': the speed alone tells how the car brakes, "
            "later and less surely; record it"
        )
    settings = settings if settings is not None else SideslipSettings.of(log, vehicle)
    run = run_over(log, SideslipObserver(vehicle, settings, kind), settings)
    if kind == "dual":
        doubted(run, static_stiffness(vehicle))
    if kind == "dual" or not judge or run.too_slow:
        return run
    return judged_by(run, run_over(log, SideslipObserver(vehicle, settings), settings))


def run_over(log: Log, observer: SideslipObserver, settings: SideslipSettings) -> SideslipRun:
    """Run an observer over a whole log."""
    unread = np.full(log.n, np.nan)
    sensors = np.column_stack([log[name] if log.has(name) else unread for name in SENSORS])
    dt = np.full(log.n, 1.0 / log.rate_hz)
    columns = observer.run(dt, sensors).T.copy()
    mode = columns[SideslipEstimate._fields.index("mode")]
    # What a log never had is told once; it is no failure of a moment.
    had = sensors[:, [log.has(name) for name in SENSORS]]
    excused = _between_readings(had)
    if had.shape != sensors.shape:
        excused = np.asarray(excused | np.isfinite(had).all(axis=1))
    mode[excused & (mode == 2)] = 0.0
    found = SideslipEstimate._make(columns)
    true_beta = true_std = None
    if log.has("vy_mps"):
        true_beta = np.arctan2(log["vy_mps"], log["vx_mps"])
        across = white_noise_std(log["vy_mps"], NOISE_BLOCK)
        true_std = across / np.maximum(np.hypot(log["vx_mps"], log["vy_mps"]), 1.0)
    run = SideslipRun(
        observer.kind, observer.vehicle, log.name, settings, log["time_s"], log["ay_mps2"],
        true_beta,
        true_std,
        **{name: np.ascontiguousarray(column) for name, column in found._asdict().items()},
    )  # fmt: skip
    if run.too_slow:
        warn(
            f"{log.name}: vx_mps: reaches {np.nanmax(log['vx_mps']):.3g} m/s, and the observer "
            f"runs from {settings['go_above_mps']:.3g} m/s on: no sideslip was estimated. Give a "
            f"log of driving forwards, check unit and sign of the speed, or lower stop_below_mps "
            f"and go_above_mps of the settings"
        )
    return run


def _between_readings(sensors: FloatArray) -> npt.NDArray[np.bool_]:
    """Samples in which sensors that are slower than the log, and none else, have no reading."""
    n = len(sensors)
    missing = ~np.isfinite(sensors)
    between = np.asarray(missing.any(axis=1))
    for column in missing.T:
        there = np.flatnonzero(~column)
        if there.size < n:
            period = float(np.median(np.diff(there))) if there.size > 1 else 1.0
            since = np.arange(n) - np.maximum.accumulate(np.where(column, -n, np.arange(n)))
            between = np.asarray(between & (~column | ((since <= period) & (period > 1.0))))
    return between


def static_stiffness(vehicle: Vehicle) -> tuple[float, float]:
    """Cornering stiffness of both axles [N/rad] at the static load, from the vehicle file."""
    front, rear = vehicle.static_loads_n
    return (
        vehicle.tyre_front.cornering_stiffness_per_load * front,
        vehicle.tyre_rear.cornering_stiffness_per_load * rear,
    )


def yaw_inertia(vehicle: Vehicle) -> float:
    """Yaw inertia of the car, or what cars of its mass and wheelbase have [kg m^2]."""
    if vehicle.yaw_inertia_kgm2 is not None:
        return vehicle.yaw_inertia_kgm2
    typical = vehicle.usual_inertia_kgm2
    warn(
        f"{vehicle.name}: yaw_inertia_kgm2 is not given; {typical:.4g} is taken, which cars of its "
        f"mass and wheelbase have"
    )
    return typical


def observed_car(vehicle: Vehicle) -> _core.ObservedCar:
    """The car as the core's observers take it."""

    def letters(tyre: Tyre) -> list[float]:
        return [tyre.B, tyre.C, tyre.D, tyre.E]

    return _core.ObservedCar(
        vehicle_data(vehicle),
        yaw_inertia(vehicle),
        letters(vehicle.tyre_front),
        letters(vehicle.tyre_rear),
    )
