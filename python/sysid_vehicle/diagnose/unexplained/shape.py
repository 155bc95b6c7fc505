"""The shape of a missing force: curves and maps with simultaneous bands.

A force that depends on z alone is a sum of hats w_k h_k(z). Through the filter the whitened
residuals become e = G d + R w + white noise, with d the change of the fitted parameters, which is
left free: whatever tyres can do is not claimed for the unknown force, and widens its band. The
weights of one force are a priori a smooth random curve of size s,

    w ~ N(0, s^2 C),  C_ij = exp(-(z_i - z_j)^2 / (2 l^2)),

and s, one for each force, is averaged over by how likely each size makes the residuals (Wahba, J.
Royal Statistical Society B 1983, for the bands; MacKay, Neural Computation 1992, for the evidence,
which also says over which coordinate a force is best drawn: a coordinate with which it has nothing
to do does not gain by having more weights). The band holds the whole curve with 95 %: its width in
standard errors is drawn from the joint distribution of the curve.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING

import numpy as np
import scipy

from ..._common.arguments import generator
from ..._common.arrays import FloatArray, as_float64
from ..._common.style import AFTER, axes_or_new, tidy
from ..._common.text import brief
from ...vehicle import GRAVITY_MPS2
from ..evidence.coordinates import COORDINATES, Coordinate, begins, coordinates, late
from ..evidence.evidence import FORCES, Evidence
from ..evidence.projection import variance_ratio
from .force_map import UNITS, draw_map

if TYPE_CHECKING:
    from matplotlib.axes import Axes

OVER = ("vx_mps", "ay_mps2", "ax_mps2", "slip_front_rad", "slip_rear_rad", "steer_rad")
_KNOTS = 7
_KNOTS_OF_PAIR = 6
_SIZES = (0.0005, 0.002, 0.006, 0.02, 0.06, 0.2)  # of the weight, or of it at half a wheelbase
_SIZES_OF_PAIR = (0.0005, 0.005, 0.05)
_SMOOTH = 0.35  # correlation length of a curve, as a share of its range
_FINE = 61
_DRAWS = 4000
_LEVEL = 0.95
_FEWEST = 20.0  # samples that make a place visited


@dataclass(frozen=True, eq=False)
class Curve:
    """A missing force over one coordinate.

    Attributes
    ----------
    target : str
        `F_x`, `F_y` or `M_z`.
    at : array, shape (n,)
        The coordinate, SI units.
    force, half_width : array, shape (n,)
        Estimate and half the width of the band that holds all of the curve with 95 % [N, N m].
    evidence : float
        Log of how much likelier the residuals are with this force than without.
    """

    target: str
    coordinate: Coordinate
    at: FloatArray
    force: FloatArray
    half_width: FloatArray
    evidence: float

    @property
    def shown(self) -> bool:
        """Whether the band excludes that there is no such force."""
        return bool(np.any(np.abs(self.force) > self.half_width))

    __repr__ = brief

    def __str__(self) -> str:
        at = int(np.argmax(np.abs(self.force) / np.maximum(self.half_width, 1e-300)))
        c = self.coordinate
        return (
            f"{self.target} over {c.label}: {self.force[at]:+.3g} +- {self.half_width[at]:.2g} "
            f"{UNITS[self.target]} at {c.scale * self.at[at]:.3g} {c.unit} (95 % band)"
        )

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the curve and its band."""
        ax = axes_or_new(ax, 4.5, 3.2)
        x = self.coordinate.scale * self.at
        low, high = self.force - self.half_width, self.force + self.half_width
        ax.fill_between(x, low, high, color=AFTER, alpha=0.25, lw=0.0)
        ax.plot(x, self.force, color=AFTER)
        ax.axhline(0.0, color="0.4", lw=0.8)
        label = f"missing {self.target} [{UNITS[self.target]}]"
        return tidy(ax, xlabel=self.coordinate.axis, ylabel=label)


@dataclass(frozen=True, eq=False)
class Surface:
    """A missing force over two coordinates, at the points of a grid.

    Attributes
    ----------
    at : tuple of array
        The coordinates of the grid, SI units.
    force, half_width : array, shape (n, m)
        As of a `Curve`; NaN where nobody drove.
    """

    target: str
    coordinates: tuple[Coordinate, Coordinate]
    at: tuple[FloatArray, FloatArray]
    force: FloatArray
    half_width: FloatArray
    evidence: float

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw it: grey where nobody drove, dots where the band excludes zero."""
        at = [c.scale * a for c, a in zip(self.coordinates, self.at, strict=True)]
        sure = np.abs(self.force) > self.half_width
        label = f"missing {self.target} [{UNITS[self.target]}]"
        return draw_map(ax, self.coordinates, at, at, self.force, sure, label, 4.0)


@dataclass(frozen=True, eq=False)
class _Posterior:
    """Weights of all targets, target by target, and the evidence for each target."""

    mean: FloatArray
    covariance: FloatArray
    evidence: FloatArray


def curves(evidence: Evidence, seed: int = 0) -> tuple[Curve, ...]:
    """Each missing force over the coordinate that tells most of it, the best supported first."""
    targets = evidence.targets(*FORCES)
    where = known(evidence)
    best: dict[str, Curve] = {}
    for name in OVER:
        knots = _knots(where[name], _KNOTS)
        if knots[-1] <= knots[0]:
            continue
        distance = (knots[:, None] - knots) / (knots[-1] - knots[0])
        found = _posterior(evidence, _hats(where[name], knots), targets, distance**2)
        fine = np.linspace(knots[0], knots[-1], _FINE)
        weights = _hats(fine, knots)
        for i, target in enumerate(targets):
            if target in best and best[target].evidence >= found.evidence[i]:
                continue
            own = slice(i * _KNOTS, (i + 1) * _KNOTS)
            V = weights @ found.covariance[own, own] @ weights.T
            half = _band(V, generator(seed))
            force = as_float64(weights @ found.mean[own])
            best[target] = Curve(
                target, COORDINATES[name], fine, force, half, float(found.evidence[i])
            )
    return tuple(sorted(best.values(), key=lambda c: -c.evidence))


def surface(evidence: Evidence, pair: tuple[str, str], seed: int = 0) -> Surface:
    """The best supported missing force over a pair of coordinates."""
    targets = evidence.targets(*FORCES)
    where = known(evidence)
    at = [_knots(where[n], _KNOTS_OF_PAIR) for n in pair]
    one, other = (_hats(where[n], k) for n, k in zip(pair, at, strict=True))
    hats = (one[:, :, None] * other[:, None, :]).reshape(len(one), -1)
    places = np.array(list(product(*(np.linspace(0.0, 1.0, _KNOTS_OF_PAIR) for _ in pair))))
    square = ((places[:, None] - places) ** 2).sum(axis=2)
    found = _posterior(evidence, hats, targets, square, _SIZES_OF_PAIR)
    i = int(np.argmax(found.evidence))
    own = slice(i * hats.shape[1], (i + 1) * hats.shape[1])
    visited = hats.sum(axis=0) >= _FEWEST
    half = np.full(len(visited), np.nan)
    V = found.covariance[own, own][np.ix_(visited, visited)]
    half[visited] = _band(V, generator(seed))
    force = np.where(visited, found.mean[own], np.nan)
    shape = (_KNOTS_OF_PAIR, _KNOTS_OF_PAIR)
    return Surface(
        targets[i],
        (COORDINATES[pair[0]], COORDINATES[pair[1]]),
        (at[0], at[1]),
        force.reshape(shape),
        half.reshape(shape),
        float(found.evidence[i]),
    )


def known(evidence: Evidence) -> dict[str, FloatArray]:
    """Coordinates of every sample as they were known one sample earlier."""
    fit, driving = evidence.fit, evidence.driving
    now, first = coordinates(fit, driving, evidence.filtered), begins(driving)
    return {
        name: late(x, first, float(np.median(x))) for name, x in now.items() if name != "time_s"
    }


def _knots(z: FloatArray, count: int) -> FloatArray:
    low, high = np.percentile(z, [1.0, 99.0])
    return as_float64(np.linspace(float(low), float(high), count))


def _hats(z: FloatArray, knots: FloatArray) -> FloatArray:
    """Linear interpolation between knots as weights, shape (len(z), knots)."""
    columns = [np.interp(z, knots, one) for one in np.eye(len(knots))]
    return as_float64(np.column_stack(columns))


def _posterior(
    evidence: Evidence,
    hats: FloatArray,
    targets: list[str],
    square: FloatArray,
    sizes: tuple[float, ...] = _SIZES,
) -> _Posterior:
    width = hats.shape[1]
    signals = np.tile(hats, (1, len(targets)))
    R = evidence.of_signals(signals, list(np.repeat(targets, width)), projected=True)
    A, b = R.T @ R, R.T @ evidence.left
    # Colour that is left in the residuals counts against all weights alike.
    size = np.linalg.lstsq(A + 1e-9 * np.trace(A) * np.eye(len(A)), b, rcond=None)[0]
    ratio = variance_ratio(R @ size, evidence.left - R @ size)
    A, b = A / ratio, b / ratio
    car = evidence.fit.model.vehicle
    weight = GRAVITY_MPS2 * car.mass_kg
    units = np.array([weight * (0.5 * car.wheelbase_m if t == "M_z" else 1.0) for t in targets])
    C = np.exp(-0.5 * square / _SMOOTH**2) + 1e-4 * np.eye(width)
    root = np.kron(np.eye(len(targets)), np.linalg.cholesky(C))
    choices = np.array(list(product(range(len(sizes)), repeat=len(targets))))
    log_evidence, means, covariances = [], [], []
    for choice in choices:
        # w = L x with x ~ N(0, I): no matrix that could be singular is inverted.
        L = np.repeat(units * np.take(sizes, choice), width)[:, None] * root
        lower = np.linalg.cholesky(np.eye(len(L)) + L.T @ A @ L)
        half = scipy.linalg.solve_triangular(lower, L.T, lower=True, check_finite=False)
        x = half @ b
        log_evidence.append(0.5 * float(x @ x) - float(np.log(np.diag(lower)).sum()))
        means.append(half.T @ x)
        covariances.append(half)
    likely = np.exp(np.array(log_evidence) - max(log_evidence))
    likely /= likely.sum()
    mean = likely @ np.array(means)
    covariance = np.zeros_like(A)
    for p, m, half in zip(likely, means, covariances, strict=True):
        if p > 1e-6:
            covariance += p * (half.T @ half + np.outer(m - mean, m - mean))
    gains = []
    for i in range(len(targets)):
        least = choices[:, i] == 0
        rest = np.logaddexp.reduce(np.array(log_evidence)[~least]) - np.log(np.sum(~least))
        none = np.logaddexp.reduce(np.array(log_evidence)[least]) - np.log(np.sum(least))
        gains.append(rest - none)
    return _Posterior(as_float64(mean), as_float64(covariance), as_float64(gains))


def _band(V: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Half the width of the band that holds all of a normal vector with 95 %."""
    if not len(V):
        return np.empty(0)  # no place was visited often enough
    values, vectors = np.linalg.eigh(V)
    std = np.sqrt(np.maximum(np.diag(V), 1e-300))
    draws = rng.standard_normal((_DRAWS, len(V))) @ (vectors * np.sqrt(np.maximum(values, 0.0))).T
    return as_float64(np.quantile(np.abs(draws / std).max(axis=1), _LEVEL) * std)
