"""`sysid-vehicle lab validate`: identified tyres on driving that was not used."""

from __future__ import annotations

import argparse
from pathlib import Path

from .._style import new_figure
from ..lab import IdentifiedCar, TyreLog, validate_tyres
from ..lab.tyre_data import READINGS
from .lab_inputs import add_log_arguments
from .log_arguments import read_logs
from .outputs import add_json, add_output, write_figures, write_picture

__all__ = ["add_arguments", "run"]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Say what may be typed."""
    add_log_arguments(parser)
    parser.add_argument(
        "--tyres",
        type=Path,
        required=True,
        metavar="JSON",
        help="what `lab identify --json` wrote, from other logs",
    )
    parser.add_argument(
        "--horizon",
        type=float,
        default=1.0,
        metavar="S",
        help="how far to look ahead, beside one sample and the whole drive (default: %(default)g)",
    )
    add_output(parser, "--plot", kind="SVG", help="picture of the first log")
    add_json(parser)


def run(args: argparse.Namespace, heard: list[str]) -> None:
    """Predict, print, and write what was asked for."""
    car = IdentifiedCar.from_json(args.tyres)
    logs = [
        part for log in read_logs(args.logs, args) for part in TyreLog.from_log(log, car.vehicle)
    ]
    found = validate_tyres(car, logs, horizon_s=args.horizon)
    print("\n\n".join(map(str, found)))
    if args.plot is not None:
        figure = new_figure(7.0, 2.2 * len(READINGS))
        for axes, reading in zip(figure.subplots(len(READINGS)), READINGS, strict=True):
            found[0].plot(axes, reading=reading)
        write_picture(args.plot, figure)
    write_figures(args.json, {"drives": [v.to_dict() for v in found]}, heard)
