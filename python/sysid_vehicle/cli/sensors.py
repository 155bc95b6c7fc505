"""The command `check`: whether the sensors of a log agree."""

from __future__ import annotations

import argparse
from pathlib import Path

from .._files import write_json, write_text
from ..errors import InvalidInput
from ..read import ChannelMap, read_log
from ..report import check_page
from ..sensors import check
from ..vehicle import Vehicle
from .log_arguments import LOG_HELP, add_reading, written_map
from .outputs import refuse_unwritable

__all__ = ["add_parser", "run"]


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command."""
    parser = commands.add_parser(
        "check", help="see whether the sensors of logs agree, before any tyre is assumed"
    )
    parser.add_argument("logs", nargs="+", type=Path, metavar="LOG", help=LOG_HELP)
    parser.add_argument("--vehicle", type=Path, metavar="TOML", help="the car's own numbers")
    add_reading(parser)
    parser.add_argument(
        "--map",
        type=Path,
        metavar="TOML",
        help="channel map to write: proposed from the first log, checked here, to be edited",
    )
    parser.add_argument("--report", type=Path, metavar="HTML", help="report to write")
    parser.add_argument("--json", type=Path, metavar="JSON", help="file for all figures")


def run(args: argparse.Namespace, heard: list[str]) -> None:
    """Check, print, write."""
    given = [
        path for path in (*args.logs, args.vehicle, args.channels, args.dbc) if path is not None
    ]
    refuse_unwritable([args.map, args.report, args.json], inputs=given)
    if args.map is not None and args.channels is not None:
        raise InvalidInput("--map, --channels: give one; the first is written, the other read")
    mapping = None if args.channels is None else ChannelMap.from_toml(args.channels)
    vehicle = None if args.vehicle is None else Vehicle.from_toml(args.vehicle)
    if args.map is not None:
        mapping = written_map(args.logs[0], args.map, args.dbc, vehicle).channel_map
    found = check([read_log(path, mapping, dbc=args.dbc) for path in args.logs], vehicle)
    print(found)
    if args.json is not None:
        write_json(args.json, {**found.to_dict(), "warnings": list(heard)})
    if args.report is not None:
        write_text(args.report, check_page(found, heard))
        print(f"Report: {args.report}")
