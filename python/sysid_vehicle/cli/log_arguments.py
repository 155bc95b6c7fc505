"""What every command that reads driving logs may be told."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from .._common.files import read_text, write_text
from .._common.progress import note
from ..effects.user import refuse_no_program
from ..errors import InvalidInput, warn
from ..log import Log
from ..read import ChannelMap, Proposal, propose_channels, read_log
from ..vehicle import Vehicle

LOG_HELP = "log of one run: CSV, MDF, MCAP, ROS bag, .mat, .vbo, CAN log, Parquet, ..."


def say_it_runs(path: Path) -> None:
    """Say that a user's file is a program: it can do whatever the user can.

    Raises
    ------
    InvalidInput
        It is another kind of file.
    """
    refuse_no_program(path)
    note(f"sysid-vehicle: runs {path} as a Python program, with all your rights")


def add_reading(parser: argparse.ArgumentParser) -> None:
    """Ask how the logs are to be read."""
    parser.add_argument(
        "--channels", type=Path, metavar="TOML", help="channel map, for other column names or units"
    )
    parser.add_argument("--dbc", type=Path, metavar="DBC", help="database of a log of CAN frames")


def add_driving(parser: argparse.ArgumentParser) -> None:
    """Ask for logs, how they are to be read, and the car."""
    parser.add_argument("logs", nargs="+", type=Path, metavar="LOG", help=LOG_HELP)
    parser.add_argument(
        "--vehicle", type=Path, required=True, metavar="TOML", help="the car's own numbers"
    )
    add_reading(parser)


def add_level(parser: argparse.ArgumentParser, what: str) -> None:
    """Ask whether the ground is level, with what that changes."""
    parser.add_argument(
        "--level-ground",
        action="store_true",
        help=f"the road neither climbs nor leans with its turns, as on a test track: {what}",
    )


def names(text: str) -> tuple[str, ...]:
    """Return names that stand between commas."""
    return tuple(name for name in (part.strip() for part in text.split(",")) if name)


def add_effects(parser: argparse.ArgumentParser) -> None:
    """Ask for the effects of a model."""
    parser.add_argument(
        "--effects",
        type=names,
        default=(),
        metavar="A,B",
        help="effects that the model has from the start",
    )
    add_define(parser)


def add_define(parser: argparse.ArgumentParser) -> None:
    """Ask for effects of the user's own."""
    parser.add_argument(
        "--define",
        action="append",
        default=[],
        type=Path,
        metavar="PY",
        help="Python file that defines effects of your own, or the id of an effect that an "
        "installed package defines; it is run as a program with all your rights: give only what "
        "you trust (may be repeated)",
    )


def read_logs(
    paths: Sequence[Path],
    args: argparse.Namespace,
    vehicle: Vehicle | None,
    mapping: ChannelMap | None = None,
) -> list[Log]:
    """Read logs of a car as `add_reading` was told, or by a channel map that is known already."""
    if mapping is None and args.channels is not None:
        mapping = ChannelMap.from_toml(args.channels)
    check = not getattr(args, "unchecked", False)
    return [read_log(p, mapping, dbc=args.dbc, check=check, vehicle=vehicle) for p in paths]


def written_map(log: Path, to: Path | None, dbc: Path | None, vehicle: Vehicle | None) -> Proposal:
    """Propose the channel map of a log, write it, and tell what it lacks.

    Raises
    ------
    InvalidInput
        If another file is there already: somebody may have edited it.
    """
    found = propose_channels(log, dbc=dbc, vehicle=vehicle)
    if to is not None:
        text = found.to_toml()
        if to.is_file() and to.stat().st_size > 0 and read_text(to) != text:
            raise InvalidInput(
                f"{to}: is there already, and is not what would be written; read it with "
                "--channels, remove it, or name another file"
            )
        write_text(to, text)
        print(f"Channel map: {to}", file=sys.stderr)
    for name in found.missing:
        warn(f"{name}: no column was found for it; name it in the channel map")
    if found.needs_pull:
        warn(
            "ax_mps2, fx_n: no column was found for either; name one of them in the channel map: "
            "nothing else tells how the car is driven and braked"
        )
    return found


def add_time_limit(parser: argparse.ArgumentParser, help: str) -> None:
    """Ask for the seconds after which a command ends."""
    parser.add_argument("--time-limit", type=_seconds, metavar="S", help=help)


def _seconds(text: str) -> float:
    value = float(text)
    if not 0.0 < value < float("inf"):
        raise ValueError
    return value


# argparse says "invalid NAME value".
_seconds.__name__ = "seconds (above 0)"
