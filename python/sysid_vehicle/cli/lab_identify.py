"""`sysid-vehicle lab identify`: tyres from logs."""

from __future__ import annotations

import argparse
from pathlib import Path

from .._files import write_json, write_text
from .._style import new_figure, svg
from ..identify import METHODS
from ..lab import GreyBoxVehicle, TyreLog, identify_tyres
from .lab_inputs import add_log_arguments, add_vehicle_argument, files_of, logs_of, vehicle_of
from .outputs import refuse_other_suffix, refuse_unwritable

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
    parser.add_argument("--plot", type=Path, metavar="SVG", help="tyre curves to write")
    parser.add_argument("--json", type=Path, metavar="JSON", help="file for all figures")


def run(args: argparse.Namespace, heard: list[str]) -> None:
    """Identify, print, and write what was asked for."""
    refuse_other_suffix(args.plot, ".svg")
    refuse_unwritable([args.plot, args.json], inputs=files_of(args))
    car = GreyBoxVehicle.of(vehicle_of(args), mass_tolerance=args.mass_tolerance)
    logs = [part for log in logs_of(args) for part in TyreLog.from_log(log, car)]
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
        write_text(args.plot, svg(figure).decode())
        print(f"Picture: {args.plot}")
    if args.json is not None:
        write_json(args.json, {**fit.to_dict(), "warnings": heard})
