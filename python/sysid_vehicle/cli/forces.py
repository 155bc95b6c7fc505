"""The command `forces`: axle forces from motion, before any tyre is assumed."""

from __future__ import annotations

import argparse
from pathlib import Path

from .._files import write_json, write_text
from .._style import new_figure, svg
from ..forces import COLOURS, axle_forces
from ..read import ChannelMap, read_log
from ..vehicle import Vehicle
from .log_arguments import add_driving
from .outputs import refuse_other_suffix, refuse_unwritable

__all__ = ["add_parser", "run"]


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command."""
    parser = commands.add_parser(
        "forces", help="find axle forces over slip angles from the motion, before any tyre"
    )
    add_driving(parser)
    parser.add_argument(
        "--cg-ahead",
        type=float,
        default=0.0,
        metavar="M",
        help="how far the centre of gravity lies ahead of the place whose speeds are logged",
    )
    parser.add_argument(
        "--colour", choices=COLOURS, default=COLOURS[0], help="what colours the points"
    )
    parser.add_argument("--plot", type=Path, metavar="SVG", help="picture to write")
    parser.add_argument("--json", type=Path, metavar="JSON", help="file for all figures")


def run(args: argparse.Namespace, heard: list[str]) -> None:
    """Find the forces, print, draw, write."""
    given = [
        path for path in (*args.logs, args.vehicle, args.channels, args.dbc) if path is not None
    ]
    refuse_other_suffix(args.plot, ".svg")
    refuse_unwritable([args.plot, args.json], inputs=given)
    mapping = None if args.channels is None else ChannelMap.from_toml(args.channels)
    logs = [read_log(path, mapping, dbc=args.dbc) for path in args.logs]
    found = axle_forces(logs, Vehicle.from_toml(args.vehicle), cg_ahead_m=args.cg_ahead)
    print(found)
    if args.json is not None:
        write_json(args.json, {**found.to_dict(), "warnings": list(heard)})
    if args.plot is not None:
        figure = new_figure(8.5, 3.6)
        found.plot(figure.subplots(1, 2, sharey=True), colour=args.colour)
        write_text(args.plot, svg(figure).decode())
        print(f"Picture: {args.plot}")
