"""Figures of the friction filter: how it converges, and why when it does."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from ..._common.arrays import FloatArray
from ..._common.progress import doing
from ..._common.style import AFTER, BEFORE, FLOOR, MEASURED, TRUTH, axes_or_new, new_figure, tidy
from ..._common.typed import typed
from ...errors import InvalidInput
from .curve import TWO_PARAMETER, MuSlipCurve
from .results import MuSlipRun

if TYPE_CHECKING:
    from matplotlib.animation import FuncAnimation
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_CIRCLE = np.linspace(0.0, 2.0 * np.pi, 120)


def one_sigma_contour(mean: FloatArray, covariance: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Slip and friction of the peak along the contour where the exponent of the density is -1/2."""
    lower = np.linalg.cholesky(covariance[:2, :2])
    mu, slip = mean[:2, None] + lower @ np.vstack([np.cos(_CIRCLE), np.sin(_CIRCLE)])
    return slip, mu


class MuSlipFrame:
    """One picture of a run on `ax`: readings, curves, the peak and its one-sigma contour.

    Parameters
    ----------
    run : MuSlipRun
        What to show.
    ax : Axes, optional
        Where to draw.
    truth : sequence of float, optional
        True parameters, if there are any.
    """

    @typed
    def __init__(
        self, run: MuSlipRun, ax: Axes | None = None, truth: Sequence[float] | None = None
    ) -> None:
        self.run = run
        self.ax = axes_or_new(ax, 6.5, 4.5)
        data = run.data
        self._slip = np.linspace(0.0, max(1.0, float(data.slip.max())), 300)
        self._readings = self.ax.plot([], [], "-", color=TRUTH, linewidth=1, label="measured")[0]
        self._now = self.ax.plot([], [], "o", color=TRUTH, markersize=5)[0]
        if truth is not None:
            mu = run.curve.mu(self._slip, truth)
            self.ax.plot(self._slip, mu, color=MEASURED, linewidth=2, label="true")
            self.ax.plot(truth[1], truth[0], "o", color=MEASURED, markersize=6)
        self._curve = self.ax.plot([], [], color=BEFORE, label="estimated")[0]
        self._peak = self.ax.plot([], [], "o", color=BEFORE, markersize=6)[0]
        self._contour = self.ax.plot([], [], color=AFTER, label="one sigma")[0]
        top = max(float(np.nanmax(data.mu)), float(run.mean[:, 0].max()), float(run.start[0][0]))
        self.ax.set(xlim=(0.0, self._slip[-1]), ylim=(min(0.0, np.nanmin(data.mu)), 1.1 * top))
        self.ax.legend(frameon=False, loc="upper right")
        tidy(self.ax, xlabel="slip ratio", ylabel="friction")

    @typed
    def show(self, used: int) -> list[Artist]:
        """Draw the state after `used` readings; 0 is the prior.

        Raises
        ------
        InvalidInput
            If there are not so many.
        """
        n = len(self.run.mean)
        if not 0 <= used <= n:
            raise InvalidInput(f"used: {used}; the run has {n} readings, choose 0 to {n}")
        mean, covariance = (
            self.run.start
            if used == 0
            else (self.run.mean[used - 1], self.run.covariance[used - 1])
        )
        data = self.run.data
        self._readings.set_data(data.slip[:used], data.mu[:used])
        self._now.set_data(data.slip[max(used - 1, 0) : used], data.mu[max(used - 1, 0) : used])
        self._curve.set_data(self._slip, self.run.curve.mu(self._slip, mean))
        self._peak.set_data([mean[1]], [mean[0]])
        self._contour.set_data(*one_sigma_contour(mean, covariance))
        self.ax.set_title(f"{self.run.method}, {used} of {n} readings")
        return [self._readings, self._now, self._curve, self._peak, self._contour]


@typed
def animate_mu_slip(
    run: MuSlipRun,
    ax: Axes | None = None,
    truth: Sequence[float] | None = None,
    *,
    every: int = 1,
    interval_ms: float = 200.0,
) -> FuncAnimation:
    """Animate the convergence of a run; `every` reading is a frame.

    Raises
    ------
    InvalidInput
        If `every` is below 1.
    """
    from matplotlib.animation import FuncAnimation

    if every < 1:
        raise InvalidInput(f"every: {every} is below 1; give 1 for each reading")
    frame = MuSlipFrame(run, ax, truth)
    frames = [*range(0, len(run.mean), every), len(run.mean)]

    def show(used: int) -> Iterable[Artist]:
        return frame.show(used)

    figure = frame.ax.get_figure(root=True)
    if figure is None:
        raise InvalidInput("ax: belongs to no figure; pass axes of one")
    return FuncAnimation(figure, show, frames=frames, interval=interval_ms, blit=False)


@doing("animation")
def save_animation(animation: FuncAnimation, path: str | Path, *, per_second: int = 5) -> None:
    """Write a GIF, whole or not at all.

    Raises
    ------
    InvalidInput
        If the name does not end in .gif or the folder cannot be written.
    """
    from matplotlib.animation import PillowWriter

    target = Path(path)
    if target.suffix.lower() != ".gif":
        raise InvalidInput(f"{path}: is not a GIF; end the name in .gif")
    try:
        folder = tempfile.TemporaryDirectory(dir=target.parent, prefix=f".{target.name}.")
    except OSError as error:
        raise InvalidInput(
            f"{path}: cannot be written ({error.strerror}); choose a folder that exists"
        ) from error
    with folder as name:
        whole = Path(name) / "animation.gif"
        animation.save(whole, writer=PillowWriter(fps=per_second))
        os.replace(whole, target)


@typed
def draw_mu_slip_convergence(run: MuSlipRun, ax: Axes | None = None) -> Axes:
    """Draw the variances relative to their start, and the correlation, over slip (Figure 1)."""
    ax = axes_or_new(ax, 6.5, 4.0)
    P, P0, slip = run.covariance, run.start[1], run.data.slip
    colours = (AFTER, BEFORE, TRUTH, FLOOR)
    for i, name in enumerate(run.curve.parameters):
        label = f"variance of {name}"
        ax.plot(slip, P[:, i, i] / P0[i, i], color=colours[i], label=label)
    correlation = P[:, 0, 1] / np.sqrt(P[:, 0, 0] * P[:, 1, 1])
    ax.plot(slip, correlation, color=MEASURED, label="correlation of the first two")
    ax.set_ylim(-1.0, 1.05)
    ax.legend(frameon=False, ncols=2, fontsize="small", loc="lower center")
    ylabel = "share of the first variance"
    return tidy(ax, xlabel="slip ratio", ylabel=ylabel, title="Convergence of the covariance")


@typed
def draw_mu_slip_lissajous(
    run: MuSlipRun, ax: Axes | None = None, truth: Sequence[float] | None = None
) -> Axes:
    """Draw friction against slip as time goes on: measured, filtered and true.

    Filtered is the friction that the filter expects at the slip of each reading, from the readings
    before it. Where slip swings to and fro, its path runs from the prior to the curve that the
    readings follow. Nothing is drawn where there is no reading.

    Parameters
    ----------
    run : MuSlipRun
        What to show.
    ax : Axes, optional
        Where to draw; a new figure is made without it.
    truth : sequence of float, optional
        True parameters, if there are any.
    """
    ax = axes_or_new(ax, 6.5, 4.5)
    data = run.data
    ax.plot(data.slip, data.mu, color=FLOOR, linewidth=0.5, alpha=0.6)
    ax.plot(data.slip, data.mu, ".", color=MEASURED, markersize=3, label="measured")
    if truth is not None:
        true = run.curve.mu(data.slip, truth)
        ax.plot(data.slip, true, color=TRUTH, linewidth=3.0, label="true")
    filtered = run.expected_mu
    ax.plot(data.slip, filtered, color=AFTER, linewidth=1.2, label="filtered")
    ax.plot(data.slip[:1], filtered[:1], "o", color=BEFORE, markersize=6, label="first reading")
    ax.legend(frameon=False)
    title = f"Friction against slip over time, {run.method}"
    return tidy(ax, xlabel="slip ratio", ylabel="friction", title=title)


@typed
def draw_mu_slip_signal(run: MuSlipRun, ax: Axes | None = None) -> Axes:
    """Draw what the filter expects to learn against what it takes for noise (Figure 2)."""
    ax = axes_or_new(ax, 6.5, 4.0)
    slip = run.data.slip
    ax.plot(slip, run.signal_before, color=AFTER, label="H P H' before the reading")
    ax.plot(slip, run.noise_variance, color=MEASURED, label="noise with pseudo-noise")
    ax.plot(slip, run.signal_after, color=BEFORE, label="H P H' after the reading")
    ax.set_ylim(bottom=0.0)
    ax.legend(frameon=False)
    return tidy(ax, xlabel="slip ratio", ylabel="variance", title="Signal and noise")


@typed
def draw_mu_slip_observability(
    values: npt.ArrayLike,
    ax: Axes | None = None,
    *,
    curve: MuSlipCurve = TWO_PARAMETER,
) -> Axes:
    """Draw the observation matrix over slip: how much friction answers to each parameter."""
    ax = axes_or_new(ax, 6.5, 4.0)
    slip = np.linspace(0.0, 1.0, 400)
    x = curve.vector(values)
    gradient = curve.points(slip, x)[1]
    colours = (AFTER, BEFORE, TRUTH, FLOOR)
    for i, name in enumerate(curve.parameters):
        ax.plot(slip, gradient[:, i], color=colours[i], label=f"d mu / d {name}")
    ax.axvline(x[1], color=FLOOR, linewidth=0.8, linestyle=":", label="slip of the peak")
    ax.legend(frameon=False)
    return tidy(ax, xlabel="slip ratio", title="What a reading tells of each parameter")


@typed
def mu_slip_overview(run: MuSlipRun, truth: Sequence[float] | None = None) -> Figure:
    """Draw the last frame of the run and the three figures that explain it on one sheet."""
    figure = new_figure(11.0, 7.5)
    axes = figure.subplots(2, 2)
    MuSlipFrame(run, axes[0, 0], truth).show(len(run.mean))
    draw_mu_slip_convergence(run, axes[0, 1])
    draw_mu_slip_signal(run, axes[1, 0])
    draw_mu_slip_observability(run.mean[-1], axes[1, 1], curve=run.curve)
    return figure
