"""The paper's figures, drawn from the experiments: 4 to 11 and 14 to 18."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from .._common.style import AFTER, BEFORE, FLOOR, MEASURED, TRUTH, legend_above, new_figure, tidy
from ..twin.car import SPORTS_CAR
from .joint import JointExperiment
from .load import LoadExperiment
from .schedule import ScheduleRun

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_ACCEPTABLE = 10.0  # per cent of the change: the paper's limit
_LINES = (AFTER, BEFORE, MEASURED, FLOOR)
_CLOSE_UP_S = 15.0


def load_figure(
    runs: Sequence[LoadExperiment],
    sweeps: Mapping[str, Mapping[float, Sequence[float]]],
    *,
    driven: str,
) -> Figure:
    """Draw estimates from several first guesses, what was driven, and errors over conditions.

    Parameters
    ----------
    runs : sequence of LoadExperiment
        One experiment, begun from several guesses.
    sweeps : mapping of str to mapping
        By the name of a condition, such as the signal to noise: its values, and at each the error
        of every parameter in % of its change.
    driven : str
        Channel of the drive to show, such as ``vx_mps``.
    """
    names = runs[0].names
    count = len(names) + 1 + len(sweeps)
    figure = new_figure(7.0, 2.2 * count)
    axes = list(figure.subplots(count, 1, squeeze=False)[:, 0])
    for ax, name in zip(axes, names, strict=False):
        for run, colour in zip(runs, _LINES, strict=False):
            value = run.found.parameters[name]
            ax.plot(run.found.time_s, value, color=colour, label=f"from {value[0]:.4g}")
        ax.axhline(getattr(runs[0].true, name), color=TRUTH, linestyle="--", label="true")
        legend_above(ax)
        tidy(ax, xlabel="time [s]", ylabel=name)
    drive = runs[0].drive
    ax = axes[len(names)]
    ax.plot(drive.time_s[::20], drive[driven][::20], color=MEASURED, linewidth=0.7)
    tidy(ax, xlabel="time [s]", ylabel=driven)
    for ax, (condition, errors) in zip(axes[len(names) + 1 :], sweeps.items(), strict=True):
        for i, (name, colour) in enumerate(zip(names, _LINES, strict=False)):
            ax.plot(list(errors), [e[i] for e in errors.values()], "o-", color=colour, label=name)
        ax.axhline(_ACCEPTABLE, color=FLOOR, linestyle=":", label="acceptable")
        legend_above(ax)
        tidy(ax, xlabel=condition, ylabel="error [% of the change]")
        ax.set_ylim(bottom=0.0)
    return figure


def schedule_figure(run: ScheduleRun) -> Figure:
    """Draw what each stage is for over its time, one stage under the other."""
    shown = [(stage, name) for stage in run.stages for name in stage.names]
    figure = new_figure(7.0, 2.2 * len(shown))
    for ax, (stage, name) in zip(figure.subplots(len(shown), 1), shown, strict=True):
        stage.plot(name, ax=ax)
        ax.set_title(stage.name, loc="left", fontsize=9)
    return figure


def joint_figure(done: Sequence[JointExperiment]) -> Figure:
    """Draw drives, mass and sideslip of some courses side by side, with a close-up of the end."""
    figure = new_figure(6.0 * len(done), 11.0)
    grid = figure.subplots(6, len(done), squeeze=False)
    for column, experiment in zip(grid.T, done, strict=True):
        _course(column, experiment)
    return figure


def _course(axes: Sequence[Axes], experiment: JointExperiment) -> None:
    drive, step = experiment.drive, experiment.stride
    time = drive.time_s[::step]
    for ax, name in zip(axes, ("vx_mps", "yaw_rate_radps", "plane_ay_mps2"), strict=False):
        ax.plot(time, drive[name][::step], color=MEASURED, linewidth=0.7)
        tidy(ax, xlabel="time [s]", ylabel=name)
    axes[0].set_title(drive.name.replace("_", " "), loc="left")
    mass = axes[3]
    mass.plot(time, experiment.twin.parameters["mass_kg"], color=AFTER, label="twin")
    mass.plot(time, experiment.benchmark.mass_kg[::step], color=BEFORE, label="double track")
    mass.axhline(SPORTS_CAR.design.mass_kg, color=TRUTH, linestyle="--", label="true")
    legend_above(mass)
    tidy(mass, xlabel="time [s]", ylabel="mass [kg]")
    for ax, shown in zip(
        axes[4:], (np.full(len(time), True), time > time[-1] - _CLOSE_UP_S), strict=True
    ):
        for values, colour, label, style in (
            (experiment.benchmark.sideslip_rad[::step], BEFORE, "double track", "-"),
            (experiment.twin.outputs["sideslip_rad"], AFTER, "twin", "-"),
            (drive["sideslip_rad"][::step], TRUTH, "true", "--"),
        ):
            beta = np.degrees(values[shown])
            ax.plot(time[shown], beta, style, color=colour, label=label, linewidth=1)
        legend_above(ax)
        tidy(ax, xlabel="time [s]", ylabel="sideslip [deg]")
