"""The command `changed`: what of a car changed between two drives."""

from __future__ import annotations

import argparse
import time
from pathlib import Path

from ..diagnose import changed
from ..identify import identify
from ..model import Model
from ..vehicle import Vehicle
from .log_arguments import LOG_HELP, add_driving, add_effects, add_time_limit, read_logs
from .outputs import add_json, write_figures

_FITTED, _COMPARED = 0.3, 0.8  # shares of what is left of a time limit; the rest is for last passes


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command."""
    parser = commands.add_parser(
        "changed", help="what of a car changed since the drives that its model fits"
    )
    add_driving(parser)
    parser.add_argument(
        "--after", nargs="+", required=True, type=Path, metavar="LOG", help=f"later: {LOG_HELP}"
    )
    parser.add_argument(
        "--vehicle-after",
        type=Path,
        metavar="TOML",
        help="vehicle file of the later drives, where it is another one",
    )
    add_effects(parser)
    add_time_limit(
        parser,
        "end after S seconds, but for some passes over the data: the fit of the earlier drives and "
        "the comparison have a share each, and what was left out is said",
    )
    add_json(parser)


def run(args: argparse.Namespace, heard: list[str]) -> None:
    """Fit the earlier drives, compare the later ones with them, print, write."""
    began, limit = time.perf_counter(), args.time_limit
    model = Model(Vehicle.from_toml(args.vehicle), args.effects)
    later = None if args.vehicle_after is None else Vehicle.from_toml(args.vehicle_after)
    before = read_logs(args.logs, args, model.vehicle)
    after = read_logs(args.after, args, later or model.vehicle)
    ends = None if limit is None else began + limit

    def left_s(share: float) -> float | None:
        return None if ends is None else max(share * (ends - time.perf_counter()), 1e-9)

    reference = identify(model, before, time_limit_s=left_s(_FITTED))
    found = changed(reference, after, vehicle=later, time_limit_s=left_s(_COMPARED))
    print(found)
    write_figures(args.json, found.to_dict(), heard)
