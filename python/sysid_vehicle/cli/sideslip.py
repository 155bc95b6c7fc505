"""`sysid-vehicle sideslip LOG`: the sideslip of a car, from the sensors every car has."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from .. import published
from .._files import write_json, write_text
from .._style import svg
from ..online import KINDS, estimate_sideslip, sideslip_overview
from ..read import read_log
from ..vehicle import Vehicle
from .log_arguments import LOG_HELP, add_reading
from .outputs import refuse_other_suffix, refuse_unwritable

__all__ = ["add_parser", "run"]

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
    parser.add_argument("--plot", type=Path, metavar="SVG", help="file for the figures")
    parser.add_argument("--json", type=Path, metavar="JSON", help="file for all numbers")


def run(args: argparse.Namespace, heard: list[str]) -> None:
    """Estimate, print, and write what was asked for."""
    refuse_other_suffix(args.plot, ".svg")
    others = [path for path in (args.channels, args.dbc) if path is not None]
    inputs = [args.log, args.vehicle, *others]
    refuse_unwritable([args.plot, args.json], inputs=inputs)
    vehicle = Vehicle.from_toml(args.vehicle)
    log = read_log(args.log, args.channels, dbc=args.dbc)
    if args.kind == "published":
        found = published.estimate_sideslip(vehicle, log)
    else:
        found = estimate_sideslip(vehicle, log, kind=args.kind)
    print(found)
    if args.plot is not None:
        write_text(args.plot, svg(sideslip_overview(found)).decode())
    if args.json is not None:
        write_json(args.json, {**found.to_dict(), "warnings": list(heard)})
