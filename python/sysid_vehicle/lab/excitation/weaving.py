"""Weaving along a road while the speed swings: the family that designs are chosen from."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..._common.arguments import check_positive_fields
from ..._common.arrays import FloatArray, as_float64
from ..._common.typed import typed, typed_fields
from ...errors import InvalidInput
from .excitation import Excitation
from .multisine import MultiSine

LEAST_MPS = 3.0
"""Below it no weaving is asked for."""


@dataclass(frozen=True)
class Weaving(Excitation):
    """A multi-sine of lateral acceleration along a straight road, at a speed that swings.

    The heading is ``psi = W / v`` with ``W`` the integral of the multi-sine: the car moves sideways
    at ``W`` whatever its speed, and stays near the line it began on. Braking loads the front tyre
    and lets the rear go first, driving the other way round, so that both come to their peak.

    Parameters
    ----------
    lateral_mps2 : float
        Peak of the wanted lateral acceleration. More than the tyres can give drives them beyond
        their peak.
    from_hz, to_hz, period_s : float
        First and last frequency, and the period in which the multi-sine repeats.
    mean_mps, swing_mps, swing_period_s : float
        The speed is ``mean - swing cos(2 pi t / period)``.
    duration_s : float
        Length; the first and the last second fade.

    Raises
    ------
    InvalidInput
        If a parameter is not positive, or the speed would fall below 3 m/s.
    """

    lateral_mps2: float = 10.0
    from_hz: float = 0.15
    to_hz: float = 0.6
    period_s: float = 20.0
    mean_mps: float = 25.0
    swing_mps: float = 6.0
    swing_period_s: float = 9.0
    duration_s: float = 60.0

    @typed_fields
    def __post_init__(self) -> None:
        check_positive_fields(
            self, "lateral_mps2", "from_hz", "to_hz", "period_s", "swing_period_s", "duration_s"
        )
        if not self.mean_mps - abs(self.swing_mps) >= LEAST_MPS:
            raise InvalidInput(
                f"Weaving: the speed would fall to {self.mean_mps - abs(self.swing_mps):.3g} m/s; "
                f"raise mean_mps or let swing_mps be less, so that {LEAST_MPS:g} m/s are left"
            )

    @cached_property
    def multi_sine(self) -> MultiSine:
        """The lateral acceleration."""
        return MultiSine(self.lateral_mps2, self.period_s, self.from_hz, self.to_hz)

    @typed
    def speed_mps(self, time_s: FloatArray) -> FloatArray:
        """Wanted speed at these times [m/s]."""
        swing = self.swing_mps * np.cos(2.0 * np.pi * time_s / self.swing_period_s)
        return as_float64(self.mean_mps - swing)

    @typed
    def heading_rad(self, time_s: FloatArray) -> FloatArray:
        """Wanted heading at these times [rad]."""
        fade = np.clip(np.minimum(time_s, self.duration_s - time_s), 0.0, 1.0)
        smooth = fade**2 * (3.0 - 2.0 * fade)
        return as_float64(smooth * self.multi_sine.integral(time_s) / self.speed_mps(time_s))
