"""`sysid-vehicle sideslip LOG`: the sideslip of a car, from the sensors every car has."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from .. import published
from ..online import KINDS, estimate_sideslip, sideslip_overview
from ..vehicle import Vehicle
from .log_arguments import LOG_HELP, add_reading, read_logs
from .outputs import add_json, add_output, write_figures, write_picture

_PUBLISHED = "dual UKF of Cl4y3R/VehicleStateEstimation, 2024, with its defects"
_KINDS = {**KINDS, "published": _PUBLISHED}
_CONTRACT = """\
Estimates sideslip, cornering stiffness and axle forces from steering angle, speed, yaw rate and
both accelerations. A measured vy_mps is not used; where the log has one, the error is printed."""


def add_parser(commands: Any) -> None:
    """Add the command to the `commands` of the parser."""
    parser = commands.add_parser(
        "sideslip",
        help="sideslip and cornering stiffness from a log without vy_mps",
        description=_CONTRACT,
        epilog="kinds: " + "; ".join(f"{kind}: {what}" for kind, what in _KINDS.items()),
    )
    parser.add_argument("log", type=Path, metavar="LOG", help=LOG_HELP)
    parser.add_argument(
        "--vehicle", type=Path, required=True, metavar="TOML", help="the car's own numbers"
    )
    add_reading(parser)
    parser.add_argument(
        "--kind", choices=sorted(_KINDS), default="dual", help="observer (default: %(default)s)"
    )
    add_output(parser, "--plot", kind="SVG", help="file for the figures")
    add_json(parser)


def run(args: argparse.Namespace, heard: list[str]) -> None:
    """Estimate, print, and write what was asked for."""
    vehicle = Vehicle.from_toml(args.vehicle)
    (log,) = read_logs([args.log], args, vehicle)
    if args.kind == "published":
        found = published.estimate_sideslip(vehicle, log)
    else:
        found = estimate_sideslip(vehicle, log, kind=args.kind)
    print(found)
    if args.plot is not None:
        write_picture(args.plot, sideslip_overview(found))
    write_figures(args.json, found.to_dict(), heard)
