"""What an excitation will teach, before anything is driven."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ..._common.printed import Part, Printed, Table
from ..._common.style import AFTER, BEFORE, FLOOR, MEASURED, axes_or_new, tidy
from ..._common.text import number
from ..._common.typed import typed
from ...identify.intervals.estimates import std_of_data
from ...model import Model
from ...vehicle import AXLES
from ..drive.loop import ClosedLoop, run_closed_loop
from ..excitation import Excitation
from ..observer.observed import READINGS
from ..setup import Setup
from .information import MOTION, TYRES, information

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# An E near zero has no size of its own to be compared with.
_LEAST_SIZE = 0.1


@dataclass(frozen=True)
class Expected:
    """What will be known of one parameter.

    Attributes
    ----------
    name : str
    value : float
        As believed now.
    std : float
        Expected standard deviation of its estimate; infinite if the drive tells nothing.
    """

    name: str
    value: float
    std: float

    @property
    def relative(self) -> float:
        """Standard deviation over the size of the value; values below 0.1 count as that."""
        return self.std / max(abs(self.value), _LEAST_SIZE)


@dataclass(frozen=True)
class Coverage:
    """How much of a tyre's curve a drive visits.

    Attributes
    ----------
    axle : str
        `front` or `rear`.
    peak_rad : float
        Slip angle at the peak of the curve, as believed.
    largest_rad : float
        Largest slip angle of the drive.
    beyond_half, beyond_peak : float
        Part of the time beyond half the slip angle at the peak, and beyond all of it.
    """

    axle: str
    peak_rad: float
    largest_rad: float
    beyond_half: float
    beyond_peak: float

    @property
    def reached(self) -> float:
        """Largest slip angle over that at the peak."""
        return self.largest_rad / self.peak_rad


@dataclass(frozen=True, eq=False)
class Preview(Printed):
    """What an excitation will teach about a car, if the car is as it is believed to be.

    Attributes
    ----------
    expected : tuple of Expected
        Every parameter that is not known.
    coverage : tuple of Coverage
        Front and rear tyre.
    condition : float
        Condition number of the information, each parameter in units of its size: above about 1e8,
        some combination of parameters will not be told.
    believed : Model
        The car that was assumed.
    drive : ClosedLoop
        The drive that was computed with it.
    """

    expected: tuple[Expected, ...]
    coverage: tuple[Coverage, ...]
    condition: float
    believed: Model
    drive: ClosedLoop

    __iter__ = None  # numbers are no names

    def __getitem__(self, name: str) -> Expected:
        for e in self.expected:
            if e.name == name:
                return e
        raise KeyError(name)

    @property
    def worst(self) -> Expected:
        """The parameter that will be known least, relative to its size."""
        return max(self.expected, key=lambda e: e.relative)

    @property
    def road_width_m(self) -> float:
        """Width of the strip along x that the car's centre stays in."""
        return float(np.ptp(self.drive.truth["y_m"]))

    def _rows(self) -> list[tuple[str, str, str, str]]:
        return [
            (e.name, number(e.value), number(e.std, 2), _percent(e.relative)) for e in self.expected
        ]

    _HEAD = ("parameter", "believed", "expected std", "relative")

    def _notes(self) -> list[str]:
        t = self.drive.truth
        notes = [
            f"{c.axle} tyre: slip angle up to {c.largest_rad:.3f} rad, {c.reached:.2g} times that "
            f"at the peak; {100.0 * c.beyond_half:.3g} % of the time beyond half of it, "
            f"{100.0 * c.beyond_peak:.3g} % beyond all"
            for c in self.coverage
        ]
        notes.append(
            f"speed {t['vx_mps'].min():.1f} to {t['vx_mps'].max():.1f} m/s, lateral acceleration "
            f"up to {np.abs(t['ay_mps2']).max():.1f} m/s2, within a strip of "
            f"{self.road_width_m:.3g} m"
        )
        if self.drive.lost_s is not None:
            notes.append(f"the car is lost at {self.drive.lost_s:.6g} s and the drive ends there")
        w = self.worst
        notes.append(f"least known will be {w.name}, to {_percent(w.relative)}")
        return notes

    def _title(self) -> str:
        return f"What {self.drive.excitation.name} will teach about {self.believed.vehicle.name}"

    def _parts(self) -> list[Part]:
        return [self._title(), Table(self._HEAD, self._rows()), self._notes()]

    @typed
    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw how long each slip angle is held; on a second axis the tyre curves as believed."""
        ax = axes_or_new(ax, 8.0, 3.6)
        right = ax.twinx()
        widest = 1.05 * max(max(c.largest_rad, c.peak_rad) for c in self.coverage)
        slip = np.linspace(-widest, widest, 401)
        bins = np.linspace(-widest, widest, 81)
        # Curves that are alike lie on each other; dashes let both be seen.
        looks = ((BEFORE, "-"), (AFTER, "--"))
        for c, (colour, line) in zip(self.coverage, looks, strict=True):
            visited = self.drive.truth[f"slip_{c.axle}_rad"]
            seconds = np.full(visited.size, 1.0 / self.drive.setup.rate_hz)
            ax.hist(
                visited,
                list(map(float, bins)),
                weights=seconds,
                color=colour,
                alpha=0.35,
                label=c.axle,
            )
            curve = self.believed.tyre(c.axle).friction(slip)
            right.plot(slip, curve, line, color=colour, linewidth=1.2)
            for side in (-c.peak_rad, c.peak_rad):
                ax.axvline(side, color=FLOOR, linewidth=0.7, linestyle=":")
        ax.set_yscale("log")
        ax.legend(frameon=False, loc="upper left")
        right.set_ylabel("force per load [-]", color=MEASURED)
        return tidy(ax, xlabel="slip angle [rad]", ylabel="time there [s]", title=self._title())


def _percent(share: float) -> str:
    return f"{100.0 * share:.2g} %" if share < 1.0 else "> 100 %"


@typed
def preview(
    excitation: Excitation,
    setup: Setup | None = None,
    *,
    believed: Model | None = None,
    free: Sequence[str] = TYRES,
    readings: Sequence[str] = READINGS,
    motion: tuple[float, float, float] = MOTION,
    seed: int | np.random.Generator = 0,
) -> Preview:
    """Compute an excitation with the car as it is believed to be, and what its log would tell.

    Parameters
    ----------
    excitation : Excitation
    setup : Setup, optional
        The laboratory; `Setup.default()` if left out.
    believed : Model, optional
        What is known of the car so far, in place of the setup's own plant.
    free : sequence of str
        Parameters that are not known and will be estimated together; the tyres if left out.
    readings : sequence of str
        Readings that will be used.
    motion : tuple of 3 floats
        White disturbance of v_x, v_y [m/s per root second] and yaw rate [rad/s per root second]
        that is allowed for. A simulated car that obeys its model exactly tells more than this
        default lets it.
    seed : int or numpy.random.Generator
        Source of the sensors' randomness.

    Raises
    ------
    InvalidInput
        If the excitation cannot be driven, or a name is unknown.

    Notes
    -----
    Equations: :mod:`sysid_vehicle.lab.design.information`.
    """
    setup = setup if setup is not None else Setup.default()
    simulator = setup.simulator
    if not simulator.late_feedback:
        simulator = replace(simulator, inputs_linear=True)
    assumed = replace(setup, plant=believed or setup.plant, simulator=simulator)
    drive = run_closed_loop(excitation, assumed, seed=seed)
    believed = assumed.plant
    values = [believed.value(name) for name in free]
    size = np.array([max(abs(v), _LEAST_SIZE) for v in values])
    found = information(drive, believed, free, readings=readings, motion=motion)
    found = found * np.outer(size, size)
    spread = np.linalg.eigvalsh(found)
    condition = float(spread[-1] / spread[0]) if spread[0] > 0.0 else float("inf")
    std = std_of_data(found)
    return Preview(
        tuple(
            Expected(name, value, float(s))
            for name, value, s in zip(free, values, std * size, strict=True)
        ),
        tuple(_coverage(drive, believed, axle) for axle in AXLES),
        condition,
        believed,
        drive,
    )


def _coverage(drive: ClosedLoop, model: Model, axle: str) -> Coverage:
    peak = model.tyre(axle).peak_slip_rad()
    slip = np.abs(drive.truth[f"slip_{axle}_rad"])
    return Coverage(
        axle,
        peak,
        float(slip.max()),
        float(np.mean(slip > 0.5 * peak)),
        float(np.mean(slip > peak)),
    )
