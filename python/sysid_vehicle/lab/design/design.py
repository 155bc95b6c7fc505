"""Designing an excitation: the drive after which the least-known coefficient is known best."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import scipy

from ..._common.arguments import generator
from ..._common.arrays import FloatArray, as_float64
from ..._common.printed import Part, Printed
from ..._common.progress import doing
from ..._common.style import AFTER, BEFORE, axes_or_new, tidy
from ..._common.threads import Workers
from ..._common.typed import typed
from ...effects import length_beyond
from ...errors import InvalidInput, NumericalError
from ...manoeuvres import peak_lateral_mps2
from ...model import Model
from ...vehicle import AXLES
from ..excitation import Excitation, Weaving
from ..observer.observed import READINGS
from ..setup import Setup
from .information import TYRES
from .limits import Limits
from .preview import Preview, preview

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_FRONT_SLIP_SHARE = 1.5  # of the slip angle at the peak, where the controller holds the tyre
_REAR_SLIP_SHARE = 1.25
_MOST_SWING_MPS = 12.0
_AT_ONCE = 4  # trials around one best, whatever the number of threads
_FIRST_SPREAD, _LAST_SPREAD = 0.25, 0.05  # of the box, for the trials around the best so far


@dataclass(frozen=True)
class Trial:
    """One excitation that was tried.

    Attributes
    ----------
    excitation : Weaving
    relative : float
        Expected relative standard deviation of the coefficient that is known least, in the worst
        of the cars that were assumed.
    broken : tuple of str
        Limits that it breaks with one of them; `control` where the car is lost.
    penalty : float
        Size of that, zero if nothing is broken.
    """

    excitation: Weaving
    relative: float
    broken: tuple[str, ...]
    penalty: float

    @property
    def cost(self) -> float:
        """What the design makes small."""
        return float(np.log(min(self.relative, 1e6))) + self.penalty


@dataclass(frozen=True, eq=False)
class Design(Printed):
    """A designed excitation.

    Attributes
    ----------
    excitation : Weaving
    setup : Setup
        The laboratory to drive it in; its controller knows where the believed tyres peak.
    preview : Preview
        What it will teach about the car as believed.
    limits : Limits
    trials : tuple of Trial
        Everything that was tried, in order.
    """

    excitation: Weaving
    setup: Setup
    preview: Preview
    limits: Limits
    trials: tuple[Trial, ...]

    @property
    def best(self) -> Trial:
        """The trial that was chosen."""
        return min(self.trials, key=lambda t: t.cost)

    def _notes(self) -> list[str]:
        e, best = self.excitation, self.best
        kept = sum(not t.broken for t in self.trials)
        what = (
            f"weaving with {e.lateral_mps2:.1f} m/s2 from {e.from_hz:.2f} to {e.to_hz:.2f} Hz at "
            f"{e.mean_mps:.1f} +- {e.swing_mps:.1f} m/s in {e.swing_period_s:.1f} s, "
            f"{e.duration_s:g} s long"
        )
        how = (
            f"{len(self.trials)} excitations tried, {kept} within the limits; in the worst car "
            f"assumed the least-known coefficient is known to {100.0 * best.relative:.2g} %"
        )
        return [what, how]

    def _parts(self) -> list[Part]:
        return [*self._notes(), *self.preview._parts()]

    @typed
    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw how well each trial would tell the least-known coefficient."""
        ax = axes_or_new(ax, 8.0, 3.0)
        for label, colour, inside in (
            ("within the limits", AFTER, True),
            ("not", BEFORE, False),
        ):
            some = [(i, t) for i, t in enumerate(self.trials) if (not t.broken) == inside]
            where = [float(i + 1) for i, _ in some]
            ax.plot(where, [100.0 * t.relative for _, t in some], "o", color=colour, label=label)
        ax.set_yscale("log")
        ax.legend(frameon=False)
        return tidy(ax, xlabel="trial", ylabel="least-known coefficient, std [%]", title="Design")


@typed
def design_excitation(
    setup: Setup | None = None,
    *,
    believed: Model | None = None,
    limits: Limits | None = None,
    duration_s: float = 60.0,
    free: Sequence[str] = TYRES,
    readings: Sequence[str] = READINGS,
    uncertainty: float = 0.1,
    trials: int = 32,
    seed: int = 0,
    workers: int | None = None,
    progress: bool | None = None,
) -> Design:
    """Choose amplitude, frequencies and speeds so that the least-known coefficient is known best.

    Parameters
    ----------
    setup : Setup, optional
        The laboratory; `Setup.default()` if left out. Its plant is not looked at if `believed` is
        given.
    believed : Model, optional
        What is known of the car so far; the setup's plant if left out.
    limits : Limits, optional
        What the drive must keep to; `Limits.usual` of the believed car if left out.
    duration_s : float
        Length of the drive.
    free : sequence of str
        Parameters that are not known; the tyres if left out.
    readings : sequence of str
        Readings that will be used.
    uncertainty : float
        The tyres' grip may be wrong by this share. Every trial is also computed with front and
        rear wrong in opposite senses, and judged by its worst.
    trials : int
        Number of excitations tried: half spread evenly, half around the best of them.
    seed : int
        Of the spread, and of the sensors' randomness.
    workers : int, optional
        Threads; by default as many as there are cores. The result is the same for any number.
    progress : bool, optional
        Show a progress bar; by default in a terminal or a notebook, after two seconds.

    Raises
    ------
    InvalidInput
        If an argument makes no sense.
    NumericalError
        If nothing that was tried keeps within the limits; the message names those that the best
        of them breaks.
    """
    setup = setup if setup is not None else Setup.default()
    believed = believed if believed is not None else setup.plant
    limits = limits if limits is not None else Limits.usual(believed.vehicle)
    if not (trials >= 2 and 0.0 <= uncertainty < 0.5 and 10.0 <= duration_s <= 1000.0):
        raise InvalidInput(
            f"design_excitation: trials = {trials!r}, uncertainty = {uncertainty!r}, duration_s = "
            f"{duration_s!r}; give 2 trials or more, an uncertainty below 0.5, and 10 to 1000 s"
        )
    designer = _Designer(
        _prepared(setup, believed), believed, limits, free, readings, uncertainty, seed
    )
    box = _box(believed, setup, limits)
    tried: list[Trial] = []
    spread = trials - trials // 2
    sobol = scipy.stats.qmc.Sobol(len(box), seed=seed)
    points = sobol.random(1 << (spread - 1).bit_length())[:spread]
    rng = generator(seed)
    with (
        Workers(workers) as pool,
        doing("excitations", progress, trials) as task,
    ):
        while len(tried) < trials:
            if len(tried) >= spread:
                points = _around(tried, box, rng, (len(tried) - spread) / (trials - spread))
                points = points[: trials - len(tried)]
            made = [_weaving(point, box, duration_s) for point in points]
            tried += pool.map(designer.trial, made)
            task.advance(len(made))
    best = min(tried, key=lambda t: t.cost)
    if best.broken:
        raise NumericalError(
            f"design_excitation: the best of {trials} excitations still breaks: "
            f"{', '.join(best.broken)}; widen that limit, or allow more trials"
        )
    return Design(
        best.excitation,
        replace(designer.setup, plant=setup.plant),
        designer.look(best.excitation, believed),
        limits,
        tuple(tried),
    )


_Box = dict[str, tuple[float, float]]


def _box(believed: Model, setup: Setup, limits: Limits) -> _Box:
    """What a design chooses, and from where to where; the swing is a share of the room it has."""
    tyres = {f"tyre_{axle}": believed.tyre(axle) for axle in AXLES}
    grip = peak_lateral_mps2(believed.vehicle.replace(**tyres)) * setup.simulator.load_share
    # Where the limit is below the grip, what is asked for is near the limit.
    least, most = (0.8 * grip, 1.7 * grip)
    if limits.lateral_mps2 < grip:
        least, most = (0.5 * limits.lateral_mps2, 1.1 * limits.lateral_mps2)
    room = limits.fastest_mps - limits.slowest_mps
    # Small cars are as much quicker as their times are shorter.
    quick = length_beyond(believed.vehicle.wheelbase_m) ** -0.5
    return {
        "lateral_mps2": (least, most),
        "from_hz": (0.15 * quick, 0.4 * quick),
        "to_hz": (0.5 * quick, 1.2 * quick),
        "mean_mps": (limits.slowest_mps + 0.25 * room, limits.slowest_mps + 0.75 * room),
        "swing_share": (0.0, 0.6),
        "swing_period_s": (6.0 / quick, 15.0 / quick),
    }


def _room(box: _Box, mean_mps: float) -> float:
    """How far the speed may swing to either side; the mean's range is the middle half of all."""
    low, high = box["mean_mps"]
    margin = 0.5 * (high - low)
    return float(min(mean_mps - low + margin, high + margin - mean_mps, _MOST_SWING_MPS))


def _weaving(point: FloatArray, box: _Box, duration_s: float) -> Weaving:
    v = {n: low + u * (high - low) for u, (n, (low, high)) in zip(point, box.items(), strict=True)}
    swing = v.pop("swing_share") * _room(box, v["mean_mps"])
    return Weaving(swing_mps=swing, duration_s=duration_s, **v)


def _around(tried: list[Trial], box: _Box, rng: np.random.Generator, done: float) -> FloatArray:
    """Points of the unit box around the best so far, nearer and nearer."""
    best = min(tried, key=lambda t: t.cost).excitation
    values = {**vars(best), "swing_share": best.swing_mps / _room(box, best.mean_mps)}
    centre = [(values[n] - low) / (high - low) for n, (low, high) in box.items()]
    spread = _FIRST_SPREAD * (_LAST_SPREAD / _FIRST_SPREAD) ** done
    drawn = np.array(centre) + spread * rng.standard_normal((_AT_ONCE, len(box)))
    return as_float64(np.clip(drawn, 0.0, 1.0))


def _prepared(setup: Setup, believed: Model) -> Setup:
    """The setup with a controller that holds the tyres somewhat beyond their believed peaks."""
    front, rear = (believed.tyre(axle).peak_slip_rad() for axle in AXLES)
    controller = replace(
        setup.controller,
        slip_limit_rad=_FRONT_SLIP_SHARE * front,
        rear_slip_limit_rad=_REAR_SLIP_SHARE * rear,
    )
    return replace(setup, controller=controller)


@dataclass(frozen=True, eq=False)
class _Designer:
    setup: Setup
    believed: Model
    limits: Limits
    free: Sequence[str]
    readings: Sequence[str]
    uncertainty: float
    seed: int

    def cars(self) -> list[Model]:
        """The car as believed, and with the grip of front and rear wrong in opposite senses."""
        cars = [self.believed]
        for sign in (1.0, -1.0) if self.uncertainty > 0.0 else ():
            grip = {
                f"D_{axle}": self.believed.value(f"D_{axle}") * (1.0 + side * self.uncertainty)
                for axle, side in (("front", sign), ("rear", -sign))
            }
            cars.append(self.believed.with_values(grip))
        return cars

    def look(self, excitation: Excitation, car: Model) -> Preview:
        return preview(
            excitation,
            self.setup,
            believed=car,
            free=self.free,
            readings=self.readings,
            seed=self.seed,
        )

    def trial(self, excitation: Weaving) -> Trial:
        worst, penalty, broken = 0.0, 0.0, []
        for car in self.cars():
            try:
                seen = self.look(excitation, car)
            except (NumericalError, InvalidInput):
                return Trial(excitation, float("inf"), ("control",), 100.0)
            worst = max(worst, seen.worst.relative)
            for what, share in self.limits.broken(seen):
                broken.append(what)
                penalty += 5.0 + 10.0 * share
            lost = seen.drive.lost_s
            if lost is not None:
                broken.append("control")
                penalty += 20.0 + 20.0 * (1.0 - lost / excitation.duration_s)
        return Trial(excitation, worst, tuple(dict.fromkeys(broken)), penalty)
