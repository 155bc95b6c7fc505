"""Maps of the force that the model lacks, over what the car was doing.

The smoother attributes what the model does not explain to disturbances. Their mean in a cell
of, say, speed and lateral acceleration has a standard error from their autocorrelation rho, which
is found over the whole drive: with 1(k) telling whether sample k lies in the cell,

    std^2 = s^2 / n^2 sum_kl 1(k) 1(l) rho(k - l).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from ..._common.arrays import FloatArray, as_float64, usual_range
from ..._common.memo import remembered
from ..._common.style import axes_or_new, tidy
from ..._common.text import HALF_95, brief, html_text
from ...estimate import Driving
from ...identify import Fit
from ...vehicle import GRAVITY_MPS2
from ..evidence.coordinates import BLOCK_S, COORDINATES, Coordinate, coordinates, that_moved
from ..evidence.evidence import FORCES

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PAIRS = (
    ("vx_mps", "ay_mps2"),
    ("ax_mps2", "ay_mps2"),
    ("slip_front_rad", "slip_rear_rad"),
    ("vx_mps", "ax_mps2"),
    ("time_s",),
)
_CELLS = (8, 9)
_CELLS_ALONE = 24
_FEWEST = 20  # samples that make a cell worth showing
_FOLDS = 5
_LONGEST_S = 5.0  # of the autocorrelation
UNITS = {"F_x": "N", "F_y": "N", "M_z": "N m"}


@dataclass(frozen=True, eq=False)
class ForceMap:
    """Mean missing force in cells of one or two coordinates.

    Attributes
    ----------
    coordinates : tuple of str
        One or two names of `COORDINATES`.
    edges : tuple of array
        Of the cells, SI units.
    targets : tuple of str
        `F_x`, `F_y`, `M_z`; without `F_x` where the wheel force is not known.
    force, std : array, shape (targets, cells...)
        Mean [N, N m] and its standard error; NaN where hardly anybody drove.
    samples : array, shape (cells...)
    share : float
        Of the forces' variance that the map predicts on driving it was not made from. Each force
        counts by how far it stands out over what the smoother could miss.
    shares : dict
        The same for each target.
    """

    coordinates: tuple[str, ...]
    edges: tuple[FloatArray, ...]
    targets: tuple[str, ...]
    force: FloatArray
    std: FloatArray
    samples: FloatArray
    share: float
    shares: dict[str, float]

    @property
    def title(self) -> str:
        """The coordinates in words."""
        return " and ".join(COORDINATES[c].label for c in self.coordinates)

    @property
    def strongest(self) -> str:
        """Target of which the map predicts most."""
        return max(self.shares, key=lambda t: self.shares[t])

    def peak(self, target: str) -> str:
        """The cell that stands out most, in words."""
        i = self.targets.index(target)
        z = np.abs(self.force[i]) / np.maximum(self.std[i], 1e-300)
        if not np.isfinite(z).any():
            return f"{target}: not enough driving"
        at = np.unravel_index(int(np.nanargmax(z)), z.shape)
        where = ", ".join(
            f"{c.label} {c.scale * e[k]:.3g} to {c.scale * e[k + 1]:.3g} {c.unit}"
            for c, e, k in zip(
                (COORDINATES[n] for n in self.coordinates), self.edges, at, strict=True
            )
        )
        return (
            f"{target} {self.force[(i, *at)]:+.3g} +- {self.std[(i, *at)]:.2g} {UNITS[target]} at "
            f"{where}"
        )

    __repr__ = brief
    _repr_html_ = html_text

    def __str__(self) -> str:
        head = f"missing force over {self.title}: predicts {100 * max(self.share, 0.0):.0f} %"
        return "\n".join([head, *(f"  {self.peak(t)}" for t in self.targets)])

    def plot(self, ax: Axes | None = None, target: str | None = None) -> Axes:
        """Draw one target: grey where nobody drove, dots where it is beyond two standard errors.

        Over one coordinate a line with its 95 % interval cell by cell.
        """
        target = self.strongest if target is None else target
        i = self.targets.index(target)
        factor = 1e-3 if np.nanmax(np.abs(self.force[i]), initial=0.0) > 2000.0 else 1.0
        label = f"{target} [{'k' if factor < 1.0 else ''}{UNITS[target]}]"
        force, std = factor * self.force[i], factor * self.std[i]
        axes = [COORDINATES[c] for c in self.coordinates]
        edges = [c.scale * e for c, e in zip(axes, self.edges, strict=True)]
        if len(axes) == 1:
            ax = axes_or_new(ax, 6.5, 2.8)
            middle = 0.5 * (edges[0][1:] + edges[0][:-1])
            ax.errorbar(middle, force, HALF_95 * std, fmt="o", ms=3.0, lw=1.0, color="0.2")
            ax.axhline(0.0, color="0.5", lw=0.8)
            return tidy(ax, xlabel=axes[0].axis, ylabel=f"missing {label}")
        middles = [0.5 * (e[1:] + e[:-1]) for e in edges]
        sure = np.abs(force) > 2.0 * std
        return draw_map(ax, axes, edges, middles, force, sure, f"missing {label}", 3.0)


def draw_map(
    ax: Axes | None,
    over: Sequence[Coordinate],
    cells: Sequence[FloatArray],
    middles: Sequence[FloatArray],
    force: FloatArray,
    sure: npt.NDArray[np.bool_],
    label: str,
    dots: float,
) -> Axes:
    """Draw a force over two coordinates: grey where nobody drove, dots where it is sure."""
    ax = axes_or_new(ax, 5.0, 3.8)
    ax.set_facecolor("0.85")
    top = max(float(np.nanmax(np.abs(force), initial=0.0)), 1e-9)
    shown = np.ma.masked_invalid(force)
    mesh = ax.pcolormesh(cells[1], cells[0], shown, cmap="RdBu_r", vmin=-top, vmax=top)
    mesh.set_rasterized(True)
    ax.figure.colorbar(mesh, ax=ax, label=label)
    at = np.argwhere(sure)
    ax.plot(middles[1][at[:, 1]], middles[0][at[:, 0]], "k.", ms=dots)
    ax.set(xlabel=over[1].axis, ylabel=over[0].axis)
    return ax


@dataclass(frozen=True, eq=False)
class MissingForces:
    """Forces that the smoother needs beside the model.

    Attributes
    ----------
    targets : tuple of str
        `F_x`, `F_y`, `M_z`; without `F_x` where the wheel force is not known.
    force, std : array, shape (samples, targets)
        [N, N m], and what the smoother could miss.
    state, state_std : array, shape (samples, n)
        The smoothed states, and what the smoother could miss of them.
    """

    targets: tuple[str, ...]
    force: FloatArray
    std: FloatArray
    state: FloatArray
    state_std: FloatArray


# Maps, ceilings and the structure of what is missing ask for the same forces.
@remembered(4)
def missing_forces(fit: Fit, driving: Driving) -> MissingForces:
    """Smooth the forces that a model lacks.

    Parameters
    ----------
    fit : Fit
    driving : Driving
    """
    car = fit.model.vehicle
    weight = GRAVITY_MPS2 * car.mass_kg
    # A disturbance that was learned small would shrink the forces that are looked for.
    least = 0.02 * weight * np.array([1.0, 1.0, 0.5 * car.wheelbase_m])
    disturbance = np.maximum(fit.noise.disturbance, least)
    noise = replace(fit.noise, disturbance=tuple(map(float, disturbance)))
    trace = driving.problem(fit.model).trace(fit.model.vector(), noise.vector(), True)
    targets = tuple(t for t in FORCES if t != "F_x" or driving.force_known)
    columns = [3 + FORCES[t] for t in targets]
    state, std = trace["state"], trace["state_std"]
    return MissingForces(targets, state[:, columns], std[:, columns], state, std)


# What fails and of which shape it is are two questions about the same maps.
@remembered(8)
def force_maps(
    fit: Fit, driving: Driving
) -> tuple[tuple[ForceMap, ...], dict[str, tuple[float, float]]]:
    """Maps over pairs of coordinates, and over time, the most telling first.

    Of a pair of which one alone moved the map is over that one. With them the mean of each force
    over all the driving, and its standard error.
    """
    found = missing_forces(fit, driving)
    targets, force, deviation = found.targets, found.force, found.std
    where = coordinates(fit, driving, found.state)
    moved = that_moved(fit, driving, found.state, found.state_std)
    over = dict.fromkeys(tuple(n for n in pair if n in moved) for pair in PAIRS)
    maps = [_map(driving, names, where, targets, force, deviation) for names in over if names]
    everywhere = np.zeros(driving.samples, dtype=np.intp), np.array([float(driving.samples)])
    steady = {}
    for i, target in enumerate(targets):
        mean, std, _ = _means(driving, *everywhere, force[:, i])
        steady[target] = float(mean[0]), float(std[0])
    return tuple(sorted(maps, key=lambda m: -m.share)), steady


def _map(
    driving: Driving,
    names: tuple[str, ...],
    where: dict[str, FloatArray],
    targets: tuple[str, ...],
    force: FloatArray,
    deviation: FloatArray,
) -> ForceMap:
    shape = _CELLS if len(names) == 2 else (_CELLS_ALONE,)
    edges = tuple(
        _edges(where[n], k, n in ("vx_mps", "time_s")) for n, k in zip(names, shape, strict=True)
    )
    # What lies beyond the edges counts to the last cell.
    inside = [
        np.clip(np.searchsorted(e, where[n], side="right") - 1, 0, len(e) - 2)
        for n, e in zip(names, edges, strict=True)
    ]
    cell = np.ravel_multi_index(tuple(inside), shape)
    cells = int(np.prod(shape))
    count = np.bincount(cell, minlength=cells).astype(float)
    mean, std, share = [], [], {}
    for i, target in enumerate(targets):
        m, s, window = _means(driving, cell, count, force[:, i])
        mean.append(np.where(count >= _FEWEST, m, np.nan))
        std.append(np.where(count >= _FEWEST, s, np.nan))
        share[target] = _predicted(driving, cell, cells, force[:, i], window)
    weight = np.var(force, axis=0) / np.maximum(np.mean(deviation**2, axis=0), 1e-300)
    return ForceMap(
        names,
        edges,
        targets,
        np.reshape(mean, (-1, *shape)),
        np.reshape(std, (-1, *shape)),
        count.reshape(shape),
        float(weight @ list(share.values()) / weight.sum()),
        share,
    )


def _edges(x: FloatArray, cells: int, one_sided: bool) -> FloatArray:
    low, high = usual_range(x)
    if not one_sided:
        low, high = -max(abs(low), abs(high)), max(abs(low), abs(high))
    return as_float64(np.linspace(low, high, cells + 1))


def _means(
    driving: Driving, cell: npt.NDArray[np.intp], count: FloatArray, x: FloatArray
) -> tuple[FloatArray, FloatArray, int]:
    """Mean and standard error by cell, and how many samples an independent piece has."""
    mean = np.bincount(cell, x, minlength=len(count)) / np.maximum(count, 1.0)
    left = x - mean[cell]
    place, length = _places(driving)
    padded = np.zeros(length)
    padded[place] = left
    finest = float(driving.sample_rate_hz.max())
    lags = min(int(_LONGEST_S * finest), len(x) // 4)
    rho = _products(padded)[: lags + 1]
    if rho[0] <= 0.0:
        return mean, np.zeros_like(mean), 1
    rho = rho / rho[0]
    if driving.sample_rate_hz.min() < finest:
        # A coarser log has no pairs at most lags.
        there = np.zeros(length)
        there[place] = 1.0
        pairs = _products(there)[: lags + 1]
        rho = rho * pairs[0] / np.maximum(pairs, 1.0)
    negative = np.flatnonzero(rho <= 0.0)
    rho[negative[0] if len(negative) else len(rho) :] = 0.0
    both = np.concatenate([rho, np.zeros(length - 2 * lags - 1), rho[:0:-1]])
    kernel = np.fft.rfft(both).real
    variance = np.zeros(len(count))
    for c in np.flatnonzero(count):
        padded[:] = 0.0
        padded[place[cell == c]] = 1.0
        power = np.abs(np.fft.rfft(padded)) ** 2 * kernel
        # Parseval: the sum of 1(k) 1(l) rho(k - l).
        total = 2.0 * power.sum() - power[0] - (power[-1] if length % 2 == 0 else 0.0)
        variance[c] = max(total / length, count[c]) / count[c] ** 2
    # Each cell's own mean takes some of the scatter away.
    kept = 1.0 - float(count @ np.minimum(variance, 1.0)) / len(x)
    scatter = float(np.mean(left**2)) / max(kept, 0.1)
    window = (2.0 * float(rho.sum()) - 1.0) * driving.mean_rate_hz / finest
    return mean, np.sqrt(scatter * variance), max(round(window), 1)


def _products(x: FloatArray) -> FloatArray:
    """Sums of products of samples so many places apart."""
    return as_float64(np.fft.irfft(np.abs(np.fft.rfft(x)) ** 2, len(x)))


def _places(driving: Driving) -> tuple[npt.NDArray[np.intp], int]:
    """Places of the samples in one array in which stretches lie too far apart to correlate.

    Neighbours are as far apart as at the finest rate of all logs.
    """
    finest = float(driving.sample_rate_hz.max())
    gap = int(_LONGEST_S * finest) + 1
    places, at = [], 0
    for first, end, rate in driving.spans:
        own = np.round(np.arange(end - first) * (finest / rate)).astype(np.intp)
        places.append(at + own)
        at += int(own[-1]) + 1 + gap
    return np.concatenate(places), 1 << int(np.ceil(np.log2(at + gap)))


def _predicted(
    driving: Driving, cell: npt.NDArray[np.intp], cells: int, x: FloatArray, window: int
) -> float:
    """Share of the variance that the map predicts where it was not made.

    Blocks of some seconds are left out in turns; a cell that was hardly visited says little.
    """
    block = int(BLOCK_S * driving.mean_rate_hz)
    fold = (np.arange(len(x)) // max(min(block, len(x) // (2 * _FOLDS)), 1)) % _FOLDS
    both = cell * _FOLDS + fold
    size = cells * _FOLDS
    n, s, q = (
        np.bincount(both, w, minlength=size).reshape(cells, _FOLDS)
        for w in (np.ones_like(x), x, x**2)
    )
    other_n, other_s = n.sum(axis=1, keepdims=True) - n, s.sum(axis=1, keepdims=True) - s
    constant = other_s.sum(axis=0) / np.maximum(other_n.sum(axis=0), 1.0)
    mean = (other_s + window * constant) / (other_n + window)
    error = float((q - 2.0 * mean * s + n * mean**2).sum())
    plain = float((q - 2.0 * constant * s + n * constant**2).sum())
    return 1.0 - error / plain if plain > 0.0 else 0.0
