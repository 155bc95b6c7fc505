"""Measured inputs with more noise, to tell what their noise does."""

from __future__ import annotations

import numpy as np

from .._common.arrays import FloatArray
from .driving import Driving
from .inputs import quiet, white_noise_std


def again(driving: Driving, rng: np.random.Generator) -> FloatArray:
    """White noise as strong as that of the measured inputs, shape (samples, 2).

    Parameters
    ----------
    driving : Driving
        Whose steering angle and wheel force, or longitudinal acceleration, tell the noise.
    rng : numpy.random.Generator
    """
    noise = np.zeros((driving.samples, 2))
    measured = _measured(driving)
    for begin, end, _ in driving.spans:
        for i, u in enumerate(measured[begin:end].T):
            noise[begin:end, i] = white_noise_std(u) * rng.standard_normal(len(u))
    return noise


def noisier(driving: Driving, inputs: FloatArray, noise: FloatArray) -> FloatArray:
    """Inputs with as much noise once more as `quiet` leaves in them; shape (samples, 2).

    Parameters
    ----------
    driving : Driving
    inputs : array, shape (samples, 2)
        Of this driving, moved in time perhaps.
    noise : array, shape (samples, 2)
        Of the measured ones, as from `again`.
    """
    measured, noisy = _measured(driving), inputs.copy()
    for begin, end, _ in driving.spans:
        for i, (u, more) in enumerate(zip(measured[begin:end].T, noise[begin:end].T, strict=True)):
            noisy[begin:end, i] += quiet(u + more) - quiet(u)
    return noisy


def _measured(driving: Driving) -> FloatArray:
    pull = driving.channel("fx_n" if driving.force_known else "ax_mps2")
    return np.column_stack([driving.channel("steer_rad"), pull])
