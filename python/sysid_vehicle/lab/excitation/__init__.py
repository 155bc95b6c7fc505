"""What the closed loop is asked to do: multi-sines and manoeuvres."""

from __future__ import annotations

from ...manoeuvres import all as _manoeuvres
from .driven import Driven, OnManoeuvre, multi_sine, speed_ramp
from .excitation import Excitation
from .multisine import MultiSine
from .weaving import Weaving

__all__ = [
    "Driven",
    "Excitation",
    "MultiSine",
    "OnManoeuvre",
    "Weaving",
    "all",
    "multi_sine",
    "speed_ramp",
]


def all() -> dict[str, Excitation]:
    """Make every excitation of the laboratory with its default parameters, by name."""
    own = (speed_ramp(), multi_sine(), Weaving())
    return {e.name: e for e in (*own, *map(OnManoeuvre, _manoeuvres().values()))}
