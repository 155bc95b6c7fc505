"""The driving log: named channels of one run on a uniform time grid."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .._common.arrays import FloatArray, filled
from .._common.files import write_text
from .._common.tables import dataset, frame
from .._common.text import html_paragraph, html_table
from .._common.typed import typed
from ..errors import InvalidInput, near_names
from ..vehicle import Vehicle
from .build import LEAST_STRETCH_S, build
from .channels import CHANNELS
from .columns import Columns
from .laws.laws import Contradiction
from .laws.plausibility import contradictions
from .signals import least_speed_mps, runs

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_HEADINGS = ("channel", "unit", "min", "max", "missing %")
_SHOWN = ("vx_mps", "steer_rad", "yaw_rate_radps", "ay_mps2", "ax_mps2", "vy_mps", "fx_n")


@dataclass(frozen=True)
class Retimed:
    """Readings that were put at another time together, and how sure that time is.

    Attributes
    ----------
    channels : tuple of str
    std_s : float
        Standard error of the time, the same error for all of them [s].
    """

    channels: tuple[str, ...]
    std_s: float


@dataclass(frozen=True, eq=False, repr=False)
class Log:
    """One run of the car; build it with :meth:`from_arrays` or ``read_log``.

    Channels (ISO 8855 axes, SI, radians): ``time_s``, ``vx_mps``, ``vy_mps``, ``yaw_rate_radps``,
    ``ax_mps2``, ``ay_mps2`` (specific force at the CG, as an accelerometer feels it),
    ``steer_rad`` (road wheel, positive left), ``fx_n`` (total commanded wheel force, drive
    positive, brake negative, before drag and rolling resistance). ``vy_mps``, ``ax_mps2`` and
    ``fx_n`` may be absent, but not both of the latter. Other numeric columns are kept under their
    own names. NaN is a missing measurement.

    Attributes
    ----------
    name : str
        Name of the run in messages, tables and plots.
    rate_hz : float
        Sample rate of the uniform grid.
    uniform : bool
        Whether the source was uniform; False if it was resampled or gaps were filled with NaN.
    corrections : tuple of str
        What was put right in the channels after they had been read, a sentence each.
    retimed : tuple of Retimed
        What of that has moved readings in time by an estimate: intervals of fits count its error.
    """

    name: str
    rate_hz: float
    uniform: bool
    _data: dict[str, FloatArray]
    corrections: tuple[str, ...] = ()
    retimed: tuple[Retimed, ...] = ()

    @classmethod
    @typed
    def from_arrays(
        cls,
        data: Columns,
        *,
        name: str = "log",
        despike: Iterable[str] = (),
        check: bool = True,
        vehicle: Vehicle | None = None,
    ) -> Log:
        """Build a log from a mapping of arrays; a DataFrame works as it is.

        Parameters
        ----------
        data : mapping of array_like, shape (n,)
            Canonical channels, and any others. Times of a clock, which begin beyond 1e6 s, are
            counted from the first, as time stamps are.
        name : str
            Name of the run.
        despike : iterable of str
            Channels in which isolated one-sample spikes and dropouts, short readings that no car
            reaches, become missing values.
        check : bool
            Whether to look for wrong units, wrong signs, frozen sensors, a log that is too short,
            too slow or without corners. False suits simulated pieces. The order of time, the
            presence of channels and holes are looked at in any case.
        vehicle : Vehicle, optional
            The car. A steering angle that only a car of unusual size has is then not warned of.

        Raises
        ------
        InvalidInput
            If the data cannot be used; the message names channel, sample, time and remedy.

        Warns
        -----
        SysidWarning
            If the data can be used but something was corrected or looks implausible.
        """
        built = build(data, name, despike, check, vehicle)
        return cls(name, built.rate_hz, built.uniform, built.channels)

    @property
    def n(self) -> int:
        """Number of samples."""
        return self._data["time_s"].size

    @property
    def duration_s(self) -> float:
        """Time from the first to the last sample."""
        time_s = self._data["time_s"]
        return float(time_s[-1] - time_s[0])

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the canonical channels that are present, then of the other columns."""
        return tuple(self._data)

    @property
    def extras(self) -> tuple[str, ...]:
        """Names of the columns that are not canonical channels."""
        return tuple(name for name in self._data if name not in CHANNELS)

    @cached_property
    def contradictions(self) -> tuple[Contradiction, ...]:
        """What is wrong with the channels by the laws of motion: unit, sign, order, time.

        The same that reading refuses or warns of; a log that was read with ``check=False`` may have
        some. Empty where the driving does not show it.
        """
        with np.errstate(over="ignore"):
            return contradictions(self._data, self.rate_hz)

    def has(self, channel: str) -> bool:
        """Tell whether the channel is present."""
        return channel in self._data

    def __getitem__(self, channel: str) -> FloatArray:
        """Return a channel as a read-only float64 array of shape (n,).

        Raises
        ------
        InvalidInput
            If the channel is absent; the message gives near names.
        """
        try:
            return self._data[channel]
        except KeyError:
            known = CHANNELS.get(channel)
            hint = near_names(channel, self._data)
            lost = f"; without it {known.without}" if known is not None and known.without else ""
            raise InvalidInput(
                f"{self.name}: there is no channel '{channel}'{hint}{lost}; "
                f"present are {', '.join(self._data)}"
            ) from None

    def __contains__(self, channel: object) -> bool:
        return channel in self._data

    def __iter__(self) -> Iterator[str]:
        """The names of all channels."""
        return iter(self._data)

    def __len__(self) -> int:
        return self.n

    @typed
    def between(self, t0: float, t1: float) -> Log:
        """Return the part with ``t0 <= time_s <= t1``; time keeps its origin.

        Raises
        ------
        InvalidInput
            If fewer than two samples lie in that range.
        """
        time_s = self._data["time_s"]
        slack = 1e-6 / self.rate_hz
        first = int(np.searchsorted(time_s, t0 - slack))
        last = int(np.searchsorted(time_s, t1 + slack))
        if last - first < 2:
            raise InvalidInput(
                f"{self.name}: fewer than two samples lie between {t0:g} and {t1:g} s; the log "
                f"goes from {time_s[0]:.6g} to {time_s[-1]:.6g} s"
            )
        part = {name: values[first:last] for name, values in self._data.items()}
        name = f"{self.name} [{time_s[first]:.6g} to {time_s[last - 1]:.6g} s]"
        return Log(name, self.rate_hz, self.uniform, part, self.corrections, self.retimed)

    def without(self, *channels: str) -> Log:
        """Return the log as if some channels had not been recorded.

        Without ``fx_n`` the acceleration drives the model: short holes of it are then filled, as
        those of every input.

        Raises
        ------
        InvalidInput
            If a channel is absent, or one that every log needs.
        """
        for channel in channels:
            self[channel]
        data = {name: values for name, values in self._data.items() if name not in channels}
        built = build(data, self.name, told=True)
        return replace(self, _data=built.channels)

    def corrected(
        self,
        channels: Mapping[str, FloatArray],
        what: Sequence[str],
        retimed: Sequence[Retimed] = (),
    ) -> Log:
        """Return the log with some channels replaced, and with what was done recorded.

        Parameters
        ----------
        channels : mapping of ndarray, shape (n,)
            New values of channels that are present.
        what : sequence of str
            Sentences for `corrections`.
        retimed : sequence of Retimed
            Those that were moved in time by an estimate.
        """
        data = dict(self._data)
        for name, values in channels.items():
            if values.shape != self[name].shape:
                raise InvalidInput(
                    f"{self.name}: {name} has {values.size} corrected samples; give {self.n}"
                )
            data[name] = np.array(values, dtype=float)
            data[name].flags.writeable = False
        said, moved = (*self.corrections, *what), (*self.retimed, *retimed)
        return Log(self.name, self.rate_hz, self.uniform, data, said, moved)

    def missing(self) -> dict[str, str]:
        """Return each absent optional channel with what cannot be seen without it, in words."""
        return {
            name: channel.without
            for name, channel in CHANNELS.items()
            if channel.without and name not in self._data
        }

    @property
    def least_speed_mps(self) -> float:
        """Slowest speed at which the model is run: 3 m/s, less where all the driving is slow."""
        return least_speed_mps(self["vx_mps"])

    def stretches(
        self, min_speed_mps: float | None = None, min_duration_s: float = LEAST_STRETCH_S
    ) -> list[slice]:
        """Return the contiguous sample ranges in which the model can run.

        Parameters
        ----------
        min_speed_mps : float, optional
            The car must be at least this fast, `least_speed_mps` by default; where ``vx_mps`` is
            missing its neighbours decide.
        min_duration_s : float
            Shorter ranges are left out.

        Returns
        -------
        list of slice
            Ranges in which the steering angle and the longitudinal input (``fx_n``, or
            ``ax_mps2`` in a log without it) are known. Each begins where the speed is measured,
            from which the model starts; missing measurements break nothing after that.
        """
        drive = "fx_n" if self.has("fx_n") else "ax_mps2"
        least = self.least_speed_mps if min_speed_mps is None else min_speed_mps
        usable = filled(self["vx_mps"]) >= least
        usable &= np.isfinite(self["steer_rad"]) & np.isfinite(self[drive])
        shortest = min_duration_s * self.rate_hz - 1e-6
        known = np.flatnonzero(np.isfinite(self["vx_mps"]))
        found = []
        for a, b in runs(usable):
            first, last = np.searchsorted(known, (a, b))
            if first < last and b - 1 - known[first] >= shortest:
                found.append(slice(int(known[first]), b))
        return found

    def to_csv(self, path: str | Path) -> None:
        """Write all channels as CSV that ``read_log`` reads; complete or not at all.

        Numbers are written so that they are read back exactly; missing values are empty cells.
        """
        columns = [
            ["" if text == "nan" else text for text in map(repr, values.tolist())]
            for values in self._data.values()
        ]
        lines = [",".join(_quoted(name) for name in self._data)]
        lines += map(",".join, zip(*columns, strict=True))
        write_text(path, "\n".join(lines) + "\n")

    def to_pandas(self) -> Any:
        """A DataFrame of all channels over ``time_s``."""
        return frame(self._data, "time_s")

    def to_xarray(self) -> Any:
        """An xarray Dataset of all channels over ``time_s``, with units."""
        units = {name: CHANNELS[name].unit if name in CHANNELS else "" for name in self._data}
        rest = {n: (("time_s",), v, units[n]) for n, v in self._data.items() if n != "time_s"}
        return dataset(rest, {"time_s": (self["time_s"], "s")}, self.name)

    def _title(self) -> str:
        return f"{self.name}: {self.duration_s:.6g} s at {self.rate_hz:.4g} Hz, {self.n} samples"

    def _rows(self) -> list[tuple[str, ...]]:
        rows: list[tuple[str, ...]] = []
        for name, values in self._data.items():
            known = values[np.isfinite(values)]
            unit = CHANNELS[name].unit if name in CHANNELS else ""
            low, high = (f"{known.min():.4g}", f"{known.max():.4g}") if known.size else ("", "")
            rows.append((name, unit, low, high, f"{100.0 * (1.0 - known.size / self.n):.3g}"))
        return rows

    def _remarks(self) -> list[str]:
        absent = [f"absent: {name}: {lost}" for name, lost in self.missing().items()]
        return absent + [f"corrected: {text}" for text in self.corrections]

    def __str__(self) -> str:
        rows = [_HEADINGS, *self._rows()]
        widths = [max(len(row[k]) for row in rows) for k in range(len(_HEADINGS))]
        lines = [
            "  "
            + "  ".join(
                text.ljust(width) if k < 2 else text.rjust(width)
                for k, (text, width) in enumerate(zip(row, widths, strict=True))
            )
            for row in rows
        ]
        return "\n".join([self._title(), *lines, *(f"  {text}" for text in self._remarks())])

    def __repr__(self) -> str:
        return f"<Log {self._title()}>"

    def _repr_html_(self) -> str:
        table = html_table(_HEADINGS, self._rows(), self._title())
        return table + "".join(map(html_paragraph, self._remarks()))

    def plot(self, axes: Sequence[Axes] | None = None) -> Sequence[Axes]:
        """Draw the canonical channels over time, one below the other.

        Parameters
        ----------
        axes : sequence of matplotlib Axes, optional
            One per canonical channel except time; a new figure is made without them.

        Returns
        -------
        sequence of matplotlib Axes
        """
        names = [name for name in _SHOWN if self.has(name)]
        if axes is None:
            from matplotlib import pyplot

            figure, grid = pyplot.subplots(
                len(names),
                1,
                sharex=True,
                squeeze=False,
                layout="constrained",
                figsize=(8.0, 1.4 * len(names)),
            )
            figure.suptitle(self.name)
            axes = list(grid[:, 0])
        if len(axes) != len(names):
            raise InvalidInput(f"{self.name}: plot needs {len(names)} axes, got {len(axes)}")
        for ax, name in zip(axes, names, strict=True):
            ax.plot(self["time_s"], self[name], linewidth=0.8)
            ax.set_ylabel(name)
            ax.grid(visible=True, alpha=0.3)
        axes[-1].set_xlabel("time_s")
        return axes


def _quoted(name: str) -> str:
    return '"' + name.replace('"', '""') + '"' if any(c in name for c in ',"\n') else name
