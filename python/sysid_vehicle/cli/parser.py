"""What may be typed."""

from __future__ import annotations

import argparse
from pathlib import Path

from .. import _core
from ..demo import DEFAULT, RANDOM
from . import changed, fleet, forces, lab, mu_slip, next_drive, sensors, sideslip, twin
from .log_arguments import (
    LOG_HELP,
    add_define,
    add_driving,
    add_effects,
    add_level,
    add_time_limit,
    names,
)
from .outputs import add_json, add_output

_MARKDOWN = (".md",)  # in which a study may be reported too


def parse(argv: list[str] | None) -> argparse.Namespace:
    """Read the arguments; ends the program with status 2 on those that make no sense."""
    parser = argparse.ArgumentParser(
        prog="sysid-vehicle",
        description="Compare a single-track car model with driving logs, find the missing effect, "
        "add it.",
    )
    parser.add_argument("--version", action="version", version=_core.__version__)
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")

    demo = commands.add_parser(
        "demo", help="hide an effect in a simulated car, find it, tell the story"
    )
    demo.add_argument(
        "--hidden",
        default=DEFAULT,
        metavar="ID",
        help=f"effect to hide, or '{RANDOM}' to draw one (default: %(default)s)",
    )
    demo.add_argument(
        "--seed", type=_seed, default=0, metavar="N", help="of all that is drawn (default: 0)"
    )
    add_output(
        demo,
        "--report",
        kind="HTML",
        also=_MARKDOWN,
        help="report to write (default: %(default)s)",
        default=Path("report.html"),
    )
    add_json(demo)

    compare = commands.add_parser("compare", help="fit the model to logs, see where it fails")
    add_driving(compare)
    add_effects(compare)
    add_json(compare)

    diagnose = commands.add_parser("diagnose", help="learn which physical effect is missing")
    add_driving(diagnose)
    _validation(diagnose)
    _search(diagnose)
    add_json(diagnose)

    improve = commands.add_parser("improve", help="add what is missing, and show what it does")
    add_driving(improve)
    _validation(improve)
    _search(improve)
    add_output(improve, "--report", kind="HTML", also=_MARKDOWN, help="report to write")
    add_json(improve)

    fleet.add_parser(commands)
    changed.add_parser(commands)
    next_drive.add_parser(commands)
    sensors.add_parser(commands)
    forces.add_parser(commands)
    mapping = commands.add_parser("map", help="propose the channel map of a log, to be edited")
    mapping.add_argument("log", type=Path, metavar="LOG", help=LOG_HELP)
    add_output(mapping, "-o", "--output", kind="TOML", help="file to write it to")
    mapping.add_argument("--dbc", type=Path, metavar="DBC", help="database of a log of CAN frames")
    mapping.add_argument(
        "--vehicle", type=Path, metavar="TOML", help="the car, whose wheelbase tells the gear"
    )

    sideslip.add_parser(commands)
    mu_slip.add_parser(commands)
    effects = commands.add_parser("effects", help="the catalogue of effects")
    effects.add_argument("names", nargs="*", metavar="EFFECT", help="those to print; all if none")
    effects.add_argument(
        "--vehicle", metavar="TOML", help="vehicle file: sizes in this car (default: ordinary ones)"
    )
    add_define(effects)
    lab.add_parser(commands)
    twin.add_parser(commands)
    return parser.parse_args(argv)


def _validation(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--test",
        nargs="+",
        type=Path,
        default=[],
        metavar="LOG",
        help="runs kept out of the fit (default: the last log, or the last 30 %% of the only one)",
    )


def _search(parser: argparse.ArgumentParser) -> None:
    add_effects(parser)
    parser.add_argument(
        "--nuisances",
        action="store_true",
        help="fit offsets that every measured log has (biases, turn of the speed sensor, steering "
        "offset, crossfall) without naming them",
    )
    add_level(parser, "no slope of the road is considered")
    parser.add_argument(
        "--exclude",
        type=names,
        default=(),
        metavar="EFFECT,...",
        help="effects not to consider, such as those that the car is known not to have",
    )
    parser.add_argument(
        "--max-effects",
        type=_count,
        default=6,
        metavar="N",
        help="add at most N effects (default 6)",
    )
    add_time_limit(
        parser,
        "end after S seconds, with what is printed and the report: every stage has a share of "
        "them, and what was left out is said",
    )
    parser.add_argument(
        "--matters",
        type=_sizes,
        metavar="CHANNEL=SIZE,...",
        help="errors that matter, such as yaw_rate=0.5deg/s,vy=0.1m/s (vx, vy, yaw_rate, ax, ay; "
        "others have usual sizes): a baseline whose errors 0.5 to 5 s ahead are smaller is "
        "adequate",
    )


def _seed(text: str) -> int:
    value = int(text)
    if value < 0:
        raise ValueError
    return value


def _count(text: str) -> int:
    value = int(text)
    if value < 0:
        raise ValueError
    return value


def _sizes(text: str) -> dict[str, str]:
    pairs = [part.split("=") for part in names(text)]
    return {name.strip(): size.strip() for name, size in pairs}


# argparse says "invalid NAME value".
_seed.__name__ = "seed (0 or more)"
_count.__name__ = "number (0 or more)"
_sizes.__name__ = "sizes (yaw_rate=0.5deg/s,...)"
