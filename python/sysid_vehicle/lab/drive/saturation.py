"""Which limits a drive met, and whether they spoilt it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ...log.signals import runs

# In the order of the bits, and for which part of the drive each may be met before the drive is no
# longer the one that was wanted. A speed that is stepped meets the force's ends for a while.
_LIMITS = (
    ("wheel force at its highest", 0.05),
    ("wheel force at its lowest", 0.05),
    ("wheel force changing at its limit", 1.0),
    ("steering at its left end", 0.01),
    ("steering at its right end", 0.01),
    ("steering turning at its limit", 0.05),
    ("wanted yaw rate cut", 0.01),
    ("change of the wanted yaw rate cut", 0.05),
    ("steering held back for the front tyre", 0.01),
    ("left to roll instead of braking", 1.0),
    ("yaw rate given up for the rear tyre", 0.01),
)


@dataclass(frozen=True)
class Saturation:
    """One limit that was met.

    Attributes
    ----------
    what : str
        The limit, in words.
    bit : int
        Its bit in the samples' `limits`.
    share : float
        Part of the samples at which it was met.
    first_s, longest_s : float
        When it was first met, and the longest time without a break.
    tolerated : float
        Part of the samples at which it may be met.
    """

    what: str
    bit: int
    share: float
    first_s: float
    longest_s: float
    tolerated: float

    @property
    def too_hard(self) -> bool:
        """Whether it was met so often that the drive is not the one that was wanted."""
        return self.share > self.tolerated

    def __str__(self) -> str:
        return (
            f"{self.what}: {100.0 * self.share:.3g} % of the time, first at {self.first_s:.4g} s, "
            f"at longest {self.longest_s:.3g} s"
        )


def saturation(limits: npt.NDArray[np.uint32], rate_hz: float) -> tuple[Saturation, ...]:
    """Sum up the bits of every sample; one entry for each limit that was met."""
    met = []
    for bit, (what, tolerated) in enumerate(_LIMITS):
        on = (limits >> np.uint32(bit)) & np.uint32(1) == 1
        if not on.any():
            continue
        longest = float(max(end - begin for begin, end in runs(on))) / rate_hz
        first = float(np.argmax(on)) / rate_hz
        met.append(Saturation(what, 1 << bit, float(on.mean()), first, longest, tolerated))
    return tuple(met)
