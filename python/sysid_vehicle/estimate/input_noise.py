"""Measured inputs with more noise, to tell what their noise does."""

from __future__ import annotations

import numpy as np

from .._common.arrays import FloatArray
from .driving import Driving
from .inputs import quiet, white_noise_std


def noisier(driving: Driving, inputs: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Inputs with as much noise once more as `quiet` leaves in them; shape (samples, 2).

    Parameters
    ----------
    driving : Driving
        Whose steering angle and wheel force, or longitudinal acceleration, tell the noise.
    inputs : array, shape (samples, 2)
        Of this driving, moved in time perhaps.
    rng : numpy.random.Generator
    """
    pull = driving.channel("fx_n" if driving.force_known else "ax_mps2")
    measured = np.column_stack([driving.channel("steer_rad"), pull])
    noisy = inputs.copy()
    for begin, end, _ in driving.spans:
        for i, u in enumerate(measured[begin:end].T):
            std = white_noise_std(u)
            noisy[begin:end, i] += quiet(u + std * rng.standard_normal(len(u))) - quiet(u)
    return noisy
