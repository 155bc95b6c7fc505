"""The command `forces`: axle forces from motion, before any tyre is assumed."""

from __future__ import annotations

import argparse

from .._common.style import new_figure
from ..forces import COLOURS, axle_forces
from ..vehicle import Vehicle
from .log_arguments import add_driving, add_level, read_logs
from .outputs import add_json, add_output, write_figures, write_picture


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command."""
    parser = commands.add_parser(
        "forces", help="find axle forces over slip angles from the motion, before any tyre"
    )
    add_driving(parser)
    add_level(parser, "as `check` takes it")
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
    add_output(parser, "--plot", kind="SVG", help="picture to write")
    add_json(parser)


def run(args: argparse.Namespace, heard: list[str]) -> None:
    """Find the forces, print, draw, write."""
    vehicle = Vehicle.from_toml(args.vehicle)
    logs = read_logs(args.logs, args, vehicle)
    found = axle_forces(logs, vehicle, level=args.level_ground, cg_ahead_m=args.cg_ahead)
    print(found)
    write_figures(args.json, found.to_dict(), heard)
    if args.plot is not None:
        figure = new_figure(8.5, 3.6)
        found.plot(figure.subplots(1, 2, sharey=True), colour=args.colour)
        write_picture(args.plot, figure)
