"""`sysid-vehicle lab identify`: tyres from logs."""

from __future__ import annotations

import argparse

from .._style import new_figure
from ..identify import METHODS
from ..lab import GreyBoxVehicle, TyreLog, identify_tyres
from .lab_inputs import add_log_arguments, add_vehicle_argument, vehicle_of
from .log_arguments import read_logs
from .outputs import add_json, add_output, write_figures, write_picture

__all__ = ["add_arguments", "run"]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Say what may be typed."""
    add_log_arguments(parser)
    add_vehicle_argument(parser)
    parser.add_argument(
        "--no-sideslip", action="store_true", help="do without the v_y that the logs have"
    )
    parser.add_argument(
        "--mass-tolerance",
        type=float,
        default=0.0,
        metavar="SHARE",
        help="how well the mass is known, as a relative standard deviation (default: exactly)",
    )
    parser.add_argument(
        "--residual-terms", action="store_true", help="also fit P1, P2 and P3 of a_y"
    )
    parser.add_argument(
        "--starts", type=int, default=16, metavar="N", help="searches (default: %(default)s)"
    )
    parser.add_argument(
        "--method", choices=tuple(METHODS), default="gauss-newton", help="local optimiser"
    )
    parser.add_argument(
        "--fast", action="store_true", help="intervals from the information matrix alone"
    )
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="of the start points")
    add_output(parser, "--plot", kind="SVG", help="tyre curves to write")
    add_json(parser)


def run(args: argparse.Namespace, heard: list[str]) -> None:
    """Identify, print, and write what was asked for."""
    car = GreyBoxVehicle.of(vehicle_of(args), mass_tolerance=args.mass_tolerance)
    logs = [part for log in read_logs(args.logs, args) for part in TyreLog.from_log(log, car)]
    if args.no_sideslip:
        logs = [log.without_sideslip() for log in logs]
    fit = identify_tyres(
        car,
        logs,
        residual_terms=args.residual_terms,
        starts=args.starts,
        method=args.method,
        profiles=not args.fast,
        seed=args.seed,
    )
    print(fit)
    if args.plot is not None:
        figure = new_figure(9.0, 3.8)  # two axes: curves that agree would cover each other
        axes = figure.subplots(1, 2, sharey=True)
        for ax, axle in zip(axes, ("front", "rear"), strict=True):
            fit.plot(ax, [axle]).label_outer()
        write_picture(args.plot, figure)
    write_figures(args.json, fit.to_dict(), heard)
