"""The command `check`: whether the sensors of a log agree."""

from __future__ import annotations

import argparse
from pathlib import Path

from .._common.files import write_text
from ..errors import InvalidInput
from ..report import check_page
from ..sensors import check
from ..vehicle import Vehicle
from .log_arguments import LOG_HELP, add_level, add_reading, read_logs, written_map
from .outputs import add_json, add_output, write_figures


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command."""
    parser = commands.add_parser(
        "check", help="see whether the sensors of logs agree, before any tyre is assumed"
    )
    parser.add_argument("logs", nargs="+", type=Path, metavar="LOG", help=LOG_HELP)
    parser.add_argument("--vehicle", type=Path, metavar="TOML", help="the car's own numbers")
    add_level(parser, "more is told of accelerometers and delays")
    add_reading(parser)
    add_output(
        parser,
        "--map",
        kind="TOML",
        help="channel map to write: proposed from the first log, checked here, to be edited",
    )
    add_output(parser, "--report", kind="HTML", help="report to write")
    add_json(parser)


def run(args: argparse.Namespace, heard: list[str]) -> None:
    """Check, print, write."""
    if args.map is not None and args.channels is not None:
        raise InvalidInput("--map, --channels: give one; the first is written, the other read")
    mapping = None
    vehicle = None if args.vehicle is None else Vehicle.from_toml(args.vehicle)
    if args.map is not None:
        mapping = written_map(args.logs[0], args.map, args.dbc, vehicle).channel_map
    logs = read_logs(args.logs, args, vehicle, mapping)
    found = check(logs, vehicle, level=args.level_ground)
    print(found)
    write_figures(args.json, found.to_dict(), heard)
    if args.report is not None:
        write_text(args.report, check_page(found, heard))
        print(f"Report: {args.report}")
