"""`sysid-vehicle lab validate`: identified tyres on driving that was not used."""

from __future__ import annotations

import argparse
from pathlib import Path

from .._files import write_json, write_text
from .._style import new_figure, svg
from ..lab import IdentifiedCar, TyreLog, validate_tyres
from ..lab.tyre_data import READINGS
from ..read import read_log
from .outputs import refuse_unwritable

__all__ = ["add_arguments", "run"]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Say what may be typed."""
    parser.add_argument("logs", nargs="+", type=Path, metavar="LOG", help="CSV file of one run")
    parser.add_argument(
        "--tyres",
        type=Path,
        required=True,
        metavar="JSON",
        help="what `lab identify --json` wrote, from other logs",
    )
    parser.add_argument("--channels", type=Path, metavar="TOML", help="channel map")
    parser.add_argument(
        "--unchecked",
        action="store_true",
        help="take the logs as they are: a car beyond its peak looks like wrong units or signs",
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
    given = [*args.logs, args.tyres, *([] if args.channels is None else [args.channels])]
    refuse_unwritable([args.plot, args.json], inputs=given)
    car = IdentifiedCar.from_json(args.tyres)
    read = [read_log(path, args.channels, check=not args.unchecked) for path in args.logs]
    logs = [part for log in read for part in TyreLog.from_log(log, car.vehicle)]
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
