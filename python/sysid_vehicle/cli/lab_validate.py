"""`sysid-vehicle lab validate`: identified tyres on driving that was not used."""

from __future__ import annotations

import argparse
from pathlib import Path

from .._files import write_json, write_text
from .._style import new_figure, svg
from ..lab import IdentifiedCar, TyreLog, validate_tyres
from ..lab.tyre_data import READINGS
from .lab_inputs import add_log_arguments, files_of, logs_of
from .outputs import refuse_other_suffix, refuse_unwritable

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
    parser.add_argument("--plot", type=Path, metavar="SVG", help="picture of the first log")
    parser.add_argument("--json", type=Path, metavar="JSON", help="file for all figures")


def run(args: argparse.Namespace, heard: list[str]) -> None:
    """Predict, print, and write what was asked for."""
    refuse_other_suffix(args.plot, ".svg")
    refuse_unwritable([args.plot, args.json], inputs=[*files_of(args), args.tyres])
    car = IdentifiedCar.from_json(args.tyres)
    logs = [part for log in logs_of(args) for part in TyreLog.from_log(log, car.vehicle)]
    found = validate_tyres(car, logs, horizon_s=args.horizon)
    print("\n\n".join(map(str, found)))
    if args.plot is not None:
        figure = new_figure(7.0, 2.2 * len(READINGS))
        for axes, reading in zip(figure.subplots(len(READINGS)), READINGS, strict=True):
            found[0].plot(axes, reading=reading)
        write_text(args.plot, svg(figure).decode())
        print(f"Picture: {args.plot}")
    if args.json is not None:
        write_json(args.json, {"drives": [v.to_dict() for v in found], "warnings": heard})
