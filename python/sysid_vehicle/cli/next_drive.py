"""The command `next-drive`: the cheapest manoeuvre that tells two effects apart."""

from __future__ import annotations

import argparse
from pathlib import Path

from .._files import write_bytes, write_json
from .._style import svg
from ..diagnose import DriveLimits, suggest_manoeuvre
from ..errors import InvalidInput
from ..identify import identify
from ..model import Model
from ..read import ChannelMap, read_log
from ..vehicle import Vehicle
from .log_arguments import add_driving
from .outputs import refuse_other_suffix, refuse_unwritable

__all__ = ["add_parser", "run"]

_USUAL = DriveLimits()


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command."""
    parser = commands.add_parser(
        "next-drive", help="the manoeuvre that tells two effects apart, as something to drive"
    )
    add_driving(parser)
    parser.add_argument(
        "--between", required=True, metavar="A,B", help="the two effects, the likelier one first"
    )
    limits = {
        "--top-speed": (_USUAL.speed_mps, "M/S", "highest speed"),
        "--lateral": (_USUAL.lateral_mps2, "M/S2", "highest lateral acceleration"),
        "--duration": (_USUAL.duration_s, "S", "longest drive"),
    }
    for name, (usual, unit, what) in limits.items():
        told = f"{what} (default: %(default)s)"
        parser.add_argument(name, type=float, default=usual, metavar=unit, help=told)
    parser.add_argument(
        "--area", nargs=2, type=float, metavar=("LENGTH", "WIDTH"), help="ground there is [m]"
    )
    parser.add_argument("--csv", type=Path, metavar="CSV", help="steering and speed over time")
    parser.add_argument("--picture", type=Path, metavar="SVG", help="picture of track and steering")
    parser.add_argument("--json", type=Path, metavar="JSON", help="file for all figures")


def run(args: argparse.Namespace, heard: list[str]) -> None:
    """Fit, suggest, print, write."""
    given = [
        path for path in (*args.logs, args.vehicle, args.channels, args.dbc) if path is not None
    ]
    refuse_unwritable([args.csv, args.picture, args.json], inputs=given)
    refuse_other_suffix(args.picture, ".svg")
    pair = [name.strip() for name in args.between.split(",")]
    if len(pair) != 2:
        raise InvalidInput(f"--between {args.between}: give two effects, as in steer_lag,mass")
    mapping = None if args.channels is None else ChannelMap.from_toml(args.channels)
    logs = [read_log(path, mapping, dbc=args.dbc) for path in args.logs]
    area = None if args.area is None else (args.area[0], args.area[1])
    limits = DriveLimits(args.top_speed, args.lateral, area, args.duration)
    fit = identify(Model(Vehicle.from_toml(args.vehicle)), logs)
    found = suggest_manoeuvre(fit, *pair, limits=limits)
    print(found)
    if args.json is not None:
        write_json(args.json, {**found.to_dict(), "warnings": list(heard)})
    if args.csv is not None:
        found.best.to_csv(args.csv)
        print(f"Steering and speed: {args.csv}")
    if args.picture is not None:
        write_bytes(args.picture, svg(found.best.picture()))
        print(f"Picture: {args.picture}")
