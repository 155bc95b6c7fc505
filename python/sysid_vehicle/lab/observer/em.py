"""Learning the observer's noise from logs by expectation-maximisation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from ... import _core
from ..._common.arguments import whole
from ..._common.arrays import FloatArray, as_float64
from ..._common.printed import Part, Printed, Table
from ..._common.progress import doing
from ..._common.style import AFTER, BEFORE, FLOOR, axes_or_new, tidy
from ..._common.text import number
from ..._common.typed import typed
from ...errors import InvalidInput, NumericalError, near_names
from .observed import READINGS, STATES
from .observer import Observer, ObserverNoise
from .record import ObserverRecord

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_FIXED = -1  # as in the core
_FEWEST = 50  # samples; ten variances are learned from them
_HEAD = ("disturbance of", "std before", "std learned", "")


@dataclass(frozen=True)
class NoiseStructure:
    """What may change in a covariance; by default each variance by itself.

    Attributes
    ----------
    full : bool
        Everything that is free may be correlated with everything else that is free.
    fixed : tuple of str
        Channels whose variance stays.
    tied : tuple of tuple of str
        Groups of channels whose variances keep their ratio.
    correlated : tuple of tuple of str
        Groups of channels that may be correlated among each other.
    floor : float or mapping of str to float
        Smallest variance, for all channels or by name.
    """

    full: bool = False
    fixed: tuple[str, ...] = ()
    tied: tuple[tuple[str, ...], ...] = ()
    correlated: tuple[tuple[str, ...], ...] = ()
    floor: float | Mapping[str, float] = 1e-12

    @typed
    def core(self, names: Sequence[str]) -> tuple[list[int], list[int], FloatArray]:
        """Numbers of scale and block, and the floor, for each of `names`.

        Raises
        ------
        InvalidInput
            An unknown name, a channel in two groups, or a correlated one that is fixed or tied.
        """
        scale = list(range(len(names)))
        block = list(range(len(names)))
        for name in self.fixed:
            scale[_index(name, names)] = _FIXED
        _group(self.tied, scale, names, "tied")
        groups = self.correlated
        if self.full:
            free = [n for n, s in zip(names, scale, strict=True) if s != _FIXED]
            groups = (tuple(free),)
        _group(groups, block, names, "correlated")
        for i, name in enumerate(names):
            if block.count(block[i]) > 1 and (scale[i] == _FIXED or scale.count(scale[i]) > 1):
                raise InvalidInput(f"{name} cannot be correlated and fixed or tied; choose one")
        floor = np.full(len(names), 1e-12)
        if isinstance(self.floor, Mapping):
            for name, value in self.floor.items():
                floor[_index(name, names)] = value
        else:
            floor[:] = self.floor
        if not (floor > 0.0).all():
            raise InvalidInput(f"floor = {self.floor} must be above zero: a variance of zero stays")
        return scale, block, floor


def _index(name: str, names: Sequence[str]) -> int:
    if name not in names:
        raise InvalidInput(
            f"no channel {name!r}{near_names(name, names)}; there are {', '.join(names)}"
        )
    return names.index(name)


def _group(
    groups: Sequence[Sequence[str]], numbers: list[int], names: Sequence[str], word: str
) -> None:
    seen: set[str] = set()
    for group in groups:
        for name in group:
            i = _index(name, names)
            if name in seen or numbers[i] == _FIXED:
                raise InvalidInput(f"{name} is {word} twice, or fixed too; name it once")
            seen.add(name)
            numbers[i] = _index(group[0], names)


@dataclass(frozen=True, eq=False)
class EMResult(Printed):
    """Noise learned from logs, and how it was reached.

    Attributes
    ----------
    noise : ObserverNoise
        The covariances learned.
    start : ObserverNoise
        Those it began from.
    log_likelihood : ndarray
        Of the start, then after each iteration.
    converged : bool
        Whether it stopped because no more was to be gained.
    shortened : int
        Iterations whose step had to be shortened for the log-likelihood not to fall.
    fell : int
        Iterations after which it was lower; zero unless `never_fall` was switched off.
    leaps : int
        Iterations that leapt ahead.
    samples : int
        Samples of all logs.
    inputs_held : tuple of bool
        Of each log whether its inputs are held from sample to sample: as told, or what is likelier.
    unmeasured : tuple of str
        Readings that no log has; their variance stayed as it was.
    """

    noise: ObserverNoise
    start: ObserverNoise
    log_likelihood: FloatArray
    converged: bool
    shortened: int
    fell: int
    leaps: int
    samples: int
    inputs_held: tuple[bool, ...] = ()
    unmeasured: tuple[str, ...] = field(default=())

    @property
    def iterations(self) -> int:
        """How often the noise was changed."""
        return len(self.log_likelihood) - 1

    @property
    def monotone(self) -> bool:
        """Whether the log-likelihood never fell."""
        return bool((np.diff(self.log_likelihood) >= 0.0).all())

    @property
    def sensor_correlation(self) -> FloatArray:
        """Correlation of the sensors' noise, shape (4, 4)."""
        std = np.sqrt(np.diag(self.noise.sensors))
        return np.asarray(self.noise.sensors / np.outer(std, std))

    def to_dict(self) -> dict[str, Any]:
        """All figures, for a JSON file."""
        return {
            "log_likelihood": self.log_likelihood.tolist(),
            "converged": self.converged,
            "samples": self.samples,
            "inputs_held": list(self.inputs_held),
            "unmeasured": list(self.unmeasured),
            "states": list(STATES),
            "readings": list(READINGS),
            "start": {
                "process": self.start.process.tolist(),
                "sensors": self.start.sensors.tolist(),
            },
            "noise": {
                "process": self.noise.process.tolist(),
                "sensors": self.noise.sensors.tolist(),
            },
        }

    @typed
    def plot(self, *, ax: Axes | None = None) -> Axes:
        """Draw the log-likelihood over the iterations."""
        ax = axes_or_new(ax, 6.0, 3.0)
        ax.plot(self.log_likelihood, ".-", color=AFTER, lw=1.0, ms=5)
        return tidy(ax, xlabel="iteration", ylabel="log-likelihood")

    @typed
    def plot_noise(self, *, ax: Axes | None = None) -> Axes:
        """Draw the standard deviations learned, as multiples of those before."""
        ax = axes_or_new(ax, 6.0, 3.2)
        before = np.concatenate([np.diag(self.start.process), np.diag(self.start.sensors)])
        after = np.concatenate([np.diag(self.noise.process), np.diag(self.noise.sensors)])
        place = np.arange(len(before))
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = np.sqrt(np.where(before > 0.0, after / before, 1.0))
        ax.plot(place, np.ones(len(place)), "o", color=BEFORE, ms=6, label="before")
        ax.plot(place, ratio, "o", color=AFTER, ms=6, label="learned")
        ax.vlines(place, np.minimum(ratio, 1.0), np.maximum(ratio, 1.0), color=FLOOR, lw=1.0)
        ax.set_yscale("log")
        labels = [*STATES, *(f"sensor {name}" for name in READINGS)]
        ax.set_xticks(place, labels, rotation=35, ha="right", fontsize="small")
        ax.legend(frameon=False)
        return tidy(ax, ylabel="standard deviation / start")

    @property
    def _title(self) -> str:
        first, last = self.log_likelihood[[0, -1]]
        end = "converged" if self.converged else "not yet converged"
        fell = f"; it fell {self.fell} times" if self.fell else ""
        held = {
            "held until the next" if held else "straight to the next" for held in self.inputs_held
        }
        inputs = f"; inputs of each sample {held.pop()}" if len(held) == 1 else ""
        return (
            f"{self.iterations} iterations on {self.samples} samples: log-likelihood {first:.2f} "
            f"-> {last:.2f}, {end}{fell}{inputs}"
        )

    def _rows(self) -> list[tuple[str, str, str, str]]:
        rows = []
        for names, before, after in (
            (STATES, self.start.process, self.noise.process),
            (READINGS, self.start.sensors, self.noise.sensors),
        ):
            sensor = names is READINGS
            for name, a, b in zip(names, np.diag(before), np.diag(after), strict=True):
                note = "not measured" if sensor and name in self.unmeasured else ""
                label = f"sensor {name}" if sensor else name
                rows.append((label, number(float(np.sqrt(a))), number(float(np.sqrt(b))), note))
        return rows

    def _parts(self) -> list[Part]:
        return [self._title, Table(_HEAD, self._rows())]


def _refuse_too_little(records: Sequence[ObserverRecord]) -> None:
    for i, name in enumerate(READINGS):
        there = sum(int(np.isfinite(record.readings[:, i]).sum()) for record in records)
        if (there or i == 0) and there < _FEWEST:
            names = ", ".join(record.name for record in records)
            raise InvalidInput(
                f"{names}: {there} readings of {name} are too few to learn its noise from; give "
                f"{_FEWEST} or more, in one log or several, or leave the channel out"
            )


def _refuse_frozen(process: FloatArray, scale: Sequence[int]) -> None:
    for name, variance, which in zip(STATES, np.diag(process), scale, strict=True):
        if which != _FIXED and variance == 0.0:
            raise InvalidInput(
                f"process noise of {name} starts at zero, where learning cannot move it; start "
                "above zero or name it in `fixed`"
            )


def _kinds(records: tuple[ObserverRecord, ...]) -> list[tuple[ObserverRecord, ...]]:
    """The records as they are, or those that do not say it with inputs held, and moving."""
    if all(record.inputs_held is not None for record in records):
        return [records]
    return [tuple(record.kinds()[-i] for record in records) for i in (0, 1)]


def _learned(observer: Observer, records: Sequence[ObserverRecord], how: tuple[Any, ...]) -> Any:
    noise = observer.noise
    try:
        return _core.learn_observer_noise(
            [observer.core_log(record) for record in records],
            as_float64(noise.process),
            as_float64(noise.sensors),
            *how,
        )
    except NumericalError as failure:
        raise NumericalError(
            f"learning the noise: {failure}; check units and stiffness, or start from larger "
            "covariances"
        ) from failure


@doing("noise of the observer")
def learn_observer_noise(
    observer: Observer,
    records: ObserverRecord | Sequence[ObserverRecord],
    *,
    process: NoiseStructure | None = None,
    sensors: NoiseStructure | None = None,
    most_iterations: int = 100,
    tolerance: float = 0.1,
    never_fall: bool = True,
    accelerate: bool = True,
) -> EMResult:
    """Find the covariances under which the readings of all records are likeliest.

    Expectation-maximisation (Shumway & Stoffer, J. Time Series Analysis 1982) from the observer's
    own noise. Nothing but the readings and inputs is used.

    Parameters
    ----------
    observer : Observer
        Model and start.
    records : ObserverRecord or sequence of them
        Logs, learned from together.
    process, sensors : NoiseStructure, optional
        What may change; by default each variance by itself. A floor keeps variances above zero.
    most_iterations : int
        At most so many changes of the noise, leaps included.
    tolerance : float
        Stops when two steps and the leap after them gained less log-likelihood than this; without
        `accelerate`, when no more is to come by the geometric decay of the last gains.
    never_fall : bool
        Shortens a step that would lower the log-likelihood. The model is linearised anew in each
        iteration, so that without it a step may.
    accelerate : bool
        Leaps ahead after every second step, where that gains (Varadhan & Roland, Scand. J.
        Statistics 2008). Variances that tend to zero take very long without it.

    Where a record does not say whether its inputs are held, noise is learned with all of them held
    and with all of them moving, and the likelier one is kept.

    Raises
    ------
    InvalidInput
        No record, no iteration, too few readings, a structure that contradicts itself, or a start
        it cannot leave.
    NumericalError
        The filter broke down.
    """
    several = (records,) if isinstance(records, ObserverRecord) else tuple(records)
    if not several:
        raise InvalidInput("no record was given; pass one ObserverRecord or a list of them")
    most = whole(most_iterations, "most_iterations", 1)
    if not 0.0 <= tolerance < np.inf:
        raise InvalidInput(f"tolerance = {tolerance}: give a log-likelihood of 0 or more")
    process_form = (process or NoiseStructure()).core(STATES)
    sensor_form = (sensors or NoiseStructure()).core(READINGS)
    _refuse_too_little(several)
    _refuse_frozen(observer.noise.process, process_form[0])
    most_of = (most, float(tolerance), never_fall, accelerate)
    ways = [
        (kind, _learned(observer, kind, (*process_form, *sensor_form, *most_of)))
        for kind in _kinds(several)
    ]
    told, found = max(ways, key=lambda way: float(way[1]["log_likelihood"][-1]))
    readings = np.vstack([record.readings for record in several])
    return EMResult(
        noise=ObserverNoise(found["process"], found["sensors"]),
        start=observer.noise,
        log_likelihood=np.array(found["log_likelihood"]),
        converged=found["converged"],
        shortened=found["shortened"],
        fell=found["fell"],
        leaps=found["leaps"],
        samples=len(readings),
        inputs_held=tuple(record.inputs_held is not False for record in told),
        unmeasured=tuple(
            name for name, y in zip(READINGS, readings.T, strict=True) if not np.isfinite(y).any()
        ),
    )
