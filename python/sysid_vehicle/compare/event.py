"""One moment that holds most of a model's error, as something outside the model happened there.

A kerb, a contact, a hand brake or a jump of a sensor leaves most of its error in less time than
any disturbance that is learned may last. What a model lacks errs wherever it acts: of drives with a
missing effect no second holds more than a part of the error (`_common/moment.py`).
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from .._common.arrays import FloatArray, filled
from .._common.moment import commands, moment_of
from .._common.text import number
from ..estimate import Driving
from ..log import LEAST_STRETCH_S, Log
from ..rules import USUAL


@dataclass(frozen=True)
class Event:
    """Where most of the error of some driving lies.

    Attributes
    ----------
    log : str
        Name of the log.
    from_s, until_s : float
        First and last sample of it, in that log.
    share : float
        Of the squared error above the noise floor, of all the driving.
    error : float
        Root mean square of the normalised residual there; 1 is the noise floor.
    remedy : str
        How to leave it out, in words.
    """

    log: str
    from_s: float
    until_s: float
    share: float
    error: float
    remedy: str

    def of(self, data: str) -> str:
        """The finding of some data, in a sentence or two."""
        return self._said(f" of the {data}")

    def __str__(self) -> str:
        return self._said("")

    def _said(self, of: str) -> str:
        begin, end = _told(self.from_s, self.until_s)
        return (
            f"{100 * self.share:.0f} % of the squared error{of} above the noise floor lies in "
            f"{number(end - begin, 2)} s of '{self.log}', {begin:.1f} to {end:.1f} s "
            f"({number(self.error, 3)} times the floor there). Look at what happened then, or "
            f"leave these seconds out: {self.remedy}."
        )

    def to_dict(self) -> dict[str, Any]:
        """All figures, ready for JSON."""
        return asdict(self)

    @classmethod
    def of_driving(
        cls, driving: Driving, squares: FloatArray, count: FloatArray, longest_s: float
    ) -> Event | None:
        """Find the event of some driving; None where the error is spread as driving is.

        Parameters
        ----------
        driving : Driving
        squares, count : array, shape (n,)
            Sum and number of the squares of each sample's whitened residuals at the noise floor.
        longest_s : float
            Of a moment: the longest that a disturbance may last.
        """
        found = moment_of(
            squares,
            count,
            _commands(driving),
            driving.spans,
            longest_s=longest_s,
            least=USUAL.taken,
            level=USUAL.level,
        )
        if found is None:
            return None
        inside, share = found
        log = driving.logs[int(driving.log_number[inside.start])]
        time = driving.channel("time_s")[inside]
        return cls(
            log.name,
            float(time[0]),
            float(time[-1]),
            share,
            float(np.sqrt(squares[inside].sum() / count[inside].sum())),
            _remedy(log, *_told(float(time[0]), float(time[-1]))),
        )


def _commands(driving: Driving) -> FloatArray:
    steer, along = driving.inputs().T
    return commands(steer, filled(driving.channel("vx_mps")), along)


def _told(begin: float, end: float) -> tuple[float, float]:
    """Times as they are printed: the tenths of a second before and after, as ends count."""
    before, after = (round(10.0 * t, 6) for t in (begin, end))
    return (math.ceil(before) - 1) / 10.0, (math.floor(after) + 1) / 10.0


def _remedy(log: Log, begin: float, end: float) -> str:
    first, last = (round(float(t), 1) for t in log["time_s"][[0, -1]])
    parts = ((first, begin), (end, last))
    kept = [f"`log.between({a:.6g}, {b:.6g})`" for a, b in parts if b - a >= LEAST_STRETCH_S]
    if not kept:
        return "take the other logs"
    return f"take {' and '.join(kept)} in place of that log, or a file without these rows"
