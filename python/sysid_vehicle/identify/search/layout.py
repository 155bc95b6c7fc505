"""Where the parameters of several runs stand in one vector, what is tied and what differs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ... import _core
from ..._common.arrays import FloatArray
from ...estimate import Driving, noise_range
from ...model import Model
from .box import free_box
from .mapped import Copied, Mapped
from .objective import Objective, gaussian_prior
from .search import Box


@dataclass(frozen=True)
class Layout:
    """Places of all parameters: the core's, with those of the first run and log; then all others.

    Attributes
    ----------
    offsets : tuple of str
        Nuisances, of which every log has its own.
    run_of : tuple of int
        The run of each part of the driving: each log where there are nuisances, else each run.
    """

    model: Model
    runs: tuple[str, ...]
    vary: tuple[str, ...]
    tie: Mapping[str, str]
    offsets: tuple[str, ...]
    run_of: tuple[int, ...]

    @classmethod
    def of(
        cls, model: Model, logs: Mapping[str, int], vary: tuple[str, ...], tie: Mapping[str, str]
    ) -> Layout:
        """The layout of runs of a model, by how many logs each has."""
        apart = () if sum(logs.values()) < 2 else model.offset_names
        parts = [count if apart else 1 for count in logs.values()]
        run_of = tuple(run for run, count in enumerate(parts) for _ in range(count))
        return cls(model, tuple(logs), vary, dict(tie), apart, run_of)

    @property
    def shared(self) -> tuple[str, ...]:
        """Parameters with one value."""
        others = {*self.vary, *self.tie, *self.offsets}
        return tuple(n for n in self.model.free_names if n not in others)

    @cached_property
    def box(self) -> Box:
        """Places and bounds of everything in `every`."""
        whole, names = free_box(self.model), list(self.model.free_names)
        order = [names.index(n) for n, _ in self.every]
        places = [self.places(n) for n in (*self.shared, *self.vary, *self.offsets)]
        return Box([c for some in places for c in some], whole.lower[order], whole.upper[order])

    @property
    def size(self) -> int:
        """Parameters in all."""
        runs, logs = (len(self.runs) - 1) * len(self.vary), len(self.run_of) - 1
        return _core.PARAMETERS + runs + logs * len(self.offsets)

    def column(self, name: str) -> int:
        """Where a parameter stands in the core's vector."""
        return self.model.parameters[name].column

    def places(self, name: str) -> list[int]:
        """Where its values stand: of all runs, of all logs, or the only one."""
        first, beyond = self.column(name), _core.PARAMETERS
        if name in self.vary:
            begin, step, count = beyond + self.vary.index(name), len(self.vary), len(self.runs)
        elif name in self.offsets:
            begin = beyond + (len(self.runs) - 1) * len(self.vary) + self.offsets.index(name)
            step, count = len(self.offsets), len(self.run_of)
        else:
            return [first]
        return [first, *(begin + step * i for i in range(count - 1))]

    def source(self, part: int) -> np.ndarray[Any, np.dtype[np.intp]]:
        """Where the parameters of a part of the driving stand."""
        source = np.arange(_core.PARAMETERS, dtype=np.intp)
        for name in self.vary:
            source[self.column(name)] = self.places(name)[self.run_of[part]]
        for name in self.offsets:
            source[self.column(name)] = self.places(name)[part]
        for name, other in self.tie.items():
            source[self.column(name)] = source[self.column(other)]
        return source

    def start(self, p: FloatArray, apart: Sequence[Mapping[str, float]]) -> FloatArray:
        """All parameters where no run differs from the core's vector `p`, logs by their offsets."""
        q = np.zeros(self.size)
        q[: _core.PARAMETERS] = p
        for name in self.vary:
            q[self.places(name)] = p[self.column(name)]
        for name in self.offsets:
            q[self.places(name)] = p[self.column(name)] + [own.get(name, 0.0) for own in apart]
        return q

    def objective(self, parts: Sequence[Driving]) -> Objective:
        """The likelihood of all parts, with the model's priors for every run's or log's values."""
        copies = tuple(Copied(d.problem(self.model), self.source(i)) for i, d in enumerate(parts))
        places = zip(self.every, self.box.columns, strict=True)
        stated = {c: self.model.priors[n] for (n, _), c in places if n in self.model.priors}
        within = noise_range(self.model.vehicle, Driving.joined(parts))
        return Objective(Mapped(copies), gaussian_prior(self.size, stated), *within)

    @property
    def every(self) -> list[tuple[str, str]]:
        """Name and run, or log, of everything in the box; nothing where it is common."""
        logs = [f"log {i + 1}" for i in range(len(self.run_of))]
        found = [(n, "") for n in self.shared] + [(n, r) for n in self.vary for r in self.runs]
        return found + [(n, log) for n in self.offsets for log in logs]

    def of_run(self, run: int) -> FloatArray:
        """What a run's free parameters are of everything in the box; nuisances the logs' means."""
        free = [n for n in self.model.free_names if n not in self.tie]
        own = [k for k, of in enumerate(self.run_of) if of == run]
        found, at = np.zeros((len(free), len(self.every))), 0
        for name in (*self.shared, *self.vary, *self.offsets):
            count = len(self.places(name))
            which = own if name in self.offsets else [run if count > 1 else 0]
            found[free.index(name), [at + k for k in which]] = 1.0 / len(which)
            at += count
        return found
