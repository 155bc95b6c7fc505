"""Axle forces as a result: printed, drawn, written."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from .._common.arrays import FloatArray
from .._common.printed import Part, Printed, Table
from .._common.style import MEASURED, tidy
from .._common.text import HALF_95, brief, number
from ..errors import InvalidInput, near_names
from ..sensors import SensorCheck
from ..vehicle import AXLES, Vehicle

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_HEAD = ("axle", "slip angle", "side force", "of the load", "slope", "95 % band")
_SMALL = 0.3  # of the load, below which a side force is nearly proportional to slip
_FEWEST = 50
_DRAWN = 4000  # points of a picture
_MODEL_CAR_KG = 100.0  # below, forces are told in newtons
# Figure, label and factor by the word that asks for it; loads in the unit of the forces.
_COLOURS = {
    "load": ("load_n", "axle load [{unit}]", 1.0),
    "a_x": ("ax_mps2", "longitudinal acceleration [m/s2]", 1.0),
    "steer rate": ("steer_rate_radps", "steering rate [deg/s]", float(np.degrees(1.0))),
    "time": ("time_s", "time [s]", 1.0),
}
COLOURS = tuple(_COLOURS)


@dataclass(frozen=True, eq=False, repr=False)
class AxleForces(Printed):
    """Axle forces from motion, before any tyre is assumed; made by `axle_forces`.

    Arrays have the shape (n,), or (n, 2) for the front and the rear axle.

    Attributes
    ----------
    log, stretch : ndarray of int
        Log and stretch of driving that a sample belongs to.
    time_s : ndarray
        Time of its log.
    vx_mps, ax_mps2, ay_mps2, yaw_acceleration_radps2 : ndarray
        Smoothed motion of the centre of gravity. The accelerations are those that the tyres make:
        gravity along and across the road is in them.
    steer_rad, steer_rate_radps : ndarray
        As read.
    slip_rad, slip_std_rad : ndarray, shape (n, 2)
        Slip angle and its standard deviation.
    lateral_n, lateral_std_n : ndarray, shape (n, 2)
        Side force in the direction of the axle's wheels, and its standard deviation.
    load_n : ndarray, shape (n, 2)
        Vertical load: weight and longitudinal load transfer.
    longitudinal_n, longitudinal_std_n : ndarray
        Force of all wheels along the car.
    moment_nm, moment_std_nm : ndarray
        Yaw moment of all forces.
    yaw_inertia_kgm2 : float
        That was taken as right.
    vehicle : Vehicle
        Whose mass and geometry were.
    sensors : SensorCheck
        Whose motion it is.
    """

    log: npt.NDArray[np.intp]
    stretch: npt.NDArray[np.intp]
    time_s: FloatArray
    vx_mps: FloatArray
    ax_mps2: FloatArray
    ay_mps2: FloatArray
    yaw_acceleration_radps2: FloatArray
    steer_rad: FloatArray
    steer_rate_radps: FloatArray
    slip_rad: FloatArray
    slip_std_rad: FloatArray
    lateral_n: FloatArray
    lateral_std_n: FloatArray
    load_n: FloatArray
    longitudinal_n: FloatArray
    longitudinal_std_n: FloatArray
    moment_nm: FloatArray
    moment_std_nm: FloatArray
    yaw_inertia_kgm2: float
    vehicle: Vehicle
    sensors: SensorCheck

    @property
    def slope_npr(self) -> tuple[float, float]:
        """Side force over slip angle where it is below 0.3 of the load [N/rad]; NaN without such.

        A least-squares line, front and rear: it knows no tyre, and slip that comes late or a load
        that changes bends it.
        """
        front, rear = (self._line(i)[0] for i in range(2))
        return front, rear

    def _line(self, axle: int) -> tuple[float, float]:
        x, y = self.slip_rad[:, axle], self.lateral_n[:, axle]
        few = np.abs(y) < _SMALL * self.load_n[:, axle]
        if np.count_nonzero(few) < _FEWEST or np.ptp(x[few]) <= 0.0:
            return float("nan"), float("nan")
        slope, at_zero = np.polyfit(x[few], y[few], 1)
        return float(slope), float(at_zero)

    @property
    def _forces_in(self) -> tuple[float, str]:
        """Factor and unit in which forces of this car read well."""
        return (1e-3, "kN") if self.vehicle.mass_kg > _MODEL_CAR_KG else (1.0, "N")

    def _rows(self) -> list[list[str]]:
        rows = []
        factor, unit = self._forces_in
        for i, axle in enumerate(AXLES):
            slip, force = np.degrees(self.slip_rad[:, i]), factor * self.lateral_n[:, i]
            use = float(np.percentile(np.abs(self.lateral_n[:, i]) / self.load_n[:, i], 99.5))
            slope = self.slope_npr[i]
            wide = (_band(self.lateral_std_n[:, i]), _band(np.degrees(self.slip_std_rad[:, i])))
            rows.append(
                [
                    axle,
                    f"{slip.min():.2g} to {slip.max():.2g} deg",
                    f"{force.min():.3g} to {force.max():.3g} {unit}",
                    f"up to {use:.2f}",
                    f"{number(factor * slope, 3)} {unit}/rad" if np.isfinite(slope) else "",
                    f"{wide[0]} N, {wide[1]} deg",
                ]
            )
        return rows

    def _said(self) -> list[str]:
        turn = float(np.percentile(np.abs(self.yaw_acceleration_radps2), 99.5))
        tilt = 0.1 * self.yaw_inertia_kgm2 * turn / self.vehicle.wheelbase_m
        factor, unit = self._forces_in
        push, moment = factor * self.longitudinal_n, factor * self.moment_nm
        said: list[str] = []
        said.append(
            f"wheel force {push.min():.3g} to {push.max():.3g} {unit}, band "
            f"{_band(self.longitudinal_std_n)} N; yaw moment {moment.min():.3g} to "
            f"{moment.max():.3g} {unit} m, band {_band(self.moment_std_nm)} N m"
        )
        said.append(
            "were the yaw inertia 10 % larger, the front force would change by up to "
            f"{number(tilt, 2)} N and the rear force by as much the other way"
        )
        bias, std = self.sensors.offsets["ay_mps2"]
        if abs(bias) > 3.0 * std:
            slope = abs(bias) * self.vehicle.mass_kg
            said.append(
                f"ay_mps2 reads {number(bias, 3)} m/s2 too much on average: taken as bias of the "
                f"sensor; were it the slope of the road, the side forces would differ by "
                f"{number(slope, 2)} N"
            )
        if self.vehicle.yaw_inertia_kgm2 is None:
            said.append(
                f"the vehicle file gives no yaw inertia: m l_f l_r = "
                f"{number(self.yaw_inertia_kgm2)} kg m2 was taken"
            )
        if any(not log.has("vy_mps") for log in self.sensors.logs):
            said.append("vy_mps is not logged: slip angles are known as far as their band says")
        return said

    @property
    def headline(self) -> str:
        """One sentence."""
        names = ", ".join(log.name for log in self.sensors.logs)
        span = sum(s.last_s - s.first_s for s in self.sensors.stretches)
        return f"axle forces of {self.vehicle.name or 'the car'}, {names}: {span:.1f} s"

    __repr__ = brief

    def _parts(self) -> list[Part]:
        return [self.headline, Table(_HEAD, self._rows()), self._said()]

    def plot(self, ax: Sequence[Axes] | None = None, colour: str = "load") -> tuple[Axes, Axes]:
        """Draw the side force over the slip angle, one axle beside the other, with 95 % bands.

        Parameters
        ----------
        ax : sequence of two matplotlib Axes, optional
            Front and rear; a new figure is made without them.
        colour : str
            What colours the points: `load`, `a_x`, `steer rate` or `time`.

        Returns
        -------
        (matplotlib Axes, matplotlib Axes)

        Raises
        ------
        InvalidInput
            If `colour` is none of these, or `ax` are not two.
        """
        if colour not in _COLOURS:
            raise InvalidInput(f"there is no colour '{colour}'{near_names(colour, _COLOURS)}")
        if ax is None:
            from matplotlib import pyplot

            figure = pyplot.figure(figsize=(8.5, 3.6), layout="constrained")
            ax = figure.subplots(1, 2, sharey=True)
        front, rear = _two(ax)
        name, label, scale = _COLOURS[colour]
        factor, unit = self._forces_in
        values = (factor if colour == "load" else scale) * getattr(self, name)
        values = np.stack([values, values], axis=1) if values.ndim == 1 else values
        low, high = np.percentile(values, [0.5, 99.5])
        some = slice(None, None, max(len(self.time_s) // _DRAWN, 1))
        for i, (axes, axle) in enumerate(zip((front, rear), AXLES, strict=True)):
            slip, force = np.degrees(self.slip_rad[some, i]), factor * self.lateral_n[some, i]
            axes.errorbar(
                slip,
                force,
                factor * HALF_95 * self.lateral_std_n[some, i],
                np.degrees(HALF_95 * self.slip_std_rad[some, i]),
                fmt="none",
                ecolor=MEASURED,
                elinewidth=0.4,
                alpha=0.12,
                rasterized=True,
            )
            points = axes.scatter(
                slip,
                force,
                4.0,
                values[some, i],
                cmap="viridis",
                vmin=low,
                vmax=high,
                rasterized=True,
                zorder=3,
            )
            tidy(axes, title=axle, xlabel="slip angle [deg]", ylabel=f"side force [{unit}]")
        rear.figure.colorbar(points, ax=[front, rear], label=label.format(unit=unit))
        return front, rear

    def to_dict(self) -> dict[str, Any]:
        """Every figure, for JSON."""
        out: dict[str, Any] = {
            name: np.asarray(getattr(self, name)).tolist()
            for name in self.__dataclass_fields__
            if name not in ("vehicle", "sensors")
        }
        out["axles"] = list(AXLES)
        out["slope_npr"] = [x if np.isfinite(x) else None for x in self.slope_npr]
        out["said"] = self._said()
        return out


def _band(std: FloatArray) -> str:
    """Half the width of a 95 % interval in the middle of the driving."""
    return number(HALF_95 * float(np.median(std)), 2)


def _two(ax: Sequence[Axes]) -> tuple[Axes, Axes]:
    try:
        front, rear = ax
    except (TypeError, ValueError) as error:
        raise InvalidInput("plot: give two axes, for the front and the rear axle") from error
    return front, rear
