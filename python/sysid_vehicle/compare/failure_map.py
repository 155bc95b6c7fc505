"""Where a model fails: the error over speed and lateral acceleration."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .._common.arrays import FloatArray, filled, usual_range
from .._common.style import axes_or_new
from ..estimate import Driving

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_FEWEST = 20  # samples that make a cell worth showing


def _range(ends: tuple[float, float], least: int, sign: str = "") -> str:
    """Both ends, with so many digits that they differ: the cells of a model car are narrow."""
    digits = max(least, -math.floor(math.log10(ends[1] - ends[0])))
    return f"{ends[0]:{sign}.{digits}f} to {ends[1]:{sign}.{digits}f}"


@dataclass(frozen=True)
class Region:
    """A part of the operating range, and its share of the error above the noise floor."""

    speed_mps: tuple[float, float]
    lateral_mps2: tuple[float, float]
    share: float
    error: float

    def __str__(self) -> str:
        return (
            f"{_range(self.speed_mps, 0)} m/s, lateral acceleration "
            f"{_range(self.lateral_mps2, 1, '+')} m/s2: "
            f"{100 * self.share:.0f} % of the excess error ({self.error:.2f} of the floor)"
        )


@dataclass(frozen=True, eq=False)
class FailureMap:
    """Error and number of samples in cells of speed and lateral acceleration.

    Attributes
    ----------
    speed_mps, lateral_mps2 : array
        Edges of the cells.
    error : array, shape (speeds, laterals)
        Root mean square of the normalised residual; NaN where hardly anybody drove.
    excess : array, same shape
        Sum of squared normalised residuals beyond their number.
    """

    speed_mps: FloatArray
    lateral_mps2: FloatArray
    error: FloatArray
    excess: FloatArray

    @classmethod
    def of(
        cls,
        driving: Driving,
        squares: FloatArray,
        count: FloatArray,
        cells: tuple[int, int] = (8, 9),
    ) -> FailureMap:
        """The map of the squares of whitened residuals, summed over the channels that are there.

        Parameters
        ----------
        driving : Driving
        squares, count : array, shape (n,)
            Sum and number of the squares of each sample.
        cells : tuple of 2 ints
            Over speed, and over lateral acceleration.
        """
        # Slow channels may never be read at the same moment.
        v = filled(driving.channel("vx_mps"))
        a = filled(driving.channel("ay_mps2"))
        known = count > 0.0
        v, a, squares, count = v[known], a[known], squares[known], count[known]
        edges_v = np.linspace(*usual_range(v), cells[0] + 1)
        reach = max(abs(x) for x in usual_range(a))
        edges_a = np.linspace(-reach, reach, cells[1] + 1)
        where = (v, a)
        edges = (edges_v, edges_a)
        total = np.histogram2d(*where, bins=edges, weights=squares)[0]
        terms = np.histogram2d(*where, bins=edges, weights=count)[0]
        samples = np.histogram2d(*where, bins=edges)[0]
        enough = samples >= _FEWEST
        error = np.full_like(total, np.nan)
        error[enough] = np.sqrt(total[enough] / terms[enough])
        return cls(edges_v, edges_a, error, np.where(enough, total - terms, 0.0))

    def worst(self, most: int = 3) -> tuple[Region, ...]:
        """The cells with the largest share of the excess error; none where there is no excess."""
        above = np.maximum(self.excess, 0.0)
        if above.sum() <= 0 or self.excess.sum() <= 0:
            return ()
        share = above / above.sum()
        # A cell at the noise floor is no failure, whatever its share of next to nothing.
        share[~(self.error > 1.1)] = 0.0
        found = []
        for flat in np.argsort(share, axis=None)[::-1][:most]:
            i, j = np.unravel_index(flat, share.shape)
            if share[i, j] < 0.03:
                break
            found.append(
                Region(
                    (float(self.speed_mps[i]), float(self.speed_mps[i + 1])),
                    (float(self.lateral_mps2[j]), float(self.lateral_mps2[j + 1])),
                    float(share[i, j]),
                    float(self.error[i, j]),
                )
            )
        return tuple(found)

    def plot(self, ax: Axes | None = None, *, highest: float | None = None) -> Axes:
        """Draw the map; grey where nobody drove."""
        ax = axes_or_new(ax, 5.5, 4.0)
        ax.set_facecolor("0.88")
        top = highest if highest is not None else max(float(np.nanmax(self.error)), 1.5)
        mesh = ax.pcolormesh(
            self.lateral_mps2, self.speed_mps, self.error, cmap="viridis", vmin=1.0, vmax=top
        )
        ax.figure.colorbar(mesh, ax=ax, label="error / noise floor")
        ax.set(xlabel="lateral acceleration [m/s2]", ylabel="speed [m/s]")
        return ax
