"""What a speed of wheels reads that slip as they drive and brake the car."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..._common.arrays import FloatArray, as_float64
from .equations import SLIPS, Readings
from .swing import smooth

# Half the air's density times the drag area, over the mass: of cars 2e-4 to 4e-4.
_DRAG_PER_M = 3e-4


def with_slips(speed: Readings, along: Readings) -> Readings:
    """The same readings of the longitudinal speed, with their `slips`.

    A wheel turns faster than it moves by a slip that grows with its force, a share of m a_x and of
    drag, that of usual cars: the speed of wheels is v_x (1 + s a), with one s where they are driven
    and another where they are braked. At one speed that is a speed which comes early by s v_x.

    Parameters
    ----------
    speed, along : Readings
        Of `vx_mps` and `ax_mps2`.
    """
    slips = np.zeros((speed.values.size, len(SLIPS)))
    for stretch in np.unique(speed.stretch):
        own, of = speed.stretch == stretch, along.stretch == stretch
        time_s = speed.time_s[own]
        if np.any(of):
            felt = smoothed(along.time_s[of], along.values[of], time_s)
            slips[own] = slips_of(felt, speed.values[own])
    return replace(speed, slips=as_float64(slips))


def slips_of(along_mps2: FloatArray, speed_mps: FloatArray) -> FloatArray:
    """The share that each of `SLIPS` adds to a speed per unit of it, shape (n, 2) [m/s2]."""
    force = along_mps2 + _DRAG_PER_M * speed_mps**2
    return np.column_stack([np.maximum(force, 0.0), np.minimum(force, 0.0)])


def smoothed(time_s: FloatArray, values: FloatArray, at_s: FloatArray) -> FloatArray:
    """A channel without its noise at other times."""
    return as_float64(np.interp(at_s, *smooth(time_s, values)))
