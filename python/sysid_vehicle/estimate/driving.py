"""Logs made ready for the core: usable stretches, inputs, measurements."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from .. import _core
from .._common.arrays import FloatArray, as_float64
from .._common.text import brief
from ..effects import Effect, channels_in_use
from ..errors import InvalidInput
from ..log import CHANNELS, MEASURED, Log, several_logs
from ..model import Model
from ..sensors import quantum
from . import pieces
from .alike import alike_in_force
from .channels import check_channels, has_channels, logged_channels
from .inputs import quiet
from .known_filters import KnownFilters, KnownProblem
from .leads import cut
from .pieces import DrivingProblem, PiecewiseProblem
from .samples import Samples, between, steering_reach, thinned

UNITS = {c: CHANNELS[c].unit for c in MEASURED}
WORDS = dict(zip(MEASURED, ("v_x", "v_y", "yaw rate", "a_x", "a_y"), strict=True))


class Span(NamedTuple):
    """First and end of a stretch among all usable samples, and its rate."""

    first: int
    end: int
    rate_hz: float


@dataclass(frozen=True)
class Stretch:
    """Samples `where` of log number `log`."""

    log: int
    where: slice


@dataclass(frozen=True, eq=False)
class Driving:
    """Everything usable in some logs of one car.

    Parameters
    ----------
    logs : tuple of Log
        Separate runs of the same car.
    force_known : bool
        Whether the total wheel force was logged. If not, the measured longitudinal acceleration
        stands in for it and is no longer a measurement to predict.
    offsets : tuple of mapping of str to float, optional
        By log, how much parameters of a model differ there from their values, by full name.
    part : Stretch, optional
        All that is used of the logs.
    """

    logs: tuple[Log, ...]
    force_known: bool
    offsets: tuple[Mapping[str, float], ...] = ()
    part: Stretch | None = None

    @classmethod
    def of(cls, logs: Log | Sequence[Log] | Driving) -> Driving:
        """Driving from one log, several, or itself.

        Raises
        ------
        InvalidInput
            No log, no usable stretch in them, or nothing that drives all of them.
        """
        if isinstance(logs, Driving):
            return logs
        several = alike_in_force(several_logs(logs))
        found = cls(several, several[0].has("fx_n"))
        if not found.stretches:
            names = ", ".join(log.name for log in several)
            least = min(log.least_speed_mps for log in several)
            raise InvalidInput(
                f"{names}: no stretch of 1 s or more at {least:.3g} m/s or faster has its inputs"
            )
        return found

    @classmethod
    def joined(cls, parts: Iterable[Driving]) -> Driving:
        """The logs of several, with the offsets that they have there."""
        every = tuple(parts)
        logs = tuple(log for part in every for log in part.logs)
        offsets = tuple(own for part in every for own in part.offsets or ({},) * len(part.logs))
        known = any(part.offsets for part in every)
        return cls(logs, all(part.force_known for part in every), offsets if known else ())

    def each_log(self) -> tuple[Driving, ...]:
        """Its logs one by one, with the offsets that they have."""
        used = range(len(self.logs)) if self.part is None else (self.part.log,)
        part = None if self.part is None else Stretch(0, self.part.where)
        return tuple(
            replace(self, logs=(self.logs[i],), offsets=self.offsets[i : i + 1], part=part)
            for i in used
        )

    @cached_property
    def stretches(self) -> tuple[Stretch, ...]:
        """The usable stretches, in the order in which the core's results come."""
        if self.part is not None:
            return (self.part,)
        return tuple(
            Stretch(i, where) for i, log in enumerate(self.logs) for where in log.stretches()
        )

    @cached_property
    def spans(self) -> tuple[Span, ...]:
        """Where each stretch lies among all usable samples."""
        ends = np.cumsum([s.where.stop - s.where.start for s in self.stretches]).tolist()
        rates = (self.logs[s.log].rate_hz for s in self.stretches)
        return tuple(map(Span, [0, *ends[:-1]], ends, rates))

    def only(self, stretch: Stretch) -> Driving:
        """One stretch, or a part of one, alone, with the offsets of its log."""
        own = self.offsets and (self.offsets[stretch.log],)
        log = self.logs[stretch.log]
        return replace(self, logs=(log,), offsets=own, part=Stretch(0, stretch.where))

    def read_otherwise(self, logs: Sequence[Log]) -> Driving:
        """The same stretches, whose ends hang on readings, of logs that differ in these."""
        other = replace(self, logs=tuple(logs))
        vars(other)["stretches"] = self.stretches
        return other

    def channel(self, name: str) -> FloatArray:
        """A channel over all stretches; NaN throughout where a log lacks it."""
        parts = []
        for s in self.stretches:
            log = self.logs[s.log]
            whole = log[name] if log.has(name) else np.full(log.n, np.nan)
            parts.append(whole[s.where])
        return np.concatenate(parts)

    @cached_property
    def log_number(self) -> FloatArray:
        """For each sample, the number of the log it comes from."""
        return np.concatenate(
            [
                np.full(end - first, float(s.log))
                for s, (first, end, _) in zip(self.stretches, self.spans, strict=True)
            ]
        )

    @cached_property
    def measured(self) -> FloatArray:
        """Measurements to predict, samples x 5; NaN where missing or used as an input."""
        y = np.column_stack([self.channel(c) for c in MEASURED])
        if not self.force_known:
            y[:, MEASURED.index("ax_mps2")] = np.nan
        return y

    @cached_property
    def rounding(self) -> FloatArray:
        """Standard deviation of what counting in quanta leaves of each measurement, shape (5,)."""
        quanta = [
            min(
                (quantum(log[c][np.isfinite(log[c])]) for log in self.logs if log.has(c)),
                default=0.0,
            )
            for c in MEASURED
        ]
        return as_float64(np.array(quanta) / np.sqrt(12.0))

    @cached_property
    def sample_rate_hz(self) -> FloatArray:
        """For each sample, the rate of the log it comes from: separate runs may differ."""
        return np.concatenate([np.full(end - first, rate) for first, end, rate in self.spans])

    @property
    def mean_rate_hz(self) -> float:
        """Usable samples per usable second."""
        return self.samples / self.usable_s

    @property
    def samples(self) -> int:
        """Number of usable samples."""
        return len(self.measured)

    @property
    def usable_s(self) -> float:
        """Usable seconds, over all stretches."""
        return float(sum((end - first) / rate for first, end, rate in self.spans))

    @property
    def present(self) -> tuple[str, ...]:
        """Measured channels that there are to predict."""
        there = np.isfinite(self.measured)
        return tuple(c for i, c in enumerate(MEASURED) if there[:, i].any())

    def inputs(self) -> FloatArray:
        """Steering angle and wheel force (or acceleration) without their noise, samples x 2."""
        return as_float64(np.vstack([self._inputs(log, where) for log, where, _ in self._whole]))

    @cached_property
    def _whole_inputs(self) -> FloatArray:
        """The same, without a copy where there is one stretch."""
        if len(self._whole) == 1:
            return self._inputs(*self._whole[0][:2])
        return self.inputs()

    def _inputs(self, log: Log, where: slice) -> FloatArray:
        """The inputs of some samples; every problem of this driving needs them."""
        key = self.logs.index(log), where.start, where.stop
        if key not in self._quiet:
            pull = "fx_n" if self.force_known else "ax_mps2"
            both = np.column_stack([quiet(log["steer_rad"][where]), quiet(log[pull][where])])
            both.flags.writeable = False
            self._quiet[key] = both
        return self._quiet[key]

    def channels(self) -> FloatArray:
        """Columns that effects of users read, samples x channels in use; NaN where missing."""
        return as_float64(
            np.vstack([logged_channels(self.logs[s.log], s.where) for s in self.stretches])
        )

    def shows(self, effect: Effect) -> bool:
        """Whether this driving holds the inputs without which an effect cannot be seen."""
        if effect.needs_force and not self.force_known:
            return False
        return all(has_channels(self.logs[s.log], s.where, effect) for s in self.stretches)

    @cached_property
    def told(self) -> dict[tuple[str, object], object]:
        """What was found out about this driving elsewhere: answers by a question and its object."""
        return {}

    @cached_property
    def _filters(self) -> KnownFilters:
        return KnownFilters()

    @cached_property
    def _quiet(self) -> dict[tuple[int, int, int], FloatArray]:
        return {}

    def problem(
        self,
        model: Model,
        *,
        most_samples: int | None = None,
        other_inputs: FloatArray | None = None,
        longest: int | None = None,
    ) -> DrivingProblem:
        """The core's problem for a model.

        Parameters
        ----------
        most_samples : int, optional
            Of at most so many samples.
        other_inputs : array, shape (samples, 2), optional
            In place of `inputs()`.
        longest : int, optional
            Samples that are worked on at once; usually `pieces.LONGEST`.

        Raises
        ------
        InvalidInput
            A log lacks a column that an effect of the model reads.
        """
        if channels_in_use():
            for s in self.stretches:
                check_channels(self.logs[s.log], s.where, model.parts)
        core = model.core(force_known=self.force_known)
        longest = pieces.LONGEST if longest is None else longest
        if most_samples is not None:
            return self._filled(
                _core.Problem(core), model, thinned(self._whole, most_samples), other_inputs
            )
        if self.samples <= longest:
            # The car and the effects tell models apart whose parameters are the same.
            made_of = model.vehicle, model.parts
            own = KnownProblem(core, self._filters, made_of, other_inputs)
            return self._filled(own, model, self._whole, other_inputs)
        # Noise is taken out of the whole signal: a cut is no corner.
        inputs = self._whole_inputs if other_inputs is None else other_inputs
        channels = self.channels() if channels_in_use() else None

        def some(core: _core.SingleTrack, begin: int, end: int) -> _core.Problem:
            parts = between(self._whole, begin, end)
            return self._filled(_core.Problem(core), model, parts, inputs, channels)

        return PiecewiseProblem(some, core, cut(self.spans, longest))

    def windows(
        self, model: Model, windows: Sequence[tuple[int, int]], told: FloatArray
    ) -> _core.Problem:
        """The core's problem whose runs are windows, each from a motion that is given.

        Whoever drives answers the grades to come: where the road has some, windows know them. A
        crossfall they do not know: what a model errs sideways looks like one to its smoother.

        Parameters
        ----------
        windows : sequence of (int, int)
            First sample and number of samples; each within one stretch.
        told : array, shape (samples, states)
            Smoothed means, as a problem gives them: v_x, v_y [m/s] and yaw rate [rad/s], with which
            the windows begin, are the first, gravity along and across [m/s2] the last of them.
        """
        along = told[:, -2]
        core, inputs = model.core(force_known=self.force_known), self._whole_inputs
        if np.isfinite(along).all() and along.any():
            slope = (along, np.zeros(len(along)))
            core, inputs = core.on_known_slopes(), np.column_stack([inputs, *slope])
        parts = [
            part for first, size in windows for part in between(self._whole, first, first + size)
        ]
        channels = self.channels() if channels_in_use() else None
        return self._filled(_core.Problem(core), model, parts, as_float64(inputs), channels, told)

    def _filled(
        self,
        problem: _core.Problem,
        model: Model,
        parts: list[Samples],
        other_inputs: FloatArray | None,
        channels: FloatArray | None = None,
        motion: FloatArray | None = None,
    ) -> _core.Problem:
        """The same problem with its runs, each of which begins with a motion where one is given."""
        for log, where, at in parts:
            own = slice(at, at + where.stop - where.start)
            inputs = self._inputs(log, where) if other_inputs is None else other_inputs[own]
            if channels_in_use():
                more = logged_channels(log, where) if channels is None else channels[own]
                inputs = np.column_stack([inputs, more])
            y = np.full((len(inputs), len(MEASURED)), np.nan)
            for i, c in enumerate(MEASURED):
                if log.has(c) and (self.force_known or c != "ax_mps2"):
                    y[:, i] = log[c][where]
            if motion is not None:
                y[0, :3] = motion[at, :3]
            began = where.start / log.rate_hz
            problem.add_run(
                1.0 / log.rate_hz,
                as_float64(inputs),
                as_float64(y),
                began,
                log.name,
                *self._steering_around(log, where, other_inputs),
                self.shift(model, log),
            )
        return problem

    def shift(self, model: Model, log: Log) -> list[float]:
        """By how much the core's parameters differ in a log; nothing where none does."""
        own = self.offsets[self.logs.index(log)] if self.offsets else {}
        columns = {n: p.column for n, p in model.parameters.items() if own.get(n, 0.0) != 0.0}
        if not columns:
            return []
        shift = np.zeros(_core.PARAMETERS)
        for name, column in columns.items():
            shift[column] = own[name]
        return [float(x) for x in shift]

    def _steering_around(
        self, log: Log, where: slice, other_inputs: FloatArray | None
    ) -> tuple[list[float], list[float]]:
        """Steering before and after some samples of a stretch, as far as a delay can reach."""
        whole, at = next(
            (w, at)
            for stretch, w, at in self._whole
            if stretch is log and w.start <= where.start and where.stop <= w.stop
        )
        if where == whole:
            return [], []
        begin, end, size = (x - whole.start for x in (where.start, where.stop, whole.stop))
        inputs = self._inputs(log, whole) if other_inputs is None else other_inputs[at : at + size]
        reach = steering_reach(log.rate_hz)
        steer = inputs[:, 0]
        return steer[max(begin - reach, 0) : begin].tolist(), steer[end : end + reach].tolist()

    @cached_property
    def _whole(self) -> list[Samples]:
        """The samples of each stretch."""
        return [
            Samples(self.logs[s.log], s.where, span.first)
            for s, span in zip(self.stretches, self.spans, strict=True)
        ]

    __repr__ = brief

    def __str__(self) -> str:
        names = ", ".join(log.name for log in self.logs)
        return f"{names}: {self.usable_s:.1f} s usable in {len(self.stretches)} stretch(es)"
