"""What the subcommands of `lab` that read logs have in common."""

from __future__ import annotations

import argparse
from pathlib import Path

from ..errors import warn
from ..lab import Setup
from ..vehicle import Vehicle
from .log_arguments import LOG_HELP, add_reading

__all__ = ["add_log_arguments", "add_vehicle_argument", "vehicle_of"]


def add_log_arguments(parser: argparse.ArgumentParser) -> None:
    """Ask for logs and how to read them."""
    parser.add_argument("logs", nargs="+", type=Path, metavar="LOG", help=LOG_HELP)
    add_reading(parser)
    parser.add_argument(
        "--unchecked",
        action="store_true",
        help="take the logs as they are: a car beyond its peak looks like wrong units or signs",
    )


def add_vehicle_argument(parser: argparse.ArgumentParser) -> None:
    """Ask for the car."""
    parser.add_argument(
        "--vehicle", type=Path, metavar="TOML", help="the car (default: the published one)"
    )


def vehicle_of(args: argparse.Namespace) -> Vehicle:
    """Read the car, or take the one that the laboratory drives."""
    if args.vehicle is None:
        warn("no --vehicle was given: mass, inertia and geometry are those of the published car")
        return Setup.default().plant.vehicle
    return Vehicle.from_toml(args.vehicle)
