"""Tyre curves of a fit, with bands from its covariance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._common.arrays import FloatArray, as_float64
from ..identify import Fit
from ..identify.loads import LOADING
from ..identify.reached import RARE
from ..model import Model
from ..vehicle import AXLES

# Columns of the core's evaluation, front and rear.
_SLIP = (5, 6)
_FORCE = (9, 10)

_SPEED_MPS = 20.0
_POINTS = 61
_SMALLEST_RANGE_RAD = 0.07


@dataclass(frozen=True, eq=False)
class TyreCurve:
    """Lateral force of one axle at its static load, without effects.

    Attributes
    ----------
    axle : str
        `front` or `rear`.
    slip_rad, force_n, std_n : array, shape (n,)
        Slip angle, force, and the standard error of the force.
    driven_rad : float
        Slip angle that one sample in 200 exceeds; the curve beyond is extrapolated.
    """

    axle: str
    slip_rad: FloatArray
    force_n: FloatArray
    std_n: FloatArray
    driven_rad: float


def driven_slip(fit: Fit) -> tuple[float, float]:
    """Find the slip angles [rad], front and rear, that one fitted sample in 200 exceeds."""
    driving, model = fit.driving, fit.model
    p = model.vector()
    motion = driving.problem(model).trace(p, fit.noise.vector(), False)["state"][:, :3]
    steer = driving.channel("steer_rad")
    pull = driving.channel("fx_n" if driving.force_known else "ax_mps2")
    core = model.core(force_known=driving.force_known)
    slip = np.array(
        [
            core.evaluate(p, as_float64(x), d, f)[0, _SLIP]
            for x, d, f in zip(motion[::5], steer[::5].tolist(), pull[::5].tolist(), strict=True)
        ]
    )
    front, rear = np.percentile(np.abs(slip), RARE, axis=0)
    return float(front), float(rear)


def model_curves(model: Model, slip_rad: FloatArray) -> tuple[TyreCurve, TyreCurve]:
    """Draw up both axles' curves of a model whose parameters are taken as exact."""
    forces = _forces(model, slip_rad)
    none = np.zeros_like(slip_rad)
    front, rear = (
        TyreCurve(axle, slip_rad, forces[:, i], none, float(slip_rad[-1]))
        for i, axle in enumerate(AXLES)
    )
    return front, rear


def identified_curves(fit: Fit) -> tuple[TyreCurve, TyreCurve]:
    """Draw up both axles' curves of a fit; errors by the delta method from its covariance."""
    driven = driven_slip(fit)
    slip = np.linspace(0.0, max(1.4 * max(driven), _SMALLEST_RANGE_RAD), _POINTS)
    forces = _forces(fit.model, slip)
    gradient = np.zeros((*forces.shape, len(fit.estimates)))
    for k, e in enumerate(fit.estimates):
        if "." in e.name or not e.name.endswith(AXLES):
            continue  # no coefficient of a tyre
        step = 1e-4 * max(abs(e.value), 0.1)
        high, low = (fit.model.with_values({e.name: e.value + s}) for s in (step, -step))
        gradient[:, :, k] = (_forces(high, slip) - _forces(low, slip)) / (2.0 * step)
    variance = np.einsum("nak,kl,nal->na", gradient, fit.covariance, gradient)
    std = np.sqrt(np.maximum(variance, 0.0))
    front, rear = (
        TyreCurve(axle, slip, forces[:, i], std[:, i], driven[i]) for i, axle in enumerate(AXLES)
    )
    return front, rear


def _forces(model: Model, slip_rad: FloatArray) -> FloatArray:
    """Lateral axle forces, slip angles x 2: sliding sideways without steering or acceleration."""
    plain = model.drop(*(e for e in model.effects if e not in LOADING))
    core, p = plain.core(force_known=False), plain.vector()
    return np.array(
        [
            core.evaluate(p, as_float64([_SPEED_MPS, -_SPEED_MPS * t, 0.0]), 0.0, 0.0)[0, _FORCE]
            for t in np.tan(slip_rad)
        ]
    )
