"""What noise of the measured inputs adds to scores.

Directions are worked out from the same noisy inputs as the residuals: where an effect scales an
input, or moves it in time, its noise stands in both, and their product does not average out. Where
little else moves, the score then asks for no input at all. With as much noise once more it changes
by as much as it has changed already (simulation and extrapolation, Cook & Stefanski, JASA 1994).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..._common.arrays import FloatArray, as_float64
from .directions import Columns
from .evidence import Evidence

Noisier = Callable[[Evidence, FloatArray], Columns]
"""Columns of the evidence with noisier inputs, and of that noise, shape (samples, 2)."""


def added_by_input_noise(evidence: Evidence, columns: Columns, noisier_ones: Noisier) -> FloatArray:
    """What noise of the inputs has added to the scores of columns, shape (width,).

    What the fitted parameters can do of a column is taken off as it was. Of the residuals they can
    do as little of the noise as they are fewer than the samples.

    Parameters
    ----------
    evidence : Evidence
    columns : Columns
        Its own.
    noisier_ones : callable
        Makes the same columns of noisier evidence.
    """
    noisy = [one for one, _ in evidence.noisier]
    others = [noisier_ones(one, noise) for one, noise in evidence.noisier]
    free = len(evidence.fit.model.free_names)
    square, across = np.zeros((free, free)), np.zeros((free, columns.width))
    own, product = np.zeros(free), np.zeros(columns.width)
    for section, *moved in zip(
        evidence.sections(), *(one.sections() for one in noisy), strict=True
    ):
        G, F = columns.of(section), section.fitted
        square += F.T @ F
        across += F.T @ G
        for other, after in zip(others, moved, strict=True):
            change = (after.residual - section.residual) / len(noisy)
            product += (other.of(after) - G).T @ change
            own += (after.fitted - F).T @ change
    scale = np.sqrt(np.maximum(np.diag(square), 1e-300))
    copied = np.linalg.lstsq(square / np.outer(scale, scale), across / scale[:, None], rcond=None)
    return as_float64(product - (own / scale) @ copied[0])
