"""How the estimators of friction over slip stand noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from ..._common.arguments import generator
from ..._common.arrays import FloatArray, as_float64
from ..._common.printed import Told
from ..._common.progress import doing
from ..._common.style import FLOOR, axes_or_new, tidy
from ..._common.text import text_table
from ..._common.typed import typed
from ...errors import InvalidInput
from .compare import every_estimate
from .curve import TWO_PARAMETER, MuSlipCurve
from .data import check_noise, simulate_mu_slip
from .least_squares import mu_slip_cramer_rao

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_LEVELS = (0.005, 0.01, 0.02, 0.04, 0.08, 0.16)
_MARKERS = "os^vDPX*<>"


@dataclass(frozen=True, eq=False, repr=False)
class MuSlipNoiseStudy(Told):
    """Errors of every estimator over the noise of the readings; `k` estimators, `m` levels.

    Attributes
    ----------
    curve : MuSlipCurve
        What was simulated and estimated.
    truth : ndarray, shape (p,)
        Its parameters.
    noise_std : ndarray, shape (m,)
        Standard deviation of a friction reading.
    sets : int
        Simulated sets of readings at each level; every estimator has the same.
    methods : tuple of str
        The estimators, the recommended one last.
    rms : ndarray, shape (k, m, 2)
        Root mean square errors of the peak friction and of its slip, over the sets that an
        estimator could use; NaN where there was none.
    bound : ndarray, shape (m, 2)
        Cramer-Rao bound of their standard deviations. Only estimators without bias are bound by
        it; a prior near the truth, or a limit of the search, gets below.
    failed : ndarray of int, shape (k, m)
        Sets that the estimator could not use.
    """

    curve: MuSlipCurve
    truth: FloatArray
    noise_std: FloatArray
    sets: int
    methods: tuple[str, ...]
    rms: FloatArray
    bound: FloatArray
    failed: npt.NDArray[np.int64]

    @property
    def signal_to_noise(self) -> FloatArray:
        """Peak friction over the noise of a reading, shape (m,)."""
        return as_float64(self.truth[0] / self.noise_std)

    @property
    def gain(self) -> FloatArray:
        """Noise of one reading over the error of the estimated peak, shape (k, m)."""
        return self.noise_std / self.rms[:, :, 0]

    def _head(self) -> str:
        values = zip(self.curve.parameters, self.truth, strict=True)
        truth = ", ".join(f"{name} {x:.4g}" for name, x in values)
        return (
            f"{self.curve.name} curve, {truth}: rms error of mu_peak over {self.sets} sets, and "
            f"how many times smaller than the noise of a reading"
        )

    def __str__(self) -> str:
        head = ["noise of a reading", *(f"{s:.4g}" for s in self.noise_std)]
        rows = [
            ["signal-to-noise", *(f"{s:.3g}" for s in self.signal_to_noise)],
            *(
                [method, *(f"{e:.5f} ({g:.1f}x)" for e, g in zip(rms[:, 0], gain, strict=True))]
                for method, rms, gain in zip(self.methods, self.rms, self.gain, strict=True)
            ),
            ["Cramer-Rao bound", *(f"{s:.5f}" for s in self.bound[:, 0])],
        ]
        notes = [
            f"  note: {method}: {int(count)} of {self.sets} sets at noise {level:.4g} left out, "
            f"the readings do not determine the curve"
            for method, row in zip(self.methods, self.failed, strict=True)
            for level, count in zip(self.noise_std, row, strict=True)
            if count
        ]
        return "\n".join([self._head(), text_table(head, rows), *notes])

    @typed
    def plot(self, ax: Axes | None = None, parameter: str = "mu_peak") -> Axes:
        """Draw the rms error of the peak friction, or of its slip, over signal-to-noise.

        Parameters
        ----------
        ax : matplotlib Axes, optional
            Where to draw; a new figure is made without it.
        parameter : str
            ``mu_peak`` or ``slip_peak``.

        Raises
        ------
        InvalidInput
            If it is another.
        """
        names = self.curve.parameters[:2]
        if parameter not in names:
            raise InvalidInput(f"parameter: '{parameter}'; choose {' or '.join(names)}")
        which = names.index(parameter)
        ax = axes_or_new(ax, 7.0, 5.0)
        at = self.signal_to_noise
        for i, method in enumerate(self.methods):
            last = i == len(self.methods) - 1
            ax.plot(
                at,
                self.rms[i, :, which],
                marker=_MARKERS[i % len(_MARKERS)],
                markersize=4,
                linewidth=2.0 if last else 1.0,
                label=f"{method} (recommended)" if last else method,
            )
        label = "Cramer-Rao bound"
        ax.plot(at, self.bound[:, which], "--", color=FLOOR, label=label)
        ax.set_xscale("log")
        ax.set_yscale("log")
        ax.set_xticks(at, [f"{s:.3g}" for s in at])
        ax.minorticks_off()
        ax.legend(frameon=False, fontsize="small")
        return tidy(
            ax,
            xlabel="peak friction / noise of a reading",
            ylabel=f"rms error of {parameter}",
            title=f"Estimators over signal-to-noise, {self.sets} sets each",
        )


@doing("estimators over noise")
def mu_slip_over_noise(
    values: Sequence[float] | FloatArray = (0.35, 0.15),
    *,
    curve: MuSlipCurve = TWO_PARAMETER,
    noise_std: npt.ArrayLike = _LEVELS,
    slip: npt.ArrayLike | None = None,
    sets: int = 200,
    seed: int | np.random.Generator = 0,
) -> MuSlipNoiseStudy:
    """Simulate sets of readings at several levels of noise and compare every estimator.

    The estimators are those of :func:`compare_mu_slip`; they are told the noise.

    Parameters
    ----------
    values : sequence of float
        True parameters of the curve.
    curve : MuSlipCurve
        `TWO_PARAMETER` or `MAGIC_FORMULA`.
    noise_std : array_like, shape (m,)
        Standard deviations of a reading.
    slip : array_like, optional
        Where readings are taken; see :func:`simulate_mu_slip`.
    sets : int
        Sets at each level.
    seed : int or Generator
        Of the noise. The same standard normal numbers are used at every level.

    Raises
    ------
    InvalidInput
        If a level is not above 0, sets are fewer than 2, or readings at these slips do not
        determine the curve.
    """
    levels = as_float64(np.atleast_1d(noise_std))
    if levels.ndim != 1 or levels.size == 0:
        raise InvalidInput(f"noise_std: shape {levels.shape}; give a list of one or more levels")
    for level in levels:
        check_noise(float(level))
    if sets < 2:
        raise InvalidInput(f"sets: {sets} is below 2; give 2 or more, 200 for smooth curves")
    truth = curve.vector(values)
    clean = simulate_mu_slip(list(truth), curve=curve, slip=slip)
    bound = np.array(
        [
            np.sqrt(np.diag(mu_slip_cramer_rao(clean.slip, truth, float(s), curve=curve)))[:2]
            for s in levels
        ]
    )
    draws = generator(seed).integers(2**63, size=sets)
    errors: dict[str, FloatArray] = {}
    order: tuple[str, ...] = ()
    for i, level in enumerate(levels):
        for j, draw in enumerate(draws):
            data = simulate_mu_slip(
                list(truth), curve=curve, noise_std=float(level), slip=clean.slip, seed=int(draw)
            )
            found, _ = every_estimate(data, curve)
            for estimate in found:
                table = errors.setdefault(estimate.method, np.full((levels.size, sets, 2), np.nan))
                table[i, j] = estimate.values[:2] - truth[:2]
            order = max(order, tuple(e.method for e in found), key=len)
    order = (*(method for method in errors if method not in order), *order)
    stacked = np.array([errors[method] for method in order])
    there = np.isfinite(stacked[..., 0])
    squares = np.where(there[..., None], stacked, 0.0) ** 2
    used = there.sum(axis=2)
    with np.errstate(invalid="ignore"):
        rms = np.sqrt(squares.sum(axis=2) / np.where(used > 0, used, np.nan)[..., None])
    return MuSlipNoiseStudy(curve, truth, levels, sets, order, rms, bound, sets - used)
