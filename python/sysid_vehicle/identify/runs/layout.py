"""Where the parameters of several runs stand in one vector, what is tied and what differs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ... import _core
from ..._common.arrays import FloatArray, as_float64
from ...estimate import Driving, noise_range
from ...model import Model
from ..search.box import free_box
from ..search.mapped import Copied, Mapped
from ..search.objective import Objective, gaussian_prior
from ..search.search import Box


@dataclass(frozen=True)
class RunsLayout:
    """Places of all parameters: those of the core, then the values of all runs but the first."""

    model: Model
    runs: tuple[str, ...]
    vary: tuple[str, ...]
    tie: Mapping[str, str]
    shared: tuple[str, ...]
    box: Box

    @classmethod
    def of(
        cls, model: Model, runs: tuple[str, ...], vary: tuple[str, ...], tie: Mapping[str, str]
    ) -> RunsLayout:
        """The layout of some runs of a model."""
        shared = tuple(n for n in model.free_names if n not in vary and n not in tie)
        whole, names = free_box(model), list(model.free_names)
        place = {n: i for i, n in enumerate(names)}
        order = [place[n] for n in shared] + [place[n] for n in vary for _ in runs]
        core = [whole.columns[place[n]] for n in shared]
        own = [
            whole.columns[place[n]] if r == 0 else _core.PARAMETERS + (r - 1) * len(vary) + k
            for k, n in enumerate(vary)
            for r in range(len(runs))
        ]
        return cls(
            model, runs, vary, dict(tie), shared,
            Box(core + own, whole.lower[order], whole.upper[order]),
        )  # fmt: skip

    @property
    def size(self) -> int:
        """Parameters in all."""
        return _core.PARAMETERS + (len(self.runs) - 1) * len(self.vary)

    def column(self, name: str) -> int:
        """Where a parameter stands in the core's vector."""
        return self.model.parameters[name].column

    def source(self, run: int) -> np.ndarray[Any, np.dtype[np.intp]]:
        """Where a run's parameters stand."""
        source = np.arange(_core.PARAMETERS, dtype=np.intp)
        if run > 0:
            for k, name in enumerate(self.vary):
                source[self.column(name)] = _core.PARAMETERS + (run - 1) * len(self.vary) + k
        for name, other in self.tie.items():
            source[self.column(name)] = source[self.column(other)]
        return source

    def start(self, p: FloatArray) -> FloatArray:
        """All parameters where no run differs from the core's vector `p`."""
        own = [p[self.column(n)] for _ in self.runs[1:] for n in self.vary]
        return as_float64([*p, *own])

    def objective(self, drivings: Mapping[str, Driving]) -> Objective:
        """The likelihood of all runs, with the model's priors for every run's own values."""
        parts = tuple(
            Copied(drivings[run].problem(self.model), self.source(i))
            for i, run in enumerate(self.runs)
        )
        places = dict(zip(self.every, self.box.columns, strict=True))
        stated = {c: self.model.priors[n] for (n, _), c in places.items() if n in self.model.priors}
        whole = Driving.joined(drivings.values())
        return Objective(
            Mapped(parts),
            gaussian_prior(self.size, stated),
            *noise_range(self.model.vehicle, whole),
        )

    @property
    def every(self) -> list[tuple[str, str]]:
        """Name and run of everything in the box; no run where it is common."""
        return [(n, "") for n in self.shared] + [(n, r) for n in self.vary for r in self.runs]
