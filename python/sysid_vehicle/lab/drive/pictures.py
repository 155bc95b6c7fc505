"""A finished drive on one page."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..._common.style import AFTER, BEFORE, TRUTH, legend_above, new_figure, tidy
from ..._common.typed import typed
from .loop import ClosedLoop

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_PANELS = ("vx_mps", "yaw_rate_radps", "steer_rad", "fx_n")


@typed
def overview(drive: ClosedLoop) -> Figure:
    """Draw references and response, inputs, disturbances, slip angles and limits over time."""
    figure = new_figure(9.0, 12.0)
    axes = figure.subplots(len(_PANELS) + 3, 1, sharex=True)
    for ax, what in zip(axes, _PANELS, strict=False):
        drive.plot(ax, what).set_title("")
    forces, slips, limits = axes[len(_PANELS) :]
    for name, colour in (("xi_x_n", TRUTH), ("xi_y_n", AFTER)):
        forces.plot(drive.time_s, drive.estimate[name], color=colour, linewidth=0.9, label=name)
    tidy(forces, ylabel="disturbance [N]")
    for axle, colour in (("front", TRUTH), ("rear", AFTER)):
        slip = drive.truth[f"slip_{axle}_rad"]
        slips.plot(drive.time_s, slip, color=colour, linewidth=0.9, label=axle)
    tidy(slips, ylabel="slip angle [rad]")
    for row, met in enumerate(drive.saturation):
        on = (drive.limits & met.bit) != 0
        limits.plot(drive.time_s[on], [row] * int(on.sum()), "|", color=BEFORE)
    tidy(limits, xlabel="time_s")
    names = [met.what for met in drive.saturation]
    limits.set_title("limits met", loc="left", fontsize="medium")
    limits.set_yticks(range(len(names)), names, fontsize="small")
    for ax in axes[:-1]:
        legend_above(ax)
    axes[0].set_title(f"{drive.excitation.name} in '{drive.setup.name}'", loc="left")
    for ax in axes[:-1]:
        ax.set_xlabel("")
    return figure
