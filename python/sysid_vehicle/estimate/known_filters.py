"""Filters that have run on driving lately, for those who ask the same again.

A refit, its standard errors, the evidence about it and the search that goes on from there each make
a problem of their own, and begin with the filter that the one before ended with.
"""

from __future__ import annotations

import hashlib
from collections import OrderedDict
from collections.abc import Hashable
from threading import Lock

from .. import _core
from .._common.arrays import FloatArray

_MOST_SAMPLES = 1 << 16  # of all filters that are kept, some 40 MB


class KnownFilters:
    """The last filters that ran on some driving, as many as its samples allow."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._kept: OrderedDict[Hashable, tuple[int, _core.FrozenFilter]] = OrderedDict()
        self._samples = 0

    def __reduce__(self) -> tuple[type[KnownFilters], tuple[()]]:
        """Copies begin without any: filters are quicker to run again than to hand over."""
        return KnownFilters, ()

    def get(self, asked: Hashable) -> _core.FrozenFilter | None:
        """A filter, if it is known."""
        with self._lock:
            if asked not in self._kept:
                return None
            self._kept.move_to_end(asked)
            return self._kept[asked][1]

    def put(self, asked: Hashable, samples: int, gains: _core.FrozenFilter) -> None:
        """Keep a filter, and let go of the oldest ones."""
        with self._lock:
            if asked in self._kept:
                return
            self._kept[asked] = samples, gains
            self._samples += samples
            while self._samples > _MOST_SAMPLES:
                _, (fewer, _) = self._kept.popitem(last=False)
                self._samples -= fewer


class KnownProblem(_core.Problem):
    """The core's problem of some driving, whose filters are kept with those of its other problems.

    Parameters
    ----------
    core : _core.SingleTrack
    known : KnownFilters
        Of the driving.
    made_of : hashable
        What else tells this problem from others of the driving, parameters and noise apart.
    inputs : array, optional
        In place of the driving's own.
    """

    def __init__(
        self,
        core: _core.SingleTrack,
        known: KnownFilters,
        made_of: Hashable,
        inputs: FloatArray | None,
    ) -> None:
        super().__init__(core)
        held = b"" if inputs is None else hashlib.blake2b(inputs.tobytes()).digest()
        self._known, self._made_of = known, (made_of, held)

    def freeze(self, parameters: FloatArray, noise: FloatArray) -> _core.FrozenFilter:
        """Gains of the filter."""
        asked = (self._made_of, parameters.tobytes(), noise.tobytes())
        gains = self._known.get(asked)
        if gains is None:
            gains = super().freeze(parameters, noise)
            if self.samples <= _core.TOLD_SAMPLES:
                self._known.put(asked, self.samples, gains)
        return gains

    def trace(self, parameters: FloatArray, noise: FloatArray, smoothed: bool) -> _core._Trace:
        """Everything the filter, or the smoother, says of each sample."""
        if smoothed or self.samples > _core.TOLD_SAMPLES:
            return super().trace(parameters, noise, smoothed)
        return self.filtered_trace(parameters, self.freeze(parameters, noise))

    def smoothed_means(self, parameters: FloatArray, noise: FloatArray) -> FloatArray:
        """The states that the smoother tells, along the filter."""
        if self.samples > _core.TOLD_SAMPLES:
            return super().smoothed_means(parameters, noise)
        return self.filtered_smoothed_means(parameters, self.freeze(parameters, noise))
