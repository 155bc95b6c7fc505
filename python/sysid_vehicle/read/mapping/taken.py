"""Factors by which the columns of a file are taken, told beside those that a remedy gives."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

from ...log import CHANNELS, listed

_THESE = "of these channels"


@dataclass(frozen=True)
class Taken:
    """What each channel is multiplied by, where that is not 1.

    A log knows its channels in SI units. A remedy such as ``factor = -1``, put into a map in the
    place of the factor that made them so, would undo that.

    Attributes
    ----------
    factors : mapping of str to float
        By canonical channel: those of the map, and of units that the file states.
    """

    factors: Mapping[str, float]

    def beside(self, told: str) -> str:
        """Return an error or a note with the factors that its remedy multiplies, if there are any.

        Parameters
        ----------
        told : str
            Of a log, in which channels have their canonical names.
        """
        _, factor, remedy = told.partition("factor")
        if not factor:
            return told
        channels, named = _channels(told), _channels(remedy)
        if " for it" in remedy or not named:
            # Of itself a message speaks first, and of a law it doubts each part.
            named = channels if _THESE in told else [*channels[:1], *named]
        present = [f"{self.factors[c]:.7g} for {c}" for c in dict.fromkeys(named) if self._has(c)]
        if not present:
            return told
        return f"{told}; it multiplies the factor that is taken now: {listed(present)}"

    def _has(self, channel: str) -> bool:
        return self.factors.get(channel, 1.0) != 1.0


def _channels(text: str) -> list[str]:
    return [word for word in re.findall(r"\w+", text) if word in CHANNELS]
